"""Runs as curves: over the plane of each chart, and in space on both skins, with the same parameter everywhere."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.charts import Chart
from dsfab.export.smooth.outline import WALL, Run, Sheet
from dsfab.export.smooth.splines import Spline, evenly, spline_through, straight

TIGHTER = (1.0, 0.2, 0.04)
"""Tolerances of a run that was refused so often."""

FLAT = 1 / 40
"""Tolerance of outlines over their polylines, as a share of the thickness; the mesh's chord error comes on top."""

IN_SPACE = 1 / 100
"""Tolerance of the curves on the skins, as a share of the thickness."""

ON_SEAM = 1 / 1000
"""Tolerance of a seam over each of its charts: what is left counts twice in the gap between them."""

OF_LOOP = 0.005
"""A loop is followed at least as closely as this share of its length."""

STEEP = 16
"""Places of an outline where the slope of the skin is asked for."""

OF_EDGE = 0.05
"""And as this share of the mesh's edges."""


@dataclass(frozen=True, eq=False)
class Edge:
    """A run as curves.

    start, end   : vertices of the sheet, its nodes.
    upper, lower : cubics of the same knots, or lines.
    flat         : by chart, the curve over its plane.
    gap          : largest distance between the curves in space and those on the skins, millimetres.
    wall         : whether a wall stands on it; otherwise two charts meet there.
    """

    start: int
    end: int
    upper: Spline
    lower: Spline
    flat: dict[int, Spline]
    gap: float
    wall: bool

    @property
    def spans(self) -> int:
        """The power of two that makes all knots whole numbers, short to write: they are halves of halves of [0, 1]."""
        knots = np.concatenate([self.upper.knots, *(curve.knots for curve in self.flat.values())])
        return next(1 << k for k in range(30) if not np.any((1 << k) * knots % 1))


@dataclass(frozen=True, eq=False)
class Nodes:
    """Ends of runs: where each vertex lies over the charts around it, and on both skins.

    uv : by chart, (n, 2), nan where a vertex is not in it.    at : by vertex, (2, 3): upper and lower point.
    gap : by vertex, largest distance of the skins of its charts from these.
    """

    uv: dict[int, Floats]
    at: dict[int, Floats]
    gap: dict[int, float]


def nodes_of(sheet: Sheet, charts: list[Chart]) -> Nodes:
    """Outline vertices on the middle surfaces of their charts, each at the nearest point."""
    uv = {}
    for k in {region.chart for region in sheet.regions}:
        runs = [run.vertices for region in sheet.regions if region.chart == k for loop in region.loops for run in loop]
        used = np.unique(np.concatenate(runs))
        flat = np.full((len(sheet.V), 2), np.nan)
        flat[used] = charts[k].middle.nearest(sheet.V[used], charts[k].over(sheet.V[used]))
        uv[k] = flat
    ends = {int(v) for region in sheet.regions for loop in region.loops for run in loop for v in run.vertices[[0, -1]]}
    at, gap = {}, {}
    start = np.searchsorted(sheet.charts[:, 0], np.arange(len(sheet.V) + 1))
    for v in sorted(ends):
        around = sheet.charts[start[v] : start[v + 1], 1].tolist()
        points = np.array([[skin(uv[k][[v]])[0] for skin in (charts[k].upper, charts[k].lower)] for k in around])
        at[v] = points.mean(axis=0)
        gap[v] = float(np.linalg.norm(points - at[v], axis=2).max())
    return Nodes(uv, at, gap)


def wall_edge(run: Run, k: int, chart: Chart, nodes: Nodes, sheet: Sheet, level: int, t: float) -> Edge:
    """The curves of a wall in chart k. t : thickness, millimetres."""
    line = nodes.uv[k][run.vertices]
    tolerance = TIGHTER[level] * _tolerance(run, line, chart, sheet, t)
    if len(line) > 2:
        x, Q = _spread(line)
        flat, _ = spline_through(x, Q, tolerance)
    else:
        flat = straight(line[0], line[1])
    x = _parameters(flat)
    on = flat(x)
    both = np.concatenate([chart.upper(on), chart.lower(on)], axis=1)
    space, off = spline_through(x, both, TIGHTER[level] * IN_SPACE * t, parts=2)
    return _ended(run, space, {k: flat}, off, nodes, wall=True)


