"""Fits of smooth curves to polylines within a tolerance."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, require_equal
from dsfab.export.splines import SAMPLES_PER_SPAN, LeastSquares, Spline, hats_within
from dsfab.surface import polyline_length

KNOT_DIGITS = 4  # decimals of knots (millimetres along the polyline)
AT_ONCE = 5_000  # number of samples in one batch of lines, for the processor's cache

THIRDS = np.arange(4) / 3
POWERS = np.linalg.inv(THIRDS[:, None] ** np.arange(4))
"""Matrix that maps a cubic's values at x = 0, 1/3, 2/3, 1 of a span to its coefficients of 1, x, x^2 and x^3."""
Refined = tuple[Floats, Floats, int, float]  # knots, poles, degree, and the largest distance from the polyline


@dataclass(frozen=True, eq=False)
class SampledLine:
    """Polyline with samples at equal distances. smooth : True for a closed line with the same tangent at both ends.
    line  : (k, d) points.    length : (k,) arc lengths, mm.    count : number of steps between samples."""

    line: Floats
    length: Floats
    total: float
    count: int
    smooth: bool

    @classmethod
    def from_points(cls, points: Floats, smooth: bool) -> Self:
        """Return the polyline through points (k, d), with samples."""
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        total = float(np.round(length[-1], KNOT_DIGITS))
        return cls(points, length, total, max(8 * len(points), 16 * SAMPLES_PER_SPAN), smooth)

    @property
    def bow(self) -> float:
        """Largest distance (mm) between points of the line and of its chord at the same fraction of the length."""
        share, start, end = self.length / self.length[-1], self.line[0], self.line[-1]
        return float(np.linalg.norm(self.line - start - share[:, None] * (end - start), axis=1).max())

    @cached_property
    def sample_lengths(self) -> Floats:
        """Arc length (count + 1,) along the line at each sample, mm."""
        return np.asarray(np.arange(self.count + 1) / self.count * self.total)

    @cached_property
    def samples(self) -> Floats:
        """Points (count + 1, d) of all samples."""
        return np.stack(self._points_at(np.arange(self.count + 1) / self.count), axis=1)

    @cached_property
    def check_points(self) -> tuple[Floats, list[Floats]]:
        """Points for comparison with a curve: arc lengths (q,), mm, and an array (q,) for each coordinate."""
        finer = 4 * self.count
        share = np.union1d(np.arange(finer + 1) / finer, self.length / self.length[-1])
        return share * self.total, self._points_at(share)

    @property
    def breaks(self) -> Floats:
        """Arc lengths (s,), mm, at the ends of the spans of the first spline in a fit."""
        return np.array([0.0, self.total / 2, self.total] if self.smooth else [0.0, self.total])

    def _points_at(self, shares: Floats) -> list[Floats]:
        return [np.interp(shares * self.length[-1], self.length, column) for column in self.line.T]


def splines_by_halving(runs: Sequence[SampledLine], tolerance: float) -> list[Refined | None]:
    """Fit a spline to each line within a tolerance (mm), and halve spans of the spline until it fits.
    The result is None for a line with too few samples."""
    splines: list[Refined | None] = [None] * len(runs)
    for batch in _batches(runs):
        breaks = {k: runs[k].breaks for k in batch}
        while breaks:
            rounded = [np.round(span_ends, KNOT_DIGITS) for span_ends in breaks.values()]
            rows = SplineSystem([runs[k] for k in breaks], rounded)
            poles, next_breaks = rows.poles(), dict[int, Floats]()
            for k, span_ends, (low, high), errors in zip(
                breaks, rows.breaks, rows.ends, rows.errors(poles), strict=True
            ):
                run, worst = runs[k], float(errors.max())
                if worst <= tolerance:
                    splines[k] = np.concatenate([[0.0] * 3, span_ends, [run.total] * 3]), poles[low:high], 3, worst
                    continue
                bad = np.flatnonzero(errors > tolerance)
                if not ((span_ends[1:] - span_ends[:-1])[bad] < 2 * SAMPLES_PER_SPAN * run.total / run.count).any():
                    next_breaks[k] = np.sort(np.concatenate([span_ends, (span_ends[bad] + span_ends[bad + 1]) / 2]))
            breaks = next_breaks
    return splines


