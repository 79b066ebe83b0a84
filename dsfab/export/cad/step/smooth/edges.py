"""Edges of smooth solids, as curves on the upper and lower skins."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.shared.sheet_outline import OutlineRun, SheetOutline
from dsfab.export.cad.step.shared.skins import LOOP_SHARE, OUTLINE_SHARE
from dsfab.export.cad.step.smooth.charts import SkinChart
from dsfab.export.splines import Fitted, Spline, even_samples, segment_spline, splines_through


@dataclass(eq=False)
class OutlineNodes:
    """Outline vertices in the planes of their charts.
    uv     : by chart, positions (n, 2) in its plane, mm; nan for vertices outside of the chart.
    steep  : by chart, largest ratio (n,) of a length on the surface to its length in the plane.
    around : by vertex, numbers of the charts at the vertex.    at : by vertex, points (2, 3) on both skins, mm.
    gap    : by vertex, largest distance of the points `at` from the skins, mm."""

    charts: dict[int, SkinChart]
    uv: dict[int, Floats]
    steep: dict[int, Floats]
    around: list[Ints]
    at: dict[int, Floats]
    gap: dict[int, float]

    def add(self, vertices: Ints) -> None:
        """Compute the points on both skins at the vertices (k,), and add them to `at`."""
        missing = [v for v in vertices.tolist() if v not in self.at]
        by_chart_number, positions = dict[int, list[int]](), dict[int, list[Floats]]({v: [] for v in missing})
        for v in missing:
            for k in self.around[v].tolist():
                by_chart_number.setdefault(k, []).append(v)
        for k, chart_vertices in by_chart_number.items():
            for v, pair in zip(chart_vertices, self.charts[k].skins(self.uv[k][chart_vertices]), strict=True):
                positions[v].append(pair)
        for v, points in positions.items():
            seen = np.array(points).reshape(-1, 2, 3)
            self.at[v] = seen.mean(axis=0)
            self.gap[v] = float(np.linalg.norm(seen - self.at[v], axis=2).max())


def nodes_of(sheet: SheetOutline, charts: dict[int, SkinChart]) -> OutlineNodes:
    """Return the outline vertices of a sheet, with their positions in the planes of the charts."""
    uv, steep = {}, {}
    for k in {region.chart for region in sheet.regions}:
        runs = [run.vertices for region in sheet.regions if region.chart == k for loop in region.loops for run in loop]
        used = np.unique(np.concatenate(runs))
        flat, grows = np.full((len(sheet.V), 2), np.nan), np.ones(len(sheet.V))
        flat[used] = charts[k].middle.nearest(sheet.V[used], charts[k].projected(sheet.V[used]))
        _, a, b = charts[k].middle.slopes(flat[used])
        grows[used] = np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1.0)
        uv[k], steep[k] = flat, grows
    start = np.searchsorted(sheet.charts[:, 0], np.arange(1, len(sheet.V)))
    nodes = OutlineNodes(charts, uv, steep, np.split(sheet.charts[:, 1], start), {}, {})
    ends = [run.vertices[[0, -1]] for region in sheet.regions for loop in region.loops for run in loop]
    nodes.add(np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *ends])))
    return nodes


LEVEL_FACTORS = (1.0, 0.2, 0.04)  # factors of a curve's tolerance after 0, 1 and 2 failed checks of the curve


@dataclass(frozen=True, eq=False)
class SmoothEdge:
    """Curves along a part of an outline. start, end : vertices.    wall : True at a wall; False where two charts meet.
    upper, lower : cubic splines with equal knots, or lines.    flat : by chart, the curve in its plane.
    gap          : largest distance of `upper` and `lower` from the curves `flat`, mm."""

    start: int
    end: int
    upper: Spline
    lower: Spline
    flat: dict[int, Spline]
    gap: float
    wall: bool

    @cached_property
    def spans(self) -> int:
        """Smallest factor 2^k by which all knots become whole numbers."""
        knots = np.concatenate([self.upper.knots, *(curve.knots for curve in self.flat.values())])
        return next(1 << k for k in range(30) if not np.any((1 << k) * knots % 1))


@dataclass(frozen=True)
class EdgeTolerances:
    """Tolerances of edge curves, mm. distance : allowed distance from the mesh.    chord : chord error of the mesh."""

    thickness: float
    distance: float
    chord: float

    def outline(self, run: OutlineRun, steep: float, level: int) -> float:
        """Return the tolerance (mm) of a curve in the chart's plane. level : number of failed checks.
        steep : ratio of a length on the surface to its length in the plane."""
        of_chord = 0.5  # fraction of the mesh's chord error that is added to the tolerance of an outline
        limit = min(OUTLINE_SHARE * self.distance + of_chord * self.chord, LOOP_SHARE * run.width)
        return LEVEL_FACTORS[level] * limit / steep

    def in_space(self, run: OutlineRun, level: int) -> float:
        """Return the tolerance (mm) of curves on the two skins. level : number of failed checks."""
        share = 1 / 50  # largest tolerance / thickness
        return LEVEL_FACTORS[level] * min(share * self.thickness, LOOP_SHARE * run.width)


class RunRequest(NamedTuple):
    """Request for curves along a part of a chart's outline. level : number of failed checks of the part."""

    run: OutlineRun
    chart: int
    level: int


