"""Cut polygons along the stripes of a `CornerField`."""

import dataclasses
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups
from dsfab.slicing.cutting.cells import (
    SNAP_FLOOR,
    cells_without_edges,
    largest_ranges,
    nearest_levels,
    snap_value_pairs,
    snap_values,
)
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.split import ROUNDS, SideValues, Split, collapsed_corners, split_cells
from dsfab.surface.fields import CornerField


@dataclass(frozen=True, eq=False)
class PolygonField:
    """A `CornerField` (field with a sign and a shift in each face) at the vertices of polygons.
    values : (n', 1 or 2) field at the vertices.    lead : (n',) uncut face in which each vertex's values hold.
    sign, shift : (h,) for polygon corners: in the polygon's own uncut face, the field is sign * value + shift.
    blank  : (h,) True for polygon corners without a value."""

    mesh: PolygonMesh
    field: CornerField
    values: Floats
    lead: Ints
    sign: Floats
    shift: Floats
    blank: Bools

    @classmethod
    def from_field(cls, mesh: PolygonMesh, field: CornerField) -> Self:
        """Interpolate a `CornerField` to the vertices of a mesh of polygons."""
        corner, n = mesh.cells.corner, len(mesh.X)
        lead = np.zeros(n, dtype=np.int64)
        lead[corner[::-1]] = mesh.face[::-1]
        valid_slots = np.flatnonzero(~field.blank[mesh.face])[::-1]
        lead[corner[valid_slots]] = mesh.face[valid_slots]
        weights = mesh.weights
        row = np.repeat(np.arange(n), np.diff(weights.indptr))
        face, column = lead[row], weights.indices.astype(np.int64)
        place = 3 * face + mesh.corner(face, column)
        x, sign, shift = field.x[column], field.sign.ravel()[place], field.shift.ravel()[place]
        values = np.empty((n, x.shape[1]))
        for k in range(x.shape[1]):
            seen = np.where(sign > 0, x[:, k], -x[:, -1 - k]) + shift
            values[:, k] = np.bincount(row, weights.data * seen, n)
        return cls._from_leads(mesh, field, values, lead)

    @classmethod
    def _from_leads(cls, mesh: PolygonMesh, field: CornerField, values: Floats, lead: Ints) -> Self:
        face, sign, shift = mesh.face, np.ones(len(mesh.face)), np.zeros(len(mesh.face))
        turned_slots = np.flatnonzero(field.changed_faces[face] | field.changed_faces[lead][mesh.cells.corner])
        if len(turned_slots):
            vertex, slot_face = mesh.cells.corner[turned_slots], face[turned_slots]
            lead_face, support_vertex = lead[vertex], mesh.support[vertex]
            slot = 3 * slot_face + mesh.corner(slot_face, support_vertex)
            lead_slot = 3 * lead_face + mesh.corner(lead_face, support_vertex)
            sign[turned_slots] = field.sign.ravel()[slot] * field.sign.ravel()[lead_slot]
            shift[turned_slots] = field.shift.ravel()[slot] - sign[turned_slots] * field.shift.ravel()[lead_slot]
        return cls(mesh, field, values, lead, sign, shift, field.blank[face])

    def value_index(self, side: int) -> Ints:
        """Return indices (h,) into values.ravel() of z + d (side 0) or z - d (side 1): field z, stripe half-width d."""
        return self._lower if side else self._upper

    @cached_property
    def _upper(self) -> Ints:
        corner = self.mesh.cells.corner
        return corner if self.values.shape[1] == 1 else 2 * corner + (self.sign < 0)

    @cached_property
    def _lower(self) -> Ints:
        return self._upper if self.values.shape[1] == 1 else self._upper ^ 1

    def slot_values(self, side: int) -> Floats:
        """Return z + d (side 0) or z - d (side 1) at all polygon corners (h,): field z, stripe half-width d."""
        return self._slots[side]

    @cached_property
    def _slots(self) -> tuple[Floats, Floats]:
        upper = self._values_at(self._upper)
        return upper, upper if self.values.shape[1] == 1 else self._values_at(self._lower)

    def _values_at(self, entity: Ints) -> Floats:
        y = self.values.ravel()[entity]
        y *= self.sign
        y += self.shift
        return np.asarray(y)

    def with_values(self, values: Floats) -> "PolygonField":
        """Return the same field with other `values` (n', 1 or 2)."""
        if values is self.values:
            return self
        changed = replace(self, values=values)
        changed.__dict__.update({name: self.__dict__[name] for name in ("_upper", "_lower") if name in self.__dict__})
        return changed

    def side_values(self, side: int, foreign: Bools | None = None) -> SideValues:
        """Return z + d (side 0) or z - d (side 1) at the two ends of each polygon side: field z, half-width d.
        foreign : (h,) mask of polygon sides without a value."""
        return SideValues.from_slots(
            self.mesh.cells, self.slot_values(side), self.blank if foreign is None else foreign
        )

    def after_split(self, split: Split, side: int, lines: Ints) -> "PolygonField":
        """Return the field after a split along levels of z + d (side 0) or z - d (side 1): field z, half-width d.
        lines : (l, 1) row in `CutLines` for each level."""
        mesh, following = self.mesh.after_split(split, lines), self.mesh.cells.following
        cut = self.slot_values(side)
        up = cut[split.side] < cut[following[split.side]]
        low = np.where(up, split.side, following[split.side])
        high = np.where(up, following[split.side], split.side)
        new_values = np.empty((len(split.t), self.values.shape[1]))
        for k in range(new_values.shape[1]):
            y = self.slot_values(k)
            new_values[:, k] = split.level if k == side else (1 - split.t) * y[low] + split.t * y[high]
        lead = np.concatenate([self.lead, self.mesh.face[split.side]])
        return PolygonField._from_leads(mesh, self.field, np.concatenate([self.values, new_values]), lead)

    def turned_edges(self) -> tuple[Bools, Bools]:
        """Return two masks (h,) of polygon sides at edges where the field changes sign between two polygons.
        The first mask marks the side in the polygon with the lower number. The second mask marks the opposite side."""
        cells = self.mesh.cells
        a, b = cells.corner, cells.next_values(cells.corner)
        leading, second = np.zeros((2, len(a)), dtype=bool)
        turned = np.zeros(len(self.mesh.X), dtype=bool)
        turned[a[self.sign < 0]] = True
        candidates = np.flatnonzero(turned[a] | turned[b])
        if not len(candidates):
            return leading, second
        p, q = a[candidates], b[candidates]
        order, begins, edge = equal_key_groups(np.minimum(p, q) * len(turned) + np.maximum(p, q))
        valid_slots = np.where(self.blank[candidates], len(a), candidates)
        first_slot = np.minimum.reduceat(valid_slots[order], begins)[edge]
        later = ~self.blank[candidates] & (first_slot < candidates)
        later_slots, first_slots = candidates[later], first_slot[later]
        same_vertex = np.where(a[first_slots] == a[later_slots], first_slots, cells.following[first_slots])
        over = self.sign[same_vertex] * self.sign[later_slots] < 0
        second[later_slots[over]] = True
        leading[first_slots[over]] = True
        return leading, second


