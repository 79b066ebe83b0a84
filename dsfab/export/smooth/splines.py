"""Cubic splines: least-squares curves of any dimension with adaptive knots, and surfaces over a rectangle.

Curves run from 0 to 1; their knots are halves of halves, so they are short decimals.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, Ints, lock

SAMPLES_PER_SPAN = 6
"""Fewest samples for each span of a curve; with fewer, curves swing between them."""

CLOSE = 1e-8
"""Nearest points are found to this share of a surface's size: a tenth of a micrometre on ten metres."""

ROUNDS = 14
"""How often the spans of a curve are halved: a span is at least 2^-14 of it."""


@dataclass(frozen=True, eq=False)
class Spline:
    """A clamped B-spline on [0, 1]: knots (p + degree + 1,), poles (p, d), degree 1, 2 or 3."""

    knots: Floats
    poles: Floats
    degree: int

    def __post_init__(self) -> None:
        lock(self, "knots", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None))

    def __call__(self, x: Floats) -> Floats:
        """(k, d) points at parameters x (k,)."""
        return np.asarray(BSpline(self.knots, self.poles, self.degree)(x))


def straight(a: Floats, b: Floats) -> Spline:
    """The segment from a to b."""
    return Spline(np.array([0.0, 0, 1, 1]), np.stack([a, b]), 1)


def spline_through(x: Floats, Q: Floats, tolerance: float, parts: int = 1) -> tuple[Spline, float]:
    """A line, parabola or cubic, of few halved spans, within `tolerance` of points Q (k, d) at x (k,) in [0, 1].

    Its ends are the first and the last point. parts : the d coordinates are those of so many points, whose distances
    count one by one. Returns the largest distance found, too; over `tolerance` where samples are too few to go on.
    """
    line = Q[0] + x[:, None] * (Q[-1] - Q[0])
    off = _largest(line - Q, parts)
    if off.max() <= 0.5 * tolerance:
        return straight(Q[0], Q[-1]), float(off.max())
    bow = 2 * x * (1 - x)
    bend = bow @ (Q - line) / (bow @ bow)
    off = _largest(line + bow[:, None] * bend - Q, parts)
    if off.max() <= tolerance:
        poles = np.stack([Q[0], (Q[0] + Q[-1]) / 2 + bend, Q[-1]])
        return Spline(np.array([0.0] * 3 + [1.0] * 3), poles, 2), float(off.max())
    breaks = np.array([0.0, 1.0])
    for _ in range(ROUNDS):
        knots = np.concatenate([[0.0] * 3, breaks, [1.0] * 3])
        poles, found = _least_squares(x, Q, knots)
        off = _largest(found - Q, parts)
        if off.max() <= tolerance:
            break
        span = np.clip(np.searchsorted(breaks, x, side="right") - 1, 0, len(breaks) - 2)
        samples = np.bincount(span, minlength=len(breaks) - 1)
        worst = np.zeros(len(samples))
        np.maximum.at(worst, span, off)
        bad = np.flatnonzero((worst > tolerance) & (samples >= 2 * SAMPLES_PER_SPAN))
        if not len(bad):
            break
        breaks = np.sort(np.concatenate([breaks, (breaks[bad] + breaks[bad + 1]) / 2]))
    return Spline(knots, poles, 3), float(off.max())


def evenly(line: Floats, spacing: float, fewest: int = 8, most: int = 4000) -> tuple[Floats, Floats]:
    """Parameters in [0, 1] and points of a polyline (k, d), evenly along it, `spacing` apart or less."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = int(np.clip(np.ceil(length[-1] / spacing), fewest, most))
    x = np.arange(count + 1) / count
    return x, np.stack([np.interp(x * length[-1], length, column) for column in line.T], axis=1)


def _largest(off: Floats, parts: int) -> Floats:
    """(k,) the largest distance of each sample's points."""
    return np.asarray(np.linalg.norm(off.reshape(len(off), parts, -1), axis=2).max(axis=1))


def _least_squares(x: Floats, Q: Floats, knots: Floats) -> tuple[Floats, Floats]:
    """Poles of the cubic nearest to Q with its ends fixed, and its points at x."""
    first, values, factor = _normal(x.tobytes(), knots.tobytes())
    at = first[:, None] + np.arange(4)
    n = len(knots) - 4
    poles = np.zeros((n, Q.shape[1]))
    poles[[0, -1]] = Q[[0, -1]]
    rest = Q - _at(values, poles, at)
    right = np.stack([np.bincount(at.ravel(), (values * r[:, None]).ravel(), n) for r in rest.T], axis=1)
    poles[1:-1] = cho_solve_banded((factor, True), right[1:-1])
    return poles, _at(values, poles, at)


