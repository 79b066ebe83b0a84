"""Spline surfaces over a rectangle: least-squares fits, and their nearest points."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product

import numpy as np
from scipy.linalg import solveh_banded

from dsfab.arrays import Bools, Floats, Ints, grouped, lock
from dsfab.export.smooth.splines import basis, hats

CLOSE = 1e-8
"""Nearest points are found to this share of a surface's size: a tenth of a micrometre on ten metres."""

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
class Patch:
    """A bicubic B-spline surface: clamped knots u (p + 4,) and v (q + 4,), poles (p, q, d)."""

    u: Floats
    v: Floats
    poles: Floats

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None,))
        lock(self, "v", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None, None))

    def __call__(self, uv: Floats) -> Floats:
        """(k, d) points at uv (k, 2)."""
        (i, a), (j, b) = basis(uv[:, 0], self.u), basis(uv[:, 1], self.v)
        return self._along_v(b, self._across_u(a, self._around(i, j)))

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, and derivatives by u and by v, (k, d) each."""
        (i, a, da), (j, b, db) = hats(uv[:, 0], self.u), hats(uv[:, 1], self.v)
        around = self._around(i, j)
        at, du = self._across_u(a, around), self._across_u(da, around)
        return self._along_v(b, at), self._along_v(b, du), self._along_v(db, at)

    def _around(self, i: Ints, j: Ints) -> Floats:
        """(k, 4, 4, d) the poles from (i, j) on."""
        _, q, d = self.poles.shape
        at = (i * q + j)[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return np.asarray(self.poles.reshape(-1, d).take(at, axis=0).reshape(-1, 4, 4, d))

    @staticmethod
    def _across_u(hat: Floats, around: Floats) -> Floats:
        """(k, 4, d) sums over the first direction, weighted with hats (k, 4)."""
        k, *_, d = around.shape
        return np.asarray(np.einsum("ka,kax->kx", hat, around.reshape(k, 4, -1)).reshape(k, 4, d))

    @staticmethod
    def _along_v(hat: Floats, rows: Floats) -> Floats:
        return np.asarray(np.einsum("kb,kbd->kd", hat, rows))

    def only(self, first: int, last: int) -> "Patch":
        """The surface of some of the coordinates."""
        return Patch(self.u, self.v, self.poles[:, :, first:last])

    def nearest(self, points: Floats, uv: Floats, rounds: int = 8) -> Floats:
        """(k, 2) parameters of the surface's points nearest to `points` (k, 3), by Gauss-Newton from uv."""
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        uv, going = np.clip(uv, low, high), np.arange(len(uv))
        for _ in range(rounds):
            at, a, b = self.slopes(uv[going])
            r = points[going] - at
            aa, ab, bb, ra, rb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b), (r, a), (r, b)))
            det = np.maximum(aa * bb - ab * ab, 1e-300)
            step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
            uv[going] = np.clip(uv[going] + step, low, high)
            going = going[np.abs(step).max(axis=1) >= CLOSE * (high - low).max()]
            if not len(going):
                break
        return uv


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


def fitted(uv: Floats, Q: Floats, inside: Bools, weight: Floats, tolerance: float, first: float = FIRST) -> Fit:
    """The surface with few poles within the tolerance of what is inside, Q (k, 6) two points each.

    The distance of a cubic surface goes with the fourth power of its spans: that says how many poles to try next.
    """
    extent = np.ptp(uv, axis=0)
    aspect = np.sqrt(np.clip(extent[0] / extent[1], 0.1, 10.0))
    most = np.sqrt(len(uv) / POINTS_PER_POLE)
    n, here = min(first, most), np.flatnonzero(inside)
    while True:
        count = [int(np.clip(np.rint(x), FEWEST_POLES, MOST_POLES)) for x in (n * aspect, n / aspect)]
        patch = patch_through(uv, Q, weight, (count[0], count[1]), SMOOTHING)
        away = np.linalg.norm((patch(uv[here]) - Q[here]).reshape(-1, 2, 3), axis=2).max(axis=1)
        off = float(away.max())
        if off <= tolerance or n >= min(most, MOST_POLES):
            return Fit(patch, off, float(n), bool(off > tolerance and n < MOST_POLES))
        n = min(n * float(np.clip(1.05 * (off / tolerance) ** 0.25, 1.15, 2.0)), max(most, n), float(MOST_POLES))


def patch_through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> Patch:
    """The bicubic surface of p x q poles nearest to points Q (k, d) at uv (k, 2), in the least-squares sense.

    weight (k,) of the points.
    smoothing : weight of the second differences of the poles, so that poles without points have a place, too.
    """
    low, high = uv.min(axis=0), uv.max(axis=0)
    pad = 0.01 * (high - low)
    knots = [
        np.concatenate([[a] * 3, np.linspace(a, b, n - 2), [b] * 3])
        for a, b, n in zip(low - pad, high + pad, count, strict=True)
    ]
    (i, a), (j, b) = (basis(uv[:, k], knots[k]) for k in (0, 1))
    p, q = count
    band, right = _normal(i * q + j, (a[:, :, None] * b[:, None, :]).reshape(-1, 16), weight, Q, p, q)
    band += smoothing * len(uv) / (p * q) * _roughness(p, q)
    poles = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    return Patch(knots[0], knots[1], poles.reshape(p, q, -1))


def _normal(first: Ints, value: Floats, weight: Floats, Q: Floats, p: int, q: int) -> tuple[Floats, Floats]:
    """Normal equations: the lower band (3 q + 4, p q) of the matrix, and the right side.

    first, value : the first of 16 poles around each point, and their hats (k, 16) there. Points of one cell have the
    same poles: a product of matrices for each cell takes a quarter of the time of sums over all points.
    """
    order, start, _ = grouped(first)
    hat, both = (weight[:, None] * value)[order].T, np.concatenate([value, Q], axis=1)[order]
    sums = np.stack([hat[:, a:b] @ both[a:b] for a, b in pairwise([*start.tolist(), len(first)])])
    at = first[order[start], None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
    row, column = np.tril_indices(16)
    place = (at[:, row] - at[:, column]) * p * q + at[:, column]
    band = np.asarray(np.bincount(place.ravel(), sums[:, row, column].ravel(), (3 * q + 4) * p * q), dtype=np.float64)
    right = [np.bincount(at.ravel(), side.ravel(), p * q) for side in np.moveaxis(sums[:, :, 16:], 2, 0)]
    return band.reshape(3 * q + 4, p * q), np.stack(right, axis=1)


@lru_cache(maxsize=256)
def _roughness(p: int, q: int) -> Floats:
    """The squared second differences of p x q poles: the lower band (3 q + 4, p q) of their matrix."""
    band = np.zeros((3 * q + 4, p, q))
    along = {n: [_gram(n, order) for order in range(3)] for n in (p, q)}
    for a, b, weight in ((2, 0, 1.0), (0, 2, 1.0), (1, 1, 2.0)):
        for di, dj in product(range(3), range(-2, 3)):
            if di * q + dj >= 0:
                band[di * q + dj] += weight * np.outer(_diagonal(along[p][a], di), _diagonal(along[q][b], dj))
    return band.reshape(3 * q + 4, p * q)


def _gram(n: int, order: int) -> Floats:
    """(n, n) the matrix of the squared differences of n poles."""
    D = np.diff(np.eye(n), order, axis=0)
    return D.T @ D


def _diagonal(table: Floats, below: int) -> Floats:
    """(n,) by columns, the entries so many rows below the diagonal, and zeros where there are none."""
    n = len(table)
    return np.array([table[k + below, k] if 0 <= k + below < n else 0.0 for k in range(n)])
