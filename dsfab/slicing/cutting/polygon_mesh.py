"""`PolygonMesh`: a surface divided into convex polygons between two cuts, and the contacts of its parts."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.arrays import Bools, Floats, Ints, grouped, sorted_order
from dsfab.slicing.cutting.cells import Cells
from dsfab.slicing.cutting.sheet import VOID
from dsfab.slicing.cutting.split import Split
from dsfab.surface import Surface
from dsfab.surface.fields import Divided
from dsfab.surface.topology import connected


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Polygons on vertices X (n', 3), their parent faces and families (c,), and the weights of the vertices.

    F     : (m, 3) the faces of the uncut surface.
    again : (c,) material that later fields divide too.
    also  : (c,) a second field that makes the same polygon material, at a crossing; else `VOID`.
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
        """Return the faces of a surface as void polygons, or the parts that `divided` makes of them."""
        if divided:
            parts = divided.surface
            cells, family = Cells.triangles(parts.F), np.full(parts.m, VOID)
            return cls.plain(surface.F, cells, parts.V, divided.weights, divided.parent, family)
        n, m = surface.n, surface.m
        cells, weights = Cells.triangles(surface.F), csr_array(eye_array(n))
        return cls.plain(surface.F, cells, surface.V, weights, np.arange(m), np.full(m, VOID))

    @classmethod
    def plain(cls, F: Ints, cells: Cells, X: Floats, weights: csr_array, parent: Ints, family: Ints) -> Self:
        """Return polygons with parent and family (c,) on X (n', 3), metres, without crossings."""
        count = len(family)
        return cls(F, cells, X, weights, parent, family, np.zeros(count, dtype=bool), np.full(count, VOID))

    def with_material(self, k: int, material: Bools, blank: Bools) -> Self:
        """Make polygons (c,) material of field k if they are void; in a blank face (m,) they become a joint, where
        stripes end.
        """
        new = material & self.void
        joint = (material & ~new & self.again) | (new & blank[self.parent])
        family, also = np.where(new, k, self.family), np.where(joint, k, self.also)
        return replace(self, family=family, also=also)

    @property
    def void(self) -> Bools:
        """(c,) mask of the void polygons."""
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
        """(n',) one of the uncut vertices that each vertex lies between."""
        return np.asarray(self.weights.indices[self.weights.indptr[:-1]])

    def after(self, split: Split) -> "PolygonMesh":
        """Return the mesh divided by a split."""
        weights = extended_weights(self.weights, split)
        source = split.source
        X, parent, family = split.extended(self.X), self.parent[source], self.family[source]
        return PolygonMesh(self.F, split.cells, X, weights, parent, family, self.again[source], self.also[source])

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints, Ints]:
        """(p,) slots of both sides of each inner edge, and the slot of the second polygon at the start of the first
        side.
        """
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
        """(c,) connected part of each marked polygon, -1 for the rest; parts connect across sides."""
        one, two, _ = self.neighbours
        f, g = self.cells.owner[one], self.cells.owner[two]
        both = marked[f] & marked[g]
        label = connected(len(marked), f[both], g[both])[1]
        label[~marked] = -1
        return label

    @cached_property
    def _corners(self) -> Ints:
        return np.ascontiguousarray(self.F.T)

    def corner(self, face: Ints, vertex: Ints) -> Ints:
        """(k,) position in `face` (k,) of the uncut vertices (k,), which must be its corners."""
        _, second, third = self._corners
        return np.asarray((second[face] == vertex) + 2 * (third[face] == vertex))


def places(F: Ints, vertex: Ints) -> Ints:
    """(k,) positions in faces (k, 3) of their corners `vertex` (k,)."""
    _, second, third = F.T
    return np.asarray((second == vertex) + 2 * (third == vertex))


def extended_weights(weights: csr_array, split: Split) -> csr_array:
    """Append rows for the new vertices of a split: (n' + k, n), at most three entries in a row, all of one face."""
    new = split.blend(weights.shape[0]) @ weights
    data, indices = (np.concatenate([getattr(part, name) for part in (weights, new)]) for name in ("data", "indices"))
    begins = np.concatenate([weights.indptr, weights.indptr[-1] + new.indptr[1:]])
    return csr_array((data, indices, begins), shape=(weights.shape[0] + new.shape[0], weights.shape[1]))


