"""Vertices, edges and faces of a solid by members, each once; text knows how they are written."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.covering import Covering
from dsfab.export.network.curves import SampledChain
from dsfab.export.network.graph import Loop
from dsfab.export.network.joining import mean_width
from dsfab.export.network.lines import NetLines, Part
from dsfab.export.network.quads import Quad
from dsfab.export.network.stations import Grid, Stations

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