class RunPart(NamedTuple):
    """Part of a chart's outline, and the fitted curve `flat` in the plane of the chart."""

    asked: RunRequest
    flat: Spline


def wall_edges(requests: list[RunRequest], nodes: OutlineNodes, allowed: EdgeTolerances) -> list[list[SmoothEdge]]:
    """Fit curves along walls of the sheet, and return the edges of each request."""
    run_parts = flat_parts(requests, nodes, allowed)
    parts = [part for group in run_parts for part in group]
    nodes.add(np.unique([v for part in parts for v in part.asked.run.vertices[[0, -1]]]))
    fits = skin_curves(parts, nodes, [allowed.in_space(part.asked.run, part.asked.level) for part in parts])
    edges = iter(
        edge_on_nodes(part.asked.run, space, {part.asked.chart: part.flat}, distance, nodes, wall=True)
        for part, (space, distance) in zip(parts, fits, strict=True)
    )
    return [[next(edges) for _ in group] for group in run_parts]


def skin_curves(parts: list[RunPart], nodes: OutlineNodes, tolerances: list[float]) -> list[Fitted]:
    """Fit curves on both skins above the plane curves of `parts`; return each curve with its largest error, mm."""
    results, todo = dict[int, Fitted](), list(range(len(parts)))
    for finer in (1, 4, 16):  # each round takes more samples, until the curve is close enough
        x = [parameters(parts[i].flat, finer) for i in todo]
        flat = [parts[i].flat(places) for i, places in zip(todo, x, strict=True)]
        skin_points = by_chart([parts[i].asked.chart for i in todo], flat, lambda k, uv: nodes.charts[k].skins(uv))
        fits = splines_through(list(zip(x, skin_points, strict=True)), [tolerances[i] for i in todo], parts=2)
        results |= zip(todo, fits, strict=True)
        todo = [i for i in todo if results[i][1] > tolerances[i]]
    return [results[i] for i in range(len(parts))]


def flat_parts(requests: list[RunRequest], nodes: OutlineNodes, allowed: EdgeTolerances) -> list[list[RunPart]]:
    """Return, for each request, fitted curves in the chart's plane along parts of the outline."""
    lines = [nodes.uv[request.chart][request.run.vertices] for request in requests]
    results = {i: [RunPart(requests[i], segment_spline(*line))] for i, line in enumerate(lines) if len(line) == 2}
    curved_numbers = [i for i in range(len(requests)) if i not in results]
    samples = [even_samples(lines[i]) for i in curved_numbers]
    steep = [float(nodes.steep[requests[i].chart][requests[i].run.vertices].max()) for i in curved_numbers]
    curved = [requests[i] for i in curved_numbers]
    tolerances = [allowed.outline(request.run, s, request.level) for request, s in zip(curved, steep, strict=True)]
    halves = dict[int, list[RunRequest]]()
    fits = splines_through(samples, tolerances)
    for i, (x, Q), tolerance, (flat, distance) in zip(curved_numbers, samples, tolerances, fits, strict=True):
        if distance <= tolerance:
            results[i] = [RunPart(requests[i], flat)]
        else:
            halves[i] = _halves(requests[i], lines[i], float(x[np.linalg.norm(flat(x) - Q, axis=1).argmax()]))
    if halves:
        deeper = flat_parts([half for two in halves.values() for half in two], nodes, allowed)
        results |= {i: deeper[2 * j] + deeper[2 * j + 1] for j, i in enumerate(halves)}
    return [results[i] for i in range(len(requests))]


def _halves(request: RunRequest, line: Floats, worst: float) -> list[RunRequest]:
    length = np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))
    position = 1 + int(np.abs(length[:-1] / length[-1] - worst).argmin())
    halves = request.run.vertices[: position + 1], request.run.vertices[position:]
    return [request._replace(run=replace(request.run, vertices=vertices)) for vertices in halves]


def by_chart(charts: list[int], rows: list[Floats], function: Callable[[int, Floats], Floats]) -> list[Floats]:
    """Return `function(chart, array)` for each array (k, d) in `rows` and its chart, with a single call per chart."""
    results = dict[int, Floats]()
    for k in dict.fromkeys(charts):
        members = [i for i, chart in enumerate(charts) if chart == k]
        values = function(k, np.concatenate([rows[i] for i in members]))
        results |= zip(members, np.split(values, np.cumsum([len(rows[i]) for i in members])[:-1]), strict=True)
    return [results[i] for i in range(len(charts))]


