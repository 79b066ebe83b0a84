"""Boundary model of a solid by members: vertices, edges, walls and faces, each once, and corners of outlines."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.by_members.curves import SampledChain
from dsfab.export.cad.step.by_members.lines import NetLines, Part
from dsfab.export.cad.step.by_members.patch_sides import Grid, Quad, Stations
from dsfab.export.cad.step.by_members.patches import Covering
from dsfab.export.cad.step.by_members.regions import Loop, mean_width

MOST_CELLS = 2
"""Patches that a compact region is divided into; one that needs more, a crossing with round corners, is trimmed."""

COMPACT = 10.0
"""Outline of a compact region over its mean width, at most: 8 of a square, 9 of two, 10.7 of three in a row."""


@dataclass(frozen=True, eq=False)
class NetEdge:
    """Two cubics, one on each skin. start, end : vertices.    poles : (4, 6), outer and inner, millimetres."""

    start: int
    end: int
    poles: Floats


@dataclass(frozen=True, eq=False)
class NetWall:
    """A ruled face between the skins. steps : edges in a row, the material on their left.    poles : (4, 6) of all."""

    steps: Loop
    poles: Floats


@dataclass(frozen=True, eq=False)
class NetPatch:
    """A four-sided face on each skin. loop : edges, counter-clockwise from outside, one or several along each side of
    the surface.    poles : (4, 4, 6).    within : whether the surface goes on beyond some edges."""

    loop: Loop
    poles: Floats
    within: bool = False


@dataclass(eq=False)
class NetModel:
    """vertices : points (6,) on both skins, millimetres.    trimmed : loops of edges of regions without patches.
    compact : those of them that have four sides, and could be divided into patches.    seam : whether edges are there
    twice, once on each side of a seam, where the outer skin is the inner one of the other."""

    vertices: list[Floats] = field(default_factory=list)
    edges: list[NetEdge] = field(default_factory=list)
    walls: list[NetWall] = field(default_factory=list)
    patches: list[NetPatch] = field(default_factory=list)
    trimmed: dict[int, list[Loop]] = field(default_factory=dict)
    compact: frozenset[int] = frozenset()
    seam: bool = False

    @property
    def faces(self) -> int:
        """How many the solid has."""
        return 2 * (len(self.patches) + len(self.trimmed)) + len(self.walls)

    def outline(self, loops: Iterable[Loop]) -> bytes:
        """The poles along loops of edges: equal where the curves are, whatever the edges' numbers."""
        return b"".join(self.poles(step).tobytes() for loop in loops for step in loop)

    def poles(self, step: tuple[int, bool]) -> Floats:
        """(4, 6) of the edge of a step, as it is run through."""
        e, ahead = step
        return self.edges[e].poles[:: 1 if ahead else -1]

    def vertex(self, step: tuple[int, bool], first: bool) -> int:
        """Where a step begins, or ends."""
        edge = self.edges[step[0]]
        return edge.start if step[1] == first else edge.end

    def over(self, loop: Callable[[Loop], Loop]) -> "NetModel":
        """The model whose faces run over other edges: those that `loop` gives for a loop of them."""
        return replace(
            self,
            walls=[replace(wall, steps=loop(wall.steps)) for wall in self.walls],
            patches=[replace(patch, loop=loop(patch.loop)) for patch in self.patches],
            trimmed={region: [loop(each) for each in loops] for region, loops in self.trimmed.items()},
        )


def net_model(
    lines: NetLines,
    chains: Mapping[int, SampledChain],
    quads: Iterable[Quad],
    others: Iterable[int],
    covering: Covering,
    patched: Collection[int] = (),
) -> NetModel:
    """The model of a net of quads and other regions.

    covering : makes patches; a region whose patches are not good is trimmed.    patched : quads that are divided into
    patches, whatever their number.
    """
    stations, some = Stations(lines, chains), list(quads)
    compact = frozenset(
        quad.region
        for quad in some
        if quad.region not in patched and stations.cells(quad) > MOST_CELLS and _compact(quad, chains)
    )
    rest = [quad for quad in some if quad.region not in compact]
    model = NetModel(compact=compact, seam=len(lines.twins) > 0)
    return _Assembly(stations, rest, [*others, *sorted(compact)], covering, model).model


