"""Boundary model of a solid with step = 'members': vertices, edges, walls and faces."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.by_members.curves import SampledChain
from dsfab.export.cad.step.by_members.lines import LinePart, NetLines
from dsfab.export.cad.step.by_members.patch_sides import Quad, SideGrid, SideStations
from dsfab.export.cad.step.by_members.patches import PatchBuilder
from dsfab.export.cad.step.by_members.regions import ChainLoop, mean_width

MOST_CELLS = 2  # a four-sided region that needs more than 2 patches becomes a trimmed face, unless the region is long


@dataclass(frozen=True, eq=False)
class NetEdge:
    """Cubic curve on the outer skin, and the opposite curve on the inner skin.
    start, end : vertex numbers.    poles : (4, 6) control points: three columns for each skin, outer first, mm."""

    start: int
    end: int
    poles: Floats


@dataclass(frozen=True, eq=False)
class NetWall:
    """Face through the thickness, from the outer to the inner skin. poles : (4, 6) control points as in `NetEdge`, mm.
    steps : edges along the wall, each with its direction. The material is on the left of these edges."""

    steps: ChainLoop
    poles: Floats


@dataclass(frozen=True, eq=False)
class NetPatch:
    """Four-sided face on the outer skin, and the opposite face on the inner skin.
    loop  : edges around the face, counter-clockwise seen from outside. A side has one or several edges.
    poles : (4, 4, 6) control points, mm.    within : True if the surfaces extend beyond the face."""

    loop: ChainLoop
    poles: Floats
    within: bool = False


@dataclass(eq=False)
class NetModel:
    """Boundary model of a solid with step = 'members'. vertices : points (6,) on the outer and inner skin, mm.
    trimmed : by number of a region without patches, the loops of edges around the region.
    seam    : True for a one-sided surface that was cut open."""

    vertices: list[Floats] = field(default_factory=list)
    edges: list[NetEdge] = field(default_factory=list)
    walls: list[NetWall] = field(default_factory=list)
    patches: list[NetPatch] = field(default_factory=list)
    trimmed: dict[int, list[ChainLoop]] = field(default_factory=dict)
    compact: frozenset[int] = frozenset()
    seam: bool = False

    @property
    def faces(self) -> int:
        """Number of faces of the solid."""
        return 2 * (len(self.patches) + len(self.trimmed)) + len(self.walls)

    def outline(self, loops: Iterable[ChainLoop]) -> bytes:
        """Return the control points of all edges in the loops as bytes."""
        return b"".join(self.poles(step).tobytes() for loop in loops for step in loop)

    def poles(self, step: tuple[int, bool]) -> Floats:
        """Return poles (4, 6) of an edge in a loop. step : edge number, True if the loop runs from `start` to `end`."""
        e, ahead = step
        return self.edges[e].poles[:: 1 if ahead else -1]

    def vertex(self, step: tuple[int, bool], at_start: bool) -> int:
        """Return the number of the vertex where an edge of a loop begins (`at_start`) or ends."""
        edge = self.edges[step[0]]
        return edge.start if step[1] == at_start else edge.end

    def with_loops(self, loop: Callable[[ChainLoop], ChainLoop]) -> "NetModel":
        """Return a model in which the result of the function `loop` replaces each loop of edges."""
        return replace(
            self,
            walls=[replace(wall, steps=loop(wall.steps)) for wall in self.walls],
            patches=[replace(patch, loop=loop(patch.loop)) for patch in self.patches],
            trimmed={region: [loop(region_loop) for region_loop in loops] for region, loops in self.trimmed.items()},
        )


def net_model(
    lines: NetLines,
    chains: Mapping[int, SampledChain],
    quads: Iterable[Quad],
    other_regions: Iterable[int],
    covering: PatchBuilder,
    patched: Collection[int] = (),
) -> NetModel:
    """Build the boundary model of a solid.
    lines    : curves along the borders of regions.    chains : samples of the borders, by number.
    quads    : four-sided regions.    other_regions : numbers of regions for trimmed faces.    covering : patch builder.
    patched  : four-sided regions that may have more than `MOST_CELLS` patches."""
    stations, quad_list = SideStations(lines, chains), list(quads)
    whole_quads = [quad for quad in quad_list if quad.region not in patched and stations.cells(quad) > MOST_CELLS]
    compact = frozenset(quad.region for quad in whole_quads if _compact(quad, chains))
    rest = [quad for quad in quad_list if quad.region not in compact]
    model = NetModel(compact=compact, seam=len(lines.twins) > 0)
    return _ModelAssembly(stations, rest, [*other_regions, *sorted(compact)], covering, model).model


class _ModelAssembly:
    def __init__(
        self, stations: SideStations, quads: list[Quad], rest: list[int], covering: PatchBuilder, model: NetModel
    ) -> None:
        self.lines = lines = stations.lines
        self.model = model
        grids = [stations.grid(quad) for quad in quads]
        self.node = dict[int, int]()
        self.place = list[dict[float, int]]()
        self.edges = list[list[int]]()
        stops = [sorted(x | stations.stops[lines.twins.get(i, i)]) for i, x in enumerate(stations.stops)]
        poles = lines.parts([(i, a, b) for i, line_stops in enumerate(stops) for a, b in pairwise(line_stops)])
        line_poles = np.split(poles, np.cumsum([len(line_stops) - 1 for line_stops in stops])[:-1])
        for i, (line_stops, P) in enumerate(zip(stops, line_poles, strict=True)):
            self._line(i, line_stops, P)
        self._walls()
        patches = covering([quad.region for quad in quads], self._sides(grids))
        for quad, grid, patch_poles in zip(quads, grids, patches, strict=True):
            if patch_poles is None:
                rest.append(quad.region)
            else:
                self._add(patch_poles, grid)
        for region in rest:
            loops = lines.net.loops[region]
            self.model.trimmed[region] = [[e for x in loop for e in self._steps(lines.line_part(x))] for loop in loops]

    def _vertex(self, point: Floats) -> int:
        self.model.vertices.append(point)
        return len(self.model.vertices) - 1

    def _edge(self, start: int, end: int, poles: Floats) -> int:
        self.model.edges.append(NetEdge(start, end, poles))
        return len(self.model.edges) - 1

    def _line(self, i: int, stops: list[float], poles: Floats) -> None:
        nodes = dict(zip(self.lines.lines[i].at.tolist(), self.lines.nodes(i), strict=True))
        points = [*poles[:, 0], poles[-1, -1]]
        vertices = list[int]()
        for x, point in zip(stops, points, strict=True):
            if x not in nodes:
                vertices.append(self._vertex(point))
                continue
            if nodes[x] not in self.node:
                self.node[nodes[x]] = self._vertex(point)
            vertices.append(self.node[nodes[x]])
        self.place.append({x: n for n, x in enumerate(stops)})
        self.edges.append([self._edge(a, b, P) for (a, b), P in zip(pairwise(vertices), poles, strict=True)])

    def _steps(self, part: LinePart) -> ChainLoop:
        i, a, b = part
        begin, finish = self.place[i][min(a, b)], self.place[i][max(a, b)]
        edge_numbers = self.edges[i][begin:finish]
        return [(e, True) for e in edge_numbers] if a < b else [(e, False) for e in edge_numbers[::-1]]

    def _walls(self) -> None:
        parts = list[LinePart]()
        for i, line in enumerate(self.lines.lines):
            for a, b in line.outlines(self.lines.net):
                inside = [x for x in line.curve.breaks.tolist() if min(a, b) < x < max(a, b)]
                parts += [(i, x, y) for x, y in pairwise([a, *(inside if a < b else inside[::-1]), b])]
        for part, P in zip(parts, self.lines.parts(parts), strict=True):
            self.model.walls.append(NetWall(self._steps(part), P))

    def _sides(self, grids: list[SideGrid]) -> list[list[Floats]]:
        poles, position = self.lines.parts([part for four in grids for side in four for part in side]), 0
        result = list[list[Floats]]()
        for four in grids:
            ends = np.cumsum([position, *map(len, four)]).tolist()
            result.append([poles[a:b] for a, b in pairwise(ends)])
            position = ends[-1]
        return result

    def _add(self, P: Floats, grid: SideGrid) -> None:
        along, up = self._inner(P, grid)
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                loop = [*along[i][j], *up[i + 1][j], *backwards(along[i][j + 1]), *backwards(up[i][j])]
                self.model.patches.append(NetPatch(loop, P[i, j]))

    def _inner(self, P: Floats, grid: SideGrid) -> tuple[list[list[ChainLoop]], list[list[ChainLoop]]]:
        bottom_side, right_side, top_side, left_side = ([self._steps(part) for part in side] for side in grid)
        ku, kv = P.shape[:2]
        vertex: Ints = np.zeros((ku + 1, kv + 1), dtype=np.int64)
        for j, side in ((0, bottom_side), (kv, top_side)):
            vertex[:, j] = self._stations(side)
        vertex[0, :], vertex[ku, :] = self._stations(left_side), self._stations(right_side)
        for i in range(1, ku):
            for j in range(1, kv):
                vertex[i, j] = self._vertex(P[i, j, 0, 0])
        along: list[list[ChainLoop]] = [[bottom_side[i], *([] for _ in range(kv - 1)), top_side[i]] for i in range(ku)]
        up: list[list[ChainLoop]] = [left_side, *([] for _ in range(ku - 1)), right_side]
        for i in range(ku):
            for j in range(1, kv):
                along[i][j] = [(self._edge(int(vertex[i, j]), int(vertex[i + 1, j]), P[i, j, :, 0]), True)]
        for i in range(1, ku):
            up[i] = [[(self._edge(int(vertex[i, j]), int(vertex[i, j + 1]), P[i, j, 0]), True)] for j in range(kv)]
        return along, up

    def _stations(self, side: list[ChainLoop]) -> list[int]:
        return [*(self.model.vertex(steps[0], True) for steps in side), self.model.vertex(side[-1][-1], False)]


def backwards(loop: ChainLoop) -> ChainLoop:
    return [(e, not ahead) for e, ahead in loop[::-1]]


def _compact(quad: Quad, chains: Mapping[int, SampledChain]) -> bool:
    limit = 10.0  # largest perimeter / `mean_width` of a compact region: 8 for a square, 10.7 for a row of 3 squares
    steps = [step for side in quad.sides for step in side]
    line = np.concatenate([chains[k].middle[:: 1 if ahead else -1][:-1] for k, ahead in steps])
    return sum(float(chains[k].lengths[-1]) for k, _ in steps) <= limit * mean_width(line)


@dataclass(frozen=True)
class FilledCorner:
    """Corner of an outline that a fillet fills, and the only seam (edge on a skin) there.
    seam     : number of the edge.    end : 0 if the seam begins at the corner, 1 if the seam ends there.
    half     : tangent of half the bend angle.    beside : edges of the walls before and after the corner.
    straight : edge of a wall in line with the seam, or None."""

    vertex: int
    seam: int
    end: int
    half: float
    beside: tuple[int, int]
    straight: int | None


def corner_tangents(model: NetModel) -> dict[int, float]:
    """Return the tangent of half the bend angle at each corner of an outline, by vertex."""
    return {vertex: half for vertex, (half, _, _) in _corners(model).items()}


def filled_corners(model: NetModel) -> list[FilledCorner]:
    """Return the outline corners that a fillet fills and where exactly one seam (edge on a skin) ends.
    The list is empty for a one-sided surface."""
    straight_cosine = np.cos(0.01)  # OCCT 8.0 accepts a bend of 0.01 radians between a seam and its continuation
    if model.seam:
        return []
    walls = {e for wall in model.walls for e, _ in wall.steps}
    corners, seam_ends = _corners(model), dict[int, list[tuple[int, int]]]()
    for e, edge in enumerate(model.edges):
        for end, v in enumerate((edge.start, edge.end)):
            if v in corners and e not in walls:
                seam_ends.setdefault(v, []).append((e, end))
    result = list[FilledCorner]()
    for v, ((e, end), *further) in seam_ends.items():
        half, before, after = corners[v]
        way_a, way_b = _end_direction(model, before, False), _end_direction(model, after, True)
        across = model.vertices[v][:3] - model.vertices[v][3:]
        if not further and np.cross(way_a, way_b) @ across < 0:
            seam = _end_direction(model, (e, not end), True)
            straight = [step[0] for step, w in ((before, way_a), (after, -way_b)) if seam @ w > straight_cosine]
            result.append(FilledCorner(v, e, end, half, (before[0], after[0]), next(iter(straight), None)))
    return result


def _corners(model: NetModel) -> dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]:
    result = dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]()
    for outline in outlines(model):
        for i, wall in enumerate(outline):
            before, after = outline[i - 1].steps[-1], wall.steps[0]
            half = half_turn(float(_end_direction(model, before, False) @ _end_direction(model, after, True)))
            if half > 0:
                result[model.vertex(after, True)] = half, before, after
    return result


def half_turn(cosine: float) -> float:
    """Return tan(bend / 2) at a corner between walls; 0 for small bends. cosine : cosine of the bend."""
    smooth = np.cos(np.deg2rad(10.0))  # walls with a bend of at most 10 degrees need no fillet
    return float(np.sqrt((1 - cosine) / max(1 + cosine, 0.05))) if cosine < smooth else 0.0


def outlines(model: NetModel) -> list[list[NetWall]]:
    """Return the walls of each outline of the solid, in order."""
    begin = dict[int, list[NetWall]]()
    for wall in model.walls:
        begin.setdefault(model.vertex(wall.steps[0], True), []).append(wall)
    rows = list[list[NetWall]]()
    for starting in begin.values():
        while starting:
            rows.append([starting.pop(0)])
            while after := begin.get(model.vertex(rows[-1][-1].steps[-1], False)):
                rows[-1].append(after.pop(0))
    return rows


def wall_direction(wall: NetWall, model: NetModel, at_start: bool) -> Floats:
    """Return the unit vector (3,) along a wall at its start (`at_start`) or at its end."""
    return _end_direction(model, wall.steps[0 if at_start else -1], at_start)


def _end_direction(model: NetModel, step: tuple[int, bool], at_start: bool) -> Floats:
    P = model.poles(step)[:, :3]
    ahead = P[1] - P[0] if at_start else P[3] - P[2]
    return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-300))