def _batches(runs: Sequence[SampledLine]) -> Iterator[list[int]]:
    batch, size = list[int](), 0
    for k, run in enumerate(runs):
        if batch and (size + run.count > AT_ONCE or run.line.shape[1] != runs[batch[0]].line.shape[1]):
            yield batch
            batch, size = [], 0
        batch.append(k)
        size += run.count
    if batch:
        yield batch


class SplineSystem:
    """Cubic splines along several lines. breaks : for each line, arc lengths (b,) at the ends of its spans, mm."""

    def __init__(self, runs: list[SampledLine], breaks: list[Floats]) -> None:
        self.runs, self.breaks = runs, breaks
        pairs = zip(runs, breaks, strict=True)
        self.knots = np.concatenate([x for run, ends in pairs for x in ([0.0] * 3, ends, [run.total] * 3)])
        size = np.array([len(span_ends) for span_ends in breaks])
        self.first_knot = np.concatenate([[0], np.cumsum(size + 6)])
        self.first_pole = np.concatenate([[0], np.cumsum(size + 2)])
        self.ends = list(zip(self.first_pole[:-1].tolist(), self.first_pole[1:].tolist(), strict=True))

    def _span_counts(self, lengths: Sequence[Floats]) -> Ints:
        counts = list[Ints]()
        for x, span_ends in zip(lengths, self.breaks, strict=True):
            many = x.searchsorted(span_ends[1:])
            many[-1] = len(x)
            many[1:] -= many[:-1].copy()
            counts.append(many)
        return np.concatenate(counts)

    def _hats(self, x: Floats, counts: Ints) -> tuple[Floats, Ints]:
        spans = np.array([len(span_ends) - 1 for span_ends in self.breaks])
        row, span = np.repeat(np.arange(len(spans)), spans), np.arange(spans.sum())
        span -= np.repeat(np.cumsum(spans) - spans, spans)
        values, _ = hats_within(x, self.knots, np.repeat(span + 3 + self.first_knot[row], counts))
        return values, np.repeat(span + self.first_pole[row], counts)

    def poles(self) -> Floats:
        """Return the poles (n, d) of the least-squares cubic splines through both ends of each line."""
        lengths = [run.sample_lengths for run in self.runs]
        values, first_hats = self._hats(np.concatenate(lengths), self._span_counts(lengths))
        points = np.concatenate([run.samples for run in self.runs])
        n = int(self.first_pole[-1])
        start, tangent, ends = np.zeros((n, points.shape[1])), np.zeros((n, 1)), list[int]()
        for run, span_ends, (low, high) in zip(self.runs, self.breaks, self.ends, strict=True):
            many = 2 if run.smooth else 1
            ends += [*range(low, low + many), *range(high - many, high)]
            start[low : low + many], start[high - many : high] = run.samples[0], run.samples[-1]
            if run.smooth:
                tangent[low + 1, 0] = (span_ends[1] - span_ends[0]) / 3
                tangent[high - 2, 0] = -(span_ends[-1] - span_ends[-2]) / 3
        system = LeastSquares.from_hats(values, first_hats, self.first_pole[:-1], n, np.array(ends))
        poles = system.poles(points, start)
        return self._smooth_poles(system, poles, points, tangent) if tangent.any() else poles

    def _smooth_poles(self, system: LeastSquares, poles: Floats, points: Floats, tangent: Floats) -> Floats:
        free = tangent - system.solve(system.sums(system.values_at_samples(tangent)))
        along, residual = system.values_at_samples(free), points - system.values_at_samples(poles)
        poles, end = poles.copy(), np.cumsum([run.count + 1 for run in self.runs])
        for run, (low, high), stop in zip(self.runs, self.ends, end.tolist(), strict=True):
            if run.smooth:
                direction = along[stop - run.count - 1 : stop]
                projected = direction.T @ residual[stop - run.count - 1 : stop]
                poles[low:high] += free[low:high] @ projected / (direction.T @ direction)
        return poles

    def errors(self, poles: Floats) -> list[Floats]:
        """Return, for each line, the largest distance (s,) of each span of its spline from the polyline, mm.
        poles : (n, d) poles of all splines."""
        begin = np.concatenate([lengths[:-1] for lengths in self.breaks])
        wide = np.concatenate([lengths[1:] - lengths[:-1] for lengths in self.breaks])
        four = (begin[:, None] + wide[:, None] * THIRDS).ravel()
        values, first_hats = self._hats(four, np.full(len(wide), len(THIRDS)))
        span_points = sum(values[i][:, None] * poles[first_hats + i] for i in range(4))
        powers = np.einsum("ij,sjd->dis", POWERS, span_points.reshape(len(wide), 4, -1))
        lengths = [run.check_points[0] for run in self.runs]
        many = self._span_counts(lengths)
        x = (np.concatenate(lengths) - np.repeat(begin, many)) / np.repeat(wide, many)
        square = np.zeros(len(x))
        for axis, power in enumerate(powers):
            points = np.concatenate([run.check_points[1][axis] for run in self.runs])
            constant, two, three, four = (np.repeat(row, many) for row in power)
            square += (((four * x + three) * x + two) * x + constant - points) ** 2
        worst = np.sqrt(np.maximum.reduceat(square, np.cumsum(many) - many))
        return np.split(worst, np.cumsum([len(span_ends) - 1 for span_ends in self.breaks])[:-1])


