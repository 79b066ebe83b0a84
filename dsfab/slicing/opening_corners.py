"""Corners of openings, and how large a radius the walls beside them leave room for."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.arcs import TINY, Arcs, touching_arcs
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.stretches import Stretches
from dsfab.slicing.walls import SHARPEST, Walls, following

ROOM = 0.98
"""Arcs at both ends of a wall leave a little of it, so that they never meet."""
FLATTEST = float(np.radians(170))
"""Corners that turn by more are treated as if they turned by this: none is rounded over an endless length."""
SMALLER = 0.7
"""An arc that does not fit is made smaller by this factor at most, and tried again."""
FITS = 0.995
"""Where an arc takes so much more than its room, it fits: it is still within what `ROOM` leaves."""
BESIDE = 0.02
"""Vertices of a wall so near to the foot of an arc, as a share of its radius, may be on its chord."""
WINDOW, WIDEST = 8, 256
"""Walls that are looked at on each side of a corner, to begin with and at most."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners (k,) along the walls of a sheet, in the order of the walls.

    first : (k,) the wall that begins at a corner.    turn : (k,) radians, to the left.
    place : (k,) metres along the chain. Where an arc already ends on a wall is a corner that does not turn.
    """

    sheet: Sheet
    walls: Walls
    first: Ints
    turn: Floats
    place: Floats

    @classmethod
    def of(cls, sheet: Sheet) -> "Corners":
        """Where the walls of a sheet turn by more than `SHARPEST`."""
        walls = Walls.of(sheet)
        turn = walls.turns(sheet)
        at = np.flatnonzero(turn > SHARPEST)
        return cls(sheet, walls, at, turn[at], walls.place[at])

    def some(self, chosen: Bools | Ints) -> "Corners":
        """Those that are marked (k,), or of these numbers."""
        return replace(self, first=self.first[chosen], turn=self.turn[chosen], place=self.place[chosen])

    def stretches(self, arcs: Arcs) -> Stretches:
        """The walls between the feet of arcs at these corners (k,)."""
        chain = self.walls.chain[self.first]
        return Stretches.of(self.walls, chain, self.place - arcs.way_a, arcs.way_a + arcs.way_b)

    def beside(self, tips: "Corners", arcs: Arcs) -> "Corners":
        """Those that do not lie between the feet of disjoint arcs (p,) at `tips`; and these feet, which do not turn."""
        walls, chain = self.walls, self.walls.chain[tips.first]
        free = ~tips.stretches(arcs).cover(walls.chain[self.first], self.place)
        feet = np.concatenate([tips.place - arcs.way_a, tips.place + arcs.way_b]) % np.tile(walls.total[chain], 2)
        first = walls.at(np.tile(chain, 2), feet)
        first, place = np.concatenate([self.first[free], first]), np.concatenate([self.place[free], feet])
        turn = np.concatenate([self.turn[free], np.zeros(len(feet))])
        order = np.lexsort((place, walls.chain[first]))
        return Corners(self.sheet, walls, first[order], turn[order], place[order])

    @cached_property
    def next(self) -> Ints:
        """(k,) the next corner along the chain, -1 before the end of an open one; of a single corner itself."""
        chain = self.walls.chain[self.first]
        follow = following(chain)
        follow[(follow <= np.arange(len(chain))) & ~self.walls.closed[chain]] = -1
        return follow

    @cached_property
    def previous(self) -> Ints:
        """(k,) the corner before each, or -1."""
        before = np.full(len(self.next), -1)
        some = self.next >= 0
        before[self.next[some]] = np.flatnonzero(some)
        return before

    @cached_property
    def ways(self) -> tuple[Floats, Floats]:
        """(k,) metres of wall before and behind each corner, up to the next one or the end of the chain."""
        walls, follow, before = self.walls, self.next, self.previous
        chain = walls.chain[self.first]
        total, here = walls.total[chain], self.place
        there = here[follow]
        behind = np.where(follow >= 0, np.where(there > here, there - here, there - here + total), total - here)
        return np.where(before >= 0, behind[before], here), behind

    @cached_property
    def tangents(self) -> Floats:
        """(k,) metres of straight walls from a corner to where an arc of radius 1 m touches."""
        return np.asarray(np.tan(np.minimum(self.turn, FLATTEST) / 2))

    @cached_property
    def rooms(self) -> tuple[Floats, Floats]:
        """(k,) metres of the walls before and behind that each corner may take: shared as tangents are."""
        t, (ahead, behind) = self.tangents, self.ways

        def share(other: Ints) -> Floats:
            beyond: Floats = np.where(other >= 0, t[other], 0.0)
            return np.asarray(t / np.maximum(t + beyond, TINY))

        return ROOM * ahead * share(self.previous), ROOM * behind * share(self.next)

    @cached_property
    def frames(self) -> Floats:
        """(k, 2, 3) unit vectors of the planes in which corners are rounded: square to the void's normal there."""
        surface, void = self.sheet.surface, np.flatnonzero(~self.sheet.material)
        vector = (surface.normals * surface.areas[:, None])[void]
        corner = surface.F[void].ravel()
        total = [np.bincount(corner, np.repeat(column, 3), surface.n) for column in vector.T]
        normal = np.stack(total, axis=1).astype(np.float64)[self.walls.start[self.first]]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = surface.V[self.walls.end[self.first]] - self.origin
        one = along - np.einsum("ki,ki->k", along, normal)[:, None] * normal
        one /= np.linalg.norm(one, axis=1, keepdims=True)
        return np.stack([one, np.cross(normal, one)], axis=1)

    @cached_property
    def origin(self) -> Floats:
        """(k, 3) the vertices of the corners."""
        return np.asarray(self.sheet.surface.V[self.walls.start[self.first]])

    def arcs(self, at: Ints, radius: Floats) -> tuple[Arcs, Floats]:
        """Arcs of radii (p,) metres at corners (p,), in their `frames` around the corners; and by which factor they
        must become smaller to have room between their neighbours: 1 for those that fit, `SMALLER` where none touches.
        """
        ahead, behind = (np.minimum(way[at], 2 * radius * self.tangents[at] + radius) for way in self.ways)
        arcs = touching_arcs(self.line(at, ahead, back=True), self.line(at, behind, back=False), radius)
        one, two = self.rooms
        least = np.minimum(one[at] / np.maximum(arcs.way_a, TINY), two[at] / np.maximum(arcs.way_b, TINY))
        factor = np.where(least >= FITS, 1.0, np.maximum(FITS * least, SMALLER))
        return arcs, np.where(arcs.touching, factor, SMALLER)

    def line(self, at: Ints, way: Floats, back: bool) -> Floats:
        """(p, q, 2) the walls before or behind corners (p,), away from these and about as far as ways (p,), metres, in
        their `frames`; at their end they stay where they are."""
        walls, V, count = self.walls, self.sheet.surface.V, WINDOW
        begin, vertex = self.first[at], walls.start if back else walls.end
        while True:
            steps = np.arange(count)
            wall, there = walls.ahead(begin[:, None], -1 - steps if back else steps)
            there &= (np.cumsum(walls.length[wall], axis=1) - walls.length[wall]) < way[:, None]
            if count >= WIDEST or not there[:, -1].any():
                break
            count *= 2
        last = np.maximum(there.sum(axis=1) - 1, 0)
        line = np.take_along_axis(vertex[wall], np.minimum(steps, last[:, None]), axis=1)
        points = np.concatenate([V[walls.start[begin]][:, None], V[line]], axis=1) - self.origin[at][:, None]
        return np.asarray(np.einsum("pqi,pji->pqj", points, self.frames[at]))

    def between_feet(self, at: Ints, arcs: Arcs, vertex: Ints) -> Bools:
        """(p,) which vertices (p,) are on the wall between the feet of arcs (p,) at corners `at` (p,), or beside."""
        walls = self.walls
        wall = np.full(self.sheet.surface.n, -1)
        wall[walls.start] = np.arange(len(walls.start))
        mine, first = wall[vertex], self.first[at]
        total = walls.total[walls.chain[first]]
        beside = BESIDE * arcs.radius
        way = (walls.place[mine] - walls.place[first] + arcs.way_a + beside) % total
        same = walls.chain[mine] == walls.chain[first]
        return np.asarray((mine >= 0) & same & (way <= arcs.way_a + arcs.way_b + 2 * beside))

    def largest(self, radius: float) -> Floats:
        """(k,) radii, metres: the one asked for, or less where walls are too short for it."""
        one, two = self.rooms
        room, t = np.minimum(one, two), self.tangents
        return np.asarray(np.minimum(radius, np.divide(room, t, out=np.zeros_like(t), where=t > 0)))
