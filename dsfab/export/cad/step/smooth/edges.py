"""Edges of smooth solids as curves on both skins: walls of the pattern, and seams between charts."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.smooth.charts import SkinChart
from dsfab.export.cad.step.smooth.layout import OutlineRun, SheetOutline
from dsfab.export.splines import Fitted, Spline, splines_through, straight


@dataclass(eq=False)
class Nodes:
    """Positions of outline vertices in the planes of their charts, and of ends of runs on both skins.

    uv    : by chart, (n, 2), nan for vertices outside of it.
    steep : by chart, (n,) largest growth of lengths from the plane to the surface; 1 or more.
    around : by vertex, its charts.
    at    : by vertex, (2, 3): upper and lower point; gap : largest distance of its charts' skins from these. Both hold
            ends of runs, and vertices that `add` was called for.
    """

    charts: dict[int, SkinChart]
    uv: dict[int, Floats]
    steep: dict[int, Floats]
    around: list[Ints]
    at: dict[int, Floats]
    gap: dict[int, float]

    def add(self, vertices: Ints) -> None:
        """Add vertices (k,), each at the mean of the points on its charts."""
        new = [v for v in vertices.tolist() if v not in self.at]
        here, said = dict[int, list[int]](), dict[int, list[Floats]]({v: [] for v in new})
        for v in new:
            for k in self.around[v].tolist():
                here.setdefault(k, []).append(v)
        for k, some in here.items():
            for v, both in zip(some, self.charts[k].both(self.uv[k][some]), strict=True):
                said[v].append(both)
        for v, points in said.items():
            seen = np.array(points).reshape(-1, 2, 3)
            self.at[v] = seen.mean(axis=0)
            self.gap[v] = float(np.linalg.norm(seen - self.at[v], axis=2).max())


def nodes_of(sheet: SheetOutline, charts: dict[int, SkinChart]) -> Nodes:
    """Project outline vertices onto the middle surfaces of their charts, each to the nearest point."""
    uv, steep = {}, {}
    for k in {region.chart for region in sheet.regions}:
        runs = [run.vertices for region in sheet.regions if region.chart == k for loop in region.loops for run in loop]
        used = np.unique(np.concatenate(runs))
        flat, grows = np.full((len(sheet.V), 2), np.nan), np.ones(len(sheet.V))
        flat[used] = charts[k].middle.nearest(sheet.V[used], charts[k].over(sheet.V[used]))
        _, a, b = charts[k].middle.slopes(flat[used])
        grows[used] = np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1.0)
        uv[k], steep[k] = flat, grows
    start = np.searchsorted(sheet.charts[:, 0], np.arange(1, len(sheet.V)))
    nodes = Nodes(charts, uv, steep, np.split(sheet.charts[:, 1], start), {}, {})
    ends = [run.vertices[[0, -1]] for region in sheet.regions for loop in region.loops for run in loop]
    nodes.add(np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *ends])))
    return nodes


TIGHTER = (1.0, 0.2, 0.04)
"""Factors of the tolerance after each refusal of a run."""

FLAT = 0.55
"""Tolerance of outlines over the allowed distance."""

IN_SPACE = 1 / 50
"""Tolerance of curves on the skins over the thickness."""

FINER = (1, 4, 16)
"""Factors of the number of samples on the skins, in turn until the curve is close enough."""

OF_LOOP = 0.03
"""Largest tolerance of a loop over its width, because the sides of a slit must not cross."""


@dataclass(frozen=True, eq=False)
class Edge:
    """Run of an outline as curves.

    start, end   : vertices of the sheet.
    upper, lower : cubics with equal knots, or lines.
    flat         : by chart, the curve in its plane.
    gap          : largest distance between the curves in space and those on the skins, millimetres.
    wall         : True under a wall, False where two charts meet.
    """

    start: int
    end: int
    upper: Spline
    lower: Spline
    flat: dict[int, Spline]
    gap: float
    wall: bool

    @cached_property
    def spans(self) -> int:
        """Least power of two that makes all knots whole numbers, because those are short; knots are repeated halves of
        [0, 1]."""
        knots = np.concatenate([self.upper.knots, *(curve.knots for curve in self.flat.values())])
        return next(1 << k for k in range(30) if not np.any((1 << k) * knots % 1))


@dataclass(frozen=True)
class Allowed:
    """Limits in millimetres: thickness of the sheet, distance from the mesh, and the mesh's chord error."""

    thickness: float
    distance: float
    chord: float

    def outline(self, run: OutlineRun, steep: float, level: int) -> float:
        """Tolerance of the curve of a run in its plane."""
        of_chord = 0.5  # share of the mesh's own chord error that is added to the tolerance
        most = min(FLAT * self.distance + of_chord * self.chord, OF_LOOP * run.width)
        return TIGHTER[level] * most / steep

    def in_space(self, run: OutlineRun, level: int) -> float:
        """Tolerance of the curves of a run in space."""
        return TIGHTER[level] * min(IN_SPACE * self.thickness, OF_LOOP * run.width)


