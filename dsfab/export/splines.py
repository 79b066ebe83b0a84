"""Splines of any dimension, the cubic hats that they are sums of, and the cubics nearest to samples."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from dsfab.arrays import Floats, Ints, lock


@dataclass(frozen=True, eq=False)
class Spline:
    """A clamped B-spline: ascending knots (p + degree + 1,), poles (p, d), degree 1, 2 or 3; a line has two poles."""

    knots: Floats
    poles: Floats
    degree: int

    def __post_init__(self) -> None:
        lock(self, "knots", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None))

    def __call__(self, x: Floats) -> Floats:
        """(k, d) points at parameters x (k,)."""
        from scipy.interpolate import BSpline

        return np.asarray(BSpline.construct_fast(self.knots, self.poles, self.degree)(x))  # a third of the time


def straight(a: Floats, b: Floats) -> Spline:
    """The segment from a (d,) to b (d,)."""
    return Spline(np.array([0.0, 0, 1, 1]), np.stack([a, b]), 1)


def bernstein(x: Floats) -> Floats:
    """(k, 4) the cubic Bernstein polynomials at x (k,) in [0, 1]."""
    y, found = 1 - x, np.empty((len(x), 4))
    found[:, 0], found[:, 1], found[:, 2], found[:, 3] = y**3, 3 * x * y**2, 3 * x**2 * y, x**3
    return found


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


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """The normal equations of the cubics nearest to samples, one curve after another, some of whose poles are held.

    Plain sums and LAPACK's own calls: thousands of short lines have a few hundred samples each, of which sparse
    matrices and their checks took three times as long.

    values : (4, k) of the hats of its curve that are not zero at each sample.
    first  : (k,) the first of these hats among all.
    factor : (4, n) the banded Cholesky factor of their products; that of held poles is the identity.
    held   : the poles that do not move.
    """

    values: Floats
    first: Ints
    factor: Floats
    held: Ints

    @classmethod
    def of(cls, values: Floats, first: Ints, begin: Ints, n: int, held: Ints) -> Self:
        """values (4, k) of the hats that are not zero at each sample, `first` (k,) the first of these hats among all n.

        begin : (r,) the first pole of each curve.
        """
        factor, failed = dpbtrf(_band(values, first, begin, held, n), lower=1)
        if failed:
            raise np.linalg.LinAlgError(f"the products of hats are not positive at pole {failed}")
        return cls(values, first, factor, held)

    def solved(self, right: Floats) -> Floats:
        """(n, d) the solution for a right-hand side (n, d); 0 for held poles."""
        right = np.array(right)
        right[self.held] = 0.0
        found, _ = dpbtrs(self.factor, right, lower=1)
        return np.asarray(found)

    def at_samples(self, poles: Floats, some: Ints | slice = slice(None)) -> Floats:
        """(k, d) what the hats make of poles (n, d) at the samples, or at some of them."""
        first, values = self.first[some], self.values[:, some]
        return np.asarray(sum(values[i][:, None] * poles[first + i] for i in range(4)))

    def sums(self, Q: Floats) -> Floats:
        """(n, d) for each hat the sum of Q (k, d) over all samples, as much as each has of the hat."""
        around, shares = (self.first[:, None] + np.arange(4)).ravel(), self.values.T
        columns = [np.bincount(around, (shares * q[:, None]).ravel(), self.factor.shape[1]) for q in Q.T]
        return np.stack(columns, axis=1)

    def poles(self, Q: Floats, start: Floats) -> Floats:
        """(n, d) nearest to samples Q (k, d); start (n, d) has the held poles, and 0 elsewhere."""
        near = np.zeros(len(start), dtype=bool)
        for i in range(4):
            near[np.maximum(self.held - i, 0)] = True
        some, rest = np.flatnonzero(near[self.first]), np.array(Q)
        rest[some] -= self.at_samples(start, some)
        return np.asarray(start + self.solved(self.sums(rest)))


def _band(values: Floats, first: Ints, begin: Ints, held: Ints, n: int) -> Floats:
    """(4, n) the banded normal equations; those of held poles say that they do not move."""
    band = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            band[j - i] += np.bincount(first + i, values[i] * values[j], n)
    band[0, held] = 0.0
    size = np.diff(np.append(begin, n))
    band[0] += np.repeat(1e-12 * np.add.reduceat(band[0], begin) / (size - 2), size)  # a span without a sample
    band[0, held] = 1.0
    for below in range(1, 4):
        band[below, held] = band[below, held - below] = 0.0  # before the first pole: of the last, which is not used
    return band
