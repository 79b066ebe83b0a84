"""`Cells`: convex polygons on shared vertices, and their split along the level lines of one field.

The corners of all polygons lie in one array, counter-clockwise; slot s of it also names the side from corner s to the
next corner of the same polygon:

    start  = [0, 4, 7]                d --- c
    corner = [a b c d | b e c]        |     | \\        side 1 : b -> c of polygon 0
              0 1 2 3   4 5 6         |     |   e      side 6 : c -> b of polygon 1
    following = [1 2 3 0 5 6 4]       a --- b /
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, Ints, grouped, sorted_order


@dataclass(frozen=True, eq=False)
class Cells:
    """Polygons as (c + 1,) `start` and (h,) `corner`: polygon i has the corners corner[start[i] : start[i + 1]]."""

    start: Ints
    corner: Ints

    @classmethod
    def triangles(cls, F: Ints) -> "Cells":
        """The faces F (m, 3) as polygons."""
        return cls(np.arange(0, 3 * len(F) + 1, 3), F.ravel())

    @cached_property
    def sizes(self) -> Ints:
        """(c,) number of corners."""
        return np.diff(self.start)

    @cached_property
    def owner(self) -> Ints:
        """(h,) the polygon of each slot."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def following(self) -> Ints:
        """(h,) the next slot around the same polygon."""
        slot = np.arange(1, len(self.corner) + 1)
        slot[self.start[1:] - 1] = self.start[:-1]
        return slot

    def sides(self, active: Bools) -> tuple[Ints, Ints]:
        """First and last vertex of every side of the active polygons."""
        on = active[self.owner]
        return self.corner[on], self.corner[self.following[on]]

    def some(self, which: Ints) -> "Cells":
        """The polygons (k,) of this list alone."""
        sizes = self.sizes[which]
        start = np.concatenate([[0], np.cumsum(sizes)])
        return Cells(start, self.corner[np.repeat(self.start[which] - start[:-1], sizes) + np.arange(start[-1])])

    def areas(self, X: Floats) -> tuple[Floats, Floats]:
        """(c,) areas of the polygons, and (c,) the squared distance of the farthest corner from the first."""
        spoke = X[self.corner] - np.repeat(X[self.corner[self.start[:-1]]], self.sizes, axis=0)
        twice = np.add.reduceat(np.cross(spoke, spoke[self.following]), self.start[:-1])
        reach = np.maximum.reduceat(np.einsum("ij,ij->i", spoke, spoke), self.start[:-1])
        return 0.5 * np.linalg.norm(twice, axis=1), reach


