"""`PolygonMesh`: a surface divided into convex polygons, between one cut and the next."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.cells import Cells
from dsfab.slicing.sheet import VOID
from dsfab.slicing.split import Split
from dsfab.surface import Surface
from dsfab.surface.divided import Divided
from dsfab.surface.topology import connected


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Polygons on vertices X (n', 3), their parent faces and families (c,), and the weights of the vertices.

    F     : (m, 3) the faces of the uncut surface.
    again : (c,) material that later fields divide too.    also : (c,) the field that makes that material as well.
    """

    F: Ints
    cells: Cells
    X: Floats
    weights: csr_array
    parent: Ints
    family: Ints
    again: Bools
    also: Ints
    stubs: int = 0

    @classmethod
    def of(cls, surface: Surface, divided: Divided | None = None) -> Self:
        """The faces of a surface, or the parts that they are divided into, all void."""
        if divided:
            parts = divided.surface
            cells, family = Cells.triangles(parts.F), np.full(parts.m, VOID)
            return cls.plain(surface.F, cells, parts.V, divided.weights, divided.parent, family)
        n, m = surface.n, surface.m
        cells, weights = Cells.triangles(surface.F), csr_array(eye_array(n))
        return cls.plain(surface.F, cells, surface.V, weights, np.arange(m), np.full(m, VOID))

    @classmethod
    def plain(cls, F: Ints, cells: Cells, X: Floats, weights: csr_array, parent: Ints, family: Ints) -> Self:
        """Polygons, parent and family (c,), on X (n', 3), metres, none of which two fields make material."""
        count = len(family)
        return cls(F, cells, X, weights, parent, family, np.zeros(count, dtype=bool), np.full(count, VOID))

    def with_material(self, k: int, material: Bools, blank: Bools) -> Self:
        """What field k makes material (c,), where an earlier field did not already; in a blank face (m,) it is a joint,
        as stripes end at that."""
        new = material & self.void
        joint = (material & ~new & self.again) | (new & blank[self.parent])
        family, also = np.where(new, k, self.family), np.where(joint, k, self.also)
        return replace(self, family=family, also=also)

    @property
    def void(self) -> Bools:
        """(c,) polygons that no field made material."""
        return np.asarray(self.family == VOID)

    @property
    def material_area(self) -> float:
        """Square metres of the polygons that are not void."""
        return float(self.cells.areas(self.X)[0][~self.void].sum())

    @cached_property
    def face(self) -> Ints:
        """(h,) the parent face of each slot."""
        return np.asarray(self.parent[self.cells.owner])

    @cached_property
    def support(self) -> Ints:
        """(n',) for each vertex one of the uncut vertices that it lies between."""
        return np.asarray(self.weights.indices[self.weights.indptr[:-1]])

    def after(self, split: Split) -> "PolygonMesh":
        """The mesh that a split makes of this one."""
        weights = extended_weights(self.weights, split)
        source = split.source
        X, parent, family = split.extended(self.X), self.parent[source], self.family[source]
        return PolygonMesh(self.F, split.cells, X, weights, parent, family, self.again[source], self.also[source])

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints, Ints]:
        """(p,) slots of both sides of each inner edge, and the slot of the second polygon where the first begins."""
        a, b = self.cells.corner, self.cells.ahead(self.cells.corner)
        order, _, edge = grouped(np.minimum(a, b) * len(self.X) + np.maximum(a, b))
        pair = np.flatnonzero(np.diff(edge[order]) == 0)
        one, two = order[pair], order[pair + 1]
        return one, two, np.where(a[one] == a[two], two, self.cells.following[two])

    @cached_property
    def beyond(self) -> Ints:
        """(h,) the polygon across each side, or -1."""
        one, two, _ = self.neighbours
        owner, found = self.cells.owner, np.full(len(self.cells.corner), -1)
        found[one], found[two] = owner[two], owner[one]
        return found

    def parts(self, marked: Bools) -> Ints:
        """(c,) the part of each marked polygon, -1 of the others: those that sides between marked ones connect."""
        one, two, _ = self.neighbours
        f, g = self.cells.owner[one], self.cells.owner[two]
        both = marked[f] & marked[g]
        label = connected(len(marked), f[both], g[both])[1]
        label[~marked] = -1
        return label

    @cached_property
    def _corners(self) -> Ints:
        """(3, m) the faces of the uncut surface, corner by corner."""
        return np.ascontiguousarray(self.F.T)

    def corner(self, face: Ints, vertex: Ints) -> Ints:
        """(k,) the place in `face` (k,) of uncut vertices (k,), which must be corners of it."""
        _, second, third = self._corners
        return np.asarray((second[face] == vertex) + 2 * (third[face] == vertex))


def places(F: Ints, vertex: Ints) -> Ints:
    """(k,) the places in faces (k, 3) of their corners `vertex` (k,)."""
    _, second, third = F.T
    return np.asarray((second == vertex) + 2 * (third == vertex))


def extended_weights(weights: csr_array, split: Split) -> csr_array:
    """Rows (n' + k, n) for the new vertices of a split below the old ones: at most three entries, all of one face."""
    new = split.blend(weights.shape[0]) @ weights
    data, indices = (np.concatenate([getattr(part, name) for part in (weights, new)]) for name in ("data", "indices"))
    begins = np.concatenate([weights.indptr, weights.indptr[-1] + new.indptr[1:]])
    return csr_array((data, indices, begins), shape=(weights.shape[0] + new.shape[0], weights.shape[1]))