def corner_band(
    mesh: PolygonMesh, field: CornerField, levels: Floats, snaps: tuple[float, float], size: float, edges: Ints
) -> tuple[PolygonMesh, Bools]:
    """Cut the void polygons along the stripes of a field; return also a mask (c',) of the new material.
    snaps : largest moves of whole stripes, and of a single stripe edge, onto a vertex: fractions of a polygon side.
    edges : (l, 2) rows in `CutLines` of the lower and of the upper edge of the stripe at each level."""
    void = (mesh.void | mesh.again) & ~field.blank[mesh.parent]
    if field.wanted is not None and void.any():
        void &= _cells_to_cut(mesh, field.wanted)
    if not len(levels) or not void.any():
        return mesh, np.zeros(len(void), dtype=bool)
    seen = PolygonField.from_field(mesh, field)
    solid, empty = cells_without_edges(mesh.cells, np.stack([seen.slot_values(0), seen.slot_values(1)], axis=1), levels)
    cutting = StripeCut(seen, levels, snaps[1], size, void & ~solid & ~empty, void & solid, edges=edges)
    cutting = cutting.with_snapped_stripes(snaps[0])
    for side in (0, 1):
        cutting = cutting.with_turned_edges(side)
    cutting, above = cutting.cut_along_levels(0, above=False)
    cutting, below = cutting.cut_along_levels(1, above=True)
    mesh, material = cutting.seen.mesh, cutting.solid | (above[cutting.source] > below)
    return mesh, material | _nodes(mesh, field.blank, material)


def _nodes(mesh: PolygonMesh, blank: Bools, material: Bools) -> Bools:
    """Return a mask (c,) of void polygons without a field value that have material along over half of their outline."""
    inner = mesh.void & blank[mesh.parent]
    if not inner.any():
        return inner
    owner, corner, ahead = mesh.cells.owner, mesh.cells.corner, mesh.cells.next_values(mesh.cells.corner)
    touched = np.zeros(len(mesh.X), dtype=bool)
    touched[corner[inner[owner]]] = True
    candidates = np.flatnonzero(touched[corner] & touched[ahead])  # includes all sides of polygons in `inner`
    p, q, polygon = corner[candidates], ahead[candidates], owner[candidates]
    length = np.linalg.norm(mesh.X[p] - mesh.X[q], axis=1)
    order, begins, edge = equal_key_groups(np.minimum(p, q) * len(touched) + np.maximum(p, q))
    borders = np.add.reduceat(material[polygon][order].astype(np.int64), begins)[edge] > material[polygon]
    around, shared = np.bincount(polygon, length, len(inner)), np.bincount(polygon, length * borders, len(inner))
    return np.asarray(inner & (shared > 0.5 * around))