def _at(values: Floats, poles: Floats, at: Ints) -> Floats:
    return np.asarray(np.einsum("ki,kid->kd", values, poles[at]))


@lru_cache(maxsize=512)
def _normal(x: bytes, knots: bytes) -> tuple[Ints, Floats, Floats]:
    """The hats at parameters, and the factor of the banded normal equations of all poles but the two at the ends.

    Most curves are asked for on the same few samples and knots, so the answers are kept.
    """
    t = np.frombuffer(knots)
    first, values = basis(np.frombuffer(x), t)
    n = len(t) - 4
    band = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            band[j - i] += np.bincount(first + i, values[:, i] * values[:, j], n)
    band = band[:, 1:-1].copy()
    band[0] += 1e-12 * band[0].mean()  # a span without a sample
    for i in range(1, 4):
        band[i, len(band[0]) - i :] = 0.0
    return first, values, cholesky_banded(band, lower=True)


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
        return self._sum(basis(uv[:, 0], self.u), basis(uv[:, 1], self.v))

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, and derivatives by u and by v, (k, d) each."""
        bu, bv = basis(uv[:, 0], self.u), basis(uv[:, 1], self.v)
        du, dv = basis(uv[:, 0], self.u, 1), basis(uv[:, 1], self.v, 1)
        return self._sum(bu, bv), self._sum(du, bv), self._sum(bu, dv)

    def _sum(self, bu: tuple[Ints, Floats], bv: tuple[Ints, Floats]) -> Floats:
        (i, a), (j, b) = bu, bv
        p, q, d = self.poles.shape
        column = ((i[:, None, None] + np.arange(4)[:, None]) * q + j[:, None, None] + np.arange(4)).reshape(-1)
        value = (a[:, :, None] * b[:, None, :]).reshape(-1)
        hats = csr_array((value, column, np.arange(0, 16 * len(a) + 1, 16)), shape=(len(a), p * q))
        return np.asarray(hats @ self.poles.reshape(p * q, d))

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


def basis(x: Floats, knots: Floats, order: int = 0) -> tuple[Ints, Floats]:
    """The first of the four cubic hats that are not zero at each x (k,), and the four values (k, 4) [de Boor 1978].

    order : 1 for their derivatives.
    """
    x = np.clip(x, knots[3], knots[-4])
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    values = np.ones((len(x), 1))
    for degree in range(1, 4 - order):
        values = _raised(x, knots, span, values, degree)
    for degree in range(4 - order, 4):
        at = span[:, None] + np.arange(1 - degree, 1)
        share = degree * values / (knots[at + degree] - knots[at])
        zero = np.zeros((len(x), 1))
        values = np.concatenate([zero, share], axis=1) - np.concatenate([share, zero], axis=1)
    return span - 3, values


def _raised(x: Floats, knots: Floats, span: Ints, values: Floats, degree: int) -> Floats:
    """(k, degree + 1) values of the hats, from those of one degree less."""
    at = span[:, None] + np.arange(1 - degree, 1)
    low, high = knots[at], knots[at + degree]
    share = values / (high - low)
    zero = np.zeros((len(x), 1))
    rising, falling = share * (x[:, None] - low), share * (high - x[:, None])
    return np.asarray(np.concatenate([zero, rising], axis=1) + np.concatenate([falling, zero], axis=1))


def patch_through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> Patch:
    """The bicubic surface of p x q poles nearest to points Q (k, d) at uv (k, 2), in the least-squares sense.

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
    k = len(uv)
    column = (i[:, None, None] + np.arange(4)[:, None]) * q + j[:, None, None] + np.arange(4)
    value = a[:, :, None] * b[:, None, :]
    B = csr_array((value.ravel(), column.ravel(), np.arange(0, 16 * k + 1, 16)), shape=(k, p * q))
    across = [kron(_difference(p, 2), eye_array(q)), kron(eye_array(p), _difference(q, 2))]
    R = vstack([*across, np.sqrt(2) * kron(_difference(p, 1), _difference(q, 1))])
    W = diags_array(weight)
    A = B.T @ W @ B + smoothing * k / (p * q) * (R.T @ R)
    poles = splu(A.tocsc()).solve(np.asarray(B.T @ (W @ Q)))
    return Patch(knots[0], knots[1], poles.reshape(p, q, -1))


def _difference(n: int, order: int) -> csr_array:
    rows = {1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    table: csr_array = csr_array(diags_array(rows, offsets=list(range(order + 1)), shape=(n - order, n)))
    return table