SHARP = np.deg2rad(35.0)
"""Smallest bend (radians) at a corner of an outline. Bends between the chords of a fillet are at most 34 degrees."""
SPANS = 4
"""Largest number of spans of an edge of a plane face. With more spans, CAD programs compute inaccurate volumes."""


@dataclass(frozen=True, eq=False)
class Curve(Spline):
    """A straight line or a cubic spline in the plane or in space; knots and poles in millimetres.
    deviation : largest distance between the curve and its polyline, mm."""

    deviation: float

    @property
    def is_straight(self) -> bool:
        return self.degree == 1


def curves_through(loop: Floats, corner: Bools, tolerance: float) -> list[Curve] | None:
    """Fit at least two curves to the closed polyline `loop` (k, 2), mm; None if no spline is within the tolerance.
    corner : (k,) True where a curve must end."""
    corners = np.flatnonzero(corner | (np.abs(turning(loop)) > SHARP))
    if len(corners) > 1:
        ends = [*corners.tolist(), int(corners[0]) + len(loop)]
        chain = [fitted_curve(loop[np.arange(a, b + 1) % len(loop)], tolerance) for a, b in pairwise(ends)]
        curves = [curve for curve in chain if curve is not None]
        return curves if len(curves) == len(chain) else None
    start = int(corners[0]) if len(corners) else 0
    line = loop[(start + np.arange(len(loop) + 1)) % len(loop)]
    closed_curve = fitted_curve(line, tolerance, smooth=not len(corners))
    return None if closed_curve is None else halves(closed_curve)


