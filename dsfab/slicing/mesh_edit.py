"""What flips and collapses of the cells of a sheet both need: the cells, their shape, and who may change at once."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.clean import CELL_AREA
from dsfab.slicing.sheet import VOID
from dsfab.surface.topology import EdgeTable, edge_table

GAIN = 1.01
"""A step must raise the smallest angle by this factor at least: what rounding alone gains is left."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Cells F (m', 3) on places V (n', 3), the face and family (m',) of each, and the uncut surface.

    normal  : (m, 3) unit normals of the uncut faces.    corner : (m, 3) their vertices.
    support : (n', 3) the uncut vertices that each vertex lies between, -1 where there are fewer.
    strayed : (n',) metres by which the edges of stripes at a vertex may have moved so far.
    """

    V: Floats
    F: Ints
    parent: Ints
    family: Ints
    normal: Floats
    corner: Ints
    support: Ints
    strayed: Floats

    @cached_property
    def edges(self) -> EdgeTable:
        """Every edge once, with the cells on it."""
        return edge_table(self.F)

    @cached_property
    def keys(self) -> Ints:
        """(e,) one number for each edge, ascending."""
        return self.key(*self.edges.ends.T)

    def key(self, a: Ints, b: Ints) -> Ints:
        """(k,) the number of the edges between vertices a (k,) and b (k,), whichever way."""
        return np.minimum(a, b) * len(self.V) + np.maximum(a, b)

    def edge(self, a: Ints, b: Ints) -> Ints:
        """(k,) the edge between vertices a (k,) and b (k,), -1 where there is none."""
        key = self.key(a, b)
        at = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        return np.where(self.keys[at] == key, at, -1)

    @cached_property
    def lines(self) -> Bools:
        """(e,) edges that bound something: the surface, or cells of one family."""
        result = np.ones(len(self.keys), dtype=bool)
        two = self.edges.count == 2
        f, g = (self.edges.pairs // 3).T
        result[two] = self.family[f] != self.family[g]
        return result

    @cached_property
    def outline(self) -> Bools:
        """(e,) edges between material and void."""
        result = np.zeros(len(self.keys), dtype=bool)
        f, g = (self.edges.pairs // 3).T
        result[self.edges.count == 2] = (self.family[f] == VOID) != (self.family[g] == VOID)
        return result

    @cached_property
    def line_ends(self) -> Ints:
        """(n',) sum of the vertices that lines lead to: of two, the other one is this less the first."""
        total = np.zeros(len(self.V), dtype=np.int64)
        a, b = self.edges.ends[self.lines].T
        np.add.at(total, a, b)
        np.add.at(total, b, a)
        return total

    @cached_property
    def angle(self) -> Floats:
        """(m',) the smallest angle of each cell."""
        return self.angles(self.F, self.parent)

    def angles(self, F: Ints, parent: Ints) -> Floats:
        """(k,) the smallest angle of triangles in uncut faces, degrees; negative where one is turned over, 0 where it
        has next to no area: no surface takes such a face."""
        P = self.V[F]
        sides = np.roll(P, -1, axis=1) - P
        back = -np.roll(sides, 1, axis=1)
        twice = np.einsum("ki,ki->k", np.cross(sides[:, 0], back[:, 0]), self.normal[parent])
        angle = np.degrees(np.arctan2(twice[:, None], np.einsum("kci,kci->kc", sides, back))).min(axis=1)
        return np.where(np.abs(twice) <= 2 * self.least, 0.0, angle)

    @cached_property
    def least(self) -> float:
        """Square metres that a cell has at least."""
        return CELL_AREA * float(np.sum(np.ptp(self.V, axis=0) ** 2))

    @cached_property
    def stars(self) -> tuple[Ints, Ints]:
        """The cells around the vertices: those of vertex v are faces[start[v] : start[v + 1]].

        faces : (3 m',).    start : (n' + 1,).
        """
        start = np.concatenate([[0], np.cumsum(np.bincount(self.F.ravel(), minlength=len(self.V)))])
        return grouped(self.F.ravel())[0] // 3, start

    def around(self, vertex: Ints) -> tuple[Ints, Ints]:
        """Rows into `vertex` (k,), ascending, and the cells around it, one by one."""
        faces, start = self.stars
        count = start[vertex + 1] - start[vertex]
        row = np.repeat(np.arange(len(vertex)), count)
        begin = np.repeat(start[vertex] - np.concatenate([[0], np.cumsum(count)[:-1]]), count)
        return row, faces[begin + np.arange(len(row))]

    def with_cells(self, F: Ints, kept: Bools | None = None, strayed: Floats | None = None) -> "Cut":
        """The same with other cells F (m', 3), of which those marked `kept` (m',) stay; strayed (n',) metres, as it
        was if left out."""
        kept = np.ones(len(F), dtype=bool) if kept is None else kept
        return replace(
            self,
            F=F[kept],
            parent=self.parent[kept],
            family=self.family[kept],
            strayed=self.strayed if strayed is None else strayed,
        )


def independent(row: Ints, face: Ints, rank: Ints, m: int) -> Bools:
    """(k,) steps that need none of the faces of a better one; step row[i] of rank[row[i]] needs face[i] of m."""
    best = np.full(m, len(rank))
    np.minimum.at(best, face, rank[row])
    free = np.ones(len(rank), dtype=bool)
    free[row[best[face] != rank[row]]] = False
    return free
