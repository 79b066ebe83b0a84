"""Split polygons along level lines of a field."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups, sorted_order
from dsfab.slicing.cutting.cells import SNAP_FLOOR, Cells, nearest_levels, snap_values
from dsfab.surface.mesh import ZERO_AREA


@dataclass(frozen=True, eq=False)
class Split:
    """Polygons after a split. The old vertices come first, then the new vertices (k,).
    cells  : the new polygons. `sides_on` is -1 - l for a side on level l.
    source : (c',) the old polygon that contains each new polygon.
    strip  : (c',) number of levels below each new polygon; -1 for polygons that were not to be split.
    low, high, t : (k,) a new vertex lies at (1 - t) low + t high, 0 < t < 1.
    side, level  : (k,) old polygon side that contains each new vertex, and the field's value at the vertex."""

    cells: Cells
    source: Ints
    strip: Ints
    low: Ints
    high: Ints
    t: Floats
    side: Ints
    level: Floats

    @classmethod
    def unchanged(cls, cells: Cells, active: Bools) -> "Split":
        """Return a split without cuts. `strip` is 0 for the polygons `active` (c,), and -1 for all further polygons."""
        no_index, no_value = np.empty(0, dtype=np.int64), np.empty(0)
        new_vertices = _NewVertices(no_index, no_index, no_value, no_index, no_value)
        return cls(cells, np.arange(len(cells.sizes)), np.where(active, 0, -1), *new_vertices)

    def with_new_values(self, values: Floats) -> Floats:
        """Append interpolated values at the new vertices to values (n, ...) at the old vertices."""
        t = self.t.reshape(-1, *[1] * (values.ndim - 1))
        return np.concatenate([values, (1 - t) * values[self.low] + t * values[self.high]])

    def new_weights(self, n: int) -> csr_array:
        """Return sparse weights (k, n) of the new vertices on the n old vertices."""
        k = len(self.t)
        data = np.stack([1 - self.t, self.t], axis=1).ravel()
        columns = np.stack([self.low, self.high], axis=1).ravel()
        return csr_array((data, columns, np.arange(0, 2 * k + 1, 2)), shape=(k, n))


@dataclass(frozen=True, eq=False)
class SideValues:
    """Values (h,) of a field at the start and the end of every polygon side.
    foreign : (k,) sides of polygons without a field value.    own : (h,) the field at the polygon corners."""

    start: Floats
    end: Floats
    foreign: Ints
    own: Floats

    @classmethod
    def from_vertices(cls, cells: Cells, x: Floats) -> "SideValues":
        """Return the values at the start and the end of each side. x : (n,) values of the field at the vertices."""
        return cls.from_slots(cells, x[cells.corner])

    @classmethod
    def from_slots(cls, cells: Cells, y: Floats, foreign: Bools | None = None) -> "SideValues":
        """Return values at the two ends of each side. y : (h,) field at the polygon corners.
        foreign : (h,) mask of sides without a value; they take the values of the neighbouring polygon."""
        if foreign is None or not foreign.any():
            return cls(y, cells.next_values(y), np.empty(0, dtype=np.int64), y)
        start, end = y.copy(), cells.next_values(y)
        ends = end.copy()
        a, b = cells.corner, cells.next_values(cells.corner)
        which = np.flatnonzero(foreign)
        touched = np.zeros(int(a.max()) + 1, dtype=bool)
        touched[a[which]] = touched[b[which]] = True
        candidates = np.flatnonzero(touched[a] & touched[b])  # only these sides can share an edge with sides in `which`
        p, q = a[candidates], b[candidates]
        order, begins, edge = equal_key_groups(np.minimum(p, q) * len(touched) + np.maximum(p, q))
        first_slot = np.minimum.reduceat(np.where(foreign[candidates], len(a), candidates)[order], begins)[edge]
        mate = first_slot[foreign[candidates]]
        unpaired = mate == len(a)
        start[which[unpaired]] = end[which[unpaired]] = y[~foreign].min(initial=0.0)
        paired, mate = which[~unpaired], mate[~unpaired]
        same_direction = a[paired] == a[mate]
        start[paired] = np.where(same_direction, y[mate], ends[mate])
        end[paired] = np.where(same_direction, ends[mate], y[mate])
        return cls(start, end, which, y)

    def places(self, cells: Cells, levels: Floats, only: Ints | None = None) -> tuple[Ints, Ints]:
        """Return the positions among the levels (k,) of the field values at side starts (h,) and side ends (h,).
        A position is 2 j + 1 on level j, and 2 j between levels j - 1 and j.
        only : numbers of sides to evaluate; all further sides get 0."""
        if only is not None:
            start, end = np.zeros((2, len(self.start)), dtype=np.int64)
            start[only], end[only] = _level_places(self.start[only], levels), _level_places(self.end[only], levels)
            return start, end
        slot_places = _level_places(self.own, levels)
        start, end = slot_places, cells.next_values(slot_places)
        if len(self.foreign):
            start = slot_places.copy()
            start[self.foreign] = _level_places(self.start[self.foreign], levels)
            end[self.foreign] = _level_places(self.end[self.foreign], levels)
        return start, end


@dataclass(frozen=True, eq=False)
class _Sides:
    """Crossings of polygon sides (h,) with the levels of a field.
    low   : (h,) number of the lowest level on each side.    count : (h,) number of levels that cross the side.
    first : (h,) number of the new vertex nearest to the lower end.

        lower end o------x-------x----o higher end      low = 2, count = 2, new vertices first + 0, first + 1
                     2   |   3   |  4                   strips 2, 3, 4: with 2, 3, 4 levels below
                      levels[2] levels[3]"""

    low: Ints
    count: Ints
    first: Ints
    up: Bools
    flat: Bools
    along: Bools

    def subset(self, slots: Ints) -> "_Sides":
        return _Sides(*(getattr(self, field.name)[slots] for field in fields(self)))


class _NewVertices(NamedTuple):
    low: Ints
    high: Ints
    t: Floats
    side: Ints
    level: Floats


def split_cells(
    cells: Cells,
    n: int,
    x: SideValues,
    levels: Floats,
    active: Bools,
    above: Bools | None = None,
    live: Bools | None = None,
) -> Split:
    """Cut the active polygons by straight chords along level lines of a field.
    levels : (l,) strictly ascending.    active : (c,) polygons to cut.
    above  : (l,) True if a polygon on this level belongs to the strip above. Default: True for odd l.
    live   : (h,) mask of sides that get new vertices even without an active polygon.    n : number of vertices."""
    above = np.arange(len(levels)) % 2 == 1 if above is None else above
    only = None
    if live is not None and not active.any():  # only polygons with a side in `live` can change
        only = cells.slots(np.flatnonzero(cells.per_polygon(np.logical_or, live)))
    ends = x.places(cells, levels, only)
    lowest, highest = (cells.per_polygon(np.minimum, ends[0]) + 1) // 2, cells.per_polygon(np.maximum, ends[0]) // 2
    if len(x.foreign):
        lowest = np.minimum(lowest, (cells.per_polygon(np.minimum, ends[1]) + 1) // 2)
        highest = np.maximum(highest, cells.per_polygon(np.maximum, ends[1]) // 2)
    # `strip`: number of levels below each uncut polygon; cut polygons get a value later
    strip = np.where(highest < lowest, highest + above[np.minimum(highest, len(levels) - 1)], lowest)
    strip[~active] = -1
    sides_on, which = _sides_on_levels(cells, ends, active), np.flatnonzero(highest > lowest)
    slots = cells.slots(which)
    crossed = Cells(np.concatenate([[0], np.cumsum(cells.sizes[which])]), cells.corner[slots], sides_on[slots])
    sides, new_vertices = _sides(crossed, n, x, levels, active[which], slots, ends, live)
    cut = active[which] | (crossed.per_polygon(np.maximum, sides.count) > 0)
    if not cut.all():
        kept_rows = np.flatnonzero(cut)
        sides, crossed, which = sides.subset(crossed.slots(kept_rows)), crossed.subset(kept_rows), which[kept_rows]
    part, label = _with_new_corners(crossed, sides)
    label[~active[which][part.owner]] = -1
    return _with_pieces(cells, sides_on, strip, which, _strip_polygons(part, label, len(levels)), new_vertices)


def _sides_on_levels(cells: Cells, ends: tuple[Ints, Ints], active: Bools) -> Ints:
    side = np.flatnonzero((ends[0] == ends[1]) & (ends[0] % 2 == 1) & (cells.sides_on == 0))
    side, sides_on = side[active[cells.owner[side]]], cells.sides_on.copy()
    sides_on[side] = -1 - ends[0][side] // 2
    return sides_on


def _level_places(x: Floats, levels: Floats) -> Ints:
    below = np.searchsorted(levels, x)
    return np.asarray(2 * below + (levels[np.minimum(below, len(levels) - 1)] == x))


def _sides(
    cells: Cells,
    n: int,
    x: SideValues,
    levels: Floats,
    active: Bools,
    slots: Ints,
    places: tuple[Ints, Ints],
    live: Bools | None,
) -> tuple[_Sides, _NewVertices]:
    a, b = cells.corner, cells.next_values(cells.corner)
    start, end, start_place, end_place = x.start[slots], x.end[slots], places[0][slots], places[1][slots]
    up = start < end
    low, high = (np.minimum(start_place, end_place) + 1) // 2, np.maximum(start_place, end_place) // 2
    crossed = np.flatnonzero(high > low)
    p, q = a[crossed], b[crossed]
    order, begins, edge = equal_key_groups(np.minimum(p, q) * n + np.maximum(p, q))
    first_sides = crossed[order[begins]]
    gets_vertices = active[cells.owner[crossed]]
    if live is not None:
        gets_vertices = gets_vertices | live[slots[crossed]]
    if len(x.foreign) and len(first_sides):  # an edge takes field values from its first polygon with values
        foreign = np.zeros(len(x.start), dtype=bool)
        foreign[x.foreign] = True
        rank = np.where(foreign[slots[crossed]], len(a), 0) + np.arange(len(crossed))
        first_sides = crossed[np.minimum.reduceat(rank[order], begins) % len(a)]
    cut = np.logical_or.reduceat(gets_vertices[order], begins) if len(first_sides) else first_sides > 0
    levels_on = np.where(cut, high[first_sides] - low[first_sides], 0)
    begin = np.cumsum(levels_on) - levels_on
    edge_of_vertex = np.repeat(np.arange(len(first_sides)), levels_on)
    value = levels[low[first_sides][edge_of_vertex] + np.arange(len(edge_of_vertex)) - begin[edge_of_vertex]]
    p, q, low_value, high_value = (
        np.where(up[first_sides], pair[0][first_sides], pair[1][first_sides])[edge_of_vertex]
        for pair in ((a, b), (b, a), (start, end), (end, start))
    )
    count, first_vertex, along = np.zeros_like(a), np.zeros_like(a), up.copy()
    count[crossed], first_vertex[crossed] = levels_on[edge], n + begin[edge]
    along[crossed] = a[crossed] == np.where(up[first_sides], a[first_sides], b[first_sides])[edge]
    sides = _Sides(low, count, first_vertex, up, high < low, along)
    return sides, _NewVertices(
        p, q, (value - low_value) / (high_value - low_value), slots[first_sides][edge_of_vertex], value
    )


def _with_new_corners(cells: Cells, sides: _Sides) -> tuple[Cells, Ints]:
    count = sides.count + 1
    offset = np.concatenate([[0], np.cumsum(count)])
    side = np.repeat(np.arange(len(count)), count)
    step = np.arange(offset[-1]) - offset[side]  # 0 at a corner of the old polygon, then 1, 2, ... at new vertices
    climbed = np.where(sides.up[side], step, sides.count[side] - step)
    corner = sides.first[side] + np.where(sides.along[side], step - 1, sides.count[side] - step)
    corner[offset[:-1]] = cells.corner
    strip, divided = sides.low[side] + climbed, Cells(offset[cells.start], corner, cells.sides_on[side])
    return divided, _flat_sides_relabelled(divided, strip, sides.flat[side])


def _flat_sides_relabelled(cells: Cells, strip: Ints, flat: Bools) -> Ints:
    if not flat.any():
        return strip
    slot = np.where(flat, -1, np.arange(len(strip)))
    source = np.maximum.accumulate(slot)
    before = source < cells.start[:-1][cells.owner]  # flat sides at the start copy the last non-flat side
    source[before] = cells.per_polygon(np.maximum, slot)[cells.owner[before]]
    return np.asarray(strip[source])


def _strip_polygons(sides: Cells, strip: Ints, level_count: int) -> tuple[Cells, Ints, Ints]:
    key = sides.owner * (level_count + 2) + strip + 1
    order = sorted_order(key)
    leaves = (strip[sides.following] != strip)[order]
    position = np.cumsum(1 + leaves) - (1 + leaves)
    corner = np.empty(len(order) + int(leaves.sum()), dtype=np.int64)
    sides_on = np.empty_like(corner)
    corner[position], sides_on[position] = sides.corner[order], sides.sides_on[order]
    chord, following = position[leaves] + 1, sides.following[order[leaves]]
    corner[chord] = sides.corner[following]
    sides_on[chord] = -1 - np.minimum(strip[following], strip[order[leaves]])
    begins = np.flatnonzero(np.diff(key[order], prepend=-1))
    group = key[order][begins]
    start = np.append(position[begins], len(corner))
    return Cells(start, corner, sides_on), group // (level_count + 2), group % (level_count + 2) - 1


def _with_pieces(
    cells: Cells,
    sides_on: Ints,
    strip: Ints,
    which: Ints,
    pieces_of_split: tuple[Cells, Ints, Ints],
    new_vertices: _NewVertices,
) -> Split:
    pieces, row, label = pieces_of_split
    count = np.ones(len(strip), dtype=np.int64)
    count[which] = np.bincount(row, minlength=len(which))
    replaced = np.zeros(len(strip), dtype=bool)
    replaced[which] = True
    source = np.repeat(np.arange(len(count)), count)
    replaced_cells = np.flatnonzero(replaced[source])
    strips, sizes = strip[source], cells.sizes[source]
    strips[replaced_cells], sizes[replaced_cells] = label, pieces.sizes
    start, begin = np.concatenate([[0], np.cumsum(sizes)]), cells.start[source]
    begin[replaced_cells] = len(cells.corner) + pieces.start[:-1]
    slots = np.repeat(begin - start[:-1], sizes) + np.arange(start[-1])
    corner, sides_on = (
        np.concatenate(pair)[slots] for pair in ((cells.corner, pieces.corner), (sides_on, pieces.sides_on))
    )
    return Split(Cells(start, corner, sides_on), source, strips, *new_vertices)


CELL_AREA = 1e3 * ZERO_AREA
"""Minimum area of a cell, divided by the squared size of the surface; 1000 times the limit of `Surface`."""
ROUNDS = 12  # Largest number of attempts to split polygons so that no cell has zero area.


class Snapping(NamedTuple):
    """Rules for moving values onto levels before a cut.
    fraction : largest move, as a fraction of the field's range on an edge.    size : size of the surface, metres.
    hold     : (k,) vertices with values that never move."""

    fraction: float
    size: float
    hold: Ints | None = None


def clean_split(
    cells: Cells, X: Floats, x: Floats, levels: Floats, active: Bools, snapping: Snapping, above: Bools | None = None
) -> Split:
    """Move values x (n,) at vertices X (n, 3) onto levels nearby, then split polygons.
    active, above : see `split_cells`.    snapping : limits of the moves."""
    snap, size, hold = snapping
    if not len(levels) or not active.any():
        return Split.unchanged(cells, active)
    free = np.ones(len(x), dtype=bool)
    free[[] if hold is None else hold] = False
    a, b = cells.sides(active)
    x = snap_values(x, levels, (a, b), np.abs(x[a] - x[b]), max(snap, SNAP_FLOOR), free)
    for _ in range(ROUNDS):
        split = split_cells(cells, len(x), SideValues.from_vertices(cells, x), levels, active, above)
        corners = collapsed_corners(split, split.with_new_values(X), size)
        corners = corners[corners < len(x)]
        stray = corners[(x[corners] != nearest_levels(x[corners], levels)) & free[corners]]
        if not len(stray):
            break
        x[stray] = nearest_levels(x[stray], levels)
    return split


def collapsed_corners(split: Split, X: Floats, size: float) -> Ints:
    """Return the vertices (k,) of new cells that have no area. X : (n, 3) vertices, m.    size : surface size, m."""
    divided = np.flatnonzero(np.bincount(split.source)[split.source] > 1)
    if not len(divided):
        return divided
    cells = split.cells.subset(divided)
    area, squared_reach = cells.areas(X)
    flat = 1e-12 * squared_reach  # a cell with a smaller area is flat: its corners lie on one line
    bad = area <= np.maximum(CELL_AREA * size**2, flat)
    return np.unique(cells.corner[bad[cells.owner]])
