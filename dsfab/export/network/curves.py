"""Chains as cubics, one for both skins: poles have six coordinates, outer and inner."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.export.network.graph import VOID, ChainNet
from dsfab.export.network.inner import InnerSpline
from dsfab.export.network.lifting import Lifting
from dsfab.export.smooth.edges import spread
from dsfab.export.smooth.fits import splines_through
from dsfab.export.smooth.limits import Limits
from dsfab.export.splines import Spline, bernstein

BETWEEN = 2
"""Samples of each edge of the mesh along a chain, on the smooth skins."""

READ = np.array([0.05, 0.35, 0.65, 0.95])
"""Where a cubic is read to know its poles."""

AT_READ = bernstein(READ)
TO_POLES = np.linalg.inv(AT_READ)


@dataclass(frozen=True, eq=False)
class SampledChain:
    """Q : (k, 6) points on the outer and on the inner skin, millimetres.    outline : whether void is beyond it.
    chord : the mesh's least chord error along it, millimetres."""

    Q: Floats
    outline: bool
    chord: float = 0.0

    @cached_property
    def middle(self) -> Floats:
        """(k, 3) half way between the skins."""
        return np.asarray((self.Q[:, :3] + self.Q[:, 3:]) / 2)

    @cached_property
    def way(self) -> Floats:
        """(k,) arc lengths, millimetres."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.middle, axis=0), axis=1))])

    def direction(self, from_start: bool, reach: float) -> tuple[Floats, Floats]:
        """The way from one of its ends to what is within `reach`, millimetres, and the normal at that end."""
        if (from_start, reach) not in self._directions:
            x = min(reach / self.way[-1], 0.5)
            Q, there = self.Q[0 if from_start else -1], self.at(x if from_start else 1 - x)
            way, across = (there[:3] + there[3:]) / 2 - (Q[:3] + Q[3:]) / 2, Q[:3] - Q[3:]
            self._directions[from_start, reach] = (way, across / np.linalg.norm(across))
        return self._directions[from_start, reach]

    @cached_property
    def _directions(self) -> dict[tuple[bool, float], tuple[Floats, Floats]]:
        return {}

    def at(self, x: float) -> Floats:
        """(6,) at a share of the length under 1."""
        way, to = self.way, x * self.way[-1]
        i = int(way.searchsorted(to, side="right"))
        return np.asarray((self.Q[i] - self.Q[i - 1]) / (way[i] - way[i - 1]) * (to - way[i - 1]) + self.Q[i - 1])


@dataclass(frozen=True, eq=False)
class ChainCurve:
    """breaks : (k + 1,) from 0 to 1, and between them spans : (k, 4, 6) Bezier poles, millimetres.
    off : largest distance from the chain's samples."""

    breaks: Floats
    spans: Floats
    off: float = 0.0

    @classmethod
    def of(cls, spline: Spline, off: float) -> "ChainCurve":
        """A line, a parabola or a cubic."""
        breaks = np.unique(spline.knots)
        x = READ[None] * np.diff(breaks)[:, None] + breaks[:-1, None]
        at = spline(x.ravel()).reshape(len(breaks) - 1, 4, -1)
        spans = np.asarray(np.linalg.solve(AT_READ, at), dtype=np.float64)
        spans[0, 0], spans[-1, -1] = spline.poles[0], spline.poles[-1]
        spans[1:, 0] = spans[:-1, 3]
        return cls(breaks, spans, off)

    def __call__(self, x: Floats) -> Floats:
        """(k, 6) points at parameters x (k,)."""
        span = np.clip(np.searchsorted(self.breaks, x, side="right") - 1, 0, len(self.spans) - 1)
        share = (x - self.breaks[span]) / np.diff(self.breaks)[span]
        return np.asarray(np.einsum("ka,kai->ki", bernstein(share), self.spans[span]))

    def stops(self, low: float, high: float) -> Floats:
        """(k,) two parameters, in order, and the breaks between them."""
        return np.concatenate([[low], self.breaks[(self.breaks > low) & (self.breaks < high)], [high]])

    def with_ends(self, start: Floats, end: Floats) -> "ChainCurve":
        """Moved so that it has other ends (6,): what is between follows by a share."""
        x = self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * np.arange(4) / 3
        ways = start - self.spans[0, 0], end - self.spans[-1, -1]
        spans = self.spans + (1 - x)[..., None] * ways[0] + x[..., None] * ways[1]
        spans[0, 0], spans[-1, -1] = start, end
        return replace(self, spans=spans)

    def reversed(self) -> "ChainCurve":
        """Run through the other way."""
        return ChainCurve(1 - self.breaks[::-1], self.spans[::-1, ::-1], self.off)


def parts_of(poles: Floats, start: Floats, end: Floats) -> Floats:
    """(k, 4, d) poles of parts of cubics with poles (k, 4, d), from shares `start` to `end` (k,) of each."""
    inside = start[:, None] + (end - start)[:, None] * READ
    rows = bernstein(inside.ravel()).reshape(len(poles), 4, 4)
    return np.asarray(TO_POLES @ rows @ poles)


def curves_through(lines: Sequence[Floats], tolerances: Sequence[float]) -> list[ChainCurve]:
    """The curves within tolerances of polylines (k, 6), millimetres; all are fitted at once."""
    fits = splines_through([spread(line) for line in lines], tolerances, parts=2)
    return [ChainCurve.of(*fit) for fit in fits]


def on_skins(curves: Sequence[ChainCurve], away: Callable[[Floats], Floats]) -> list[ChainCurve]:
    """Curves that what `away` says of points (k, 6) of theirs has brought onto the skins between their ends.

    Beside their samples they may be by a tolerance, but a face whose edges are off it strays.
    """
    if not curves:
        return []
    inner = [InnerSpline.of(curve.breaks) for curve in curves]
    ways = away(np.concatenate([curve(spline.places) for curve, spline in zip(curves, inner, strict=True)]))
    each = np.split(ways, np.cumsum([len(spline.places) for spline in inner])[:-1])
    return [
        replace(curve, spans=curve.spans + spline.poles @ way)
        for curve, spline, way in zip(curves, inner, each, strict=True)
    ]


def sampled_chains(net: ChainNet, lifting: Lifting, limits: Limits) -> dict[int, SampledChain]:
    """The chains of a net on the smooth skins, by number."""
    numbers = list(net.chains)
    points = [net.chains[k].points for k in numbers]
    start, end = (np.concatenate([p[some] for p in points]) for some in (slice(-1), slice(1, None)))
    one, two = net.weights[start], net.weights[end]
    parts = [csr_array(one * (1 - t) + two * t) for t in np.arange(BETWEEN) / BETWEEN]
    last = net.weights[np.array([p[-1] for p in points])]
    Q = lifting.points(csr_array(vstack([*parts, last], format="csr")))
    count, chord = len(start), limits.allowed(Q[: len(start), :3]) - limits.distance
    inner = Q[: BETWEEN * count].reshape(BETWEEN, count, 6).transpose(1, 0, 2)
    at, found = 0, dict[int, SampledChain]()
    for i, (k, p) in enumerate(zip(numbers, points, strict=True)):
        mine = inner[at : at + len(p) - 1].reshape(-1, 6)
        Qk = np.concatenate([mine, Q[[BETWEEN * count + i]]])
        found[k] = SampledChain(Qk, net.chains[k].right == VOID, float(chord[at : at + len(p) - 1].min()))
        at += len(p) - 1
    return found
