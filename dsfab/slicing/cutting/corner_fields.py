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

    values : (n', 1 or 2) at each vertex, as the face `lead` (n',) of its own sees them.
    sign, shift, blank : (h,) how the polygon of each slot sees that.
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
        """Each vertex as the first face around it sees it in which the field means something."""
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
        at = np.flatnonzero(field.turned[face] | field.turned[lead][mesh.cells.corner])  # the others see it as it is
        if len(at):
            vertex, here = mesh.cells.corner[at], face[at]
            there, stand = lead[vertex], mesh.support[vertex]
            slot, first = 3 * here + mesh.corner(here, stand), 3 * there + mesh.corner(there, stand)
            sign[at] = field.sign.ravel()[slot] * field.sign.ravel()[first]
            shift[at] = field.shift.ravel()[slot] - sign[at] * field.shift.ravel()[first]
        return cls(mesh, field, values, lead, sign, shift, field.blank[face])

    def entity(self, side: int) -> Ints:
        """(h,) for each slot the place in values.ravel() of what it sees as the upper (0) or lower (1) field."""
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
        """The same with other values (n', s), one or two sides."""
        if values is self.values:
            return self
        other = replace(self, values=values)
        other.__dict__.update({name: self.__dict__[name] for name in ("_upper", "_lower") if name in self.__dict__})
        return other

    def sides(self, side: int, foreign: Bools | None = None) -> SideValues:
        """The field at both ends of every side; foreign: (h,) slots where it means nothing."""
        return SideValues.at(self.mesh.cells, self.slots(side), self.blank if foreign is None else foreign)

    def after(self, split: Split, side: int) -> "Seen":
        """The same on the mesh that a split by one of the two fields makes; its new vertices are on levels exactly."""
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
        """(h,) sides on whose edge the other polygon sees the field turned over: those of the first, of the second."""
        cells = self.mesh.cells
        a, b = cells.corner, cells.ahead(cells.corner)
        leading, second = np.zeros((2, len(a)), dtype=bool)
        turned = np.zeros(len(self.mesh.X), dtype=bool)
        turned[a[self.sign < 0]] = True
        near = np.flatnonzero(turned[a] | turned[b])  # all others are seen alike
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


NODE = 0.5
"""A polygon without a phase is material where more than this share of its outline borders on stripes."""
WANTED = 0.5
"""A field is drawn in an opening where it is wanted in more than this share of it."""


def corner_band(
    mesh: PolygonMesh, field: CornerField, levels: Floats, snap: float, tip: float, size: float
) -> tuple[PolygonMesh, Bools]:
    """The mesh with its void polygons cut along the edges of the stripes, and (c',) those that they make material.

    snap, tip : see `cut` and `TIP`.    size : of the surface, metres.

    Where neighbours see the field turned over, what is the upper edge of a stripe to one is the lower edge to the
    other. There the edge of the mesh is divided by both before anything is cut, so that both find the same vertices.
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
    """(c',) void polygons of blank faces that stripes enclose by more than half: there they meet in a node."""
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
    return np.asarray(inner & (shared > NODE * around))


def _wanted_cells(mesh: PolygonMesh, wanted: Floats) -> Bools:
    """(c,) polygons in the openings where a field is wanted, and on the members between them that are cut again."""
    crossed = mesh.again & (wanted > WANTED)[mesh.parent]
    if not mesh.void.any():
        return crossed
    opening = mesh.parts(mesh.void)
    here = opening >= 0
    area = mesh.cells.areas(mesh.X)[0]
    total = np.bincount(opening[here], area[here])
    wishes = np.bincount(opening[here], (area * wanted[mesh.parent])[here])
    return np.asarray(crossed | (here & (wishes > WANTED * total)[opening]))


@dataclass(frozen=True, eq=False)
class Cutting:
    """What is seen so far, and which polygons (c,) are to be cut or are material as they are.

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
        """Of the sides of the active polygons: the places of the values at both ends, and their difference."""
        place, y = self.seen.entity(side), self.seen.slots(side)
        on, ahead = self._sides
        return place[on], place[ahead], np.abs(y[on] - y[ahead])

    @cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        """The slots of the active polygons, and the next slot of each."""
        cells = self.seen.mesh.cells
        on = np.flatnonzero(self.active[cells.owner])
        return on, cells.following[on]

    def snapped(self, fraction: float) -> "Cutting":
        """Each stripe moved onto the vertices that it nearly meets, keeping its width."""
        values = self.seen.values
        reach = np.zeros(values.size)
        for side in (0, 1):
            a, b, difference = self._ends(side)
            reach = np.maximum(reach, ranges(values.size, (a, b), difference))
        moved = snapped_together(values, self.levels, reach.reshape(-1, 2), max(fraction, SNAP_FLOOR))
        return replace(self, seen=self.seen.with_values(moved))

    def tipped(self, side: int) -> "Cutting":
        """Single values moved onto the levels that they nearly meet."""
        x = self.seen.values.ravel()
        a, b, difference = self._ends(side)
        free = np.ones(len(x), dtype=bool)
        moved = snapped(x, self.levels, (a, b), difference, max(self.tip, SNAP_FLOOR), free)
        return replace(self, seen=self.seen.with_values(moved.reshape(self.seen.values.shape)))

    def with_turned_edges(self, side: int) -> "Cutting":
        """New vertices on edges across which the field is turned over, where its upper (0) or lower (1) field, as the
        first polygon sees it, meets a level."""
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
        """The active polygons cut where the upper or lower field meets a level, and (c',) how many levels are below.

        above : what a polygon on a level counts as. Like `clean_split`, it leaves no polygon without area.
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