def parameters(curve: Spline, finer: int = 1) -> Floats:
    """Return the parameters (k,) of samples along a curve. finer : factor on the number of samples."""
    return _parameters(curve.knots.tobytes(), finer)


@lru_cache(maxsize=1024)
def _parameters(knots: bytes, finer: int) -> Floats:
    breaks = np.unique(np.frombuffer(knots))
    count = finer * max(24, int(np.ceil(128 / (len(breaks) - 1))))
    steps = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(count) / count
    return np.concatenate([steps.ravel(), [1.0]])


def edge_on_nodes(
    run: OutlineRun, space: Spline, flat: dict[int, Spline], distance: float, nodes: OutlineNodes, wall: bool
) -> SmoothEdge:
    """Return the edge along a part of an outline, with its ends moved to the points in `nodes`.
    space : curve on both skins.    flat : by chart, the curve in its plane.    distance : error of `space`, mm."""
    start, end = int(run.vertices[0]), int(run.vertices[-1])
    poles = space.poles.copy()
    node_points = np.concatenate([nodes.at[start].reshape(1, 6), nodes.at[end].reshape(1, 6)])
    moved = float(np.linalg.norm((node_points - poles[[0, -1]]).reshape(2, 2, 3), axis=2).max())
    poles[[0, -1]] = node_points
    upper, lower = (Spline(space.knots, poles[:, i : i + 3], space.degree) for i in (0, 3))
    return SmoothEdge(start, end, upper, lower, flat, distance + moved, wall)


T = TypeVar("T")

RunKey = tuple[int, int, int, int]  # first two and last two vertices of a part of an outline


def seam_edges(
    requests: list[RunRequest], nodes: OutlineNodes, sheet: SheetOutline, allowed: EdgeTolerances
) -> list[SmoothEdge]:
    """Fit curves on both skins along seams (borders of two charts)."""
    of_edge = 0.05  # tolerance of the first curve along a seam, as a fraction of the longest mesh edge along it
    of_thickness = 1 / 1000  # tolerance of curves in charts and on skins, divided by the sheet's thickness
    runs, factors = [request.run for request in requests], [LEVEL_FACTORS[request.level] for request in requests]
    charts = [k for request in requests for k in (request.chart, request.run.beyond)]
    tight = [factor * of_thickness * allowed.thickness for factor in factors]
    middle = _in_space([sheet.V[run.vertices] for run in runs], [factor * of_edge for factor in factors])
    x = [parameters(curve) for curve in middle]
    points = _for_both_charts([curve(places) for curve, places in zip(middle, x, strict=True)])
    uv = by_chart(charts, points, lambda k, P: nodes.charts[k].middle.nearest(P, nodes.charts[k].projected(P)))
    for places, k, run in zip(uv, charts, _for_both_charts(runs), strict=True):
        places[[0, -1]] = nodes.uv[k][run.vertices[[0, -1]]]
    fits = splines_through(list(zip(_for_both_charts(x), uv, strict=True)), _for_both_charts(tight))
    flat = _pairs([curve for curve, _ in fits])
    x = [np.unique(np.concatenate([parameters(curve) for curve in pair])) for pair in flat]
    chart_points = [curve(places) for pair, places in zip(flat, x, strict=True) for curve in pair]
    sides = _pairs(by_chart(charts, chart_points, lambda k, uv: nodes.charts[k].skins(uv)))
    fits = splines_through(list(zip(x, [(a + b) / 2 for a, b in sides], strict=True)), tight, parts=2)
    gaps = [float(np.linalg.norm((a - b).reshape(-1, 2, 3), axis=2).max()) for a, b in sides]
    ways = [dict(zip(chart_pair, pair, strict=True)) for chart_pair, pair in zip(_pairs(charts), flat, strict=True)]
    return [
        edge_on_nodes(run, space, curves, distance + gap, nodes, wall=False)
        for run, (space, distance), curves, gap in zip(runs, fits, ways, gaps, strict=True)
    ]


def _for_both_charts(values: list[T]) -> list[T]:
    return [value for value in values for _ in range(2)]


def _pairs(values: list[T]) -> list[tuple[T, T]]:
    return list(zip(values[::2], values[1::2], strict=True))


def _in_space(lines: list[Floats], shares: list[float]) -> list[Spline]:
    longest = [float(np.linalg.norm(np.diff(line, axis=0), axis=1).max()) for line in lines]
    bent = [i for i, line in enumerate(lines) if len(line) > 2]
    fits = splines_through([even_samples(lines[i]) for i in bent], [shares[i] * longest[i] for i in bent])
    curved = {i: curve for i, (curve, _) in zip(bent, fits, strict=True)}
    return [curved[i] if i in curved else segment_spline(*line) for i, line in enumerate(lines)]


def run_key(run: OutlineRun) -> tuple[RunKey, bool]:
    """Return a key for a part of an outline, equal in both directions, and True if `run` has the key's direction."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back