@dataclass(frozen=True, eq=False)
class Contacts:
    """Stretches of outline along which parts touch.

    parts  : (k, 2) both parts of each; the second is -1 for an edge of the surface or an anchor.
    length : (k,) metres.
    links  : (l, 2) consecutive stretches of one part; k is added to the number of a stretch seen from its second part.
    around : (p,) metres, the outline of each part.
    """

    parts: Ints
    length: Floats
    links: Ints
    around: Floats

    @classmethod
    def of(cls, mesh: PolygonMesh, part: Ints, anchor: Bools) -> "Contacts":
        """Return the contacts of parts (c,); consecutive sides between the same two parts make one stretch.

        anchor : (n,) uncut vertices at which stripes may end.
        """
        one, two, _ = mesh.neighbours
        owner, cells = mesh.cells.owner, mesh.cells
        f, g = part[owner[one]], part[owner[two]]
        between = (f != g) & ~mesh.void[owner[one]] & ~mesh.void[owner[two]]
        rim = (mesh.beyond < 0) & ~mesh.void[owner]
        side = np.concatenate([one[between], np.flatnonzero(rim)])
        first = np.concatenate([np.minimum(f, g)[between], part[owner[rim]]])
        second = np.concatenate([np.maximum(f, g)[between], np.full(int(rim.sum()), -1)])
        ends = np.stack([cells.corner[side], cells.corner[cells.following[side]]], axis=1)
        pair = np.unique(np.stack([first, second], axis=1), axis=0, return_inverse=True)[1].ravel()
        i, j = meeting(pair, ends, len(mesh.X))
        _, at, of = np.unique(connected(len(side), i, j)[1], return_index=True, return_inverse=True)
        held = np.flatnonzero(np.append(anchor, np.zeros(len(mesh.X) - len(anchor), dtype=bool))[cells.corner])
        held = held[~mesh.void[owner[held]]]
        anchored = np.unique(part[owner[held]])
        pairs = np.concatenate(
            [np.stack([first[at], second[at]], axis=1), np.stack([anchored, np.full(len(anchored), -1)], axis=1)]
        )
        size = np.linalg.norm(mesh.X[cells.corner] - mesh.X[cells.ahead(cells.corner)], axis=1)
        outer = np.ones(len(owner), dtype=bool)
        within = f == g
        outer[one[within]], outer[two[within]] = False, False
        around = np.bincount(part[owner[outer]], size[outer], int(part.max()) + 1).astype(np.float64)
        length = np.concatenate([np.bincount(of.ravel(), size[side], len(at)), np.zeros(len(anchored))])
        inner = second >= 0
        whose = np.concatenate([first[inner], second[inner]])
        stretch = np.concatenate([of.ravel()[inner], of.ravel()[inner] + len(pairs)])
        i, j = meeting(whose, np.tile(ends[inner], (2, 1)), len(mesh.X))
        return cls(pairs, length, np.unique(np.stack([stretch[i], stretch[j]], axis=1), axis=0), around)

    def ending(self, gone: Bools) -> Bools:
        """(p,) parts that touch others, or an edge of the surface, at one place, along less than half their outline.

        Consecutive stretches count as one place. For example, a stripe that ends in the corner between two others has
        one.
        gone : (p,) parts that are removed already.
        """
        part, _, length, row = self._left(gone)
        live = np.zeros(2 * len(self.parts), dtype=bool)
        live[row] = True
        i, j = self.links[live[self.links].all(axis=1)].T
        label = connected(len(live), i, j)[1]
        place = np.unique(np.stack([part, label[row]], axis=1), axis=0)[:, 0]
        places = np.bincount(place, minlength=len(gone))
        return np.asarray((places == 1) & (np.bincount(part, length, len(gone)) < self.around / 2))

    def single(self, gone: Bools) -> tuple[Ints, Ints]:
        """(k,) parts that touch nothing but one other part along one stretch, and (k,) that part."""
        part, other, _, _ = self._left(gone)
        alone = (np.bincount(part, minlength=len(gone))[part] == 1) & (other >= 0)
        return part[alone], other[alone]

    def islands(self, before: Bools, gone: Bools, stays: Bools) -> Bools:
        """(p,) parts that the last removal disconnected from all supports: parts that stay, edges and anchors."""
        return self._grounded(before, stays) & ~self._grounded(gone, stays) & ~gone

    def _grounded(self, gone: Bools, stays: Bools) -> Bools:
        part, other, _, _ = self._left(gone)
        inner = other >= 0
        count, label = connected(len(gone), part[inner], other[inner])
        ground = np.zeros(count, dtype=bool)
        ground[label[part[~inner]]] = True
        ground[label[stays]] = True
        return np.asarray(ground[label])

    def _left(self, gone: Bools) -> tuple[Ints, Ints, Floats, Ints]:
        """The remaining contacts from both sides: part, neighbour, metres, and the number as in `links`."""
        a, b = self.parts.T
        here = np.flatnonzero(~gone[a] & ((b < 0) | ~gone[b]))
        both = here[b[here] >= 0]
        rows = np.concatenate([here, both])
        part, other = np.concatenate([a[here], b[both]]), np.concatenate([b[here], a[both]])
        return part, other, self.length[rows], np.concatenate([here, both + len(a)])


def meeting(group: Ints, ends: Ints, count: int) -> tuple[Ints, Ints]:
    """Pairs (l,), (l,) of sides of the same group (k,) that share one of their ends (k, 2), vertices below `count`."""
    key = (group[:, None] * count + ends).ravel()
    order = sorted_order(key)
    meet = np.flatnonzero(np.diff(key[order]) == 0)
    return order[meet] // 2, order[meet + 1] // 2