class _Assembly:
    def __init__(
        self,
        stations: Stations,
        quads: list[Quad],
        others: list[int],
        covering: Covering,
        model: NetModel,
    ) -> None:
        self.lines = lines = stations.lines
        self.model = model
        grids = [stations.grid(quad) for quad in quads]
        self.node = dict[int, int]()
        self.place = list[dict[float, int]]()
        self.edges = list[list[int]]()
        stops = [sorted(some | stations.stops[lines.twins.get(i, i)]) for i, some in enumerate(stations.stops)]
        poles = lines.parts([(i, a, b) for i, some in enumerate(stops) for a, b in pairwise(some)])
        each = np.split(poles, np.cumsum([len(some) - 1 for some in stops])[:-1])
        for i, (some, P) in enumerate(zip(stops, each, strict=True)):
            self._line(i, some, P)
        self._walls()
        patches = covering([quad.region for quad in quads], self._sides(grids))
        for quad, grid, found in zip(quads, grids, patches, strict=True):
            if found is None:
                others.append(quad.region)
            else:
                self._add(found, grid)
        for region in others:
            self.model.trimmed[region] = [
                [e for step in loop for e in self._steps(lines.along(step))] for loop in lines.net.loops[region]
            ]

    def _vertex(self, point: Floats) -> int:
        self.model.vertices.append(point)
        return len(self.model.vertices) - 1

    def _edge(self, start: int, end: int, poles: Floats) -> int:
        self.model.edges.append(NetEdge(start, end, poles))
        return len(self.model.edges) - 1

    def _line(self, i: int, stops: list[float], poles: Floats) -> None:
        """The vertices and the edges (k, 4, 6) of a line that is divided at some parameters."""
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

    def _steps(self, part: Part) -> Loop:
        """The edges of a part of a line."""
        i, a, b = part
        first, last = self.place[i][min(a, b)], self.place[i][max(a, b)]
        some = self.edges[i][first:last]
        return [(e, True) for e in some] if a < b else [(e, False) for e in some[::-1]]

    def _walls(self) -> None:
        """One for each cubic of an outline."""
        parts = list[Part]()
        for i, line in enumerate(self.lines.lines):
            for a, b in line.outlines(self.lines.net):
                inside = [x for x in line.curve.breaks.tolist() if min(a, b) < x < max(a, b)]
                parts += [(i, x, y) for x, y in pairwise([a, *(inside if a < b else inside[::-1]), b])]
        for part, P in zip(parts, self.lines.parts(parts), strict=True):
            self.model.walls.append(NetWall(self._steps(part), P))

    def _sides(self, grids: list[Grid]) -> list[list[Floats]]:
        """(k, 4, 6) poles of the parts of each side of regions, in the order of their grids."""
        poles, at = self.lines.parts([part for four in grids for side in four for part in side]), 0
        found = list[list[Floats]]()
        for four in grids:
            ends = np.cumsum([at, *map(len, four)]).tolist()
            found.append([poles[a:b] for a, b in pairwise(ends)])
            at = ends[-1]
        return found

    def _add(self, P: Floats, grid: Grid) -> None:
        """Add the patches of a region."""
        bottom, right, top, left = ([self._steps(part) for part in side] for side in grid)
        along, up = self._inner(P, bottom, right, top, left)
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                loop = [*along[i][j], *up[i + 1][j], *turned(along[i][j + 1]), *turned(up[i][j])]
                self.model.patches.append(NetPatch(loop, P[i, j]))

    def _inner(
        self, P: Floats, bottom: list[Loop], right: list[Loop], top: list[Loop], left: list[Loop]
    ) -> tuple[list[list[Loop]], list[list[Loop]]]:
        """The edges of all cells: along [i][j] below cell (i, j), and up [i][j] on its left."""
        ku, kv = P.shape[:2]
        vertex: Ints = np.zeros((ku + 1, kv + 1), dtype=np.int64)
        for j, side in ((0, bottom), (kv, top)):
            vertex[:, j] = self._stations(side)
        vertex[0, :], vertex[ku, :] = self._stations(left), self._stations(right)
        for i in range(1, ku):
            for j in range(1, kv):
                vertex[i, j] = self._vertex(P[i, j, 0, 0])
        along: list[list[Loop]] = [[bottom[i], *([] for _ in range(kv - 1)), top[i]] for i in range(ku)]
        up: list[list[Loop]] = [left, *([] for _ in range(ku - 1)), right]
        for i in range(ku):
            for j in range(1, kv):
                along[i][j] = [(self._edge(int(vertex[i, j]), int(vertex[i + 1, j]), P[i, j, :, 0]), True)]
        for i in range(1, ku):
            up[i] = [[(self._edge(int(vertex[i, j]), int(vertex[i, j + 1]), P[i, j, 0]), True)] for j in range(kv)]
        return along, up

    def _stations(self, side: list[Loop]) -> list[int]:
        """The vertices where parts of a side begin and end."""
        return [*(self.model.vertex(steps[0], True) for steps in side), self.model.vertex(side[-1][-1], False)]