def turning(loop: Floats) -> Floats:
    """Return the turning angle (k,) at each vertex of a closed polyline (k, 2), radians; positive to the left."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(across, np.einsum("ki,ki->k", before, after)))


@dataclass(frozen=True, eq=False)
class Polyline:
    """A polyline with points (k, 2) or (k, 3). most : largest number of samples in a fit.
    smooth : True for a closed line with the same tangent at both ends."""

    points: Floats
    smooth: bool = False
    most: int = 50_000


def fitted_curve(line: Floats, tolerance: float, smooth: bool = False) -> Curve | None:
    """Fit a single curve to the polyline `line` (k, 2) or (k, 3), mm; None if the fit needs too many samples."""
    return fitted_curves([Polyline(line, smooth)], tolerance)[0]


def fitted_curves(lines: Sequence[Polyline], tolerance: float) -> list[Curve | None]:
    """Fit a single curve to each polyline within `tolerance` (mm); None if the fit needs too many samples."""
    curves: list[Curve | None] = [None] * len(lines)
    open_runs = dict[int, SampledLine]()
    for k, line in enumerate(lines):
        run = SampledLine.from_points(line.points, line.smooth)
        if not run.total > 0:
            continue
        deviation = np.inf if line.smooth else run.bow
        if deviation <= tolerance:
            curves[k] = Curve(np.array([0, 0, run.total, run.total]), line.points[[0, -1]], 1, deviation)
        elif run.count <= line.most:
            open_runs[k] = run
    while open_runs:
        splines = splines_by_halving(list(open_runs.values()), tolerance)
        missed = dict[int, SampledLine]()
        for (k, run), spline in zip(open_runs.items(), splines, strict=True):
            if spline is not None:
                curves[k] = Curve(*spline)
            elif 4 * run.count <= lines[k].most:
                missed[k] = replace(run, count=4 * run.count)
        open_runs = missed
    return curves


def halves(curve: Curve) -> list[Curve]:
    """Split a spline near its middle into two curves."""
    return _split(curve, float(np.round((curve.knots[0] + curve.knots[-1]) / 2, KNOT_DIGITS)))


def split_at_knots(curve: Curve) -> list[Curve]:
    """Split a curve at its knots into curves of at most `SPANS` spans."""
    breaks, pieces = np.unique(curve.knots), [curve]
    count = -(-(len(breaks) - 1) // SPANS)
    for knot in np.round(np.arange(1, count) * (len(breaks) - 1) / count).astype(int):
        pieces += _split(pieces.pop(), float(breaks[knot]))
    return pieces


def _split(curve: Curve, parameter: float) -> list[Curve]:
    from scipy.interpolate import BSpline

    spline = BSpline(curve.knots, curve.poles, curve.degree)
    for _ in range(curve.degree - int(np.count_nonzero(curve.knots == parameter))):
        spline = spline.insert_knot(parameter)
    first_knot = int(np.searchsorted(spline.t, parameter))
    end = first_knot + curve.degree
    before = np.concatenate([spline.t[:end], [parameter]])
    after = np.concatenate([[parameter], spline.t[first_knot:]])
    poles = spline.c[: len(spline.t) - curve.degree - 1]
    return [
        Curve(before, poles[:first_knot], curve.degree, curve.deviation),
        Curve(after, poles[first_knot - 1 :], curve.degree, curve.deviation),
    ]


CLOSEST = 1e-3  # smallest tolerance (mm) of curves
SAMPLES_PER_POINT, FEWEST_SAMPLES = 32, 400
"""Largest number of samples of a polyline: the larger of FEWEST_SAMPLES, and SAMPLES_PER_POINT * number of points.
With more samples, the fitted curve could have more poles than the polyline has points."""
REMEMBERED = 4096  # number of lines whose curves stay in the cache


def curve_tolerance(part: Part) -> float:
    """Return the tolerance (mm) of the curves that are fitted to a part's lines."""
    return max(part.details.tolerance, CLOSEST)


def chains(part: Part) -> list[list[Curve]]:
    """Return, for each line of a part, the fitted curves in order along the line."""
    return all_curves_along([line.points for line in part.details.lines], curve_tolerance(part))


def curves_along(points: Floats, tolerance: float) -> list[Curve]:
    """Fit curves to a polyline (k, 3) within `tolerance` (mm). Curves begin and end at sharp corners."""
    return all_curves_along([points], tolerance)[0]


def all_curves_along(lines: Sequence[Floats], tolerance: float) -> list[list[Curve]]:
    """Fit curves to each polyline (k, 3) within `tolerance` (mm), as in `curves_along`."""
    lines = [np.ascontiguousarray(points, dtype=np.float64) for points in lines]
    keys = [(points.tobytes(), points.shape, tolerance) for points in lines]
    chain_by_key = {key: _remembered[key] for key in keys if key in _remembered}
    missing = {key: list(_runs(points)) for key, points in zip(keys, lines, strict=True) if key not in chain_by_key}
    fits = iter(fitted_curves([run for runs in missing.values() for run in runs], tolerance))
    for key, runs in missing.items():
        chain = list[Curve]()
        for run in runs:
            curve = next(fits)
            chain += [curve] if curve is not None else _segments(run.points)
        chain_by_key[key] = tuple(chain)
    _remember(chain_by_key)
    return [list(chain_by_key[key]) for key in keys]


