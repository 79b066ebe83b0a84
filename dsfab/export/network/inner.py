"""Splines that are 0 at both ends, by which curves and patches are moved between their ends or borders."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.splines import basis, bernstein

NODES = np.array([0.05, 0.35, 0.65, 0.95])
"""Where a cubic is read to know its poles."""


@dataclass(frozen=True, eq=False)
class InnerSpline:
    """The cubic splines, twice differentiable, of the k spans between breaks (k + 1,), which are 0 at the first and at
    the last of these.

    places : (k + 1,) the means of three knots, at which values may be asked for whatever the spans [de Boor 1978,
    chapter XIII].    poles : (k, 4, k + 1) what each of these values does for the poles of each span.
    """

    breaks: Floats
    places: Floats
    poles: Floats

    @classmethod
    def of(cls, breaks: Floats) -> "InnerSpline":
        """breaks : from 0 to 1."""
        return _inner_spline(breaks.tobytes())

    @classmethod
    def _made(cls, breaks: Floats) -> "InnerSpline":
        count, knots = len(breaks) - 1, np.concatenate([[0.0] * 3, breaks, [1.0] * 3])
        places = (knots[2:-4] + knots[3:-3] + knots[4:-2]) / 3
        inside = (np.diff(breaks)[:, None] * NODES + breaks[:-1, None]).ravel()
        values = np.linalg.solve(_rows(places, knots).T, _rows(inside, knots).T).T
        poles = np.linalg.solve(bernstein(NODES), values.reshape(count, 4, -1))
        poles[0, 0] = poles[-1, -1] = 0
        return cls(breaks, places, np.asarray(poles))

    @cached_property
    def hats(self) -> Floats:
        """(k + 1, k, 4) what each pole of any spans between these breaks counts at each place."""
        count = len(self.places) - 1
        span = np.clip(np.searchsorted(self.breaks, self.places, side="right") - 1, 0, count - 1)
        found = np.zeros((count + 1, count, 4))
        share = (self.places - self.breaks[span]) / np.diff(self.breaks)[span]
        found[np.arange(count + 1), span] = bernstein(share)
        return found


@lru_cache(maxsize=1024)
def _inner_spline(breaks: bytes) -> InnerSpline:
    """Most curves have one of a few lists of breaks, and a patch is made more than once."""
    return InnerSpline._made(np.frombuffer(breaks))


def _rows(x: Floats, knots: Floats) -> Floats:
    """(k, p - 2) the p cubic hats of some knots at x (k,), without the first and the last."""
    first, values = basis(x, knots)
    rows = np.zeros((len(x), len(knots) - 4))
    np.put_along_axis(rows, first[:, None] + np.arange(4), values, axis=1)
    return rows[:, 1:-1]
