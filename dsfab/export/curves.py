"""Smooth curves through polylines within a tolerance: straight lines and cubic splines for DXF, 3DM and STEP."""

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
from dsfab.export.readback import ReadBack, differs
from dsfab.export.splines import SAMPLES_PER_SPAN, LeastSquares, Spline, hats_within
from dsfab.surface import polyline_length

KNOT_DIGITS = 4
"""Decimals of knots, which are millimetres along the polyline."""


AT_ONCE = 5_000
"""Samples of one batch of lines; the processor's cache holds their hats and points."""

THIRDS = np.arange(4) / 3
POWERS = np.linalg.inv(THIRDS[:, None] ** np.arange(4))
"""Matrix from a cubic's values at thirds of a span to its factors of 1, x, x^2 and x^3, x from 0 to 1."""

Refined = tuple[Floats, Floats, int, float]
"""Knots, poles, degree, and the largest distance from the polyline."""


@dataclass(frozen=True, eq=False)
class SampledLine:
    """A polyline (k, d) with the lengths along it (k,), its total length rounded to 1e-4 mm, and a number of samples.

    smooth : the line is closed, and its spline has the same tangent at both ends.
    """

    line: Floats
    length: Floats
    total: float
    count: int
    smooth: bool

    @classmethod
    def of(cls, line: Floats, smooth: bool) -> Self:
        """Return the polyline (k, d) with the number of samples for the first attempt."""
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        total = float(np.round(length[-1], KNOT_DIGITS))
        return cls(line, length, total, max(8 * len(line), 16 * SAMPLES_PER_SPAN), smooth)

    @property
    def bow(self) -> float:
        """Largest distance from the chord between the ends, at equal shares of the length."""
        share, first, last = self.length / self.length[-1], self.line[0], self.line[-1]
        return float(np.linalg.norm(self.line - first - share[:, None] * (last - first), axis=1).max())

    @cached_property
    def at(self) -> Floats:
        """(k + 1,) lengths of the k + 1 samples along the line."""
        return np.asarray(np.arange(self.count + 1) / self.count * self.total)

    @cached_property
    def samples(self) -> Floats:
        """(k + 1, d) points of the samples."""
        return np.stack(self._on(np.arange(self.count + 1) / self.count), axis=1)

    @cached_property
    def asked(self) -> tuple[Floats, list[Floats]]:
        """(q,) ascending lengths at which the spline is compared with the line, and d arrays (q,) of the line's
        coordinates.
        """
        finer = 4 * self.count
        share = np.union1d(np.arange(finer + 1) / finer, self.length / self.length[-1])
        return share * self.total, self._on(share)

    @property
    def breaks(self) -> Floats:
        """(s,) ends of the first spans: one span, or two for a smooth line."""
        return np.array([0.0, self.total / 2, self.total] if self.smooth else [0.0, self.total])

    def _on(self, share: Floats) -> list[Floats]:
        return [np.interp(share * self.length[-1], self.length, column) for column in self.line.T]


def refined(runs: Sequence[SampledLine], tolerance: float) -> list[Refined | None]:
    """Fit a spline to each line: halve its spans until the spline is within the tolerance.

    A result is None if the tolerance needs more samples than the line has.
    """
    found: list[Refined | None] = [None] * len(runs)
    for batch in _batches(runs):
        breaks = {k: runs[k].breaks for k in batch}
        while breaks:
            rows = _Rows([runs[k] for k in breaks], [np.round(at, KNOT_DIGITS) for at in breaks.values()])
            poles, left = rows.poles(), dict[int, Floats]()
            for k, at, (first, last), off in zip(breaks, rows.breaks, rows.ends, rows.off(poles), strict=True):
                run, worst = runs[k], float(off.max())
                if worst <= tolerance:
                    knots = np.concatenate([[0.0] * 3, at, [run.total] * 3])
                    found[k] = knots, poles[first:last], 3, worst
                    continue
                bad = np.flatnonzero(off > tolerance)
                if not ((at[1:] - at[:-1])[bad] < 2 * SAMPLES_PER_SPAN * run.total / run.count).any():
                    left[k] = np.sort(np.concatenate([at, (at[bad] + at[bad + 1]) / 2]))
            breaks = left
    return found


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


