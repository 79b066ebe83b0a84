r"""Rims of openings beside sharp corners, moved onto trimmed faces that cannot be made to run through them.

     | seam         A surface that leaves its outline by .01 mm over the last half millimetre before a corner would
     |              have to wave all over to follow it there. Beside a rim is a wall, which is ruled, and can be along
-----o--x--------   any curve: between the corner o and x, as far as a fillet goes, the rim is moved along the face's
       void         normal onto it. From there on what it moves by fades. A seam has a face on both sides, and stays:
                    where one ends at o, the face has to run through it.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.model import NetEdge, NetModel, NetWall
from dsfab.export.network.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

NODES = np.linspace(0, 1, 4)[:, None]
"""(4, 1) shares of a piece where it is moved onto a face: a cubic through so many heights."""


@dataclass(frozen=True)
class MovedRim:
    """What is changed for one face: pieces of its rims that are on it then, edges, and vertices (6,), by number."""

    pieces: list[int]
    edges: dict[int, NetEdge]
    vertices: dict[int, Floats]


class Rims:
    """The rims of a model, some of them moved onto the faces beside.

    pieces : edges at sharp corners, rims among them.    ends : by vertex the edges that end there.
    """

    def __init__(self, model: NetModel, pieces: Collection[int]) -> None:
        self.model, self.edges, self.vertices = model, list(model.edges), list(model.vertices)
        self.rims = {e for wall in model.walls for e, _ in wall.steps}
        self.pieces = self.rims.intersection(pieces)
        self.ends = dict[int, list[int]]()
        for e, edge in enumerate(model.edges):
            for v in (edge.start, edge.end):
                self.ends.setdefault(v, []).append(e)
        self.moved = set[int]()

    def beside(self, face: TrimmedFace) -> set[int]:
        """The pieces around a face."""
        return self.pieces & _around(face)

    def seams(self, face: TrimmedFace, curves: Mapping[int, Floats]) -> dict[int, Floats]:
        """Those of some curves that are around a face, and no rims."""
        around = _around(face)
        return {e: poles for e, poles in curves.items() if e in around and e not in self.rims}

    def moved_onto(self, face: TrimmedFace, on_seams: bool) -> MovedRim | None:
        """What is changed so that the pieces around a face are on it; nothing where it has none.

        on_seams : whether it runs through the seams that end at corners: then pieces beside these can be on it, too.
        """
        around = _around(face)
        free = {v for v, ends in self.ends.items() if len(ends) == 2 and around & self.rims >= set(ends)}
        ends = {e: (self.edges[e].start, self.edges[e].end) for e in around}
        mine = [e for e in sorted(self.beside(face)) if on_seams or free.issuperset(ends[e])]
        if not mine:
            return None
        normals = np.stack([axes[2] for axes in face.axes])
        moves = {v: -face.gaps(self.vertices[v][None])[0] for e in mine for v in ends[e] if v in free}
        vertices = {v: self.vertices[v] + (way[:, None] * normals).ravel() for v, way in moves.items()}
        edges = dict[int, NetEdge]()
        for e in sorted({e for v in moves for e in self.ends[v]}.union(mine)):
            edge, (a, b) = self.edges[e], (moves.get(v, np.zeros(2)) for v in ends[e])
            way = (1 - NODES) * a + NODES * b
            if e in mine:
                way[1:-1] = -face.gaps(bernstein(NODES[1:-1, 0]) @ edge.poles)
                way = np.linalg.solve(bernstein(NODES[:, 0]), way)
            poles = edge.poles + (way[:, :, None] * normals).reshape(4, 6)
            poles[[0, -1]] = [vertices.get(v, self.vertices[v]) for v in ends[e]]
            edges[e] = replace(edge, poles=poles)
        return MovedRim(mine, edges, vertices)

    def take(self, change: MovedRim) -> None:
        """Move edges and vertices."""
        for e, edge in change.edges.items():
            self.edges[e] = edge
        for v, point in change.vertices.items():
            self.vertices[v] = point
        self.moved |= change.edges.keys()

    def result(self) -> NetModel:
        """The model, with walls along what its rims are now."""
        new, walls = replace(self.model, edges=self.edges, vertices=self.vertices), list[NetWall]()
        for wall in self.model.walls:
            still = self.moved.isdisjoint(e for e, _ in wall.steps)
            walls += [wall] if still else [NetWall([step], new.poles(step)) for step in wall.steps]
        return replace(new, walls=walls)


def _around(face: TrimmedFace) -> set[int]:
    """The edges of a face."""
    return {e for loop in face.loops for e, _ in loop}