class Asked(NamedTuple):
    """A run in a chart, with the number of its refusals."""

    run: OutlineRun
    chart: int
    level: int


class _Part(NamedTuple):
    """Part of a run of walls, and its curve in the plane."""

    asked: Asked
    flat: Spline


def wall_edges(asked: list[Asked], nodes: Nodes, allowed: Allowed) -> list[list[Edge]]:
    """Fit the edges of all runs at once."""
    found = _parts(asked, nodes, allowed)
    parts = [part for some in found for part in some]
    nodes.add(np.unique([v for part in parts for v in part.asked.run.vertices[[0, -1]]]))
    fits = _on_skins(parts, nodes, [allowed.in_space(part.asked.run, part.asked.level) for part in parts])
    edges = iter(
        with_ends_on_nodes(part.asked.run, space, {part.asked.chart: part.flat}, off, nodes, wall=True)
        for part, (space, off) in zip(parts, fits, strict=True)
    )
    return [[next(edges) for _ in some] for some in found]


def _on_skins(parts: list[_Part], nodes: Nodes, wanted: list[float]) -> list[Fitted]:
    """Fit curves on both skins over curves in planes, within `tolerances` (mm); return each with its largest distance.

    A skin may wave along a simple plane curve; then more samples are taken.
    """
    found, todo = dict[int, Fitted](), list(range(len(parts)))
    for finer in FINER:
        x = [parameters(parts[i].flat, finer) for i in todo]
        flat = [parts[i].flat(at) for i, at in zip(todo, x, strict=True)]
        both = by_chart([parts[i].asked.chart for i in todo], flat, lambda k, uv: nodes.charts[k].both(uv))
        fits = splines_through(list(zip(x, both, strict=True)), [wanted[i] for i in todo], parts=2)
        found |= zip(todo, fits, strict=True)
        todo = [i for i in todo if found[i][1] > wanted[i]]
    return [found[i] for i in range(len(parts))]


def _parts(asked: list[Asked], nodes: Nodes, allowed: Allowed) -> list[list[_Part]]:
    lines = [nodes.uv[one.chart][one.run.vertices] for one in asked]
    found = {i: [_Part(asked[i], straight(*line))] for i, line in enumerate(lines) if len(line) == 2}
    some = [i for i in range(len(asked)) if i not in found]
    samples = [spread(lines[i]) for i in some]
    steep = [float(nodes.steep[asked[i].chart][asked[i].run.vertices].max()) for i in some]
    wanted = [allowed.outline(asked[i].run, s, asked[i].level) for i, s in zip(some, steep, strict=True)]
    halves = dict[int, list[Asked]]()
    fits = splines_through(samples, wanted)
    for i, (x, Q), tolerance, (flat, off) in zip(some, samples, wanted, fits, strict=True):
        if off <= tolerance:
            found[i] = [_Part(asked[i], flat)]
        else:
            halves[i] = _halves(asked[i], lines[i], float(x[np.linalg.norm(flat(x) - Q, axis=1).argmax()]))
    if halves:
        deeper = _parts([half for two in halves.values() for half in two], nodes, allowed)
        found |= {i: deeper[2 * j] + deeper[2 * j + 1] for j, i in enumerate(halves)}
    return [found[i] for i in range(len(asked))]


def _halves(asked: Asked, line: Floats, worst: float) -> list[Asked]:
    length = np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))
    at = 1 + int(np.abs(length[:-1] / length[-1] - worst).argmin())
    run = asked.run
    return [
        asked._replace(run=OutlineRun(v, run.beyond, run.width)) for v in (run.vertices[: at + 1], run.vertices[at:])
    ]


def by_chart(charts: list[int], rows: list[Floats], of: Callable[[int, Floats], Floats]) -> list[Floats]:
    """Apply a function of a chart and rows (k, d) to all rows, with one call for each chart."""
    found = dict[int, Floats]()
    for k in dict.fromkeys(charts):
        mine = [i for i, chart in enumerate(charts) if chart == k]
        said = of(k, np.concatenate([rows[i] for i in mine]))
        found |= zip(mine, np.split(said, np.cumsum([len(rows[i]) for i in mine])[:-1]), strict=True)
    return [found[i] for i in range(len(charts))]


def spread(line: Floats) -> tuple[Floats, Floats]:
    """Return parameters in [0, 1] and points evenly along a polyline (k, d), many more than it has vertices.

    The number of intervals is a power of two.
    """
    count = 1 << (min(max(16 * len(line), 64), 4096) - 1).bit_length()
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    x = np.arange(count + 1) / count
    return x, np.stack([np.interp(x * length[-1], length, column) for column in line.T], axis=1)