class _Rows:
    """Cubic splines along several lines, with given span ends, solved in one system."""

    def __init__(self, runs: list[SampledLine], breaks: list[Floats]) -> None:
        self.runs, self.breaks = runs, breaks
        self.knots = np.concatenate(
            [part for run, at in zip(runs, breaks, strict=True) for part in ([0.0] * 3, at, [run.total] * 3)]
        )
        size = np.array([len(at) for at in breaks])
        self.first_knot = np.concatenate([[0], np.cumsum(size + 6)])
        self.first_pole = np.concatenate([[0], np.cumsum(size + 2)])
        self.ends = list(zip(self.first_pole[:-1].tolist(), self.first_pole[1:].tolist(), strict=True))

    def _spans(self, at: Sequence[Floats]) -> Ints:
        found = list[Ints]()
        for x, own in zip(at, self.breaks, strict=True):
            many = x.searchsorted(own[1:])
            many[-1] = len(x)
            many[1:] -= many[:-1].copy()
            found.append(many)
        return np.concatenate(found)

    def _hats(self, x: Floats, many: Ints) -> tuple[Floats, Ints]:
        """(4, k) hats at lengths x (k,), `many` of them in each span, and (k,) the first of each four among all
        poles.
        """
        spans = np.array([len(at) - 1 for at in self.breaks])
        row, own = np.repeat(np.arange(len(spans)), spans), np.arange(spans.sum())
        own -= np.repeat(np.cumsum(spans) - spans, spans)
        values, _ = hats_within(x, self.knots, np.repeat(own + 3 + self.first_knot[row], many))
        return values, np.repeat(own + self.first_pole[row], many)

    def poles(self) -> Floats:
        """(n, d) poles of the least-squares cubic splines, which begin and end at the first and last samples.

        Smooth lines share one unknown tangent d at both ends: pole 1 is pole 0 + a d, the last but one is
        the last - b d, with a and b a third of the first and the last span.
        """
        at = [run.at for run in self.runs]
        values, first = self._hats(np.concatenate(at), self._spans(at))
        points = np.concatenate([run.samples for run in self.runs])
        n = int(self.first_pole[-1])
        start, tangent, ends = np.zeros((n, points.shape[1])), np.zeros((n, 1)), list[int]()
        for run, own, (low, high) in zip(self.runs, self.breaks, self.ends, strict=True):
            many = 2 if run.smooth else 1
            ends += [*range(low, low + many), *range(high - many, high)]
            start[low : low + many], start[high - many : high] = run.samples[0], run.samples[-1]
            if run.smooth:
                tangent[[low + 1, high - 2], 0] = (own[1] - own[0]) / 3, -(own[-1] - own[-2]) / 3
        system = LeastSquares.of(values, first, self.first_pole[:-1], n, np.array(ends))
        poles = system.poles(points, start)
        return self._smoothed(system, poles, points, tangent) if tangent.any() else poles

    def _smoothed(self, system: LeastSquares, poles: Floats, points: Floats, tangent: Floats) -> Floats:
        """Add the shared tangent d of each smooth line. It couples the first and last poles outside of the band, so it
        is eliminated from the system and solved alone.
        """
        free = tangent - system.solved(system.sums(system.at_samples(tangent)))
        along, off = system.at_samples(free), points - system.at_samples(poles)
        poles, end = poles.copy(), np.cumsum([run.count + 1 for run in self.runs])
        for run, (low, high), last in zip(self.runs, self.ends, end.tolist(), strict=True):
            if run.smooth:
                own = along[last - run.count - 1 : last]
                poles[low:high] += free[low:high] @ (own.T @ off[last - run.count - 1 : last]) / (own.T @ own)
        return poles

    def off(self, poles: Floats) -> list[Floats]:
        """Largest distances of the spans of each line, poles (n, d)."""
        begin, wide = (
            np.concatenate([at[:-1] for at in self.breaks]),
            np.concatenate([at[1:] - at[:-1] for at in self.breaks]),
        )
        four = (begin[:, None] + wide[:, None] * THIRDS).ravel()
        values, first = self._hats(four, np.full(len(wide), len(THIRDS)))
        there = sum(values[i][:, None] * poles[first + i] for i in range(4))
        powers = np.einsum("ij,sjd->dis", POWERS, there.reshape(len(wide), 4, -1))
        at = [run.asked[0] for run in self.runs]
        many = self._spans(at)
        x = (np.concatenate(at) - np.repeat(begin, many)) / np.repeat(wide, many)
        square = np.zeros(len(x))
        for axis, power in enumerate(powers):
            points = np.concatenate([run.asked[1][axis] for run in self.runs])
            one, two, three, four = (np.repeat(row, many) for row in power)
            square += (((four * x + three) * x + two) * x + one - points) ** 2
        worst = np.sqrt(np.maximum.reduceat(square, np.cumsum(many) - many))
        return np.split(worst, np.cumsum([len(own) - 1 for own in self.breaks])[:-1])


