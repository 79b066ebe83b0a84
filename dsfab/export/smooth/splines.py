"""Splines of any dimension, and the cubic hats that they are sums of.

They run from 0 to 1; their knots are halves of halves, so they are short decimals.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from dsfab.arrays import Floats, Ints, lock


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
    """The segment from a (3,) to b (3,)."""
    return Spline(np.array([0.0, 0, 1, 1]), np.stack([a, b]), 1)


def basis(x: Floats, knots: Floats) -> tuple[Ints, Floats]:
    """The first of the four cubic hats that are not zero at each x (k,), and the four values (k, 4)."""
    first, values, _ = hats(x, knots)
    return first, values


def hats(x: Floats, knots: Floats) -> tuple[Ints, Floats, Floats]:
    """The first of the four cubic hats that are not zero at each x (k,), their values and slopes (k, 4)."""
    x = np.clip(x, knots[3], knots[-4])
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    values, shares = hats_within(x, knots, span)
    slopes = np.zeros((4, len(x)))
    slopes[1:] = shares
    slopes[:-1] -= shares
    return span - 3, values.T, 3 * slopes.T


def hats_within(x: Floats, knots: Floats, span: Ints) -> tuple[Floats, Floats]:
    """(4, k) the cubic hats at x (k,) from knots[span] to the next, and (3, k) the shares they have [de Boor 1978].

    Of each degree, hat r is a share of hat r and a share of hat r - 1 of the degree below.
    """
    past = x - knots[span - np.arange(3)[:, None]]
    ahead = knots[span + np.arange(1, 4)[:, None]] - x
    values = shares = np.ones((1, len(x)))
    for degree in range(1, 4):
        behind = past[degree - 1 :: -1]
        shares = values / (ahead[:degree] + behind)
        values = np.zeros((degree + 1, len(x)))
        values[:-1] = ahead[:degree] * shares
        values[1:] += behind * shares
    return values, shares
