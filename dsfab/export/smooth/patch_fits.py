"""Least-squares spline surfaces of few poles."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import solveh_banded

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.export.smooth.patches import Patch
from dsfab.export.splines import basis

SMOOTHING = 1e-5
"""Weight of the differences of poles against the distances from the points."""

FEWEST_POLES, MOST_POLES = 6, 48
"""Poles of a fit in one direction."""

FIRST = 8.0
"""Poles of the first attempt, in the geometric mean of both directions."""

POINTS_PER_POLE = 2.5
"""Fewest points of a fit for each pole: with fewer, surfaces wave between the points, and two of them gape at a seam
by more than either is off its points."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A surface through points.

    off     : its largest distance from those that count.
    size    : its poles, the geometric mean of both directions, but for limits.
    starved : whether more poles would have been tried on more points.
    """

    patch: Patch
    off: float
    size: float
    starved: bool


def fitted(
    uv: Floats,
    Q: Floats,
    inside: Bools,
    weight: Floats,
    tolerance: float,
    first: float = FIRST,
    most_poles: int = MOST_POLES,
) -> Fit:
    """The surface with few poles within the tolerance of what is inside, Q (k, 6) two points each.

    first, most_poles : poles to begin and to end with, the geometric mean of both directions, and in one of them.
    The distance of a cubic surface goes with the fourth power of its spans: that says how many poles to try next.
    """
    extent = np.ptp(uv, axis=0)
    aspect = np.sqrt(np.clip(extent[0] / extent[1], 0.1, 10.0))
    most = np.sqrt(len(uv) / POINTS_PER_POLE)
    n, here = min(first, most), np.flatnonzero(inside)
    while True:
        count = [int(np.clip(np.rint(x), FEWEST_POLES, most_poles)) for x in (n * aspect, n / aspect)]
        patch, found = _through(uv, Q, weight, (count[0], count[1]), SMOOTHING)
        away = np.linalg.norm((found[here] - Q[here]).reshape(-1, 2, 3), axis=2)
        off = float(away.max())
        if off <= tolerance or n >= min(most, most_poles):
            return Fit(patch, off, float(n), bool(off > tolerance and n < most_poles))
        n = min(n * float(np.clip(1.05 * (off / tolerance) ** 0.25, 1.15, 2.0)), max(most, n), float(most_poles))


def patch_through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> Patch:
    """The bicubic surface of p x q poles nearest to points Q (k, d) at uv (k, 2), in the least-squares sense.

    weight (k,) of the points.
    smoothing : weight of the second differences of the poles, so that poles without points have a place, too.
    """
    return _through(uv, Q, weight, count, smoothing)[0]


def _through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> tuple[Patch, Floats]:
    """The surface of `patch_through`, and its points (k, d) at uv."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    pad = 0.01 * (high - low)
    u, v = (
        np.concatenate([[a] * 3, np.linspace(a, b, n - 2), [b] * 3])
        for a, b, n in zip(low - pad, high + pad, count, strict=True)
    )
    p, q = count
    cells = _Cells.of(uv, u, v)
    band, right = cells.normal(weight, Q, p, q)
    rows, rough = _roughness(p, q)
    band[rows] += smoothing * len(uv) / (p * q) * rough
    poles = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    return Patch(u, v, poles.reshape(p, q, -1)), cells.sums(poles)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Points by the cells of the knots that they are in, and the hats of the 16 poles around them.

    Points of one cell have the same poles: a product of matrices for each cell takes a quarter of the time of sums over
    all points.

    order : (k,) the points, cell after cell; start : of each cell there.
    poles : (c, 16) the numbers of each cell's; hats (k, 16) of the points in that order.
    """

    order: Ints
    start: Ints
    poles: Ints
    hats: Floats

    @classmethod
    def of(cls, uv: Floats, u: Floats, v: Floats) -> "_Cells":
        (i, a), (j, b) = basis(uv[:, 0], u), basis(uv[:, 1], v)
        q = len(v) - 4
        order, start, _ = grouped(i * q + j)
        first = (i * q + j)[order[start]]
        poles = first[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return cls(order, start, poles, np.einsum("ka,kb->kab", a[order], b[order]).reshape(-1, 16))

    @property
    def parts(self) -> Iterator[slice]:
        """The points of each cell."""
        return (slice(a, b) for a, b in pairwise([*self.start.tolist(), len(self.order)]))

    def normal(self, weight: Floats, Q: Floats, p: int, q: int) -> tuple[Floats, Floats]:
        """Normal equations: the lower band (3 q + 4, p q) of the matrix, and the right side."""
        left = (weight[self.order, None] * self.hats).T
        both = np.concatenate([self.hats, Q[self.order]], axis=1)
        sums = np.stack([left[:, one] @ both[one] for one in self.parts])
        row, column = np.tril_indices(16)
        place = (self.poles[:, row] - self.poles[:, column]) * p * q + self.poles[:, column]
        band = np.bincount(place.ravel(), sums[:, row, column].ravel(), (3 * q + 4) * p * q).astype(np.float64)
        sides = np.moveaxis(sums[:, :, 16:], 2, 0)
        right = [np.bincount(self.poles.ravel(), side.ravel(), p * q) for side in sides]
        return band.reshape(3 * q + 4, p * q), np.stack(right, axis=1)

    def sums(self, poles: Floats) -> Floats:
        """(k, d) the points of the surface with poles (p q, d)."""
        found = np.empty((len(self.order), poles.shape[1]))
        for one, some in zip(self.parts, self.poles, strict=True):
            found[self.order[one]] = self.hats[one] @ poles[some]
        return found


@lru_cache(maxsize=256)
def _roughness(p: int, q: int) -> tuple[Ints, Floats]:
    """The squared second differences of p x q poles: rows below the diagonal, and these rows of the lower band."""
    steps = ((0, 0), (0, 1), (0, 2), (1, -1), (1, 0), (1, 1), (2, 0))
    (*u,), (*v,) = ([_gram(n, order) for order in range(3)] for n in (p, q))
    terms = ((1.0, u[2], v[0]), (1.0, u[0], v[2]), (2.0, u[1], v[1]))
    rows = [sum(w * np.outer(_diagonal(a, di), _diagonal(b, dj)).ravel() for w, a, b in terms) for di, dj in steps]
    return np.array([di * q + dj for di, dj in steps]), np.array(rows)


def _gram(n: int, order: int) -> Floats:
    """(n, n) the matrix of the squared differences of n poles."""
    D = np.diff(np.eye(n), order, axis=0)
    return D.T @ D


def _diagonal(table: Floats, below: int) -> Floats:
    """(n,) by columns, the entries so many rows below the diagonal, and zeros where there are none."""
    entries, none = np.diagonal(table, -below), np.zeros(abs(below))
    return np.concatenate([entries, none] if below > 0 else [none, entries])