SHARP = np.deg2rad(30.0)
"""An outline has a corner where it turns by more than this (radians)."""


SPANS = 4
"""Most spans of one edge of a plane face. CAD programs integrate volumes with a few points on each edge, however many
spans it has. Openings with edges of 6 to 40 spans changed a plate's volume by 0.1 to 0.5 %; 4 spans keep it to 6e-5.
"""


@dataclass(frozen=True, eq=False)
class Curve(Spline):
    """A line or a cubic in the plane or in space; knots and poles in millimetres.

    deviation : largest distance between points of the curve and of the polyline at equal shares of the length.
    """

    deviation: float

    @property
    def straight(self) -> bool:
        """True for a line."""
        return self.degree == 1


def curves_through(loop: Floats, corner: Bools, tolerance: float) -> list[Curve] | None:
    """Fit a chain of at least two curves to the closed polyline `loop` (k, 2); None if a spline misses the tolerance.

    corner : (k,) vertices between two curves; sharp turns are added. A loop with at most one corner has one smooth
             curve, which is split in two.
    """
    at = np.flatnonzero(corner | (np.abs(turning(loop)) > SHARP))
    if len(at) > 1:
        ends = [*at.tolist(), int(at[0]) + len(loop)]
        chain = [fitted(loop[np.arange(a, b + 1) % len(loop)], tolerance) for a, b in pairwise(ends)]
        found = [curve for curve in chain if curve is not None]
        return found if len(found) == len(chain) else None
    start = int(at[0]) if len(at) else 0
    whole = fitted(loop[(start + np.arange(len(loop) + 1)) % len(loop)], tolerance, smooth=not len(at))
    return None if whole is None else halves(whole)


