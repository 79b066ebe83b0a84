"""Spline surfaces over a rectangle: least-squares fits, and their nearest points."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement, product

import numpy as np
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array, diags_array, eye_array, kron, tril, vstack

from dsfab.arrays import Bools, Floats, Ints, lock
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
        return np.asarray(self._sum(i, j, [(a, b)])[0])

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, and derivatives by u and by v, (k, d) each."""
        (i, a, da), (j, b, db) = hats(uv[:, 0], self.u), hats(uv[:, 1], self.v)
        at, du, dv = self._sum(i, j, [(a, b), (da, b), (a, db)])
        return at, du, dv

    def _sum(self, i: Ints, j: Ints, of: list[tuple[Floats, Floats]]) -> Floats:
        """(len(of), k, d) sums of the poles from (i, j) on, weighted with products of hats."""
        p, q, d = self.poles.shape
        k, many = len(i), len(of)
        column = ((i[:, None, None] + np.arange(4)[:, None]) * q + j[:, None, None] + np.arange(4)).reshape(-1)
        value = np.concatenate([(a[:, :, None] * b[:, None, :]).reshape(-1) for a, b in of])
        rows = np.arange(0, 16 * k * many + 1, 16)
        weights = csr_array((value, np.tile(column, many), rows), shape=(k * many, p * q))
        return np.asarray(weights @ self.poles.reshape(p * q, d)).reshape(many, k, d)

    def only(self, first: int, last: int) -> "Patch":
        """The surface of some of the coordinates."""
        return Patch(self.u, self.v, self.poles[:, :, first:last])

    def nearest(self, points: Floats, uv: Floats, rounds: int = 8) -> Floats:
        """(k, 2) parameters of the surface's points nearest to `points` (k, 3), by Gauss-Newton from uv."""
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        for _ in range(rounds):
            uv = np.clip(uv, low, high)
            at, a, b = self.slopes(uv)
            r = points - at
            aa, ab, bb, ra, rb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b), (r, a), (r, b)))
            det = np.maximum(aa * bb - ab * ab, 1e-300)
            step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
            uv = uv + step
            if not len(step) or np.abs(step).max() < CLOSE * (high - low).max():
                break
        return np.asarray(np.clip(uv, low, high))


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
    value = np.ascontiguousarray((a[:, :, None] * b[:, None, :]).reshape(-1, 16).T)
    band, right = _normal(i * q + j, value, weight, Q, p, q)
    below, column, rough = _roughness(p, q)
    band[below, column] += smoothing * len(uv) / (p * q) * rough
    poles = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    return Patch(knots[0], knots[1], poles.reshape(p, q, -1))


def _normal(first: Ints, value: Floats, weight: Floats, Q: Floats, p: int, q: int) -> tuple[Floats, Floats]:
    """Normal equations: the lower band (3 q + 4, p q) of the matrix, and the right side.

    first, value : the first of 16 poles around each point, and their hats (16, k) there.
    """
    shift = [di * q + dj for di, dj in product(range(4), range(4))]
    band, right = np.zeros((3 * q + 4, p * q)), np.zeros((p * q, Q.shape[1]))
    for one, other in combinations_with_replacement(range(16), 2):
        low, high = sorted((shift[one], shift[other]))
        band[high - low] += np.bincount(first + low, weight * value[one] * value[other], p * q)
    for s, hat in zip(shift, weight * value, strict=True):
        for d in range(Q.shape[1]):
            right[:, d] += np.bincount(first + s, hat * Q[:, d], p * q)
    return band, right


@lru_cache(maxsize=256)
def _roughness(p: int, q: int) -> tuple[Ints, Ints, Floats]:
    """The squared second differences of p x q poles: rows below the diagonal, columns, and values of the lower half."""
    across = [kron(_difference(p, 2), eye_array(q)), kron(eye_array(p), _difference(q, 2))]
    R = vstack([*across, np.sqrt(2) * kron(_difference(p, 1), _difference(q, 1))])
    lower = tril(R.T @ R).tocoo()
    return lower.row - lower.col, lower.col, lower.data


def _difference(n: int, order: int) -> csr_array:
    rows = {1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    table: csr_array = csr_array(diags_array(rows, offsets=list(range(order + 1)), shape=(n - order, n)))
    return table
