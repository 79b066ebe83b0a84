"""Stripes of a corner field cut out of polygons, with each vertex evaluated once for all of its polygons."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.cutting.cells import SNAP_FLOOR, nearest, ranges, settled_cells, snapped, snapped_together
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.split import ROUNDS, SideValues, Split, collapsed_corners, split_cells
from dsfab.surface.fields import CornerField


@dataclass(frozen=True, eq=False)
class Seen:
    """A corner field on the vertices of a mesh of polygons.

    values : (n', 1 or 2) at each vertex, as the face `lead` (n',) sees them.
    sign, shift, blank : (h,) change of these values in the polygon of each slot; blank slots have no value.
    """

    mesh: PolygonMesh
    field: CornerField
    values: Floats
    lead: Ints
    sign: Floats
    shift: Floats
    blank: Bools

    @classmethod
    def of(cls, mesh: PolygonMesh, field: CornerField) -> Self:
        """Evaluate the field at each vertex, in the first face around it that has a phase."""
        corner, n = mesh.cells.corner, len(mesh.X)
        lead = np.zeros(n, dtype=np.int64)
        lead[corner[::-1]] = mesh.face[::-1]
        telling = np.flatnonzero(~field.blank[mesh.face])[::-1]
        lead[corner[telling]] = mesh.face[telling]
        weights = mesh.weights
        row = np.repeat(np.arange(n), np.diff(weights.indptr))
        face, column = lead[row], weights.indices.astype(np.int64)
        place = 3 * face + mesh.corner(face, column)
        x, sign, shift = field.x[column], field.sign.ravel()[place], field.shift.ravel()[place]
        values = np.empty((n, x.shape[1]))
        for k in range(x.shape[1]):
            seen = np.where(sign > 0, x[:, k], -x[:, -1 - k]) + shift
            values[:, k] = np.bincount(row, weights.data * seen, n)
        return cls._on(mesh, field, values, lead)

    @classmethod
    def _on(cls, mesh: PolygonMesh, field: CornerField, values: Floats, lead: Ints) -> Self:
        face, sign, shift = mesh.face, np.ones(len(mesh.face)), np.zeros(len(mesh.face))
        at = np.flatnonzero(field.turned[face] | field.turned[lead][mesh.cells.corner])  # elsewhere signs agree
        if len(at):
            vertex, here = mesh.cells.corner[at], face[at]
            there, stand = lead[vertex], mesh.support[vertex]
            slot, first = 3 * here + mesh.corner(here, stand), 3 * there + mesh.corner(there, stand)
            sign[at] = field.sign.ravel()[slot] * field.sign.ravel()[first]
            shift[at] = field.shift.ravel()[slot] - sign[at] * field.shift.ravel()[first]
        return cls(mesh, field, values, lead, sign, shift, field.blank[face])

    def entity(self, side: int) -> Ints:
        """(h,) index into values.ravel() of the upper (0) or lower (1) field at each slot."""
        return self._lower if side else self._upper

    @cached_property
    def _upper(self) -> Ints:
        corner = self.mesh.cells.corner
        return corner if self.values.shape[1] == 1 else 2 * corner + (self.sign < 0)

    @cached_property
    def _lower(self) -> Ints:
        return self._upper if self.values.shape[1] == 1 else self._upper ^ 1

    def slots(self, side: int) -> Floats:
        """(h,) the upper (0) or lower (1) field at the slots."""
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

    def with_values(self, values: Floats) -> "Seen":
        """Return the same field with other values (n', s) for one or two sides."""
        if values is self.values:
            return self
        other = replace(self, values=values)
        other.__dict__.update({name: self.__dict__[name] for name in ("_upper", "_lower") if name in self.__dict__})
        return other

    def sides(self, side: int, foreign: Bools | None = None) -> SideValues:
        """Return the field at both ends of every side; `foreign` (h,) marks slots without a value."""
        return SideValues.at(self.mesh.cells, self.slots(side), self.blank if foreign is None else foreign)

    def after(self, split: Split, side: int) -> "Seen":
        """Return the field on the mesh after a split by one of its sides; new vertices lie on levels exactly."""
        mesh, following = self.mesh.after(split), self.mesh.cells.following
        cut = self.slots(side)
        up = cut[split.side] < cut[following[split.side]]
        low = np.where(up, split.side, following[split.side])
        high = np.where(up, following[split.side], split.side)
        new = np.empty((len(split.t), self.values.shape[1]))
        for k in range(new.shape[1]):
            y = self.slots(k)
            new[:, k] = split.level if k == side else (1 - split.t) * y[low] + split.t * y[high]
        lead = np.concatenate([self.lead, self.mesh.face[split.side]])
        return Seen._on(mesh, self.field, np.concatenate([self.values, new]), lead)

    def turned_edges(self) -> tuple[Bools, Bools]:
        """(h,) sides on edges across which the field changes its sign: those of the first polygon, and of the
        second.
        """
        cells = self.mesh.cells
        a, b = cells.corner, cells.ahead(cells.corner)
        leading, second = np.zeros((2, len(a)), dtype=bool)
        turned = np.zeros(len(self.mesh.X), dtype=bool)
        turned[a[self.sign < 0]] = True
        near = np.flatnonzero(turned[a] | turned[b])
        if not len(near):
            return leading, second
        p, q = a[near], b[near]
        order, begins, edge = grouped(np.minimum(p, q) * len(turned) + np.maximum(p, q))
        telling = np.where(self.blank[near], len(a), near)
        first = np.minimum.reduceat(telling[order], begins)[edge]
        later = ~self.blank[near] & (first < near)
        some, mate = near[later], first[later]
        same = np.where(a[mate] == a[some], mate, cells.following[mate])
        over = self.sign[same] * self.sign[some] < 0
        second[some[over]] = True
        leading[mate[over]] = True
        return leading, second


def corner_band(
    mesh: PolygonMesh, field: CornerField, levels: Floats, snap: float, tip: float, size: float
) -> tuple[PolygonMesh, Bools]:
    """Cut the void polygons along the edges of the stripes of a corner field; return also the new material (c',).

    snap, tip : see `cut` and `TIP`.    size : of the surface, metres.

    If neighbours see the field with opposite signs, the upper edge of a stripe in one is the lower edge in the other.
    Such an edge of the mesh is divided by both fields before anything is cut, so that both find the same vertices.
    """
    void = (mesh.void | mesh.again) & ~field.blank[mesh.parent]
    if field.wanted is not None and void.any():
        void &= _wanted_cells(mesh, field.wanted)
    if not len(levels) or not void.any():
        return mesh, np.zeros(len(void), dtype=bool)
    seen = Seen.of(mesh, field)
    solid, empty = settled_cells(mesh.cells, np.stack([seen.slots(0), seen.slots(1)], axis=1), levels)
    cutting = Cutting(seen, levels, tip, size, void & ~solid & ~empty, void & solid)
    cutting = cutting.snapped(snap)
    for side in (0, 1):
        cutting = cutting.with_turned_edges(side)
    cutting, above = cutting.along(0, above=False)
    cutting, below = cutting.along(1, above=True)
    mesh, material = cutting.seen.mesh, cutting.solid | (above[cutting.source] > below)
    return mesh, material | _nodes(mesh, field.blank, material)


def _nodes(mesh: PolygonMesh, blank: Bools, material: Bools) -> Bools:
    """(c',) void polygons of blank faces with stripes along more than half of their outline: nodes of stripes."""
    inner = mesh.void & blank[mesh.parent]
    if not inner.any():
        return inner
    owner, corner, ahead = mesh.cells.owner, mesh.cells.corner, mesh.cells.ahead(mesh.cells.corner)
    on = np.zeros(len(mesh.X), dtype=bool)
    on[corner[inner[owner]]] = True
    near = np.flatnonzero(on[corner] & on[ahead])  # no other side is on an edge of these
    p, q, of = corner[near], ahead[near], owner[near]
    length = np.linalg.norm(mesh.X[p] - mesh.X[q], axis=1)
    order, begins, edge = grouped(np.minimum(p, q) * len(on) + np.maximum(p, q))
    borders = np.add.reduceat(material[of][order].astype(np.int64), begins)[edge] > material[of]
    around, shared = np.bincount(of, length, len(inner)), np.bincount(of, length * borders, len(inner))
    return np.asarray(inner & (shared > 0.5 * around))


def _wanted_cells(mesh: PolygonMesh, wanted: Floats) -> Bools:
    """(c,) polygons in openings with enough of a wanted share (m,), and on members between them that are cut again."""
    least = 0.5  # share of an opening in which the field is wanted
    crossed = mesh.again & (wanted > least)[mesh.parent]
    if not mesh.void.any():
        return crossed
    opening = mesh.parts(mesh.void)
    here = opening >= 0
    area = mesh.cells.areas(mesh.X)[0]
    total = np.bincount(opening[here], area[here])
    wishes = np.bincount(opening[here], (area * wanted[mesh.parent])[here])
    return np.asarray(crossed | (here & (wishes > least * total)[opening]))


@dataclass(frozen=True, eq=False)
class Cutting:
    """A corner field during a cut, with the polygons (c,) that are active or solid.

    source : (c,) the polygon that each was before the last split.
    """

    seen: Seen
    levels: Floats
    tip: float
    size: float
    active: Bools
    solid: Bools
    source: Ints | None = None

    def _ends(self, side: int) -> tuple[Ints, Ints, Floats]:
        """The value indices at both ends of the sides of active polygons, and their difference."""
        place, y = self.seen.entity(side), self.seen.slots(side)
        on, ahead = self._sides
        return place[on], place[ahead], np.abs(y[on] - y[ahead])

    @cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        cells = self.seen.mesh.cells
        on = np.flatnonzero(self.active[cells.owner])
        return on, cells.following[on]

    def snapped(self, fraction: float) -> "Cutting":
        """Move each stripe onto vertices near its edges, with its width unchanged."""
        values = self.seen.values
        reach = np.zeros(values.size)
        for side in (0, 1):
            a, b, difference = self._ends(side)
            reach = np.maximum(reach, ranges(values.size, (a, b), difference))
        moved = snapped_together(values, self.levels, reach.reshape(-1, 2), max(fraction, SNAP_FLOOR))
        return replace(self, seen=self.seen.with_values(moved))

    def tipped(self, side: int) -> "Cutting":
        """Move single values onto levels that they nearly meet."""
        x = self.seen.values.ravel()
        a, b, difference = self._ends(side)
        free = np.ones(len(x), dtype=bool)
        moved = snapped(x, self.levels, (a, b), difference, max(self.tip, SNAP_FLOOR), free)
        return replace(self, seen=self.seen.with_values(moved.reshape(self.seen.values.shape)))

    def with_turned_edges(self, side: int) -> "Cutting":
        """Add vertices on edges across which the field changes sign, at levels of the first polygon's field on
        `side`.
        """
        first, second = self.seen.turned_edges()
        owner = self.seen.mesh.cells.owner
        if not self.active[owner[first | second]].any():
            return self
        state = self.tipped(side)
        sides = state.seen.sides(side, state.seen.blank | second)
        nothing = np.zeros(len(self.active), dtype=bool)
        live = first | second
        split = split_cells(state.seen.mesh.cells, len(state.seen.mesh.X), sides, self.levels, nothing, live=live)
        return state._after(split, side)

    def along(self, side: int, above: bool) -> tuple["Cutting", Ints]:
        """Cut the active polygons along the levels of one side of the field; return also the number of levels below
        (c',).

        above : the strip of a polygon that lies on a level. Like `clean_split`, it leaves no polygon without area.
        """
        state = self.tipped(side)
        for _ in range(ROUNDS):
            seen, mesh = state.seen, state.seen.mesh
            over = np.full(len(self.levels), above)
            split = split_cells(mesh.cells, len(mesh.X), seen.sides(side), self.levels, self.active, over)
            corners = collapsed_corners(split, split.extended(mesh.X), self.size)
            bad = np.zeros(len(mesh.X), dtype=bool)
            bad[corners[corners < len(mesh.X)]] = True
            place = np.unique(seen.entity(side)[bad[mesh.cells.corner] & self.active[mesh.cells.owner]])
            x = seen.values.ravel().copy()
            stray = place[x[place] != nearest(x[place], self.levels)]
            if not len(stray):
                break
            x[stray] = nearest(x[stray], self.levels)
            state = replace(state, seen=seen.with_values(x.reshape(seen.values.shape)))
        return state._after(split, side), split.strip

    def _after(self, split: Split, side: int) -> "Cutting":
        source = split.source
        seen = self.seen.after(split, side)
        return replace(self, seen=seen, active=self.active[source], solid=self.solid[source], source=source)