def turning(loop: Floats) -> Floats:
    """(k,) turning angles (radians) at the vertices of a closed polyline (k, 2); counter-clockwise is positive."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(across, np.einsum("ki,ki->k", before, after)))


@dataclass(frozen=True, eq=False)
class Polyline:
    """Input of a curve fit: points (k, 2) or (k, 3), and the largest number of samples of the fit.

    smooth : the line is closed, and its curve has the same tangent at both ends.
    """

    points: Floats
    smooth: bool = False
    most: int = 50_000


def fitted(line: Floats, tolerance: float, smooth: bool = False) -> Curve | None:
    """Fit one curve to the polyline (k, 2) or (k, 3); None if that needs too many samples."""
    return all_fitted([Polyline(line, smooth)], tolerance)[0]


def all_fitted(lines: Sequence[Polyline], tolerance: float) -> list[Curve | None]:
    """Fit one curve to each polyline; None if that needs more samples than the line allows.

    One call with thousands of lines takes a sixth of the time of single calls.
    """
    found: list[Curve | None] = [None] * len(lines)
    open_runs = dict[int, SampledLine]()
    for k, line in enumerate(lines):
        run = SampledLine.of(line.points, line.smooth)
        if not run.total > 0:
            continue
        off = np.inf if line.smooth else run.bow
        if off <= tolerance:
            found[k] = Curve(np.array([0, 0, run.total, run.total]), line.points[[0, -1]], 1, off)
        elif run.count <= line.most:
            open_runs[k] = run
    while open_runs:
        made = refined(list(open_runs.values()), tolerance)
        missed = dict[int, SampledLine]()
        for (k, run), one in zip(open_runs.items(), made, strict=True):
            if one is not None:
                found[k] = Curve(*one)
            elif 4 * run.count <= lines[k].most:
                missed[k] = replace(run, count=4 * run.count)
        open_runs = missed
    return found


def halves(curve: Curve) -> list[Curve]:
    """Split a spline near the middle of its parameters into two curves with the same points."""
    return _cut(curve, float(np.round((curve.knots[0] + curve.knots[-1]) / 2, KNOT_DIGITS)))


def of_few_spans(curve: Curve) -> list[Curve]:
    """Split a curve at its knots into curves of at most `SPANS` spans with the same points."""
    breaks, found = np.unique(curve.knots), [curve]
    count = -(-(len(breaks) - 1) // SPANS)
    for at in np.round(np.arange(1, count) * (len(breaks) - 1) / count).astype(int):
        found += _cut(found.pop(), float(breaks[at]))
    return found


def _cut(curve: Curve, at: float) -> list[Curve]:
    from scipy.interpolate import BSpline

    spline = BSpline(curve.knots, curve.poles, curve.degree)
    for _ in range(curve.degree - int(np.count_nonzero(curve.knots == at))):
        spline = spline.insert_knot(at)
    first = int(np.searchsorted(spline.t, at))
    end = first + curve.degree
    before = np.concatenate([spline.t[:end], [at]])
    after = np.concatenate([[at], spline.t[first:]])
    poles = spline.c[: len(spline.t) - curve.degree - 1]
    return [
        Curve(before, poles[:first], curve.degree, curve.deviation),
        Curve(after, poles[first - 1 :], curve.degree, curve.deviation),
    ]


CLOSEST = 1e-3
"""Least tolerance of curves along exact lines (mm)."""

SAMPLES_PER_POINT, FEWEST_SAMPLES = 32, 400
"""A spline that would take more samples than this has more poles than the polyline has points, and takes long."""


REMEMBERED = 4096
"""Largest number of lines in the cache of curves: the next format of the same design needs the same curves."""


def within(part: Part) -> float:
    """Tolerance of the curves along a part's lines (mm)."""
    return max(part.details.tolerance, CLOSEST)


def chains(part: Part) -> list[list[Curve]]:
    """Return the curves along each line of a part."""
    return all_curves_along([line.points for line in part.details.lines], within(part))


def curves_along(points: Floats, tolerance: float) -> list[Curve]:
    """Fit curves to a polyline (k, 3) within `tolerance` (mm); they begin and end at its sharp turns.

    A closed line without corners becomes one smooth curve. The result has the polyline's own segments where no spline
    meets the tolerance.
    """
    return all_curves_along([points], tolerance)[0]


def all_curves_along(lines: Sequence[Floats], tolerance: float) -> list[list[Curve]]:
    """Apply `curves_along` to each polyline (k, 3); one fit covers all lines that the cache does not have."""
    lines = [np.ascontiguousarray(points, dtype=np.float64) for points in lines]
    keys = [(points.tobytes(), points.shape, tolerance) for points in lines]
    found = {key: _remembered[key] for key in keys if key in _remembered}
    new = {key: list(_runs(points)) for key, points in zip(keys, lines, strict=True) if key not in found}
    made = iter(all_fitted([run for runs in new.values() for run in runs], tolerance))
    for key, runs in new.items():
        chain = list[Curve]()
        for run in runs:
            curve = next(made)
            chain += [curve] if curve is not None else _segments(run.points)
        found[key] = tuple(chain)
    _remember(found)
    return [list(found[key]) for key in keys]


