"""Stripes of a `CornerField` cut out of polygons: as those of two plain fields, whoever sees them from which side."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.clean import ROUNDS, collapsed_corners
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.seen import Seen
from dsfab.slicing.snap import SNAP_FLOOR, nearest, ranges, settled_cells, snapped, snapped_together
from dsfab.slicing.split import Split, split_cells
from dsfab.surface.corner_field import CornerField

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