def turned(loop: Loop) -> Loop:
    """The same edges, run through the other way."""
    return [(e, not ahead) for e, ahead in loop[::-1]]


def _compact(quad: Quad, chains: Mapping[int, SampledChain]) -> bool:
    """Whether a region is about as long as wide."""
    steps = [step for side in quad.sides for step in side]
    line = np.concatenate([chains[k].middle[:: 1 if ahead else -1][:-1] for k, ahead in steps])
    return sum(float(chains[k].way[-1]) for k, _ in steps) <= COMPACT * mean_width(line)


SMOOTH = np.cos(np.deg2rad(10.0))
"""Cosine of the turn between two walls up to which there is no corner to be rounded."""

STRAIGHT = np.cos(0.01)
"""Cosine of the angle up to which OCCT (8.0) takes a seam for what a wall's edge goes on as."""


@dataclass(frozen=True)
class FilledCorner:
    """A corner where the void is less than a half turn, and the one seam that ends there.

    seam, end : the edge, and whether that is its last end (1) or its first (0).    half : tangent of half the turn.
    beside : the edges of walls before and after the corner.    straight : that of them that the seam goes straight on
    from, if there is one.
    """

    vertex: int
    seam: int
    end: int
    half: float
    beside: tuple[int, int]
    straight: int | None


def corner_tangents(model: NetModel) -> dict[int, float]:
    """By vertex where an outline has a corner the tangent of half its turn."""
    return {vertex: half for vertex, (half, _, _) in _corners(model).items()}


def filled_corners(model: NetModel) -> list[FilledCorner]:
    """Where one seam alone ends at a corner that a fillet fills; none of a model whose edges are there twice."""
    if model.seam:
        return []
    walls = {e for wall in model.walls for e, _ in wall.steps}
    corners, at = _corners(model), dict[int, list[tuple[int, int]]]()
    for e, edge in enumerate(model.edges):
        for end, v in enumerate((edge.start, edge.end)):
            if v in corners and e not in walls:
                at.setdefault(v, []).append((e, end))
    found = list[FilledCorner]()
    for v, ((e, end), *others) in at.items():
        half, before, after = corners[v]
        one, two = _end_way(model, before, False), _end_way(model, after, True)
        across = model.vertices[v][:3] - model.vertices[v][3:]
        if not others and np.cross(one, two) @ across < 0:
            seam = _end_way(model, (e, not end), True)
            straight = [step[0] for step, w in ((before, one), (after, -two)) if seam @ w > STRAIGHT]
            beside = before[0], after[0]
            found.append(FilledCorner(v, e, end, half, beside, straight[0] if straight else None))
    return found


def _corners(model: NetModel) -> dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]:
    """By vertex where an outline has a corner the tangent of half its turn, and the edges before and after it."""
    found = dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]()
    for outline in outlines(model):
        for i, wall in enumerate(outline):
            before, after = outline[i - 1].steps[-1], wall.steps[0]
            half = half_turn(float(_end_way(model, before, False) @ _end_way(model, after, True)))
            if half > 0:
                found[model.vertex(after, True)] = half, before, after
    return found


def half_turn(cosine: float) -> float:
    """The tangent of half the turn at a corner, by which a fillet's radius is multiplied; 0 where there is none."""
    return float(np.sqrt((1 - cosine) / max(1 + cosine, 0.05))) if cosine < SMOOTH else 0.0


def outlines(model: NetModel) -> list[list[NetWall]]:
    """Walls that follow each other, each once."""
    begin = dict[int, list[NetWall]]()
    for wall in model.walls:
        begin.setdefault(model.vertex(wall.steps[0], True), []).append(wall)
    found = list[list[NetWall]]()
    for some in begin.values():
        while some:
            found.append([some.pop(0)])
            while after := begin.get(model.vertex(found[-1][-1].steps[-1], False)):
                found[-1].append(after.pop(0))
    return found


def way(wall: NetWall, model: NetModel, first: bool) -> Floats:
    """(3,) the direction of a wall where it begins, or ends."""
    return _end_way(model, wall.steps[0 if first else -1], first)


def _end_way(model: NetModel, step: tuple[int, bool], first: bool) -> Floats:
    """(3,) the direction of an edge where it begins, or ends, as it is run through."""
    P = model.poles(step)[:, :3]
    ahead = P[1] - P[0] if first else P[3] - P[2]
    return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-300))
