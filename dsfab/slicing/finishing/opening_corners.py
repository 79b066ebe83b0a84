"""Corners of openings, and the arcs that round these corners."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, unit_vectors
from dsfab.slicing.cutting.walls import SHARPEST, Stretches, Walls, next_in_chains

CHORD = float(np.radians(34))
"""Largest angle of the arc over a chord, radians. The arc is up to 1 - cos(17 degrees) = 1/23 radius from the chord."""


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs (k,) at corners of openings, each in a plane, from wall a to the next wall b.
    Arcs run counter-clockwise around `centre` (k, 2).
    foot_a, foot_b : (k, 2) points of contact with the walls.
    way_a, way_b   : (k,) distance from the corner to these points along the walls, metres.
    touching       : (k,) True if an arc touches the two walls."""

    centre: Floats
    radius: Floats
    foot_a: Floats
    foot_b: Floats
    way_a: Floats
    way_b: Floats
    touching: Bools

    @property
    def begin(self) -> Floats:
        """(k,) direction from the centre of each arc to `foot_a`, radians."""
        x, y = (self.foot_a - self.centre).T
        return np.asarray(np.arctan2(y, x))

    @property
    def angle(self) -> Floats:
        """(k,) angle of each arc, radians."""
        x, y = (self.foot_b - self.centre).T
        return np.asarray((np.arctan2(y, x) - self.begin) % (2 * np.pi))

    def subset(self, chosen: Bools | Ints) -> "Arcs":
        """Return the arcs that the mask or index array `chosen` selects."""
        return Arcs(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def rays(self) -> tuple[Floats, Floats]:
        """Return for each arc the two rays from the centre through the ends.
        Rays have unit normals (k, 2, 2), out of the arc's sector, and distances (k, 2) from the origin."""
        a, b = (unit_vectors(foot - self.centre) for foot in (self.foot_a, self.foot_b))
        normal = np.stack([np.stack([a[:, 1], -a[:, 0]], axis=1), np.stack([-b[:, 1], b[:, 0]], axis=1)], axis=1)
        return normal, np.einsum("kci,ki->kc", normal, self.centre)

    def chords(self) -> tuple[Floats, Floats]:
        """Return outward unit normals (k, c, 2) and distances (k, c) of each arc's equal chords.
        For missing chords, normals are 0 and distances are 1."""
        number = np.arange(6)  # six chords are enough for half a circle
        count = np.maximum(np.ceil(self.angle / CHORD), 1)
        step = self.angle / count
        middle = self.begin[:, None] + (number + 0.5) * step[:, None]
        normal = np.stack([np.cos(middle), np.sin(middle)], axis=2)
        sagged = (self.radius * np.cos(step / 2))[:, None]
        exists = number < count[:, None]
        distance = np.einsum("kci,ki->kc", normal, self.centre) + sagged
        return normal * exists[:, :, None], np.where(exists, distance, 1.0)


def tangent_arcs(a: Floats, b: Floats, radius: Floats, first_centre: Floats | None = None) -> Arcs:
    """Return arcs of radii (k,) that touch polylines a (k, p, 2) and b (k, q, 2) from a common corner.
    The void is on the right of a and on the left of b.
    first_centre : (k, 2) first guess of the centres, or None."""
    if first_centre is None:
        centre, valid = _first_centres(a, b, radius)
    else:
        centre, valid = first_centre, np.ones(len(first_centre), dtype=bool)
    for _ in range(12):  # nearly straight walls need two or three steps
        foot_a, foot_b = _nearest(a, centre)[0], _nearest(b, centre)[0]
        centre, regular = circle_centres(
            foot_a, unit_vectors(centre - foot_a), foot_b, unit_vectors(centre - foot_b), radius
        )
        valid &= regular
    (foot_a, way_a), (foot_b, way_b) = _nearest(a, centre), _nearest(b, centre)
    for foot in (foot_a, foot_b):
        valid &= np.abs(np.linalg.norm(foot - centre, axis=1) - radius) < 5e-3 * radius
    arcs = Arcs(centre, radius, foot_a, foot_b, way_a, way_b, valid)
    valid &= (arcs.angle > 0) & (arcs.angle < np.pi)
    return arcs


def _first_centres(a: Floats, b: Floats, radius: Floats) -> tuple[Floats, Bools]:
    u, v = (unit_vectors(line[:, 1] - line[:, 0]) for line in (a, b))
    left_normal, right_normal = np.stack([u[:, 1], -u[:, 0]], axis=1), np.stack([-v[:, 1], v[:, 0]], axis=1)
    centre, in_void = circle_centres(a[:, 0], left_normal, b[:, 0], right_normal, radius)
    in_void &= (np.einsum("ki,ki->k", left_normal, v) > 0) & (np.einsum("ki,ki->k", right_normal, u) > 0)
    return centre, in_void


def circle_centres(p: Floats, m: Floats, q: Floats, n: Floats, radius: Floats) -> tuple[Floats, Bools]:
    """Return centres (k, 2) of circles that touch two lines, and a mask (k,), False for nearly parallel lines.
    p, q : (k, 2) a point on each line.    m, n : (k, 2) unit normals of the lines, towards the centre."""
    det = m[:, 0] * n[:, 1] - m[:, 1] * n[:, 0]
    regular = np.abs(det) > 0.02  # at smaller values, the lines are nearly parallel
    det = np.where(regular, det, 1.0)
    offset_a, offset_b = np.einsum("ki,ki->k", m, p) + radius, np.einsum("ki,ki->k", n, q) + radius
    x, y = offset_a * n[:, 1] - offset_b * m[:, 1], offset_b * m[:, 0] - offset_a * n[:, 0]
    return np.stack([x, y], axis=1) / det[:, None], regular


def _nearest(line: Floats, point: Floats) -> tuple[Floats, Floats]:
    start, along = line[:, :-1], np.diff(line, axis=1)
    size = np.einsum("kpi,kpi->kp", along, along)
    t = np.einsum("kpi,kpi->kp", point[:, None] - start, along) / np.where(size > 0, size, 1.0)
    foot = start + np.clip(t, 0, 1)[:, :, None] * along
    pick = np.linalg.norm(foot - point[:, None], axis=2).argmin(axis=1)
    row = np.arange(len(pick))
    length = np.sqrt(size)
    before = (np.cumsum(length, axis=1) - length)[row, pick]
    return foot[row, pick], before + (np.clip(t, 0, 1) * length)[row, pick]


SMALLER = 0.7  # If an arc does not fit, its next radius is at least this fraction of the last radius.


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners (k,) along walls, in the order of the walls.
    first : (k,) the wall that begins at a corner.    turn : (k,) change of direction to the left, radians.
    place : (k,) distance from the start of the chain of walls, metres."""

    walls: Walls
    first: Ints
    turn: Floats
    place: Floats

    @classmethod
    def from_walls(cls, walls: Walls) -> "Corners":
        """Return the places where walls turn to the left by more than `SHARPEST`."""
        rows = np.flatnonzero(walls.turns > SHARPEST)
        return cls(walls, rows, walls.turns[rows], walls.place[rows])

    def subset(self, chosen: Bools | Ints) -> "Corners":
        """Return the corners that the mask or index array `chosen` selects."""
        return replace(self, first=self.first[chosen], turn=self.turn[chosen], place=self.place[chosen])

    def stretches(self, arcs: Arcs) -> Stretches:
        """Return the stretch of wall that each corner's arc replaces."""
        chain = self.walls.chain[self.first]
        return Stretches.from_chains(self.walls, chain, self.place - arcs.way_a, arcs.way_a + arcs.way_b)

    def with_arc_feet(self, tips: "Corners", arcs: Arcs) -> "Corners":
        """Return corners in which the two ends of each arc (p,) replace the corner of `tips` (p,) that the arc rounds.
        An end of an arc has `turn` 0."""
        walls, chain = self.walls, self.walls.chain[tips.first]
        free = ~tips.stretches(arcs).covers(walls.chain[self.first], self.place)
        feet = np.concatenate([tips.place - arcs.way_a, tips.place + arcs.way_b]) % np.tile(walls.total[chain], 2)
        first_wall = walls.walls_at(np.tile(chain, 2), feet)
        first_wall, place = np.concatenate([self.first[free], first_wall]), np.concatenate([self.place[free], feet])
        turn = np.concatenate([self.turn[free], np.zeros(len(feet))])
        order = np.lexsort((place, walls.chain[first_wall]))
        return Corners(walls, first_wall[order], turn[order], place[order])

    @cached_property
    def next_corner(self) -> Ints:
        """(k,) the next corner along the chain, -1 at the end of an open chain."""
        chain = self.walls.chain[self.first]
        follow = next_in_chains(chain)
        follow[(follow <= np.arange(len(chain))) & ~self.walls.closed[chain]] = -1
        return follow

    @cached_property
    def previous_corner(self) -> Ints:
        """(k,) the previous corner along the chain, or -1."""
        before = np.full(len(self.next_corner), -1)
        has_next = self.next_corner >= 0
        before[self.next_corner[has_next]] = np.flatnonzero(has_next)
        return before

    @cached_property
    def wall_lengths(self) -> tuple[Floats, Floats]:
        """Distances along walls to the previous corner (k,) and the next corner (k,), or to a chain's end, metres."""
        walls, follow, before = self.walls, self.next_corner, self.previous_corner
        chain = walls.chain[self.first]
        total, place = walls.total[chain], self.place
        next_place = place[follow]
        ahead = np.where(next_place > place, next_place - place, next_place - place + total)
        behind = np.where(follow >= 0, ahead, total - place)
        return np.where(before >= 0, behind[before], place), behind

    @cached_property
    def tangents(self) -> Floats:
        """(k,) distance from each corner to the ends of its arc, divided by the arc's radius, for straight walls."""
        return np.asarray(np.tan(np.minimum(self.turn, np.radians(170)) / 2))

    @cached_property
    def rooms(self) -> tuple[Floats, Floats]:
        """Lengths of wall that an arc may use before its corner (k,) and after its corner (k,), metres."""
        t, (ahead, behind) = self.tangents, self.wall_lengths

        def share(neighbour: Ints) -> Floats:
            beyond: Floats = np.where(neighbour >= 0, t[neighbour], 0.0)
            return np.divide(t, t + beyond, out=np.zeros_like(t), where=t > 0)

        room = 0.98  # under 1, so that arcs at both ends of a wall stay apart
        return room * ahead * share(self.previous_corner), room * behind * share(self.next_corner)

    @cached_property
    def frames(self) -> Floats:
        """(k, 2, 3) two unit vectors in the plane of each corner's arc."""
        normal = self.walls.void_normals[self.walls.start[self.first]]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = self.walls.surface.V[self.walls.end[self.first]] - self.origin
        first_axis = along - np.einsum("ki,ki->k", along, normal)[:, None] * normal
        first_axis /= np.linalg.norm(first_axis, axis=1, keepdims=True)
        return np.stack([first_axis, np.cross(normal, first_axis)], axis=1)

    @cached_property
    def origin(self) -> Floats:
        """(k, 3) vertex at each corner, metres: origin of `frames`."""
        return np.asarray(self.walls.surface.V[self.walls.start[self.first]])

    def circles(self, rows: Ints, arcs: Arcs) -> Floats:
        """Return the circles (p, 7) of arcs at corners `rows` (p,): centre, unit axis, radius, metres."""
        frames = self.frames[rows]
        centre = self.origin[rows] + np.einsum("pj,pji->pi", arcs.centre, frames)
        return np.hstack([centre, np.cross(frames[:, 0], frames[:, 1]), arcs.radius[:, None]])

    def arcs(self, rows: Ints, radius: Floats) -> tuple[Arcs, Floats]:
        """Return arcs of radii (p,), metres, at corners `rows` (p,), and factors (p,) for a next attempt.
        A factor is 1 if the arc fits, otherwise smaller."""
        reach = 2 * radius * self.tangents[rows] + radius
        ahead, behind = (np.minimum(length[rows], reach) for length in self.wall_lengths)
        arcs = tangent_arcs(self.wall_line(rows, ahead, back=True), self.wall_line(rows, behind, back=False), radius)
        ways = np.array([arcs.way_a, arcs.way_b])
        rooms = np.array(self.rooms)[:, rows]
        least = np.divide(rooms, ways, out=np.full_like(ways, np.inf), where=ways > 0).min(axis=0)
        fits = 0.995  # margin of 0.5 % for rounding errors; the lengths in `rooms` already have a margin of 2 %
        factor = np.where(least >= fits, 1.0, np.maximum(fits * least, SMALLER))
        return arcs, np.where(arcs.touching, factor, SMALLER)

    def wall_line(self, rows: Ints, reach: Floats, back: bool) -> Floats:
        """Return polylines (p, q, 2) along the walls from corners `rows` (p,), in coordinates of `frames`.
        reach : (p,) length, metres.    back : True to follow the walls backwards."""
        walls, V, count = self.walls, self.walls.surface.V, 8
        begin, vertex = self.first[rows], walls.start if back else walls.end
        while True:
            steps = np.arange(count)
            wall, within_reach = walls.walls_ahead(begin[:, None], -1 - steps if back else steps)
            within_reach &= (np.cumsum(walls.length[wall], axis=1) - walls.length[wall]) < reach[:, None]
            if count >= 256 or not within_reach[:, -1].any():
                break
            count *= 2
        last_point = np.maximum(within_reach.sum(axis=1) - 1, 0)
        line = np.take_along_axis(vertex[wall], np.minimum(steps, last_point[:, None]), axis=1)
        points = np.concatenate([V[walls.start[begin]][:, None], V[line]], axis=1) - self.origin[rows][:, None]
        return np.asarray(np.einsum("pqi,pji->pqj", points, self.frames[rows]))

    def between_feet(self, rows: Ints, arcs: Arcs, vertex: Ints) -> Bools:
        """Return a mask (p,) of vertices (p,) on the walls between the ends of an arc.
        rows : (p,) the corner for each vertex."""
        walls = self.walls
        wall = np.full(walls.surface.n, -1)
        wall[walls.start] = np.arange(len(walls.start))
        wall_of_vertex, first_wall = wall[vertex], self.first[rows]
        total = walls.total[walls.chain[first_wall]]
        margin = 0.02 * arcs.radius
        distance = (walls.place[wall_of_vertex] - walls.place[first_wall] + arcs.way_a + margin) % total
        same_chain = walls.chain[wall_of_vertex] == walls.chain[first_wall]
        return np.asarray((wall_of_vertex >= 0) & same_chain & (distance <= arcs.way_a + arcs.way_b + 2 * margin))

    def largest(self, radius: float) -> Floats:
        """Return the largest radius (k,) of an arc at each corner, at most `radius`, metres."""
        room_before, room_behind = self.rooms
        room, t = np.minimum(room_before, room_behind), self.tangents
        return np.asarray(np.minimum(radius, np.divide(room, t, out=np.zeros_like(t), where=t > 0)))
