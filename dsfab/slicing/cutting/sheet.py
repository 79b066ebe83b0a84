"""`Sheet`: a surface cut into material and void, and parts of it as surfaces of their own."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.core.errors import PatternError
from dsfab.surface import Surface, spanned_edges

if TYPE_CHECKING:
    import compas.datastructures
    import pyvista
    import trimesh


VOID = -1
"""The `family` of a cell that no field made material."""

ON_SIMPLEX = 1 - 1e-9
"""A carried 0/1 field of at least this value marks a point that lies between marked vertices only."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A cut surface: n' vertices and m' triangles (cells), each inside one face of the uncut surface (n, m).

    surface : the cells, oriented as the faces they lie in.
    parent  : (m',) face of the uncut surface that a cell lies in.
    family  : (m',) index of the field that made the cell material, `VOID` (-1) for void.
    weights : (n', n) barycentric weights of the vertices on the uncut surface's vertices: not negative, at most three
              in a row, rows sum to 1. A vertex of the uncut surface has itself with weight 1.
    stubs   : at how many places stripes that met past their last crossings were cut off or drawn straight, or got an
              even bow, when it was cut.
    """

    surface: Surface
    parent: Ints
    family: Ints
    weights: csr_array
    stubs: int = 0

    def __post_init__(self) -> None:
        lock(self, "parent", np.int64, (None,))
        lock(self, "family", np.int64, (None,))
        weights = csr_array(self.weights, copy=True)
        weights.sum_duplicates()
        for part in (weights.data, weights.indices, weights.indptr):
            part.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        shapes = (len(self.parent), len(self.family), weights.shape[0])
        if shapes != (self.surface.m, self.surface.m, self.surface.n):
            raise ValueError(f"expected {self.surface.m} cells and {self.surface.n} vertices, got {shapes}")

    def to_trimesh(self) -> "trimesh.Trimesh":
        """Its cells, metres."""
        return self.surface.to_trimesh()

    def to_pyvista(self) -> "pyvista.PolyData":
        """Its cells, metres, with `family` and `parent` of each."""
        mesh = self.surface.to_pyvista()
        mesh.cell_data["family"], mesh.cell_data["parent"] = self.family, self.parent
        return mesh

    def to_compas(self) -> "compas.datastructures.Mesh":
        """Its cells, metres; raises SurfaceError where compas is not installed."""
        return self.surface.to_compas()

    @property
    def material(self) -> Bools:
        """(m',) whether a cell is material."""
        return np.asarray(self.family != VOID)

    @property
    def has_openings(self) -> bool:
        """Whether some cells are material and others void."""
        material = self.material
        return bool(material.any() and not material.all())

    @cached_property
    def void_beside(self) -> Ints:
        """(m', 3) the void cell across each side of void cells, -1 elsewhere."""
        one, two = self.surface.edges.pairs.T
        inner = ~(self.material[one // 3] | self.material[two // 3])
        cell = np.full(3 * self.surface.m, -1)
        cell[one[inner]], cell[two[inner]] = two[inner] // 3, one[inner] // 3
        return cell.reshape(-1, 3)

    def carry(self, x: Floats) -> Floats:
        """Values x (n, ...) on the uncut surface's vertices, interpolated linearly to this sheet's (n', ...)."""
        return np.asarray(self.weights @ x)

    def carry_corners(self, x: Floats, F: Ints) -> Floats:
        """Values x (m, 3, k) at the corners of the uncut faces F (m, 3), interpolated to this sheet's vertices (n', k).

        Each vertex takes them from the parent of the first cell around it: for vectors that other faces there see from
        their other side, as on a Moebius strip. Equals `carry` where the corners at each vertex agree.
        """
        corner = np.full(self.surface.n, -1)
        corner[self.surface.F[::-1, ::-1].ravel()] = np.arange(3 * self.surface.m)[::-1]
        parent = self.parent[corner // 3]
        weights = self.weights.tocoo()
        row, column = weights.coords
        at = (F[parent[row]] == column[:, None]).argmax(axis=1)
        values = weights.data[:, None] * x[parent[row], at]
        total = np.stack([np.bincount(row, v, self.surface.n) for v in values.T], axis=1)
        return np.asarray(np.where((corner >= 0)[:, None], total, 0.0))

    def between(self, surface: Surface, marks: Bools, edges: Bools | None = None) -> Bools:
        """(n', ...) vertices that lie where marks (n, ...) on the vertices of the uncut surface mean them to be.

        edges : (e, ...) of the uncut surface, those that are marked between their ends; left out, those that the marks
                span (`spanned_edges`). A vertex within a face lies there if all three of its edges are marked, and not
                all of them are free: then the boundary is.
        """
        found: Bools = np.asarray(self.carry(marks.astype(np.float64)) >= ON_SIMPLEX)
        table = surface.edges
        edges = spanned_edges(surface.F, table, marks) if edges is None else edges
        column, weight = three_each(self.weights)
        off = weight > 1 - ON_SIMPLEX
        free = np.ones(self.surface.n, dtype=bool)
        for i, j in ((0, 1), (1, 2), (0, 2)):
            both = np.flatnonzero(off[:, i] & off[:, j])
            edge = table.between(column[both, i], column[both, j])
            found[both] &= edges[edge]
            free[both] &= table.boundary[edge]
        found[off.all(axis=1) & free] = False
        return found

    def same_vertex(self) -> Ints:
        """(n,) the vertex of this sheet at each vertex of the uncut surface, -1 where it was cut away."""
        weights = self.weights.tocoo()
        whole = weights.data >= ON_SIMPLEX
        at = np.full(weights.shape[1], -1)
        at[weights.coords[1][whole]] = weights.coords[0][whole]
        return at

    def kept(self, mask: Bools | None = None) -> "Sheet":
        """The sheet of the marked cells only (m',), of the material when left out; vertices without a cell are dropped.

        Raises PatternError when nothing is marked.
        """
        return self._material_alone if mask is None else self._kept(mask)

    @cached_property
    def _material_alone(self) -> "Sheet":
        """Several stages ask for it, and for its edges."""
        return self._kept(self.material)

    def _kept(self, mask: Bools) -> "Sheet":
        if not mask.any():
            raise PatternError(
                f"none of the {self.surface.m} cells is kept: there is nothing to build; "
                "lower the threshold or raise the frequency"
            )
        F = self.surface.F[np.flatnonzero(mask)]
        used = np.zeros(self.surface.n, dtype=bool)
        used[F] = True
        vertices = np.flatnonzero(used)
        surface = Surface(self.surface.V[vertices], (np.cumsum(used) - 1)[F])
        return replace(
            self, surface=surface, parent=self.parent[mask], family=self.family[mask], weights=self.weights[vertices]
        )


def three_each(weights: csr_array) -> tuple[Ints, Floats]:
    """(k, 3) columns and values of the rows of barycentric weights (k, n), at most three in each; filled up with
    zeros."""
    count = np.diff(weights.indptr)
    place = np.arange(weights.nnz) - np.repeat(weights.indptr[:-1], count)
    row = np.repeat(np.arange(len(count)), count)
    column, value = np.zeros((len(count), 3), dtype=np.int64), np.zeros((len(count), 3))
    column[row, place], value[row, place] = weights.indices, weights.data
    return column, value


def part_of(surface: Surface, mask: Bools) -> tuple[Surface, Ints]:
    """The marked faces as a surface, and the faces that they were."""
    F, used = surface.F[mask], np.zeros(surface.n, dtype=bool)
    used[F] = True
    number = np.cumsum(used) - 1
    return Surface(surface.V[used], number[F]), np.flatnonzero(mask)


def whole_edges(part: Surface, whole: Surface, faces: Ints) -> Ints:
    """(e,) the edges of the whole that those of a part are; `faces` (f,) are those of the part."""
    found = np.empty(len(part.edges.ends), dtype=np.int64)
    found[part.edges.of] = whole.edges.of[faces]
    return found


def inner_walls(void: Surface, whole: Surface, faces: Ints) -> Bools:
    """(e,) the boundary edges of a part that are not on the boundary of the whole."""
    return np.asarray(void.edges.boundary & ~whole.edges.boundary[whole_edges(void, whole, faces)])


def round_sizes(part: Surface, walls: Bools, label: Ints, count: int) -> Floats:
    """(count,) 4 area / perimeter of the pieces of a part; infinite for those that walls do not enclose wholly."""
    length = part.edge_lengths
    edge = np.flatnonzero(part.edges.boundary)
    whose = label[part.edges.order[part.edges.start[:-1]][edge] // 3]
    around = np.bincount(whose, length[edge], count)
    enclosed = (np.bincount(whose, ~walls[edge], count) == 0) & (around > 0)
    areas = np.bincount(label, part.areas, count)
    sizes: Floats = np.divide(4 * areas, around, out=np.full(count, np.inf), where=enclosed)
    return sizes


def medians(values: Floats, weight: Floats, label: Ints, count: int) -> Floats:
    """(count,) the value that half of the weight under each label does not exceed; infinite where nothing weighs.

    Values that are not a number do not count.
    """
    good = np.flatnonzero((weight > 0) & ~np.isnan(values))
    order = good[np.lexsort((values[good], label[good]))]
    x, of = values[order], label[order]
    total = np.bincount(of, weight[order], count)
    upto = np.cumsum(weight[order]) - (np.cumsum(total) - total)[of]
    half = np.flatnonzero(upto >= 0.5 * total[of])
    found = np.full(count, np.inf)
    found[of[half][::-1]] = x[half][::-1]
    return found
