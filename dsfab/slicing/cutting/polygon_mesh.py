"""A surface that a cut divides into convex polygons, and the contacts between its parts."""

import dataclasses
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups, sorted_order
from dsfab.slicing.cutting.cells import Cells
from dsfab.slicing.cutting.sheet import VOID, CutLines, LineKind, Sheet
from dsfab.slicing.cutting.split import Split
from dsfab.surface import Surface
from dsfab.surface.fields import DividedSurface
from dsfab.surface.topology import link_components


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Convex polygons on vertices X (n', 3), metres.
    F       : (m, 3) faces of the uncut surface.
    weights : (n', n) barycentric weights of the vertices on the uncut vertices.
    parent  : (c,) uncut face of each polygon.    family : (c,) number of the field with material here, or `VOID`.
    again   : (c,) mask of material that is cut again by the next fields.
    also    : (c,) number of a second field with material in the polygon, or `VOID`.
    stubs   : number of removed and straightened stripes.    lines : lines to which `Cells.sides_on` refers."""

    F: Ints
    cells: Cells
    X: Floats
    weights: csr_array
    parent: Ints
    family: Ints
    again: Bools
    also: Ints
    stubs: int = 0
    lines: CutLines = dataclasses.field(default_factory=CutLines.first_three)

    @classmethod
    def from_surface(cls, surface: Surface, divided: DividedSurface | None = None) -> Self:
        """Return the faces of a surface, or the parts of its faces in `divided`, as polygons without material."""
        if divided:
            parts = divided.surface
            cells, family = Cells.triangles(parts.F, _rim(parts)), np.full(parts.m, VOID)
            return cls.from_cells(surface.F, cells, parts.V, divided.weights, divided.parent, family)
        n, m = surface.n, surface.m
        cells, weights = Cells.triangles(surface.F, _rim(surface)), csr_array(eye_array(n))
        return cls.from_cells(surface.F, cells, surface.V, weights, np.arange(m), np.full(m, VOID))

    @classmethod
    def from_sheet(cls, sheet: Sheet) -> Self:
        """Return the cells of a sheet as polygons."""
        F, V = sheet.surface.F, sheet.surface.V
        return cls.from_cells(F, Cells.triangles(F), V, sheet.weights, sheet.parent, sheet.family).with_lines_of(sheet)

    def with_lines_of(self, sheet: Sheet) -> Self:
        """Return this mesh with the cut lines of a sheet. Triangle i of the sheet must be polygon i."""
        return replace(self, cells=Cells.triangles(sheet.surface.F, sheet.sides_on), lines=sheet.lines)

    @classmethod
    def from_cells(cls, F: Ints, cells: Cells, X: Floats, weights: csr_array, parent: Ints, family: Ints) -> Self:
        """Return a mesh in which no polygon is material of two fields."""
        count = len(family)
        return cls(F, cells, X, weights, parent, family, np.zeros(count, dtype=bool), np.full(count, VOID))

    def with_material(self, k: int, material: Bools, blank: Bools) -> Self:
        """Return the mesh with added material (c,) of field k. blank : (m,) mask of faces without a value of field k.
        `also` becomes k where two fields have material, and in new material of `blank` faces."""
        new_material = material & self.void
        joint = (material & ~new_material & self.again) | (new_material & blank[self.parent])
        family, also = np.where(new_material, k, self.family), np.where(joint, k, self.also)
        return replace(self, family=family, also=also)

    @property
    def void(self) -> Bools:
        """(c,) mask of the void polygons."""
        return np.asarray(self.family == VOID)

    @property
    def material_area(self) -> float:
        """Area of the material, square metres."""
        return float(self.cells.areas(self.X)[0][~self.void].sum())

    @cached_property
    def face(self) -> Ints:
        """(h,) the parent face of each polygon corner."""
        return np.asarray(self.parent[self.cells.owner])

    @cached_property
    def support(self) -> Ints:
        """(n',) for each vertex, a corner of the uncut edge or face that contains the vertex."""
        return np.asarray(self.weights.indices[self.weights.indptr[:-1]])

    def after_split(self, split: Split, lines: Ints | None = None) -> "PolygonMesh":
        """Return the mesh after a split. lines : (l or 1, c' or 1) rows in `CutLines` for the new sides, or None."""
        weights = weights_after_split(self.weights, split)
        cells = split.cells.with_new_lines(np.zeros((1, 1), dtype=np.int64) if lines is None else lines)
        names, source = ("parent", "family", "again", "also"), split.source
        columns = {name: getattr(self, name)[source] for name in names}
        return replace(self, cells=cells, X=split.with_new_values(self.X), weights=weights, **columns)

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints, Ints]:
        """For each inner edge, three indices into `Cells.corner`, as arrays (p,).
        First: start of the edge in its first polygon. Second: start of the edge in its second polygon.
        Third: corner of the second polygon at the vertex of the first array."""
        a, b = self.cells.corner, self.cells.next_values(self.cells.corner)
        order, _, edge = equal_key_groups(np.minimum(a, b) * len(self.X) + np.maximum(a, b))
        pair = np.flatnonzero(np.diff(edge[order]) == 0)
        slot_a, slot_b = order[pair], order[pair + 1]
        return slot_a, slot_b, np.where(a[slot_a] == a[slot_b], slot_b, self.cells.following[slot_b])

    @cached_property
    def polygon_across(self) -> Ints:
        """(h,) the neighbouring polygon at each polygon side; -1 at the boundary."""
        slot_a, slot_b, _ = self.neighbours
        owner, polygon = self.cells.owner, np.full(len(self.cells.corner), -1)
        polygon[slot_a], polygon[slot_b] = owner[slot_b], owner[slot_a]
        return polygon

    def part_labels(self, marked: Bools) -> Ints:
        """Number the connected parts of the `marked` (c,) polygons. Return each polygon's part (c,); -1 if unmarked."""
        slot_a, slot_b, _ = self.neighbours
        f, g = self.cells.owner[slot_a], self.cells.owner[slot_b]
        joined = marked[f] & marked[g]
        label = link_components(len(marked), f[joined], g[joined])[1]
        label[~marked] = -1
        return label

    @cached_property
    def _corners(self) -> Ints:
        return np.ascontiguousarray(self.F.T)

    def corner(self, face: Ints, vertex: Ints) -> Ints:
        """Return for each face (k,) the number (k,), 0 to 2, of the corner that is at the vertex (k,)."""
        _, second, third = self._corners
        return np.asarray((second[face] == vertex) + 2 * (third[face] == vertex))


def _rim(surface: Surface) -> Ints:
    sides_on = np.zeros(3 * surface.m, dtype=np.int64)
    sides_on[surface.edges.outline] = LineKind.RIM
    return sides_on.reshape(-1, 3)


def corner_places(F: Ints, vertex: Ints) -> Ints:
    """Return for each face F (k, 3) the number (k,), 0 to 2, of the corner that is at `vertex` (k,)."""
    _, second, third = F.T
    return np.asarray((second == vertex) + 2 * (third == vertex))


def weights_after_split(weights: csr_array, split: Split) -> csr_array:
    """Append the barycentric weights (k, n) of a split's new vertices to the weights (n', n) of its old vertices."""
    new_weights = split.new_weights(weights.shape[0]) @ weights
    data, indices = (
        np.concatenate([getattr(part, name) for part in (weights, new_weights)]) for name in ("data", "indices")
    )
    begins = np.concatenate([weights.indptr, weights.indptr[-1] + new_weights.indptr[1:]])
    return csr_array((data, indices, begins), shape=(weights.shape[0] + new_weights.shape[0], weights.shape[1]))


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts between parts (p,) of a mesh: stretches (k,) of outline along which two parts touch.
    parts  : (k, 2) the two parts. -1 stands for the surface's boundary, or for a vertex at which stripes may end.
    length : (k,) length of each stretch, metres.
    links  : (l, 2) pairs of adjacent stretches on a part's outline. Stretch i has the number i on the outline of
             parts[i, 0], and the number i + k on the outline of parts[i, 1].
    around : (p,) length of each part's outline, metres."""

    parts: Ints
    length: Floats
    links: Ints
    around: Floats

    @classmethod
    def from_parts(cls, mesh: PolygonMesh, part: Ints, anchor: Bools) -> "Contacts":
        """Return the contacts between parts of a mesh. part : (c,) the part of each polygon.
        anchor : (n,) mask of uncut vertices where stripes may end."""
        slot_a, slot_b, _ = mesh.neighbours
        owner, cells = mesh.cells.owner, mesh.cells
        f, g = part[owner[slot_a]], part[owner[slot_b]]
        between = (f != g) & ~mesh.void[owner[slot_a]] & ~mesh.void[owner[slot_b]]
        rim = (mesh.polygon_across < 0) & ~mesh.void[owner]
        side = np.concatenate([slot_a[between], np.flatnonzero(rim)])
        part_a = np.concatenate([np.minimum(f, g)[between], part[owner[rim]]])
        part_b = np.concatenate([np.maximum(f, g)[between], np.full(int(rim.sum()), -1)])
        ends = np.stack([cells.corner[side], cells.corner[cells.following[side]]], axis=1)
        pair = np.unique(np.stack([part_a, part_b], axis=1), axis=0, return_inverse=True)[1].ravel()
        i, j = adjacent_sides(pair, ends, len(mesh.X))
        _, first_side, stretch_of_side = np.unique(
            link_components(len(side), i, j)[1], return_index=True, return_inverse=True
        )
        anchor_slots = np.flatnonzero(np.append(anchor, np.zeros(len(mesh.X) - len(anchor), dtype=bool))[cells.corner])
        anchor_slots = anchor_slots[~mesh.void[owner[anchor_slots]]]
        anchored = np.unique(part[owner[anchor_slots]])
        pairs = np.concatenate(
            [
                np.stack([part_a[first_side], part_b[first_side]], axis=1),
                np.stack([anchored, np.full(len(anchored), -1)], axis=1),
            ]
        )
        size = np.linalg.norm(mesh.X[cells.corner] - mesh.X[cells.next_values(cells.corner)], axis=1)
        outer = np.ones(len(owner), dtype=bool)
        within = f == g
        outer[slot_a[within]], outer[slot_b[within]] = False, False
        around = np.bincount(part[owner[outer]], size[outer], int(part.max()) + 1).astype(np.float64)
        length = np.concatenate(
            [np.bincount(stretch_of_side.ravel(), size[side], len(first_side)), np.zeros(len(anchored))]
        )
        inner = part_b >= 0
        whose = np.concatenate([part_a[inner], part_b[inner]])
        stretch = np.concatenate([stretch_of_side.ravel()[inner], stretch_of_side.ravel()[inner] + len(pairs)])
        i, j = adjacent_sides(whose, np.tile(ends[inner], (2, 1)), len(mesh.X))
        return cls(pairs, length, np.unique(np.stack([stretch[i], stretch[j]], axis=1), axis=0), around)

    def dead_ends(self, gone: Bools) -> Bools:
        """Return a mask (p,) of dead ends: parts with a single contact, shorter than half of the part's outline.
        gone : (p,) mask of removed parts."""
        part, _, length, row = self._remaining(gone)
        live = np.zeros(2 * len(self.parts), dtype=bool)
        live[row] = True
        i, j = self.links[live[self.links].all(axis=1)].T
        label = link_components(len(live), i, j)[1]
        place = np.unique(np.stack([part, label[row]], axis=1), axis=0)[:, 0]
        places = np.bincount(place, minlength=len(gone))
        return np.asarray((places == 1) & (np.bincount(part, length, len(gone)) < self.around / 2))

    def single_contacts(self, gone: Bools) -> tuple[Ints, Ints]:
        """Return the parts (k,) that touch only a single neighbour, along a single stretch, and the neighbours (k,).
        gone : (p,) mask of removed parts."""
        part, neighbour, _, _ = self._remaining(gone)
        is_single = (np.bincount(part, minlength=len(gone))[part] == 1) & (neighbour >= 0)
        return part[is_single], neighbour[is_single]

    def islands(self, before: Bools, gone: Bools, stays: Bools) -> Bools:
        """Return a mask (p,) of parts that a removal cuts off from surface edges, anchors, and parts in `stays` (p,).
        before, gone : (p,) masks of removed parts, before and after this removal."""
        return self._has_ground(before, stays) & ~self._has_ground(gone, stays) & ~gone

    def _has_ground(self, gone: Bools, stays: Bools) -> Bools:
        part, neighbour, _, _ = self._remaining(gone)
        inner = neighbour >= 0
        count, label = link_components(len(gone), part[inner], neighbour[inner])
        ground = np.zeros(count, dtype=bool)
        ground[label[part[~inner]]] = True
        ground[label[stays]] = True
        return np.asarray(ground[label])

    def _remaining(self, gone: Bools) -> tuple[Ints, Ints, Floats, Ints]:
        a, b = self.parts.T
        remaining = np.flatnonzero(~gone[a] & ((b < 0) | ~gone[b]))
        inner = remaining[b[remaining] >= 0]
        rows = np.concatenate([remaining, inner])
        part, neighbour = np.concatenate([a[remaining], b[inner]]), np.concatenate([b[remaining], a[inner]])
        return part, neighbour, self.length[rows], np.concatenate([remaining, inner + len(a)])


def adjacent_sides(group: Ints, ends: Ints, count: int) -> tuple[Ints, Ints]:
    """Return pairs of sides with the same group and a common vertex, as two arrays (l,) of side numbers.
    group : (k,) group of each side.    ends : (k, 2) vertices of each side.    count : number of vertices."""
    key = (group[:, None] * count + ends).ravel()
    order = sorted_order(key)
    meet = np.flatnonzero(np.diff(key[order]) == 0)
    return order[meet] // 2, order[meet + 1] // 2