def _cells_to_cut(mesh: PolygonMesh, wanted_share: Floats) -> Bools:
    """Return a mask (c,) of polygons to cut. Stripes must be wanted on over half of the face or opening."""
    least = 0.5
    crossed = mesh.again & (wanted_share > least)[mesh.parent]
    if not mesh.void.any():
        return crossed
    opening = mesh.part_labels(mesh.void)
    in_opening = opening >= 0
    area = mesh.cells.areas(mesh.X)[0]
    total = np.bincount(opening[in_opening], area[in_opening])
    wanted_area = np.bincount(opening[in_opening], (area * wanted_share[mesh.parent])[in_opening])
    return np.asarray(crossed | (in_opening & (wanted_area > least * total)[opening]))


@dataclass(frozen=True, eq=False)
class StripeCut:
    """A cut along the stripes of a `CornerField`, in progress.
    seen   : the field on the polygons.
    tip    : largest move of a stripe edge onto a vertex, as a fraction of a polygon side.    size : of the surface, m.
    active : (c,) mask of polygons to cut.    solid : (c,) mask of polygons inside stripes.
    source : (c,) number of the polygon, before the last split, that contains each polygon.
    edges  : (l, 2) rows in `CutLines` of the two edges of the stripe at each level."""

    seen: PolygonField
    levels: Floats
    tip: float
    size: float
    active: Bools
    solid: Bools
    source: Ints | None = None
    edges: Ints = dataclasses.field(default_factory=lambda: np.zeros((1, 2), dtype=np.int64))

    def _side_ends(self, side: int) -> tuple[Ints, Ints, Floats]:
        place, y = self.seen.value_index(side), self.seen.slot_values(side)
        slots, next_slots = self._sides
        return place[slots], place[next_slots], np.abs(y[slots] - y[next_slots])

    @cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        cells = self.seen.mesh.cells
        slots = np.flatnonzero(self.active[cells.owner])
        return slots, cells.following[slots]

    def with_snapped_stripes(self, fraction: float) -> "StripeCut":
        """Move whole stripes so that their edges meet nearby vertices. fraction : largest move / polygon side."""
        values = self.seen.values
        reach = np.zeros(values.size)
        for side in (0, 1):
            a, b, difference = self._side_ends(side)
            reach = np.maximum(reach, largest_ranges(values.size, (a, b), difference))
        moved = snap_value_pairs(values, self.levels, reach.reshape(-1, 2), max(fraction, SNAP_FLOOR))
        return replace(self, seen=self.seen.with_values(moved))

    def with_snapped_values(self, side: int) -> "StripeCut":
        """Move stripe edges onto vertices that are very near. side : 0 for lower, 1 for upper edges of stripes."""
        x = self.seen.values.ravel()
        a, b, difference = self._side_ends(side)
        free = np.ones(len(x), dtype=bool)
        moved = snap_values(x, self.levels, (a, b), difference, max(self.tip, SNAP_FLOOR), free)
        return replace(self, seen=self.seen.with_values(moved.reshape(self.seen.values.shape)))

    def with_turned_edges(self, side: int) -> "StripeCut":
        """Add vertices where stripe edges cross mesh edges at which the field changes sign.
        side : 0 for lower edges of stripes, 1 for upper edges."""
        leading, second = self.seen.turned_edges()
        owner = self.seen.mesh.cells.owner
        if not self.active[owner[leading | second]].any():
            return self
        state = self.with_snapped_values(side)
        sides = state.seen.side_values(side, state.seen.blank | second)
        inactive = np.zeros(len(self.active), dtype=bool)
        live = leading | second
        split = split_cells(state.seen.mesh.cells, len(state.seen.mesh.X), sides, self.levels, inactive, live=live)
        return state._after_split(split, side)

    def cut_along_levels(self, side: int, above: bool) -> tuple["StripeCut", Ints]:
        """Cut the polygons `active` along the lower edges (side 0) or the upper edges (side 1) of stripes.
        Return also the number (c',) of levels below each polygon.
        above : True if a level counts as below a polygon that lies on the level."""
        state = self.with_snapped_values(side)
        for _ in range(ROUNDS):
            seen, mesh = state.seen, state.seen.mesh
            over = np.full(len(self.levels), above)
            split = split_cells(mesh.cells, len(mesh.X), seen.side_values(side), self.levels, self.active, over)
            corners = collapsed_corners(split, split.with_new_values(mesh.X), self.size)
            bad = np.zeros(len(mesh.X), dtype=bool)
            bad[corners[corners < len(mesh.X)]] = True
            place = np.unique(seen.value_index(side)[bad[mesh.cells.corner] & self.active[mesh.cells.owner]])
            x = seen.values.ravel().copy()
            stray = place[x[place] != nearest_levels(x[place], self.levels)]
            if not len(stray):
                break
            x[stray] = nearest_levels(x[stray], self.levels)
            state = replace(state, seen=seen.with_values(x.reshape(seen.values.shape)))
        return state._after_split(split, side), split.strip

    def _after_split(self, split: Split, side: int) -> "StripeCut":
        source = split.source
        seen = self.seen.after_split(split, side, self.edges[:, side : side + 1])
        return replace(self, seen=seen, active=self.active[source], solid=self.solid[source], source=source)