Key = tuple[bytes, tuple[int, ...], float]
_remembered = dict[Key, tuple[Curve, ...]]()
"""Curves by line and tolerance; the latest are at the end."""


def _remember(found: Mapping[Key, tuple[Curve, ...]]) -> None:
    for key in found:
        _remembered.pop(key, None)
    _remembered.update(found)
    for key in list(_remembered)[: max(len(_remembered) - REMEMBERED, 0)]:
        del _remembered[key]


def _runs(points: Floats) -> Iterator[Polyline]:
    closed = len(points) > 2 and bool((points[0] == points[-1]).all())
    at = np.flatnonzero(_sharp(points, closed))
    smooth = closed and not len(at)
    if closed and len(at):  # begin at a corner
        points = np.concatenate([points[at[0] : -1], points[: at[0] + 1]])
        at = (at - at[0])[1:]
    for a, b in pairwise([0, *at.tolist(), len(points) - 1]):
        yield Polyline(points[a : b + 1], smooth, max(SAMPLES_PER_POINT * (b + 1 - a), FEWEST_SAMPLES))


def _sharp(points: Floats, closed: bool) -> Bools:
    along = np.diff(points, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    before = along[-1:] if closed else along[:1]
    turn = np.zeros(len(points), dtype=bool)
    turn[:-1] = np.einsum("ki,ki->k", along, np.concatenate([before, along[:-1]])) < np.cos(SHARP)
    return turn


def _segments(points: Floats) -> list[Curve]:
    curves = (fitted(points[i : i + 2], np.inf) for i in range(len(points) - 1))
    return [curve for curve in curves if curve is not None]


def joined(chain: list[Curve]) -> list[Curve | Floats]:
    """Merge neighbouring straight curves of a chain into polylines (k, 3); splines stay as they are."""
    found = list[Curve | Floats]()
    for straight, group in groupby(chain, key=lambda curve: curve.straight):
        run = list(group)
        found += [np.concatenate([run[0].poles[:1], *(curve.poles[-1:] for curve in run)])] if straight else run
    return found


def sampled(knots: Floats, per_span: int = 16) -> Floats:
    """(k,) ascending parameters along a curve with knots (p,), `per_span` in each span.

    Lengths along 16 points are right to 1e-4 where a span turns by less than a radian.
    """
    breaks = np.unique(knots)
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(per_span) / per_span)
    return np.append(inner.ravel(), breaks[-1])


def check_curves(part: Part, found: Mapping[str, Sequence[Floats]]) -> ReadBack:
    """Check the curves that a reader found in a file against the lines of a part.

    found : by line id, points (k, 3) along each curve of the line (mm).
    The length of all curves must agree within the tolerance of bends, and each line must have its place.
    Raises ExportError for a difference.
    """
    lines = {line.id: line.points for line in part.details.lines}
    if found.keys() != lines.keys():
        raise differs(part, "lines", len(lines), len(found))
    off = check_length(part, sum(polyline_length(points) for curves in found.values() for points in curves))
    for name, points in lines.items():
        there, here = (np.array([x.min(axis=0), x.max(axis=0)]) for x in (np.concatenate(found[name]), points))
        if not (moved := float(np.abs(there - here).max())) <= 2 * within(part):
            raise ExportError(
                f"the line {name} of {part.name!r} reads back {moved:.3g} mm away from where it is; "
                "write another format"
            )
    return ReadBack(len(found), "lines", off, "length")


def check_length(part: Part, found: float) -> float:
    """Return the relative error of a length (mm); raises ExportError unless it is that of all lines."""
    expected = sum(polyline_length(line.points) for line in part.details.lines)
    if not abs(found - expected) <= 5 * READ_BACK * expected:
        raise ExportError(
            f"the lines of {part.name!r} read back {found:.6g} mm long instead of {expected:.6g} mm; "
            "write another format"
        )
    return found / expected - 1