Key = tuple[bytes, tuple[int, ...], float]
_remembered = dict[Key, tuple[Curve, ...]]()  # curves by line and tolerance; the newest curves are at the end


def _remember(chain_by_key: Mapping[Key, tuple[Curve, ...]]) -> None:
    for key in chain_by_key:
        _remembered.pop(key, None)
    _remembered.update(chain_by_key)
    for key in list(_remembered)[: max(len(_remembered) - REMEMBERED, 0)]:
        del _remembered[key]


def _runs(points: Floats) -> Iterator[Polyline]:
    closed = len(points) > 2 and bool((points[0] == points[-1]).all())
    corners = np.flatnonzero(_sharp(points, closed))
    smooth = closed and not len(corners)
    if closed and not smooth:  # the chain begins at a corner
        points = np.concatenate([points[corners[0] : -1], points[: corners[0] + 1]])
        corners = (corners - corners[0])[1:]
    for a, b in pairwise([0, *corners.tolist(), len(points) - 1]):
        yield Polyline(points[a : b + 1], smooth, max(SAMPLES_PER_POINT * (b + 1 - a), FEWEST_SAMPLES))


def _sharp(points: Floats, closed: bool) -> Bools:
    along = np.diff(points, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    before = along[-1:] if closed else along[:1]
    turn = np.zeros(len(points), dtype=bool)
    turn[:-1] = np.einsum("ki,ki->k", along, np.concatenate([before, along[:-1]])) < np.cos(SHARP)
    return turn


def _segments(points: Floats) -> list[Curve]:
    curves = (fitted_curve(points[i : i + 2], np.inf) for i in range(len(points) - 1))
    return [curve for curve in curves if curve is not None]


def joined_segments(chain: list[Curve]) -> list[Curve | Floats]:
    """Merge neighbouring straight curves into polylines (k, 3). Return splines and polylines in order."""
    pieces = list[Curve | Floats]()
    for straight, group in groupby(chain, key=lambda curve: curve.is_straight):
        run = list(group)
        pieces += [np.concatenate([run[0].poles[:1], *(curve.poles[-1:] for curve in run)])] if straight else run
    return pieces


def sample_parameters(knots: Floats, per_span: int = 16) -> Floats:
    """Return ascending parameters (k,) along a curve with knots (p,). Each span gets `per_span` parameters."""
    breaks = np.unique(knots)
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(per_span) / per_span)
    return np.append(inner.ravel(), breaks[-1])


def check_curves(part: Part, curves_read: Mapping[str, Sequence[Floats]]) -> ReadBack:
    """Compare the curves in a file with the lines of a part. Raises ExportError for a difference.
    curves_read : by line id, points (k, 3) along each curve of the line, mm."""
    lines = {line.id: line.points for line in part.details.lines}
    require_equal(part, "lines", lines.keys(), curves_read.keys())
    error = check_length(part, sum(polyline_length(points) for curves in curves_read.values() for points in curves))
    for name, points in lines.items():
        clouds = np.concatenate(curves_read[name]), points
        box_read, box_expected = (np.array([x.min(axis=0), x.max(axis=0)]) for x in clouds)
        if not (moved := float(np.abs(box_read - box_expected).max())) <= 2 * curve_tolerance(part):
            raise ExportError(
                f"the line {name} of {part.name!r} is {moved:.3g} mm from its place when read back; use another format"
            )
    return ReadBack(len(curves_read), "lines", error, "length")


def check_length(part: Part, length_read: float) -> float:
    """Return the relative error of the total length of a part's lines in a file. Raises ExportError for a large error.
    length_read : total length in the file, mm."""
    expected = sum(polyline_length(line.points) for line in part.details.lines)
    if not abs(length_read - expected) <= 5 * READ_BACK * expected:
        raise ExportError(
            f"the total length of the lines of {part.name!r} is {length_read:.6g} mm in the file instead of "
            f"{expected:.6g} mm; write another format"
        )
    return length_read / expected - 1
