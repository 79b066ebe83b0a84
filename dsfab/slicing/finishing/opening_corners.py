"""Corners of openings, arcs that touch two walls, and the largest radius that fits each corner."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.finishing.walls import SHARPEST, Stretches, Walls, following

CHORD = float(np.radians(34))
"""Largest turn of a chord: it strays from its arc by 1 - cos(17 degrees) = 1/23 of the radius."""
TINY = 1e-300
"""Replacement for a zero length in a division."""


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs in k planes, from wall a to wall b, counter-clockwise around `centre` (k, 2).

    foot_a, foot_b : (k, 2) points of contact.    way_a, way_b : (k,) metres from the corner to there, along the wall.
    touching       : (k,) mask of the arcs that exist.
    """

    centre: Floats
    radius: Floats
    foot_a: Floats
    foot_b: Floats
    way_a: Floats
    way_b: Floats
    touching: Bools

    @property
    def begin(self) -> Floats:
        """(k,) start angle, radians."""
        x, y = (self.foot_a - self.centre).T
        return np.asarray(np.arctan2(y, x))

    @property
    def angle(self) -> Floats:
        """(k,) angle from begin to end, radians."""
        x, y = (self.foot_b - self.centre).T
        return np.asarray((np.arctan2(y, x) - self.begin) % (2 * np.pi))

    def some(self, chosen: Bools | Ints) -> "Arcs":
        return Arcs(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def rays(self) -> tuple[Floats, Floats]:
        """Unit normals (k, 2, 2) of the lines from the middle through both feet, away from the arc, and their distance
        (k, 2).

        The region that an arc fills lies on the inner side of both.
        """
        a, b = (unit(foot - self.centre) for foot in (self.foot_a, self.foot_b))
        normal = np.stack([np.stack([a[:, 1], -a[:, 0]], axis=1), np.stack([-b[:, 1], b[:, 0]], axis=1)], axis=1)
        return normal, np.einsum("kci,ki->kc", normal, self.centre)

    def chords(self) -> tuple[Floats, Floats]:
        """Outward unit normals (k, c, 2) of equal chords of each arc, and their distance (k, c) from the origin.

        Unused chords have a normal of 0 and a distance of 1: everything lies within them.
        """
        number = np.arange(6)  # enough for a half circle
        count = np.maximum(np.ceil(self.angle / CHORD), 1)
        step = self.angle / count
        middle = self.begin[:, None] + (number + 0.5) * step[:, None]
        normal = np.stack([np.cos(middle), np.sin(middle)], axis=2)
        sagged = (self.radius * np.cos(step / 2))[:, None]
        there = number < count[:, None]
        distance = np.einsum("kci,ki->kc", normal, self.centre) + sagged
        return normal * there[:, :, None], np.where(there, distance, 1.0)


def touching_arcs(a: Floats, b: Floats, radius: Floats, first: Floats | None = None) -> Arcs:
    """Arcs of radii (k,) that touch polylines a (k, p, 2) and b (k, q, 2), which lead away from their corners.

    first_centre : (k, 2) first guess; default: the circles that touch the walls beside the corners.

    The void is on the right of a and on the left of b. Newton's method on both distances: the circle of the tangents
    at the nearest points is the next guess.
    """
    centre, good = _beside_corners(a, b, radius) if first is None else (first, np.ones(len(first), dtype=bool))
    for _ in range(12):  # two or three steps are enough for nearly straight walls
        one, two = _nearest(a, centre)[0], _nearest(b, centre)[0]
        centre, regular = crossing(one, unit(centre - one), two, unit(centre - two), radius)
        good &= regular
    (one, way_a), (two, way_b) = _nearest(a, centre), _nearest(b, centre)
    for foot in (one, two):
        good &= np.abs(np.linalg.norm(foot - centre, axis=1) - radius) < 5e-3 * radius
    arcs = Arcs(centre, radius, one, two, way_a, way_b, good)
    good &= (arcs.angle > 0) & (arcs.angle < np.pi)
    return arcs


def _beside_corners(a: Floats, b: Floats, radius: Floats) -> tuple[Floats, Bools]:
    """(k, 2) middles of circles that touch the first walls, and a mask of those in the void."""
    u, v = _direction(a), _direction(b)
    left, right = np.stack([u[:, 1], -u[:, 0]], axis=1), np.stack([-v[:, 1], v[:, 0]], axis=1)
    centre, good = crossing(a[:, 0], left, b[:, 0], right, radius)
    good &= (np.einsum("ki,ki->k", left, v) > 0) & (np.einsum("ki,ki->k", right, u) > 0)
    return centre, good


def crossing(p: Floats, m: Floats, q: Floats, n: Floats, radius: Floats) -> tuple[Floats, Bools]:
    """(k, 2) the points at distance `radius` from lines through p and q with unit normals m and n; and a mask of
    their existence.
    """
    det = m[:, 0] * n[:, 1] - m[:, 1] * n[:, 0]
    good = np.abs(det) > 0.02  # else the walls are nearly parallel
    det = np.where(good, det, 1.0)
    one, two = np.einsum("ki,ki->k", m, p) + radius, np.einsum("ki,ki->k", n, q) + radius
    x, y = one * n[:, 1] - two * m[:, 1], two * m[:, 0] - one * n[:, 0]
    return np.stack([x, y], axis=1) / det[:, None], good


def _nearest(line: Floats, point: Floats) -> tuple[Floats, Floats]:
    """(k, 2) the points of polylines (k, p, 2) nearest to points (k, 2), and the length of the line up to them."""
    first, along = line[:, :-1], np.diff(line, axis=1)
    size = np.einsum("kpi,kpi->kp", along, along)
    t = np.einsum("kpi,kpi->kp", point[:, None] - first, along) / np.where(size > 0, size, 1.0)
    foot = first + np.clip(t, 0, 1)[:, :, None] * along
    pick = np.linalg.norm(foot - point[:, None], axis=2).argmin(axis=1)
    row = np.arange(len(pick))
    length = np.sqrt(size)
    before = (np.cumsum(length, axis=1) - length)[row, pick]
    return foot[row, pick], before + (np.clip(t, 0, 1) * length)[row, pick]


def _direction(line: Floats) -> Floats:
    return unit(line[:, 1] - line[:, 0])


def unit(x: Floats) -> Floats:
    """(k, d) vectors x (k, d) scaled to length 1; zero vectors stay."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), TINY))


SMALLER = 0.7
"""Least factor by which an arc without room shrinks before the next trial."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners (k,) along the walls of a sheet, in the order of the walls.

    first : (k,) the wall that begins at a corner.    turn : (k,) radians, to the left.
    place : (k,) metres along the chain. The foot of an existing arc is a corner that does not turn.
    """

    sheet: Sheet
    walls: Walls
    first: Ints
    turn: Floats
    place: Floats

    @classmethod
    def of(cls, sheet: Sheet) -> "Corners":
        """Return the points where the walls of a sheet turn by more than `SHARPEST`."""
        walls = Walls.of(sheet)
        turn = walls.turns(sheet)
        at = np.flatnonzero(turn > SHARPEST)
        return cls(sheet, walls, at, turn[at], walls.place[at])

    def some(self, chosen: Bools | Ints) -> "Corners":
        return replace(self, first=self.first[chosen], turn=self.turn[chosen], place=self.place[chosen])

    def stretches(self, arcs: Arcs) -> Stretches:
        """The walls between the feet of arcs at these corners (k,)."""
        chain = self.walls.chain[self.first]
        return Stretches.of(self.walls, chain, self.place - arcs.way_a, arcs.way_a + arcs.way_b)

    def beside(self, tips: "Corners", arcs: Arcs) -> "Corners":
        """Return the corners outside disjoint arcs (p,) at `tips`, and the feet of these arcs, which do not turn."""
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
        """(k,) metres of straight walls from a corner to the foot of an arc of radius 1 m, for turns up to 170
        degrees.
        """
        return np.asarray(np.tan(np.minimum(self.turn, np.radians(170)) / 2))

    @cached_property
    def rooms(self) -> tuple[Floats, Floats]:
        """(k,) metres of the walls before and behind that each corner may take, in proportion to the tangents."""
        t, (ahead, behind) = self.tangents, self.ways

        def share(other: Ints) -> Floats:
            beyond: Floats = np.where(other >= 0, t[other], 0.0)
            return np.asarray(t / np.maximum(t + beyond, TINY))

        room = 0.98  # so that arcs at both ends of a wall never meet
        return room * ahead * share(self.previous), room * behind * share(self.next)

    @cached_property
    def frames(self) -> Floats:
        """(k, 2, 3) unit vectors of the planes of the arcs, square to the void's normal."""
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
        """Return arcs of radii (p,) metres at corners (p,), in their `frames`, and the factors by which they must
        shrink.

        A factor is 1 for an arc that fits between its neighbours, `SMALLER` without a touching arc.
        """
        ahead, behind = (np.minimum(way[at], 2 * radius * self.tangents[at] + radius) for way in self.ways)
        arcs = touching_arcs(self.line(at, ahead, back=True), self.line(at, behind, back=False), radius)
        one, two = self.rooms
        least = np.minimum(one[at] / np.maximum(arcs.way_a, TINY), two[at] / np.maximum(arcs.way_b, TINY))
        fits = 0.995  # `rooms` leave a little more than that
        factor = np.where(least >= fits, 1.0, np.maximum(fits * least, SMALLER))
        return arcs, np.where(arcs.touching, factor, SMALLER)

    def line(self, at: Ints, way: Floats, back: bool) -> Floats:
        """(p, q, 2) the walls before or behind corners (p,), away from these up to a reach (p,), metres, in their
        `frames`.

        Shorter lines repeat their last point. It examines 8 to 256 walls.
        """
        walls, V, count = self.walls, self.sheet.surface.V, 8
        begin, vertex = self.first[at], walls.start if back else walls.end
        while True:
            steps = np.arange(count)
            wall, there = walls.ahead(begin[:, None], -1 - steps if back else steps)
            there &= (np.cumsum(walls.length[wall], axis=1) - walls.length[wall]) < way[:, None]
            if count >= 256 or not there[:, -1].any():
                break
            count *= 2
        last = np.maximum(there.sum(axis=1) - 1, 0)
        line = np.take_along_axis(vertex[wall], np.minimum(steps, last[:, None]), axis=1)
        points = np.concatenate([V[walls.start[begin]][:, None], V[line]], axis=1) - self.origin[at][:, None]
        return np.asarray(np.einsum("pqi,pji->pqj", points, self.frames[at]))

    def between_feet(self, at: Ints, arcs: Arcs, vertex: Ints) -> Bools:
        """(p,) mask of vertices (p,) on the wall between the feet of arcs (p,) at corners (p,), or 2 % of a radius
        beside.
        """
        walls = self.walls
        wall = np.full(self.sheet.surface.n, -1)
        wall[walls.start] = np.arange(len(walls.start))
        mine, first = wall[vertex], self.first[at]
        total = walls.total[walls.chain[first]]
        beside = 0.02 * arcs.radius
        way = (walls.place[mine] - walls.place[first] + arcs.way_a + beside) % total
        same = walls.chain[mine] == walls.chain[first]
        return np.asarray((mine >= 0) & same & (way <= arcs.way_a + arcs.way_b + 2 * beside))

    def largest(self, radius: float) -> Floats:
        """(k,) radii, metres: the input, or less at walls that are too short for it."""
        one, two = self.rooms
        room, t = np.minimum(one, two), self.tangents
        return np.asarray(np.minimum(radius, np.divide(room, t, out=np.zeros_like(t), where=t > 0)))
