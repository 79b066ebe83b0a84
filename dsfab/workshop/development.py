"""Development of members: axes and edges laid open, and strips rolled out into the plane."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from dsfab.core.arrays import Bools, Floats, cross, lock
from dsfab.members import Member, MemberAxis, MemberGraph, Node

CONSTANT = 0.05
"""Even edges between which widths differ by less than this share are parallel."""
OBLIQUE = 1.5
"""Widths from the ends of a member in which its cells do not tell how wide it is."""
BEYOND = 16
"""Stations that an axis is carried on by."""


@dataclass(frozen=True, eq=False)
class StripCourse:
    """Stations along an axis, metres and 1/m as `MemberAxis` has them, and a little beyond its ends.

    s     : (k,) arc length of the axis; of a closed one over its length where it passes its beginning.
    P, T, N : (k, 3)    kg, kn, tg : (k,)
    left, right : (k,) metres from the axis to the edges of the member.
    begin, end : where what is to be built begins and ends.    closed : whether both are one place.
    """

    s: Floats
    P: Floats
    T: Floats
    N: Floats
    kg: Floats
    kn: Floats
    tg: Floats
    left: Floats
    right: Floats
    begin: float
    end: float
    closed: bool

    def __post_init__(self) -> None:
        for name in ("s", "kg", "kn", "tg", "left", "right"):
            lock(self, name, np.float64, (len(self.s),))
        for name in ("P", "T", "N"):
            lock(self, name, np.float64, (len(self.s), 3))

    def at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """(q, 3) points, unit tangents and unit normals at arc lengths (q,): cubic from station to station [Hermite],
        for a chord is a quarter of a millimetre off the arcs of a narrow ring."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = (self.s[i + 1] - self.s[i])[:, None]
        t = (np.asarray(s) - self.s[i])[:, None] / h
        P, Q, T, U = self.P[i], self.P[i + 1], h * self.T[i], h * self.T[i + 1]
        way = Q - P
        place = P + t * (T + t * (3 * way - 2 * T - U + t * (T + U - 2 * way)))
        T = T + t * (2 * (3 * way - 2 * T - U) + 3 * t * (T + U - 2 * way))
        N = self.N[i] + t * (self.N[i + 1] - self.N[i])
        N = N / np.linalg.norm(N, axis=1)[:, None]
        T = T - np.einsum("qi,qi->q", T, N)[:, None] * N
        return place, T / np.linalg.norm(T, axis=1)[:, None], N

    def rounds(self, s: Floats) -> Floats:
        """(3q,) arc lengths (q,) a round before, as they are, and a round later; (q,) as they are if it is open."""
        around = self.end - self.begin
        return np.concatenate([s - around, s, s + around]) if self.closed else s

    def width(self, s: Floats) -> Floats:
        """(q,) metres at arc lengths (q,)."""
        return np.asarray(np.interp(s, self.s, self.left + self.right))

    def wrapped(self, s: float) -> float:
        """The arc length between `begin` and `end` of the same place on the axis."""
        if not self.closed:
            return s
        length = self.end - self.begin
        return self.begin + float(np.mod(s - self.begin, length))


def member_course(graph: MemberGraph, member: Member, past: float, more: float) -> StripCourse:
    """The course of a member with an axis.

    past : metres that it goes on beyond a node that is nearer than that to its end.
    more : metres of stations beyond what is to be built.
    A closed one begins in the middle of its longest bay, and one that curls up at an end stops before that.
    """
    axis = member.axis
    assert axis is not None
    left, right = even_edges(axis, member.sides)
    at = node_stations(member, graph.along[member.id])
    if axis.closed:
        return _opened(axis, left, right, at, more)
    before = past - float(at[0]) if len(at) and at[0] < past else 0.0
    after = past - (axis.length - float(at[-1])) if len(at) and axis.length - at[-1] < past else 0.0
    first, last = uncurled(member)
    parts = [_beyond(axis, 0, -(before + more)), axis, _beyond(axis, -1, after + more)]
    rows = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ("s", "P", "T", "N")}
    rows |= {name: np.concatenate([getattr(part, name) for part in parts]) for name in ("kg", "kn", "tg")}
    pad = (BEYOND, BEYOND)
    return StripCourse(
        **rows,
        left=np.pad(left, pad, mode="edge"),
        right=np.pad(right, pad, mode="edge"),
        begin=first or -before,
        end=last if last < axis.length else axis.length + after,
        closed=False,
    )


def turns_within_its_width(member: Member) -> Bools:
    """(k,) where the axis of a member turns about a point that lies within its own width, or nearly."""
    assert member.axis is not None
    return np.asarray(np.abs(member.axis.kg) * member.width / 2 >= 0.9)


