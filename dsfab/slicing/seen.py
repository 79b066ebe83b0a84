"""`Seen`: how the polygons of a cut see a `CornerField`, each vertex once, so that all of them are cut alike."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.split import SideValues, Split
from dsfab.surface.corner_field import CornerField


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