def parameters(curve: Spline, finer: int = 1) -> Floats:
    """(k,) many sample parameters in each span; finer : factor of their number."""
    return _parameters(curve.knots.tobytes(), finer)


@lru_cache(maxsize=1024)
def _parameters(knots: bytes, finer: int) -> Floats:
    """Memoised, because most curves share a few lists of knots."""
    breaks = np.unique(np.frombuffer(knots))
    each = finer * max(24, int(np.ceil(128 / (len(breaks) - 1))))
    steps = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(each) / each
    return np.concatenate([steps.ravel(), [1.0]])


def with_ends_on_nodes(
    run: OutlineRun, space: Spline, flat: dict[int, Spline], off: float, nodes: Nodes, wall: bool
) -> Edge:
    """Move the ends of curves onto their nodes."""
    start, end = int(run.vertices[0]), int(run.vertices[-1])
    both = space.poles.copy()
    wanted = np.concatenate([nodes.at[start].reshape(1, 6), nodes.at[end].reshape(1, 6)])
    moved = float(np.linalg.norm((wanted - both[[0, -1]]).reshape(2, 2, 3), axis=2).max())
    both[[0, -1]] = wanted
    upper, lower = (Spline(space.knots, both[:, i : i + 3], space.degree) for i in (0, 3))
    return Edge(start, end, upper, lower, flat, off + moved, wall)


ON_SEAM = 1 / 1000
"""Tolerance of a seam in each of its charts over the thickness. The remainder counts twice in the gap between them."""

T = TypeVar("T")

Key = tuple[int, int, int, int]
"""First two and last two vertices of a run."""


def seam_edges(asked: list[Asked], nodes: Nodes, sheet: SheetOutline, allowed: Allowed) -> list[Edge]:
    """Fit one curve for both charts of each seam, half way between their skins."""
    of_edge = 0.05  # tolerance in space as a share of the mesh's edges: the place of a seam does not matter
    runs, charts = [one.run for one in asked], [k for one in asked for k in (one.chart, one.run.beyond)]
    tight = [TIGHTER[one.level] * ON_SEAM * allowed.thickness for one in asked]
    middle = _in_space([sheet.V[run.vertices] for run in runs], [TIGHTER[one.level] * of_edge for one in asked])
    x = [parameters(curve) for curve in middle]
    points = _twice([curve(at) for curve, at in zip(middle, x, strict=True)])
    uv = by_chart(charts, points, lambda k, P: nodes.charts[k].middle.nearest(P, nodes.charts[k].over(P)))
    for at, k, run in zip(uv, charts, _twice(runs), strict=True):
        at[[0, -1]] = nodes.uv[k][run.vertices[[0, -1]]]
    fits = splines_through(list(zip(_twice(x), uv, strict=True)), _twice(tight))
    flat = _pairs([curve for curve, _ in fits])
    x = [np.unique(np.concatenate([parameters(curve) for curve in pair])) for pair in flat]
    on = [curve(at) for pair, at in zip(flat, x, strict=True) for curve in pair]
    sides = _pairs(by_chart(charts, on, lambda k, uv: nodes.charts[k].both(uv)))
    fits = splines_through([(at, (one + two) / 2) for at, (one, two) in zip(x, sides, strict=True)], tight, parts=2)
    gaps = [off + _apart(one, two) for (_, off), (one, two) in zip(fits, sides, strict=True)]
    ways = [dict(zip(both, pair, strict=True)) for both, pair in zip(_pairs(charts), flat, strict=True)]
    return [
        with_ends_on_nodes(run, space, way, gap, nodes, wall=False)
        for run, (space, _), way, gap in zip(runs, fits, ways, gaps, strict=True)
    ]


def _twice(values: list[T]) -> list[T]:
    return [value for value in values for _ in range(2)]


def _pairs(values: list[T]) -> list[tuple[T, T]]:
    return list(zip(values[::2], values[1::2], strict=True))


def _apart(one: Floats, two: Floats) -> float:
    return float(np.linalg.norm((one - two).reshape(-1, 2, 3), axis=2).max())


def _in_space(lines: list[Floats], shares: list[float]) -> list[Spline]:
    longest = [float(np.linalg.norm(np.diff(line, axis=0), axis=1).max()) for line in lines]
    bent = [i for i, line in enumerate(lines) if len(line) > 2]
    fits = splines_through([spread(lines[i]) for i in bent], [shares[i] * longest[i] for i in bent])
    curved = {i: curve for i, (curve, _) in zip(bent, fits, strict=True)}
    return [curved[i] if i in curved else straight(*line) for i, line in enumerate(lines)]


def run_key(run: OutlineRun) -> tuple[Key, bool]:
    """Return the key that both charts of a seam share, and True if this run has its direction."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back
