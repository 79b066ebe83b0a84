"""Cubic splines: least-squares curves of any dimension with adaptive knots.

They run from 0 to 1; their knots are halves of halves, so they are short decimals.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from dsfab.arrays import Floats, Ints, lock

SAMPLES_PER_SPAN = 6
"""Fewest samples for each span of a curve; with fewer, curves swing between them."""

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
        return np.asarray(BSpline.construct_fast(self.knots, self.poles, self.degree)(x))  # a third of the time


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


def basis(x: Floats, knots: Floats) -> tuple[Ints, Floats]:
    """The first of the four cubic hats that are not zero at each x (k,), and the four values (k, 4)."""
    first, values, _ = hats(x, knots)
    return first, values


def hats(x: Floats, knots: Floats) -> tuple[Ints, Floats, Floats]:
    """The first of the four cubic hats that are not zero at each x (k,), their values and slopes (k, 4) [de Boor 1978].

    Of each degree, hat r is a share of hat r and a share of hat r - 1 of the degree below.
    """
    x = np.clip(x, knots[3], knots[-4])
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    past = x - knots[span - np.arange(3)[:, None]]
    ahead = knots[span + np.arange(1, 4)[:, None]] - x
    values = shares = np.ones((1, len(x)))
    for degree in range(1, 4):
        behind = past[degree - 1 :: -1]
        shares = values / (ahead[:degree] + behind)
        values = np.zeros((degree + 1, len(x)))
        values[:-1] = ahead[:degree] * shares
        values[1:] += behind * shares
    slopes = np.zeros((4, len(x)))
    slopes[1:] = shares
    slopes[:-1] -= shares
    return span - 3, values.T, 3 * slopes.T