def uncurled(member: Member) -> tuple[float, float]:
    """The arc lengths between which a member with an axis does not curl up at its ends: half of the turn at which a
    stripe was parted in two members is left there."""
    axis = member.axis
    assert axis is not None
    reach = OBLIQUE * float(np.median(member.width))
    if axis.closed or axis.length < 4 * reach:
        return 0.0, axis.length
    curl = turns_within_its_width(member)
    head, tail = np.flatnonzero(curl & (axis.s < reach)), np.flatnonzero(curl & (axis.s > axis.length - reach))
    first = float(axis.s[head[-1] + 1]) if len(head) else 0.0
    return first, float(axis.s[tail[0] - 1]) if len(tail) else axis.length


def node_stations(member: Member, nodes: tuple[Node, ...]) -> Floats:
    """(q,) ascending arc lengths at which a member meets others."""
    return np.array([node.at[node.members.index(member.id)] for node in nodes])


def even_edges(axis: MemberAxis, sides: Floats) -> tuple[Floats, Floats]:
    """(k,) each: metres to the left and to the right edge, of sides (k, 2) as they were cut on a mesh.

    Edges that run in parallel to the axis, but for what the mesh does, are parallel; others are evened out.
    """
    if not axis.closed:
        sides = _square_ends(axis.s, sides)
    per_station = axis.length / (len(axis.s) - 1)
    reach = min(4 * float(np.median(sides.sum(axis=1))), axis.length / 4) / per_station  # four widths to both sides
    mode: Literal["wrap", "nearest"] = "wrap" if axis.closed else "nearest"
    calm = median_filter(sides, size=(2 * round(reach / 2) + 1, 1), mode=mode)
    calm = gaussian_filter1d(calm, max(reach, 0.5), axis=0, mode=mode)
    low, high = np.percentile(calm.sum(axis=1), [5, 95])
    if high - low < CONSTANT * high:
        both = np.median(sides, axis=0)
        even = np.full(2, np.median(sides.sum(axis=1)) / 2)
        calm = np.tile(even if np.ptp(both) < CONSTANT * high else both, (len(sides), 1))
    return calm[:, 0], calm[:, 1]


def _square_ends(s: Floats, sides: Floats) -> Floats:
    """Sides (k, 2) that go on to both ends as they are `OBLIQUE` widths before: there an oblique edge cuts them off."""
    past = min(OBLIQUE * float(np.median(sides.sum(axis=1))), s[-1] / 3)
    inner = np.clip(s, past, s[-1] - past)
    return np.stack([np.interp(inner, s, side) for side in sides.T], axis=1)


def _opened(axis: MemberAxis, left: Floats, right: Floats, at: Floats, more: float) -> StripCourse:
    """A closed axis from the middle of its longest bay, once around and a little more at both ends."""
    L = axis.length
    begin = 0.0
    if len(at):
        bays = np.diff(at, append=at[0] + L)
        begin = float(np.mod(at[bays.argmax()] + bays.max() / 2, L))
    more = min(more, L / 2)
    s = np.concatenate([axis.s[:-1] + turn * L for turn in (-1, 0, 1, 2)])
    keep = (s > begin - more - L / len(axis.s)) & (s < begin + L + more + L / len(axis.s))
    rows = {name: np.tile(getattr(axis, name)[:-1], (4, 1))[keep] for name in ("P", "T", "N")}
    rows |= {name: np.tile(getattr(axis, name)[:-1], 4)[keep] for name in ("kg", "kn", "tg")}
    rows |= {"left": np.tile(left[:-1], 4)[keep], "right": np.tile(right[:-1], 4)[keep]}
    return StripCourse(s=s[keep], **rows, begin=begin, end=begin + L, closed=True)


def _beyond(axis: MemberAxis, end: int, metres: float) -> MemberAxis:
    """Stations beyond an end, ascending: the axis goes on with the curvatures that it has there [Darboux].

    The frame is carried on to the second order, which is exact to the fourth of lengths that are short for a bend.
    """
    u = metres * np.arange(1, BEYOND + 1) / BEYOND
    u = u[::-1] if metres < 0 else u
    P, T, N, B = axis.P[end], axis.T[end], axis.N[end], axis.B[end]
    kg, kn, tg = (float(getattr(axis, name)[end]) for name in ("kg", "kn", "tg"))
    bend = kg * B + kn * N
    tangents = T + u[:, None] * bend
    normals = N + u[:, None] * (-kn * T - tg * B)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    tangents -= np.einsum("ki,ki->k", tangents, normals)[:, None] * normals
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    return replace(
        axis,
        s=axis.s[end] + u,
        P=P + u[:, None] * T + (u**2)[:, None] / 2 * bend,
        T=tangents,
        N=normals,
        kg=np.full(BEYOND, kg),
        kn=np.full(BEYOND, kn),
        tg=np.full(BEYOND, tg),
        traced=np.zeros(BEYOND),
    )


SAGITTA = 2e-5
"""Metres that a chord of an outline may be off its arc."""


