"""Splines in any dimension, and least-squares fits of splines."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from dsfab.core.arrays import Bools, Floats, Ints, lock


@dataclass(frozen=True, eq=False)
class Spline:
    """A clamped B-spline with ascending knots (p + degree + 1,), poles (p, d), and degree 1, 2 or 3."""

    knots: Floats
    poles: Floats
    degree: int

    def __post_init__(self) -> None:
        lock(self, "knots", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None))

    def __call__(self, x: Floats) -> Floats:
        """Return points (k, d) at parameters x (k,)."""
        from scipy.interpolate import BSpline

        return np.asarray(BSpline.construct_fast(self.knots, self.poles, self.degree)(x))  # faster than BSpline()


def segment_spline(a: Floats, b: Floats) -> Spline:
    """Return the straight line from a (d,) to b (d,) as a spline of degree 1."""
    return Spline(np.array([0.0, 0, 1, 1]), np.stack([a, b]), 1)


def polyline_length(line: Floats) -> float:
    """Return the length of a polyline (k, d)."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def arc_lengths(line: Floats) -> Floats:
    """Return the lengths (k,) along a polyline (k, d) from its first point to each point."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def even_samples(line: Floats) -> tuple[Floats, Floats]:
    """Return parameters (k,) in [0, 1] and evenly spaced points (k, d) along a polyline. k is a power of two plus 1."""
    count = 1 << (min(max(16 * len(line), 64), 4096) - 1).bit_length()
    length = arc_lengths(line)
    x = np.arange(count + 1) / count
    return x, np.stack([np.interp(x * length[-1], length, column) for column in line.T], axis=1)


def bernstein(x: Floats) -> Floats:
    """Return the cubic Bernstein polynomials (k, 4) at x (k,) in [0, 1]."""
    y, values = 1 - x, np.empty((len(x), 4))
    values[:, 0], values[:, 1], values[:, 2], values[:, 3] = y**3, 3 * x * y**2, 3 * x**2 * y, x**3
    return values


def basis(x: Floats, knots: Floats) -> tuple[Ints, Floats]:
    """Return, for each x (k,), the number (k,) of the first nonzero cubic basis function and the four values (k, 4)."""
    first_hats, values, _ = hats(x, knots)
    return first_hats, values


def hats(x: Floats, knots: Floats) -> tuple[Ints, Floats, Floats]:
    """Return, for each x (k,), the number (k,) of its first nonzero cubic basis function.
    Return also the values (k, 4) and slopes (k, 4) of the four nonzero functions."""
    x = np.clip(x, knots[3], knots[-4])
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    values, shares = hats_within(x, knots, span)
    slopes = np.zeros((4, len(x)))
    slopes[1:] = shares
    slopes[:-1] -= shares
    return span - 3, values.T, 3 * slopes.T


def hats_within(x: Floats, knots: Floats, span: Ints) -> tuple[Floats, Floats]:
    """Return values (4, k) of the nonzero cubic basis functions at x (k,) [de Boor 1978].
    Return also the quadratic basis functions (3, k), divided by their support widths.
    span : (k,) number of the last knot before x."""
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
    """Normal equations of a least-squares fit of several cubic splines; selected poles are fixed.
    values : (4, k) nonzero basis functions at each sample.    first : (k,) number of the first nonzero function.
    factor : (4, n) banded Cholesky factor of the normal matrix.    held : numbers of the fixed poles."""

    values: Floats
    first: Ints
    factor: Floats
    held: Ints

    @classmethod
    def from_hats(cls, values: Floats, first_hats: Ints, first_poles: Ints, n: int, fixed_poles: Ints) -> Self:
        """Return the normal equations for n poles, k samples. values : (4, k) nonzero basis functions at samples.
        first_hats  : (k,) number of the first nonzero function.    fixed_poles : numbers of the fixed poles.
        first_poles : (r,) number of the first pole of each curve."""
        factor, failed = dpbtrf(_band(values, first_hats, first_poles, fixed_poles, n), lower=1)
        if failed:
            raise np.linalg.LinAlgError(f"the spline fit is singular at pole {failed}")
        return cls(values, first_hats, factor, fixed_poles)

    def solve(self, right_side: Floats) -> Floats:
        """Solve the normal equations for a right-hand side (n, d); return the poles (n, d). Fixed poles are 0."""
        right_side = np.array(right_side)
        right_side[self.held] = 0.0
        solution, _ = dpbtrs(self.factor, right_side, lower=1)
        return np.asarray(solution)

    def values_at_samples(self, poles: Floats, samples: Ints | slice = slice(None)) -> Floats:
        """Return the points (k, d) of the splines with poles (n, d) at the samples with the numbers `samples`."""
        first_hats, values = self.first[samples], self.values[:, samples]
        return np.asarray(sum(values[i][:, None] * poles[first_hats + i] for i in range(4)))

    def sums(self, Q: Floats) -> Floats:
        """Return the sum (n, d), over all samples, of Q (k, d) times each basis function."""
        around, shares = (self.first[:, None] + np.arange(4)).ravel(), self.values.T
        columns = [np.bincount(around, (shares * q[:, None]).ravel(), self.factor.shape[1]) for q in Q.T]
        return np.stack(columns, axis=1)

    def poles(self, Q: Floats, start: Floats) -> Floats:
        """Return the least-squares poles (n, d) for samples Q (k, d). start : (n, d) fixed poles; free rows are 0."""
        touches_fixed = np.zeros(len(start), dtype=bool)
        for i in range(4):
            touches_fixed[np.maximum(self.held - i, 0)] = True
        affected, rest = np.flatnonzero(touches_fixed[self.first]), np.array(Q)
        rest[affected] -= self.values_at_samples(start, affected)
        return np.asarray(start + self.solve(self.sums(rest)))


def _band(values: Floats, first_hats: Ints, first_poles: Ints, fixed_poles: Ints, n: int) -> Floats:
    band = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            band[j - i] += np.bincount(first_hats + i, values[i] * values[j], n)
    band[0, fixed_poles] = 0.0
    size = np.diff(np.append(first_poles, n))
    # a small number on the diagonal, because a span without samples would make the matrix singular
    band[0] += np.repeat(1e-12 * np.add.reduceat(band[0], first_poles) / (size - 2), size)
    band[0, fixed_poles] = 1.0
    for below in range(1, 4):
        # negative indices set entries that LAPACK does not read
        band[below, fixed_poles] = band[below, fixed_poles - below] = 0.0
    return band


@dataclass(frozen=True, eq=False)
class SplineRows:
    """The k samples of r curves, in the order of the curves. parts : number of points in a row of Q.
    number : (r,) number of each curve.    row : (k,) index of each sample's curve.    x, Q : parameters, points.
    count, first, last : (r,) number of samples, first sample and last sample of each curve."""

    number: Ints
    count: Ints
    first: Ints
    last: Ints
    row: Ints
    x: Floats
    Q: Floats
    tolerance: Floats
    parts: int

    @classmethod
    def from_counts(
        cls, number: Ints, count: Ints, x: Floats, Q: Floats, tolerance: Floats, parts: int
    ) -> "SplineRows":
        """Collect samples with parameters x (k,) and points Q (k, d), in the order of the curves.
        number, count : (r,) number of each curve, and number of its samples."""
        end, row = np.cumsum(count), np.repeat(np.arange(len(count)), count)
        return cls(number, count, end - count, end - 1, row, x, Q, tolerance, parts)

    def subset(self, chosen: Bools) -> "SplineRows":
        """Return only the samples of the curves for which `chosen` (r,) is True."""
        chosen_samples = chosen[self.row]
        number, count, tolerance = self.number[chosen], self.count[chosen], self.tolerance[chosen]
        x, Q = self.x[chosen_samples], self.Q[chosen_samples]
        return SplineRows.from_counts(number, count, x, Q, tolerance, self.parts)

    @property
    def line(self) -> Floats:
        """Points (k, d), for each sample, on the straight line between the ends of its curve."""
        start, end = self.Q[self.first], self.Q[self.last]
        return start[self.row] + self.x[:, None] * (end - start)[self.row]

    def distances(self, points: Floats) -> Floats:
        """Return the distance (k,) of each sample from its row of `points` (k, d).
        If a row has several points, the largest of their distances counts."""
        offset = (points - self.Q).reshape(len(points), self.parts, -1)
        return np.asarray(np.sqrt(np.einsum("kpi,kpi->pk", offset, offset).max(axis=0)))

    def row_maxima(self, distances: Floats) -> Floats:
        """Return the largest distance (r,) on each curve. distances : (k,) distances at the samples."""
        return np.asarray(np.maximum.reduceat(distances, self.first))


@dataclass(frozen=True, eq=False)
class RowSpans:
    """Spans of curves, from knot `low` to `high` (s,). row : (s,) curve of each span. of : (k,) span of each sample."""

    low: Floats
    high: Floats
    row: Ints
    of: Ints

    @property
    def count(self) -> Ints:
        """Number (r,) of spans of each curve."""
        return np.bincount(self.row)

    @property
    def knots(self) -> Floats:
        """Knots (s + 7 r,) of cubic splines with s spans on r curves, in the order of the curves."""
        knots, end = np.zeros(len(self.row) + 7 * len(self.count)), np.cumsum(self.count + 7)
        knots[np.arange(len(self.row)) + 7 * self.row + 3] = self.low
        knots[(end[:, None] - np.arange(1, 5)).ravel()] = 1.0
        return knots

    def with_halves(self, bad: Bools, unfinished: Bools, rows: SplineRows) -> "RowSpans":
        """Return the spans of the curves marked by `unfinished` (r,), and halve the spans marked by `bad` (s,)."""
        stays = unfinished[self.row]
        low, high, two = self.low[stays], self.high[stays], bad[stays]
        row = (np.cumsum(unfinished) - 1)[self.row[stays]]
        span = (np.cumsum(stays) - 1)[self.of[unfinished[rows.row]]]
        x, middle = rows.x[unfinished[rows.row]], (low + high) / 2
        first_half, times = np.cumsum(1 + two) - (1 + two), 1 + two
        low, high, row = (np.repeat(values, times) for values in (low, high, row))
        high[first_half[two]] = low[first_half[two] + 1] = middle[two]
        return RowSpans(low, high, row, first_half[span] + (two[span] & (x >= middle[span])))


SAMPLES_PER_SPAN = 6  # smallest number of samples per span; with fewer samples, a curve oscillates
AT_ONCE = 20_000  # number of samples in one batch of curves, for the processor's cache
Fitted = tuple[Spline, float]  # a curve, and its largest distance from its samples


def splines_through(
    samples: Sequence[tuple[Floats, Floats]], tolerances: Sequence[float], parts: int = 1
) -> list[Fitted]:
    """Fit a line, parabola or cubic spline to each sample (x, Q): points Q (k, d) at parameters x (k,) from 0 to 1.
    Each result includes the largest distance from the points, which exceeds the tolerance if samples are too few.
    parts : number of points in a row of Q."""
    fits = dict[int, Fitted]()
    for batch in _batches([len(x) for x, _ in samples]):
        x, Q = (np.concatenate(column) for column in zip(*(samples[c] for c in batch), strict=True))
        count = np.array([len(samples[c][0]) for c in batch])
        rows = SplineRows.from_counts(np.array(batch), count, x, Q, np.array([tolerances[c] for c in batch]), parts)
        rows = _lines(rows, fits)
        if len(rows.number):
            rows = _parabolas(rows, fits)
        if len(rows.number):
            _cubics(rows, fits)
    return [fits[c] for c in range(len(samples))]


def _batches(counts: list[int]) -> Iterator[range]:
    start = total = 0
    for c, count in enumerate(counts):
        total += count
        if total >= AT_ONCE or c == len(counts) - 1:
            yield range(start, c + 1)
            start, total = c + 1, 0


def _lines(rows: SplineRows, fits: dict[int, Fitted]) -> SplineRows:
    errors = rows.row_maxima(rows.distances(rows.line))
    accepted = errors <= 0.5 * rows.tolerance
    for r in np.flatnonzero(accepted):
        fits[int(rows.number[r])] = segment_spline(rows.Q[rows.first[r]], rows.Q[rows.last[r]]), float(errors[r])
    return rows.subset(~accepted)


def _parabolas(rows: SplineRows, fits: dict[int, Fitted]) -> SplineRows:
    line, bow = rows.line, 2 * rows.x * (1 - rows.x)
    bend = np.add.reduceat(bow[:, None] * (rows.Q - line), rows.first) / np.add.reduceat(bow * bow, rows.first)[:, None]
    errors = rows.row_maxima(rows.distances(line + bow[:, None] * bend[rows.row]))
    accepted = errors <= rows.tolerance
    knots = np.array([0.0] * 3 + [1.0] * 3)
    for r in np.flatnonzero(accepted):
        start, end = rows.Q[rows.first[r]], rows.Q[rows.last[r]]
        poles = np.stack([start, (start + end) / 2 + bend[r], end])
        fits[int(rows.number[r])] = Spline(knots, poles, 2), float(errors[r])
    return rows.subset(~accepted)


def _cubics(rows: SplineRows, fits: dict[int, Fitted]) -> None:
    spans = RowSpans(np.zeros(len(rows.number)), np.ones(len(rows.number)), np.arange(len(rows.number)), rows.row)
    rounds = 14  # the shortest span is 2^-14 of its curve
    for turn in range(rounds):
        poles, distances = _least_squares(rows, spans)
        errors, many = rows.row_maxima(distances), np.bincount(spans.of, minlength=len(spans.row))
        worst, used = np.zeros(len(many)), many > 0
        worst[used] = np.maximum.reduceat(distances, (np.cumsum(many) - many)[used])
        bad = (worst > rows.tolerance[spans.row]) & (many >= 2 * SAMPLES_PER_SPAN) & (turn < rounds - 1)
        unfinished = np.zeros(len(errors), dtype=bool)
        unfinished[spans.row[bad]] = True
        knots, end = spans.knots, np.cumsum(spans.count)
        start = end - spans.count
        for r in np.flatnonzero(~unfinished):
            t, row_poles = knots[start[r] + 7 * r : end[r] + 7 * r + 7], poles[start[r] + 3 * r : end[r] + 3 * r + 3]
            fits[int(rows.number[r])] = Spline(t, row_poles, 3), float(errors[r])
        if not unfinished.any():
            return
        rows, spans = rows.subset(unfinished), spans.with_halves(bad, unfinished, rows)


def _least_squares(rows: SplineRows, spans: RowSpans) -> tuple[Floats, Floats]:
    values, _ = hats_within(rows.x, spans.knots, spans.of + 7 * rows.row + 3)
    first_hats, size = spans.of + 3 * rows.row, spans.count + 3
    begin, n = np.cumsum(size) - size, int(size.sum())
    ends = np.concatenate([begin, begin + size - 1])
    start = np.zeros((n, rows.Q.shape[1]))
    start[ends] = rows.Q[np.concatenate([rows.first, rows.last])]
    system = LeastSquares.from_hats(values, first_hats, begin, n, ends)
    poles = system.poles(rows.Q, start)
    return poles, rows.distances(system.values_at_samples(poles))
