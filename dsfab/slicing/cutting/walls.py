"""Walls of a cut sheet: the edges between void and material, joined to chains."""

from bisect import bisect
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, face_angles, group_sums
from dsfab.surface import nearest_places
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import half_edges

SHARPEST = float(np.radians(20))  # Smallest turn of an outline at a corner, radians.


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls (w,) of a cut surface: edges between material and void, sorted by chain. The void is left of a wall.
    surface : all cells, material and void.    void : (m',) mask of the void cells.
    inside, outside : (w,) half-edge in the void cell, and half-edge in the material cell.
    start, end : (w,) vertices.    length : (w,) metres.    place : (w,) metres along the chain to `start`.
    chain  : (w,) number of the wall's chain.    begin : (c + 1,) first wall of each chain.
    total  : (c,) length of each chain, metres.    closed : (c,) False if a chain ends on the surface's boundary."""

    surface: Surface
    void: Bools
    inside: Ints
    outside: Ints
    start: Ints
    end: Ints
    length: Floats
    place: Floats
    chain: Ints
    begin: Ints
    total: Floats
    closed: Bools

    @classmethod
    def from_cells(cls, surface: Surface, void: Bools) -> "Walls":
        """Return the walls between the material and the void cells (m',) of a surface."""
        side_a, side_b = surface.edges.pairs.T
        wall = void[side_a // 3] != void[side_b // 3]
        side_a, side_b = side_a[wall], side_b[wall]
        h = np.where(void[side_a // 3], side_a, side_b)
        a, b = (ends[h] for ends in half_edges(surface.F))
        order, begin, closed = _chains(_next_walls(surface, a, b))
        chain = np.repeat(np.arange(len(closed)), np.diff(begin))
        h, a, b = h[order], a[order], b[order]
        length = np.linalg.norm(surface.V[b] - surface.V[a], axis=1)
        total = np.bincount(chain, length, len(closed)).astype(np.float64)
        place = np.cumsum(length) - length - (np.cumsum(total) - total)[chain]
        outside = (side_a + side_b)[order] - h
        return cls(surface, void, h, outside, a, b, length, place, chain, begin, total, closed)

    @cached_property
    def void_cells(self) -> Ints:
        """(w,) the void cell at each wall."""
        return self.inside // 3

    @cached_property
    def material_cells(self) -> Ints:
        """(w,) the material cell at each wall."""
        return self.outside // 3

    @cached_property
    def void_neighbours(self) -> Ints:
        """(m', 3) the neighbouring void cell at each side of a void cell, else -1."""
        side_a, side_b = self.surface.edges.pairs.T
        inner = self.void[side_a // 3] & self.void[side_b // 3]
        cell = np.full(3 * self.surface.m, -1)
        cell[side_a[inner]], cell[side_b[inner]] = side_b[inner] // 3, side_a[inner] // 3
        return cell.reshape(-1, 3)

    def walls_ahead(self, wall: Ints, steps: Ints) -> tuple[Ints, Bools]:
        """Return the wall that is `steps` (k,) walls ahead in the chain of each wall (k,).
        Return also a mask (k,): False beyond the ends of an open chain."""
        chain = self.chain[wall]
        begin, size = self.begin[chain], self.begin[chain + 1] - self.begin[chain]
        position = wall - begin + steps
        exists = self.closed[chain] | ((position >= 0) & (position < size))
        return begin + position % size, exists

    @cached_property
    def chain_offsets(self) -> Floats:
        """(c,) total length of the chains before each chain, metres."""
        return np.asarray(np.cumsum(self.total) - self.total)

    def walls_at(self, chain: Ints, place: Floats) -> Ints:
        """Return the walls (k,) at distances `place` (k,), metres, from the starts of chains `chain` (k,)."""
        before = self.chain_offsets
        wall = np.searchsorted(before[self.chain] + self.place, before[chain] + place, side="right") - 1
        return np.clip(wall, self.begin[chain], self.begin[chain + 1] - 1)

    def points(self, wall: Ints, share: Floats) -> Floats:
        """Return points (k, 3) on walls (k,). share : (k,) position on the wall, 0 at its start, 1 at its end."""
        segment_start, segment_end = self.surface.V[self.start[wall]], self.surface.V[self.end[wall]]
        return np.asarray(segment_start + share[:, None] * (segment_end - segment_start))

    def nearest(self, points: Floats) -> tuple[Ints, Floats]:
        """Return the walls (k,) nearest to points (k, 3), and the nearest points (k, 3)."""
        nearest = nearest_places(points, self.surface.V, np.stack([self.start, self.end], axis=1))
        return nearest.simplex, nearest.place

    @cached_property
    def turns(self) -> Floats:
        """(w,) left turn at the start of each wall, radians; -inf at the start of an open chain."""
        F, angle = self.surface.F[self.void], np.zeros(self.surface.n)
        for corner, angles in zip(F.T, face_angles(self.surface.V, F).T, strict=True):
            angle += np.bincount(corner, angles, self.surface.n)
        turn = np.pi - angle[self.start]
        turn[self.begin[:-1][~self.closed]] = -np.inf
        return turn

    @cached_property
    def void_normals(self) -> Floats:
        """(n', 3) sum of the normals of the void cells around each vertex, weighted by area."""
        cells = np.flatnonzero(self.void)
        vector = (self.surface.normals * self.surface.areas[:, None])[cells]
        return group_sums(self.surface.F[cells].ravel(), np.repeat(vector, 3, axis=0), self.surface.n)


def next_in_chains(chain: Ints) -> Ints:
    """Return for each position the number (k,) of the next position in its chain; the first follows the last.
    chain : (k,) the chain of each position; positions of a chain are adjacent."""
    after = np.arange(1, len(chain) + 1)
    chain_start = np.flatnonzero(np.diff(chain, prepend=-1))
    after[np.append(chain_start[1:], len(chain))[: len(chain_start)] - 1] = chain_start
    return after


def _next_walls(surface: Surface, a: Ints, b: Ints) -> Ints:
    ends = surface.edges.ends[surface.edges.boundary]
    single = (np.bincount(a, minlength=surface.n) == 1) & (np.bincount(b, minlength=surface.n) == 1)
    single[ends] = False
    wall_from = np.full(surface.n, -1)
    wall_from[a] = np.arange(len(a))
    return np.where(single[b], wall_from[b], -1)


def _chains(onward: Ints) -> tuple[Ints, Ints, Bools]:
    headless = np.ones(len(onward), dtype=bool)
    headless[onward[onward >= 0]] = False
    follow, seen = onward.tolist(), bytearray(len(onward))
    order, begin, closed = list[int](), [0], list[bool]()
    heads = np.flatnonzero(headless).tolist()
    for k, first_wall in enumerate([*heads, *range(len(follow))]):
        wall = first_wall
        while wall >= 0 and not seen[wall]:
            seen[wall] = 1
            order.append(wall)
            wall = follow[wall]
        if len(order) > begin[-1]:
            begin.append(len(order))
            closed.append(k >= len(heads))
    return np.array(order, dtype=np.int64), np.array(begin), np.array(closed, dtype=bool)


@dataclass(frozen=True, eq=False)
class Stretches:
    """Parts (p,) of chains of walls. A part across the start of a closed chain has two entries.
    low, high : (q,) start and end of each entry, metres, plus the length of all earlier chains.
    part      : (q,) part of each entry.    before : (c,) length of all chains before each chain, metres."""

    low: Floats
    high: Floats
    part: Ints
    before: Floats

    @classmethod
    def from_chains(cls, walls: Walls, chain: Ints, begin: Floats, length: Floats) -> "Stretches":
        """Return parts of chains of walls. chain : (p,) chain of each part.
        begin, length : (p,) start in the chain, and length of the part, metres."""
        before, total = walls.chain_offsets, walls.total[chain]
        begin = begin % total
        over = np.flatnonzero(begin + length > total)
        low = before[chain] + begin
        high = before[chain] + np.minimum(begin + length, total)
        rest = before[chain[over]]
        low, high = np.append(low, rest), np.append(high, rest + (begin + length - total)[over])
        return cls(low, high, np.append(np.arange(len(chain)), over), before)

    def covers(self, chain: Ints, place: Floats) -> Bools:
        """Return a mask (k,) of places that lie in these parts, which must be disjoint.
        place : (k,) metres from the start of the chain `chain` (k,)."""
        if not len(self.low):
            return np.zeros(len(place), dtype=bool)
        order = np.argsort(self.low)
        x = self.before[chain] + np.maximum(place, 0.0)  # rounding can make a place slightly negative
        index = np.searchsorted(self.low[order], x, side="right") - 1
        return np.asarray((index >= 0) & (x <= self.high[order][np.maximum(index, 0)]))

    def overlaps(self, stretches: "Stretches", count: int) -> Bools:
        """Return a mask (count,) of parts that overlap parts of `stretches`. `stretches` must be disjoint."""
        if not len(stretches.low):
            return np.zeros(count, dtype=bool)
        order = np.argsort(stretches.low)
        index = np.searchsorted(stretches.low[order], self.high) - 1
        into = (index >= 0) & (stretches.high[order][np.maximum(index, 0)] > self.low)
        return np.asarray(np.bincount(self.part, into, count) > 0)

    def disjoint(self, count: int) -> Bools:
        """Return a mask (count,) of parts that do not overlap. Where two parts overlap, the longer part remains."""
        length = np.bincount(self.part, self.high - self.low, count)
        stay, taken = np.ones(count, dtype=bool), list[tuple[float, float]]()
        for k in np.argsort(-length[self.part], kind="stable").tolist():
            low, high = float(self.low[k]), float(self.high[k])
            index = bisect(taken, (low, high))
            if (index and taken[index - 1][1] > low) or (index < len(taken) and taken[index][0] < high):
                stay[self.part[k]] = False
            else:
                taken.insert(index, (low, high))
        return stay