@dataclass(frozen=True, eq=False)
class Development:
    """A course at a height h along its normals, metres, and the same rolled out: x (k, 2) from the origin along +x."""

    course: StripCourse
    height: float

    @cached_property
    def speed(self) -> Floats:
        """(k,) ds_h / ds."""
        c, h = self.course, self.height
        return np.asarray(np.hypot(1 - h * c.kn, h * c.tg))

    @cached_property
    def turn(self) -> Floats:
        """(k,) phi, radians."""
        c, h = self.course, self.height
        return np.asarray(np.arctan2(-h * c.tg, 1 - h * c.kn))

    @cached_property
    def length(self) -> Floats:
        """(k,) arc length of the layer's own middle line."""
        steps = (self.speed[1:] + self.speed[:-1]) / 2 * np.diff(self.course.s)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def angle(self) -> Floats:
        """(k,) radians, of the tangent of the developed line: the integral of kg ds, and the change of phi."""
        kg = self.course.kg
        bent = np.concatenate([[0.0], np.cumsum((kg[1:] + kg[:-1]) / 2 * np.diff(self.course.s))])
        return np.asarray(bent + self.turn - self.turn[0])

    @cached_property
    def x(self) -> Floats:
        """(k, 2) the developed middle line, an arc of a circle from station to station."""
        return np.concatenate([np.zeros((1, 2)), np.cumsum(_arcs(np.diff(self.length), self.angle), axis=0)])

    def at(self, s: Floats) -> tuple[Floats, Floats]:
        """(q, 2) places of the developed middle line and (q,) its angles at arc lengths s (q,) of the course."""
        s = np.atleast_1d(s)
        i = np.clip(np.searchsorted(self.course.s, s, side="right") - 1, 0, len(self.course.s) - 2)
        step = np.interp(s, self.course.s, self.length) - self.length[i]
        angle = np.interp(s, self.course.s, self.angle)
        return self.x[i] + _chords(step, self.angle[i], angle), angle

    def flat(self, s: Floats, y: Floats) -> Floats:
        """(q, 2) the place y (q,) metres to the left of the middle line at arc lengths s (q,)."""
        x, angle = self.at(s)
        return np.asarray(x + np.asarray(y)[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1))

    def frame(self, s: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """(q, 3) points in space, tangents, lefts and normals of the layer at arc lengths s (q,)."""
        P, T, N = self.course.at(s)
        B = cross(N, T)
        turn = np.interp(s, self.course.s, self.turn)[:, None]
        return P + self.height * N, np.cos(turn) * T + np.sin(turn) * B, np.cos(turn) * B - np.sin(turn) * T, N

    def place(self, point: Floats, normal: Floats, s: float) -> tuple[float, float]:
        """Where the line through a point (3,) of the surface along a unit normal (3,) goes through the layer: the arc
        length of the course, near `s`, and metres to the left."""
        y = 0.0
        for _ in range(4):  # Newton steps
            P, T, B, N = (row[0] for row in self.frame(np.array([s])))
            on = point + normal * ((P - point) @ N) / (normal @ N)
            y = float((on - P) @ B)
            step = float(np.interp(s, self.course.s, self.speed)) - y * self._bend(s)
            s += float((on - P) @ T) / step
            if abs((on - P) @ T) < 1e-9:
                break
        return s, y

    def outline(self, begin: float, end: float) -> Floats:
        """(k, 2) the strip from one arc length to another, counter-clockwise, from its right edge at the beginning."""
        s = self.stations(begin, end)
        left, right = (np.interp(s, self.course.s, side) for side in (self.course.left, self.course.right))
        x, angle = self.at(s)  # once for both edges: pieces are tried in many lengths
        across = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        return np.concatenate([x - right[:, None] * across, (x + left[:, None] * across)[::-1]])

    def stations(self, begin: float, end: float) -> Floats:
        """(k,) arc lengths from one to another, so near to each other that chords are as good as arcs."""
        most = float(np.diff(self.course.s).max())
        count = int(np.ceil((end - begin) / min(most, np.sqrt(8 * SAGITTA / self._largest_bend)))) + 1
        return np.linspace(begin, end, max(count, 2))

    @cached_property
    def _largest_bend(self) -> float:
        """The largest |kg_h|, 1/m."""
        return float(np.abs(np.gradient(self.angle, self.length)).max(initial=1e-9))

    def _bend(self, s: float) -> float:
        """kg_h ds_h / ds there, 1/m."""
        i = int(np.clip(np.searchsorted(self.course.s, s, side="right") - 1, 0, len(self.course.s) - 2))
        return float((self.angle[i + 1] - self.angle[i]) / (self.course.s[i + 1] - self.course.s[i]))


def _arcs(steps: Floats, angle: Floats) -> Floats:
    """(k - 1, 2) chords of arcs of lengths (k - 1,) between angles (k,)."""
    return _chords(steps, angle[:-1], angle[1:])


def _chords(step: Floats, begin: Floats, end: Floats) -> Floats:
    """(q, 2) chords of arcs (q,) that begin and end with these angles (q,)."""
    middle, half = (begin + end) / 2, (end - begin) / 2
    chord = step * np.sinc(half / np.pi)
    return np.asarray(chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1))