def _spread(line: Floats) -> tuple[Floats, Floats]:
    """Even samples of a polyline, more than it has vertices."""
    count = int(np.clip(8 * len(line), 48, 1500))
    total = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    return evenly(line, total / count, fewest=count, most=count)


def _tolerance(run: Run, line: Floats, chart: Chart, sheet: Sheet, t: float) -> float:
    """Millimetres over the plane: a share of the thickness on the skin, and what the polyline itself is off a curve."""
    _, a, b = chart.middle.slopes(line[:: len(line) // STEEP + 1])
    steep = float(np.linalg.norm(np.cross(a, b), axis=1).max())
    points = sheet.V[run.vertices]
    along = np.diff(points, axis=0)
    length = np.linalg.norm(along, axis=1)
    chord = 0.0
    if len(length) > 2:
        unit = along / np.maximum(length, 1e-300)[:, None]
        turn = np.linalg.norm(np.diff(unit, axis=0), axis=1)
        sag = (length[1:] + length[:-1]) / 2 * turn / 8
        chord = min(float(np.percentile(sag, 75)), OF_EDGE * float(length.max()))
    return min(FLAT * t + chord, OF_LOOP * run.around) / max(steep, 1.0)


def _parameters(curve: Spline) -> Floats:
    """Parameters to measure at: many in each span."""
    breaks = np.unique(curve.knots)
    each = max(24, int(np.ceil(128 / (len(breaks) - 1))))
    steps = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(each) / each
    return np.concatenate([steps.ravel(), [1.0]])


def seam_edge(run: Run, k: int, charts: list[Chart], nodes: Nodes, sheet: Sheet, level: int, t: float) -> Edge:
    """The curves between chart k and the chart beyond: one for both, half way between what the two say."""
    pair, tight = (k, run.beyond), TIGHTER[level]
    points = sheet.V[run.vertices]
    if len(points) > 2:
        x, Q = _spread(points)
        length = np.linalg.norm(np.diff(points, axis=0), axis=1)
        middle, _ = spline_through(x, Q, tight * OF_EDGE * float(length.max()))
    else:
        middle = straight(points[0], points[1])
    x = _parameters(middle)
    flat: dict[int, Spline] = {}
    for c in pair:
        ends = nodes.uv[c][run.vertices[[0, -1]]]
        uv = charts[c].middle.nearest(middle(x), charts[c].over(middle(x)))
        uv[0], uv[-1] = ends
        flat[c], _ = spline_through(x, uv, tight * ON_SEAM * t)
    x = np.unique(np.concatenate([_parameters(flat[c]) for c in pair]))
    sides = [np.concatenate([charts[c].upper(flat[c](x)), charts[c].lower(flat[c](x))], axis=1) for c in pair]
    space, off = spline_through(x, (sides[0] + sides[1]) / 2, tight * ON_SEAM * t, parts=2)
    apart = (sides[0] - sides[1]).reshape(len(x), 2, 3)
    return _ended(run, space, flat, off + float(np.linalg.norm(apart, axis=2).max()), nodes, wall=False)


def _ended(run: Run, space: Spline, flat: dict[int, Spline], off: float, nodes: Nodes, wall: bool) -> Edge:
    """The curves with their ends pulled onto the nodes."""
    start, end = int(run.vertices[0]), int(run.vertices[-1])
    both = space.poles.copy()
    wanted = np.concatenate([nodes.at[start].reshape(1, 6), nodes.at[end].reshape(1, 6)])
    moved = float(np.linalg.norm((wanted - both[[0, -1]]).reshape(2, 2, 3), axis=2).max())
    both[[0, -1]] = wanted
    upper, lower = (Spline(space.knots, both[:, i : i + 3], space.degree) for i in (0, 3))
    return Edge(start, end, upper, lower, flat, off + moved, wall)


def seam_key(run: Run) -> tuple[tuple[int, int, int, int], bool]:
    """What both charts call a seam's run, and whether this one runs the way the key does."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back


def is_wall(run: Run) -> bool:
    """Whether a wall stands on the run."""
    return run.beyond == WALL
