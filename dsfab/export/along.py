"""Lines as smooth curves: what DXF, 3DM and STEP hold in place of the polylines that a mesh gives.

o---o--o            a line of the mesh turns a little on every edge that it crosses: it becomes one spline
        \\          within a stated tolerance; where it turns by more than SHARP, a curve ends and another begins
         o---o---o
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, pairwise

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.errors import ExportError
from dsfab.export.curves import SHARP, Curve, Polyline, all_fitted, fitted
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.limits import READ_BACK
from dsfab.surface import polyline_length

CLOSEST = 1e-3
"""Millimetres: curves are not asked to be nearer than this when the lines are exact."""

SAMPLES_PER_POINT, FEWEST_SAMPLES = 32, 400
"""A spline that would take more samples than this has more poles than the polyline has points, and takes long."""

PER_SPAN = 16
"""Points of a span when a curve is measured: its length is then right to 1e-4 where it turns by less than a radian."""


REMEMBERED = 4096
"""Lines whose curves are remembered: the next format of the same design holds the same ones."""


def within(part: Part) -> float:
    """Millimetres that the curves of a part may be off its lines."""
    return max(part.details.tolerance, CLOSEST)


def chains(part: Part) -> list[list[Curve]]:
    """The curves along each line of a part."""
    return all_curves_along([line.points for line in part.details.lines], within(part))


def curves_along(points: Floats, tolerance: float) -> list[Curve]:
    """A polyline (k, 3) as curves within `tolerance`, millimetres, that begin and end at its sharp turns.

    A closed line without corners is one curve, which leaves as it arrives. Where no spline follows so closely, the
    polyline's own segments.
    """
    return all_curves_along([points], tolerance)[0]


def all_curves_along(lines: Sequence[Floats], tolerance: float) -> list[list[Curve]]:
    """`curves_along` for each polyline; those that are not remembered are made together."""
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
"""The curves of a line within a tolerance, those asked for last at its end."""


def _remember(found: Mapping[Key, tuple[Curve, ...]]) -> None:
    for key in found:
        _remembered.pop(key, None)
    _remembered.update(found)
    for key in list(_remembered)[: max(len(_remembered) - REMEMBERED, 0)]:
        del _remembered[key]


def _runs(points: Floats) -> Iterator[Polyline]:
    """The parts of a polyline between its sharp turns."""
    closed = len(points) > 2 and bool((points[0] == points[-1]).all())
    at = np.flatnonzero(_sharp(points, closed))
    smooth = closed and not len(at)
    if closed and len(at):  # begin at a corner
        points = np.concatenate([points[at[0] : -1], points[: at[0] + 1]])
        at = (at - at[0])[1:]
    for a, b in pairwise([0, *at.tolist(), len(points) - 1]):
        yield Polyline(points[a : b + 1], smooth, max(SAMPLES_PER_POINT * (b + 1 - a), FEWEST_SAMPLES))


def _sharp(points: Floats, closed: bool) -> Bools:
    """(k,) vertices of a polyline in space where it turns by more than SHARP; of a closed one perhaps the first too."""
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
    """Curves in their order: splines as they are, and neighbouring straight ones as the points (k, 3) of a polyline."""
    found = list[Curve | Floats]()
    for straight, group in groupby(chain, key=lambda curve: curve.straight):
        run = list(group)
        found += [np.concatenate([run[0].poles[:1], *(curve.poles[-1:] for curve in run)])] if straight else run
    return found


def sampled(knots: Floats) -> Floats:
    """(k,) ascending parameters from end to end of a curve, PER_SPAN to a span between its knots (p,)."""
    breaks = np.unique(knots)
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(PER_SPAN) / PER_SPAN)
    return np.append(inner.ravel(), breaks[-1])


def check_curves(part: Part, found: Mapping[str, Sequence[Floats]]) -> ReadBack:
    """What was found; raises ExportError unless the lines of a part, and no other, were found as curves.

    found : for each id, the curves that make up the line, as points (k, 3) along them, millimetres. Together they must
            be as long as the lines, to the tolerance at their bends, and each line must lie where it belongs.
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
    """The share that `found` is off; raises ExportError unless it is the length of all lines, mm, to the tolerance at
    their bends."""
    expected = sum(polyline_length(line.points) for line in part.details.lines)
    if not abs(found - expected) <= 5 * READ_BACK * expected:
        raise ExportError(
            f"the lines of {part.name!r} read back {found:.6g} mm long instead of {expected:.6g} mm; "
            "write another format"
        )
    return found / expected - 1