@dataclass(frozen=True, eq=False)
class Split:
    """What `split_cells` gives.

    cells  : the new polygons, on the old vertices followed by the new ones.
    source : (c',) the old polygon that each new one is a part of.
    strip  : (c',) how many levels lie below a new polygon; -1 for those that were not to be cut.
    low, high, t : (k,) new vertex i lies at (1 - t) low + t high of two old vertices, 0 < t < 1.
    """

    cells: Cells
    source: Ints
    strip: Ints
    low: Ints
    high: Ints
    t: Floats

    def extended(self, old: Floats) -> Floats:
        """Values (n, ...) on the old vertices, followed by the interpolated ones on the new vertices."""
        t = self.t.reshape(-1, *[1] * (old.ndim - 1))
        return np.concatenate([old, (1 - t) * old[self.low] + t * old[self.high]])

    def blend(self, n: int) -> csr_array:
        """(k, n) sparse weights of the new vertices on the n old ones."""
        k = len(self.t)
        data = np.stack([1 - self.t, self.t], axis=1).ravel()
        columns = np.stack([self.low, self.high], axis=1).ravel()
        return csr_array((data, columns, np.arange(0, 2 * k + 1, 2)), shape=(k, n))


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where levels cross the edges of the active polygons; each edge once, so that its polygons share the new vertices.

    edge  : (h,) the edge of each side, -1 where no active polygon has it.
    low, high : (e,) its ends, the smaller value first.    up : (h,) whether a side runs from low to high.
    base  : (e,) how many levels are not above the low end: the strip in which the edge starts.
    count : (e,) how many levels lie strictly between the ends.    flat : (e,) whether it lies wholly on a level.

        low o------x-------x----o high        base = 2, count = 2, new vertices first + 0, first + 1
               2   |   3   |  4               strips 2, 3, 4
                levels[2] levels[3]
    """

    edge: Ints
    up: Bools
    low: Ints
    high: Ints
    base: Ints
    count: Ints
    flat: Bools


def split_cells(cells: Cells, x: Floats, levels: Floats, active: Bools, above: Bools | None = None) -> Split:
    """Cut the active polygons along every level of the field x (n,) on their vertices, each along straight chords.

    levels : (l,) strictly ascending. Polygons that are not active get the new vertices of the sides that they share
             with active ones, and stay whole. A side that lies on a level goes with the side before it.
    above  : (l,) whether a polygon that lies on a level with all its corners gets the strip above it or the one below;
             when left out, the even one of the two, which is void.
    """
    above = np.arange(len(levels)) % 2 == 1 if above is None else above
    crossings = _crossings(cells, x, levels, active)
    new = np.repeat(np.arange(len(crossings.low)), crossings.count)
    first = np.cumsum(crossings.count) - crossings.count
    value = levels[crossings.base[new] + np.arange(len(new)) - first[new]]
    low, high = crossings.low[new], crossings.high[new]
    t = (value - x[low]) / (x[high] - x[low])
    sides, strip = _subdivided_sides(cells, crossings, first + len(x))
    strip[~active[sides.owner]] = -1
    strip = _fill_unknown(sides, strip, x, levels, above)
    grouped, source, label = _grouped(sides, strip, len(levels))
    return Split(grouped, source, label, low, high, t)


_UNKNOWN = -2


def _crossings(cells: Cells, x: Floats, levels: Floats, active: Bools) -> Crossings:
    a, b = cells.corner, cells.corner[cells.following]
    first, last = np.minimum(a, b), np.maximum(a, b)
    order, begins, of = grouped(first * len(x) + last)
    live = np.logical_or.reduceat(active[cells.owner][order], begins)
    edge = np.where(live, np.cumsum(live) - 1, -1)[of]
    one = order[begins[live]]
    p, q = first[one], last[one]
    falling = x[p] > x[q]
    low, high = np.where(falling, q, p), np.where(falling, p, q)
    base = np.searchsorted(levels, x[low], side="right")
    top = np.searchsorted(levels, x[high], side="left")
    return Crossings(edge, a == low[edge], low, high, base, np.maximum(top - base, 0), top < base)


def _subdivided_sides(cells: Cells, crossings: Crossings, first: Ints) -> tuple[Cells, Ints]:
    """The same polygons with the new vertices as corners, and the strip of each side (`_UNKNOWN` on a level)."""
    edge, up = crossings.edge, crossings.up
    count = np.where(edge < 0, 0, crossings.count[edge])
    offset = np.concatenate([[0], np.cumsum(count + 1)])
    side = np.repeat(np.arange(len(edge)), count + 1)
    step = np.arange(offset[-1]) - offset[side]  # 0 at the old corner, then 1, 2, ... along the side
    e, rising = edge[side], up[side]
    climbed = np.where(rising, step, count[side] - step)
    corner = np.where(step == 0, cells.corner[side], first[e] + np.where(rising, step - 1, climbed))
    strip = np.where(crossings.flat[e], _UNKNOWN, crossings.base[e] + climbed)
    return Cells(offset[cells.start], corner), strip


def _fill_unknown(sides: Cells, strip: Ints, x: Floats, levels: Floats, above: Bools) -> Ints:
    """Give every side on a level the strip of the last known side before it, around its polygon."""
    unknown = strip == _UNKNOWN
    if not unknown.any():
        return strip
    slot = np.where(unknown, -1, np.arange(len(strip)))
    last_known = np.maximum.reduceat(slot, sides.start[:-1])[sides.owner]  # of the whole polygon: for the wrap-around
    source = np.maximum.accumulate(slot)
    source = np.where(source >= sides.start[:-1][sides.owner], source, last_known)
    below = np.searchsorted(levels, x[np.minimum(sides.corner, len(x) - 1)], side="left")
    lone = below + above[np.minimum(below, len(levels) - 1)]
    return np.where(source >= 0, strip[source], lone)  # no known side: the polygon lies on levels[below]


def _grouped(sides: Cells, strip: Ints, level_count: int) -> tuple[Cells, Ints, Ints]:
    """Polygons of one strip each: the sides of one strip of one polygon, closed by chords.

        b            Sides a-b and c-d are of strip 1. Each gives its first corner, and its last one too
      / |  strip 2   where the next side is of another strip (b and d): a b c d is the new polygon, with
    a   |            the chords b-c and d-a.
    |   c
    d /   strip 0
    """
    key = sides.owner * (level_count + 2) + strip + 1
    order = sorted_order(key)
    leaves = (strip[sides.following] != strip)[order]
    at = np.cumsum(1 + leaves) - (1 + leaves)
    corner = np.empty(len(order) + int(leaves.sum()), dtype=np.int64)
    corner[at] = sides.corner[order]
    corner[at[leaves] + 1] = sides.corner[sides.following[order[leaves]]]
    begins = np.flatnonzero(np.diff(key[order], prepend=-1))
    found = key[order][begins]
    start = np.append(at[begins], len(corner))
    return Cells(start, corner), found // (level_count + 2), found % (level_count + 2) - 1
