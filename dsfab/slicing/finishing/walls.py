"""Walls of a cut sheet: edges between void and material as chains around openings, and stretches of the chains."""

from bisect import bisect
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.surface import nearest
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import half_edges

SHARPEST = float(np.radians(20))
"""The outline of an opening has a corner where it turns by more."""


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls (w,), chain after chain, each in the order in which the void lies on its left.

    inside, outside : (w,) the half-edge of the void cell, and that of the material cell.
    start, end : (w,) vertices.    length : (w,) metres.    place : (w,) metres from the chain's beginning to start.
    chain  : (w,) its number.    begin : (c + 1,) first wall of each chain.    total : (c,) lengths of chains, metres.
    closed : (c,) True for a closed chain; open chains end on the boundary of the surface.
    """

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
    def of(cls, sheet: Sheet) -> "Walls":
        """Return the walls between material and void of a sheet, chained."""
        one, two = sheet.surface.edges.pairs.T
        void = ~sheet.material
        wall = void[one // 3] != void[two // 3]
        one, two = one[wall], two[wall]
        h = np.where(void[one // 3], one, two)
        a, b = (ends[h] for ends in half_edges(sheet.surface.F))
        order, begin, closed = _chains(_onward(sheet.surface, a, b))
        chain = np.repeat(np.arange(len(closed)), np.diff(begin))
        h, a, b = h[order], a[order], b[order]
        length = np.linalg.norm(sheet.surface.V[b] - sheet.surface.V[a], axis=1)
        total = np.bincount(chain, length, len(closed)).astype(np.float64)
        place = np.cumsum(length) - length - (np.cumsum(total) - total)[chain]
        return cls(h, (one + two)[order] - h, a, b, length, place, chain, begin, total, closed)

    def ahead(self, wall: Ints, steps: Ints) -> tuple[Ints, Bools]:
        """(k,) the walls `steps` (k,) after `wall` (k,) along its chain, and a mask of those that exist: open
        chains end.
        """
        chain = self.chain[wall]
        begin, size = self.begin[chain], self.begin[chain + 1] - self.begin[chain]
        at = wall - begin + steps
        there = self.closed[chain] | ((at >= 0) & (at < size))
        return begin + at % size, there

    @cached_property
    def before(self) -> Floats:
        """(c,) metres at which the chains begin when all are laid end to end."""
        return np.asarray(np.cumsum(self.total) - self.total)

    def at(self, chain: Ints, place: Floats) -> Ints:
        """(k,) the walls at places (k,), metres along chains (k,)."""
        before = self.before
        found = np.searchsorted(before[self.chain] + self.place, before[chain] + place, side="right") - 1
        return np.clip(found, self.begin[chain], self.begin[chain + 1] - 1)

    def points(self, V: Floats, wall: Ints, share: Floats) -> Floats:
        """(k, 3) the points at shares (k,) of walls (k,), on vertices V (n, 3)."""
        one, two = V[self.start[wall]], V[self.end[wall]]
        return np.asarray(one + share[:, None] * (two - one))

    def nearest(self, V: Floats, points: Floats) -> tuple[Ints, Floats]:
        """(k,) the walls nearest to points (k, 3), and the nearest points (k, 3) on them, on vertices V (n, 3)."""
        found = nearest(points, V, np.stack([self.start, self.end], axis=1))
        return found.simplex, found.place

    def turns(self, sheet: Sheet) -> Floats:
        """(w,) left turn of the outline at the start of each wall, radians: pi less the angle of the void.

        Minus infinity without a wall before. Angles are those on the surface: a crease makes no corner.
        """
        F, V = sheet.surface.F[~sheet.material], sheet.surface.V
        angle: Floats = np.zeros(sheet.surface.n)
        for c in range(3):
            u, v = (V[F[:, (c + k) % 3]] - V[F[:, c]] for k in (1, 2))
            size = np.linalg.norm(np.cross(u, v), axis=1)
            angle += np.bincount(F[:, c], np.arctan2(size, np.einsum("ki,ki->k", u, v)), sheet.surface.n)
        turn = np.pi - angle[self.start]
        turn[self.begin[:-1][~self.closed]] = -np.inf
        return turn


def following(chain: Ints) -> Ints:
    """(k,) the next of each in its chain, the first behind the last; chains (k,) are runs of one number."""
    after = np.arange(1, len(chain) + 1)
    first = np.flatnonzero(np.diff(chain, prepend=-1))
    after[np.append(first[1:], len(chain))[: len(first)] - 1] = first
    return after


def _onward(surface: Surface, a: Ints, b: Ints) -> Ints:
    """(w,) the wall after each wall from a to b, or -1 at a boundary and where several walls meet."""
    ends = surface.edges.ends[surface.edges.boundary]
    plain = (np.bincount(a, minlength=surface.n) == 1) & (np.bincount(b, minlength=surface.n) == 1)
    plain[ends] = False
    at = np.full(surface.n, -1)
    at[a] = np.arange(len(a))
    return np.where(plain[b], at[b], -1)


def _chains(onward: Ints) -> tuple[Ints, Ints, Bools]:
    """The walls chain by chain, the limits of the chains, and a mask of the closed ones."""
    headless = np.ones(len(onward), dtype=bool)
    headless[onward[onward >= 0]] = False
    follow, seen = onward.tolist(), bytearray(len(onward))
    order, begin, closed = list[int](), [0], list[bool]()
    heads = np.flatnonzero(headless).tolist()
    for k, first in enumerate([*heads, *range(len(follow))]):
        at = first
        while at >= 0 and not seen[at]:
            seen[at] = 1
            order.append(at)
            at = follow[at]
        if len(order) > begin[-1]:
            begin.append(len(order))
            closed.append(k >= len(heads))
    return np.array(order, dtype=np.int64), np.array(begin), np.array(closed, dtype=bool)


@dataclass(frozen=True, eq=False)
class Stretches:
    """Parts (p,) of chains; a part that runs over the beginning of a closed chain has two entries.

    low, high : (q,) metres, all chains laid end to end.    part : (q,) the part of each entry.
    """

    low: Floats
    high: Floats
    part: Ints
    before: Floats

    @classmethod
    def of(cls, walls: Walls, chain: Ints, begin: Floats, length: Floats) -> "Stretches":
        """Return parts of chains (p,), from a place (p,) along each, of a length (p,), all in metres."""
        before, total = walls.before, walls.total[chain]
        begin = begin % total
        over = np.flatnonzero(begin + length > total)
        low = before[chain] + begin
        high = before[chain] + np.minimum(begin + length, total)
        rest = before[chain[over]]
        low, high = np.append(low, rest), np.append(high, rest + (begin + length - total)[over])
        return cls(low, high, np.append(np.arange(len(chain)), over), before)

    def cover(self, chain: Ints, place: Floats) -> Bools:
        """(k,) mask of places (k,), metres along chains (k,), in the parts, which must be disjoint."""
        if not len(self.low):
            return np.zeros(len(place), dtype=bool)
        order = np.argsort(self.low)
        x = self.before[chain] + np.maximum(place, 0.0)  # rounding may give less than 0
        at = np.searchsorted(self.low[order], x, side="right") - 1
        return np.asarray((at >= 0) & (x <= self.high[order][np.maximum(at, 0)]))

    def meet(self, other: "Stretches", count: int) -> Bools:
        """(count,) mask of the parts that overlap other stretches, which must be disjoint."""
        if not len(other.low):
            return np.zeros(count, dtype=bool)
        order = np.argsort(other.low)
        at = np.searchsorted(other.low[order], self.high) - 1
        into = (at >= 0) & (other.high[order][np.maximum(at, 0)] > self.low)
        return np.asarray(np.bincount(self.part, into, count) > 0)

    def disjoint(self, count: int) -> Bools:
        """(count,) mask of parts that do not overlap; of two the longer stays."""
        length = np.bincount(self.part, self.high - self.low, count)
        stay, taken = np.ones(count, dtype=bool), list[tuple[float, float]]()
        for k in np.argsort(-length[self.part], kind="stable").tolist():
            low, high = float(self.low[k]), float(self.high[k])
            at = bisect(taken, (low, high))
            if (at and taken[at - 1][1] > low) or (at < len(taken) and taken[at][0] < high):
                stay[self.part[k]] = False
            else:
                taken.insert(at, (low, high))
        return stay
