"""Vertices, edges and faces of a solid by members, each once; text knows how they are written."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.curves import ChainCurve
from dsfab.export.network.graph import VOID, ChainNet, Loop
from dsfab.export.network.patches import coons, least_jacobian, pulled
from dsfab.export.network.quads import Quad, QuadNet

FOLDED = 0.1
"""Least relative Jacobian of a patch: one that is less is trimmed instead."""


@dataclass(frozen=True, eq=False)
class NetEdge:
    """Two cubics, one on each skin. start, end : vertices.    poles : (4, 6), outer and inner, millimetres.
    wall : whether a wall stands on it, the material on its left."""

    start: int
    end: int
    poles: Floats
    wall: bool


@dataclass(frozen=True, eq=False)
class NetPatch:
    """A four-sided face on each skin. loop : edges, counter-clockwise from outside.    poles : (4, 4, 6)."""

    loop: Loop
    poles: Floats


@dataclass(eq=False)
class NetModel:
    """vertices : points (6,) on both skins, millimetres.    trimmed : loops of edges of regions without patches."""

    vertices: list[Floats] = field(default_factory=list)
    edges: list[NetEdge] = field(default_factory=list)
    patches: list[NetPatch] = field(default_factory=list)
    trimmed: dict[int, list[Loop]] = field(default_factory=dict)


def net_model(net: ChainNet, quads: QuadNet, nodes: Mapping[int, Floats], away: Callable[[Floats], Floats]) -> NetModel:
    """The model of a net; nodes : (6,) by their numbers.    away : the ways (k, 6) to both skins from points there."""
    return _Assembly(net, quads, nodes, away).model


_Sides = tuple[Loop, Loop, Loop, Loop]


class _Assembly:
    def __init__(
        self, net: ChainNet, quads: QuadNet, nodes: Mapping[int, Floats], away: Callable[[Floats], Floats]
    ) -> None:
        self.net, self.curves, self.model = net, quads.curves, NetModel()
        self.vertex = {node: self._vertex(point) for node, point in nodes.items()}
        self.chain = {k: self._edges(k, curve) for k, curve in quads.curves.items()}
        sides = [self._sides(quad) for quad in quads.quads]
        others = list(quads.others)
        for quad, four, P in zip(quads.quads, sides, self._patches(sides, away), strict=True):
            if least_jacobian(np.concatenate([P[..., :3], P[..., 3:]])) < FOLDED:
                others.append(quad.region)
            else:
                self._add(P, four)
        for region in others:
            self.model.trimmed[region] = [self._steps(loop) for loop in net.loops[region]]

    def _vertex(self, point: Floats) -> int:
        self.model.vertices.append(point)
        return len(self.model.vertices) - 1

    def _edge(self, start: int, end: int, poles: Floats, wall: bool = False) -> int:
        self.model.edges.append(NetEdge(start, end, poles, wall))
        return len(self.model.edges) - 1

    def _edges(self, k: int, curve: ChainCurve) -> list[int]:
        """The edges of a chain."""
        points = self.net.chains[k].points
        at = [self.vertex[int(points[0])], *(self._vertex(p) for p in curve.spans[1:, 0]), self.vertex[int(points[-1])]]
        wall = self.net.chains[k].right == VOID
        return [self._edge(at[i], at[i + 1], poles, wall) for i, poles in enumerate(curve.spans)]

    def _steps(self, loop: Loop) -> Loop:
        """The edges of a loop of chains."""
        return [(e, ahead) for k, ahead in loop for e in self.chain[k][:: 1 if ahead else -1]]

    def _poles(self, steps: Loop) -> Floats:
        """(k, 4, 6) of edges as they are run through."""
        return np.stack([self.model.edges[e].poles[:: 1 if ahead else -1] for e, ahead in steps])

    def _sides(self, quad: Quad) -> _Sides:
        """Bottom, right, top and left of a region, opposite ones run through the same way."""
        bottom, right, top, left = (self._steps(side) for side in quad.sides)
        return bottom, right, _turned(top), _turned(left)

    def _patches(self, sides: list[_Sides], away: Callable[[Floats], Floats]) -> list[Floats]:
        """(ku, kv, 4, 4, 6) poles of the patches of regions."""
        return pulled([coons(*map(self._poles, four)) for four in sides], away) if sides else []

    def _add(self, P: Floats, sides: _Sides) -> None:
        """Add the patches of a region."""
        bottom, right, top, left = sides
        along, up = self._inner(P, bottom, right, top, left)
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                loop = [along[i][j], up[i + 1][j], *_turned([along[i][j + 1]]), *_turned([up[i][j]])]
                self.model.patches.append(NetPatch(loop, P[i, j]))

    def _inner(self, P: Floats, bottom: Loop, right: Loop, top: Loop, left: Loop) -> tuple[list[Loop], list[Loop]]:
        """The edges of all cells: along [i][j] below cell (i, j), and up [i][j] on its left."""
        ku, kv = P.shape[:2]
        vertex: Ints = np.zeros((ku + 1, kv + 1), dtype=np.int64)
        for j, side in ((0, bottom), (kv, top)):
            vertex[:, j] = self._stations(side)
        vertex[0, :], vertex[ku, :] = self._stations(left), self._stations(right)
        for i in range(1, ku):
            for j in range(1, kv):
                vertex[i, j] = self._vertex(P[i, j, 0, 0])
        along = [[bottom[i], *((-1, True) for _ in range(kv - 1)), top[i]] for i in range(ku)]
        up = [left, *([(-1, True)] * kv for _ in range(ku - 1)), right]
        for i in range(ku):
            for j in range(1, kv):
                along[i][j] = self._edge(int(vertex[i, j]), int(vertex[i + 1, j]), P[i, j, :, 0]), True
        for i in range(1, ku):
            up[i] = [(self._edge(int(vertex[i, j]), int(vertex[i, j + 1]), P[i, j, 0]), True) for j in range(kv)]
        return along, up

    def _stations(self, steps: Loop) -> list[int]:
        """The vertices along some edges."""
        ends = [(self.model.edges[e].start, self.model.edges[e].end)[:: 1 if ahead else -1] for e, ahead in steps]
        return [ends[0][0], *(end for _, end in ends)]


def _turned(loop: Loop) -> Loop:
    """The same edges, run through the other way."""
    return [(e, not ahead) for e, ahead in loop[::-1]]
