"""Convex polygons that share vertices, and their division into triangles."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Bools, Floats, Ints, sorted_order
from dsfab.surface.topology import half_edges

CHUNK = 1 << 13  # Number of polygons in a batch. A batch fits the processor's cache.


@dataclass(frozen=True, eq=False)
class Cells:
    """Polygons in one flat array. Polygon i has the corners corner[start[i]], ..., corner[start[i + 1] - 1].
    start    : (c + 1,) index of each polygon's first corner.
    corner   : (h,) vertices. An index into `corner` is called a slot.
    sides_on : (h,) row in `CutLines` of the line that contains the side from each slot to the next; 0 without a line.
               During a cut, -1 - l means level l of the cut."""

    start: Ints
    corner: Ints
    sides_on: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __post_init__(self) -> None:
        if len(self.sides_on) != len(self.corner):  # default: no side lies on a line of `CutLines`
            object.__setattr__(self, "sides_on", np.zeros(len(self.corner), dtype=np.int64))

    @classmethod
    def triangles(cls, F: Ints, sides_on: Ints | None = None) -> "Cells":
        """Return the triangles F (m, 3) as polygons. sides_on : (m, 3) row in `CutLines` of each side's line."""
        return cls(
            np.arange(0, 3 * len(F) + 1, 3), F.ravel(), (np.zeros_like(F) if sides_on is None else sides_on).ravel()
        )

    @cached_property
    def sizes(self) -> Ints:
        """(c,) number of corners of each polygon."""
        return np.diff(self.start)

    @cached_property
    def owner(self) -> Ints:
        """(h,) number of the polygon at each slot (index into `corner`)."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def following(self) -> Ints:
        """(h,) slot (index into `corner`) of the next corner of the same polygon."""
        slot = np.arange(1, len(self.corner) + 1)
        slot[self.start[1:] - 1] = self.start[:-1]
        return slot

    def next_values(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return for each polygon corner the value (h,) at the next corner. values : (h,) at the corners."""
        result: NDArray[Any] = np.empty_like(values)
        result[:-1] = values[1:]
        result[self.start[1:] - 1] = values[self.start[:-1]]
        return result

    def per_polygon(self, ufunc: np.ufunc, values: NDArray[Any]) -> NDArray[Any]:
        """Reduce the values (h,) at the corners of each polygon with `ufunc`, such as a sum; return (c,) numbers."""
        if len(values) == 3 * len(self.sizes):  # all polygons are triangles
            a, b, c = values.reshape(-1, 3).T
            return np.asarray(ufunc(ufunc(a, b), c))
        return ufunc.reduceat(values, self.start[:-1])

    def sides(self, active: Bools) -> tuple[Ints, Ints]:
        """Return the start and the end vertex (s,) of every side of the polygons that `active` (c,) marks."""
        a, b = self.corner, self.next_values(self.corner)
        if active.all():
            return a, b
        slots = np.flatnonzero(active[self.owner])
        return a[slots], b[slots]

    def slots(self, which: Ints) -> Ints:
        """Return the slots (indices into `corner`) of all corners of the polygons with the numbers `which` (k,)."""
        sizes = self.sizes[which]
        ends = np.cumsum(sizes)
        return np.asarray(np.repeat(self.start[which] - (ends - sizes), sizes) + np.arange(int(sizes.sum())))

    def subset(self, which: Ints) -> "Cells":
        """Return only the polygons with the numbers `which` (k,)."""
        slots = self.slots(which)
        return Cells(np.concatenate([[0], np.cumsum(self.sizes[which])]), self.corner[slots], self.sides_on[slots])

    def with_new_lines(self, lines: Ints) -> "Cells":
        """Return the polygons with a line for every new side: in `sides_on`, lines[l, polygon] replaces -1 - l.
        lines : (levels or 1, c or 1) rows of `CutLines`."""
        side = np.flatnonzero(self.sides_on < 0)
        if not len(side):
            return self
        sides_on, level, polygon = self.sides_on.copy(), -1 - self.sides_on[side], self.owner[side]
        sides_on[side] = lines[level if len(lines) > 1 else 0, polygon if lines.shape[1] > 1 else 0]
        return Cells(self.start, self.corner, sides_on)

    def triangle_sides(self, F: Ints, polygon: Ints) -> Ints:
        """Return for each side of triangles F (m, 3) the row in `CutLines` (m, 3) of the line that contains it.
        polygon : (m,) number of the polygon that contains each triangle."""
        slot = np.flatnonzero(self.sides_on)
        n, owner, end = int(self.corner.max()) + 1, self.owner[slot], self.next_values(self.corner)[slot]
        key = owner * n + self.corner[slot]
        order = sorted_order(key)
        a, b = half_edges(F)
        on_line = np.zeros(len(self.sizes), dtype=bool)
        on_line[owner] = True
        half_edge = np.flatnonzero(np.repeat(on_line[polygon], 3))
        half_edge_key = polygon[half_edge // 3] * n + a[half_edge]
        row = order[np.minimum(np.searchsorted(key[order], half_edge_key), len(order) - 1)] if len(order) else half_edge
        on_slot = (key[row] == half_edge_key) & (end[row] == b[half_edge])
        sides_on = np.zeros(3 * len(F), dtype=np.int64)
        sides_on[half_edge[on_slot]] = self.sides_on[slot[row[on_slot]]]
        return sides_on.reshape(-1, 3)

    def _slice(self, begin: int, end: int) -> "Cells":
        start = self.start[begin : end + 1]
        return Cells(start - start[0], self.corner[start[0] : start[-1]])

    def areas(self, X: Floats) -> tuple[Floats, Floats]:
        """Return the area (c,) of each polygon, and the squared distance (c,) from the first to the farthest corner."""
        if len(self.sizes) > CHUNK:
            parts = [self._slice(k, k + CHUNK).areas(X) for k in range(0, len(self.sizes), CHUNK)]
            area, reach = (np.concatenate(column) for column in zip(*parts, strict=True))
            return area, reach
        base = np.repeat(self.corner[self.start[:-1]], self.sizes)
        spoke = (X.take(self.corner, axis=0) - X.take(base, axis=0)).T
        x, y, z = spoke
        u, v, w = (self.next_values(column) for column in spoke)
        twice = [np.add.reduceat(part, self.start[:-1]) for part in (y * w - z * v, z * u - x * w, x * v - y * u)]
        reach = np.maximum.reduceat(x * x + y * y + z * z, self.start[:-1])
        return 0.5 * np.sqrt(twice[0] ** 2 + twice[1] ** 2 + twice[2] ** 2), reach


LARGEST = 9
"""Largest number of corners of polygons that `triangulate` divides directly. Larger polygons are first halved."""


def triangulate(cells: Cells, X: Floats) -> tuple[Ints, Ints]:
    """Divide convex polygons into triangles (m, 3); return also the polygon (m,) of each triangle, ascending.
    X : (n, 3) positions."""
    waiting: dict[int, list[tuple[Ints, Ints]]] = {}
    for size in np.flatnonzero(np.bincount(cells.sizes)).tolist():
        which = np.flatnonzero(cells.sizes == size)
        waiting[size] = [(cells.corner[cells.start[which][:, None] + np.arange(size)], which)]
    triangles, owners = [], []
    while waiting:
        size = max(waiting)
        parts = waiting.pop(size)
        polygons, owner = (np.concatenate(column) for column in zip(*parts, strict=True))
        if size > LARGEST:
            for half, whose in _chord_halves(polygons, owner, X):
                waiting.setdefault(half.shape[1], []).append((half, whose))
        else:
            for k in range(0, len(polygons), CHUNK):
                T, row = _best_triangles(polygons[k : k + CHUNK], X)
                triangles.append(T)
                owners.append(owner[k : k + CHUNK][row])
    T, owner = np.concatenate(triangles), np.concatenate(owners)
    order = sorted_order(owner)
    return T[order], owner[order]


def _quality(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return 4 sqrt(3) area / sum of squared sides (g,) of triangles; 1 if equilateral [Bank, Smith 1997]."""
    u, v = b - a, c - a
    w = v - u
    squares = sum((s[0] * s[0] + s[2] * s[2]) + s[1] * s[1] for s in (u, v, w))
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    return np.asarray(2 * np.sqrt(3) * np.sqrt(x * x + y * y + z * z) / np.maximum(squares, 1e-300))


def _best_triangles(polygons: Ints, X: Floats) -> tuple[Ints, Ints]:
    g, size = polygons.shape
    if size == 3:
        return polygons, np.arange(g)
    P = [np.ascontiguousarray(X.take(column, axis=0).T) for column in polygons.T]
    rating = {(i, i + 1): np.full(g, np.inf) for i in range(size - 1)}
    apex = np.zeros((size, size, g), dtype=np.int64)
    for span in range(2, size):
        for i in range(size - span):
            j = i + span
            each_apex = [(np.minimum(rating[i, k], rating[k, j]), _quality(P[i], P[k], P[j])) for k in range(i + 1, j)]
            worst = np.stack([np.minimum(*qualities) for qualities in each_apex])
            apex[i, j] = i + 1 + worst.argmax(axis=0)
            rating[i, j] = worst.max(axis=0)
    return _chosen_triangles(polygons, apex)


def _chosen_triangles(polygons: Ints, apex: Ints) -> tuple[Ints, Ints]:
    g, size = polygons.shape
    triangles, rows = [], []
    chords = [(np.arange(g), np.zeros(g, dtype=np.int64), np.full(g, size - 1))]
    while chords:
        row, i, j = chords.pop()
        divisible = j - i >= 2
        row, i, j = row[divisible], i[divisible], j[divisible]
        if len(row):
            k = apex[i, j, row]
            triangles.append(np.stack([polygons[row, i], polygons[row, k], polygons[row, j]], axis=1))
            rows.append(row)
            chords += [(row, i, k), (row, k, j)]
    return np.concatenate(triangles), np.concatenate(rows)


def _chord_halves(polygons: Ints, owner: Ints, X: Floats) -> list[tuple[Ints, Ints]]:
    size = polygons.shape[1]
    spoke = X[polygons] - X[polygons[:, :1]]
    fan = np.linalg.norm(np.cross(spoke[:, :-1], spoke[:, 1:]), axis=2)
    upto = np.concatenate([np.zeros((len(fan), 1)), np.cumsum(fan, axis=1)], axis=1)
    i, j = np.triu_indices(size, 2)
    i, j = i[j - i < size - 1], j[j - i < size - 1]  # a chord cannot join neighbouring corners
    corner = np.linalg.norm(np.cross(spoke[:, i], spoke[:, j]), axis=2)
    ear = upto[:, j] - upto[:, i] - corner  # twice the area between corners i, i + 1, ..., j
    choice = np.minimum(ear, upto[:, -1:] - ear).argmax(axis=1)
    groups = []
    for c in np.unique(choice):
        rows = np.flatnonzero(choice == c)
        ring = np.arange(size)
        inner, outer = ring[i[c] : j[c] + 1], np.concatenate([ring[: i[c] + 1], ring[j[c] :]])
        groups += [(polygons[rows][:, inner], owner[rows]), (polygons[rows][:, outer], owner[rows])]
    return groups


SNAP_FLOOR = 1e-9
"""Least value of `snap` (see `cut`): a field value moves onto a level nearer than this fraction of the local range."""
TIP = 1e-3  # Upper limit of `snap` (see `cut`) for moves of one stripe edge, without the opposite edge.


def nearest_levels(x: Floats, levels: Floats) -> Floats:
    """Return for each value x (n,) the nearest of the ascending levels (k,)."""
    upper_index = np.searchsorted(levels, x)
    below, above = levels[np.maximum(upper_index - 1, 0)], levels[np.minimum(upper_index, len(levels) - 1)]
    closest: Floats = np.where(np.abs(x - below) < np.abs(above - x), below, above)
    return closest


def snap_values(
    x: Floats, levels: Floats, sides: tuple[Ints, Ints], difference: Floats, fraction: float, free: Bools
) -> Floats:
    """Move the value x (n,) of each vertex onto the nearest of the levels (k,), if this level is close.
    sides    : start and end vertex (s,) of each edge.    difference : (s,) change of x along each edge.
    fraction : largest move / largest `difference` at edges of the vertex.    free : (n,) True if x may move."""
    level = nearest_levels(x, levels)
    gap = np.abs(x - level)
    may_snap = gap <= fraction * difference.max(initial=0.0) + _rounding(x)
    candidate_edges = np.flatnonzero(may_snap[sides[0]] | may_snap[sides[1]])
    reach = largest_ranges(len(x), (sides[0][candidate_edges], sides[1][candidate_edges]), difference[candidate_edges])
    snaps = may_snap & free & (gap <= fraction * reach + _rounding(x))
    moved: Floats = np.where(snaps, level, x)
    return moved


def snap_value_pairs(x: Floats, levels: Floats, reach: Floats, fraction: float) -> Floats:
    """Add a small step to the two values x (n, 2) of a vertex. It moves the value nearest to a level onto this level.
    reach : (n, 2) largest change of each value along edges of the vertex.    fraction : largest step / reach."""
    level = np.stack([nearest_levels(x[:, i], levels) for i in (0, 1)], axis=1)
    steps, limit = level - x, fraction * reach + _rounding(x)
    gap = np.abs(steps)
    share = gap * limit[:, ::-1]
    tie = (share[:, 0] == share[:, 1]) & (steps[:, 0] > steps[:, 1])  # equal distances: take the larger step
    upper_nearer = (share[:, 0] < share[:, 1]) | tie
    chosen = np.stack([upper_nearer, ~upper_nearer], axis=1)
    step = np.where(chosen, steps, 0).sum(axis=1)
    snaps = np.any(chosen & (gap <= limit), axis=1)
    bounded = np.concatenate([[-np.inf], levels, [np.inf]])
    low = bounded[np.searchsorted(levels, x, side="right")]
    high = bounded[np.searchsorted(levels, x, side="left") + 1]
    shifted = np.clip(x + step[:, None], low, high)
    moved: Floats = np.where(snaps[:, None], np.where(chosen, level, shifted), x)
    return moved


def cells_without_edges(cells: Cells, y: Floats, levels: Floats) -> tuple[Bools, Bools]:
    """Return a mask (c,) of polygons that stripes cover fully, and a mask (c,) of polygons without stripes.
    y : (h, 2) z + d and z - d at each polygon corner: field z, half-width d of the stripes."""
    width, begins = y[:, 0] - y[:, 1], cells.start[:-1]
    gap = np.diff(levels).max(initial=0.0)
    within = (y[:, 0] >= levels[0]) & (y[:, 1] < levels[-1])
    wide = (width >= gap - _rounding(y)) & within
    return np.logical_and.reduceat(wide, begins), np.maximum.reduceat(width, begins) <= _rounding(y)


def largest_ranges(n: int, sides: tuple[Ints, Ints], difference: Floats) -> Floats:
    """Return for each of n vertices the largest `difference` at its edges (n,); 0 for a vertex without edges.
    sides : start and end vertex (s,) of each edge.    difference : (s,) change of a field along each edge."""
    reach = np.zeros(n)
    for end in sides:
        np.maximum.at(reach, end, difference)
    return reach


def _rounding(x: Floats) -> float:
    return float(8 * np.spacing(np.abs(x).max()))  # rounding errors are below 8 units in the last place
