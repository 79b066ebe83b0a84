"""Development of members into the plane: axes with distances to the edges, and flat strips.

Points P of an axis move by a height h along normals N to a curve P + h N of length ds_h, at the angle phi to the
axis, with the geodesic curvature kg_h:
    ds_h = sqrt((1 - h kn)^2 + (h tg)^2) ds      phi = atan2(-h tg, 1 - h kn)      kg_h = (kg + phi') ds / ds_h
kg, kn, tg are the axis's curvatures and torsion."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from dsfab.core.arrays import Bools, Floats, cross, lock
from dsfab.members import Member, MemberAxis, MemberGraph

PARALLEL_SHARE = 0.05  # relative change of width up to which edges count as parallel
OBLIQUE_WIDTHS = 1.5  # an oblique cut may reach this far from a member's end, in member widths
EXTENSION_STATIONS = 16  # number of stations beyond each end of an axis


@dataclass(frozen=True, eq=False)
class StripCourse:
    """Stations along a member's axis and beyond its ends; metres and 1/m.
    s           : (k,) arc length; a closed axis has stations for more than one round.
    P, T, N     : (k, 3) points, unit tangents, unit normals of the surface.
    kg, kn, tg  : (k,) geodesic curvature, normal curvature, geodesic torsion.
    left, right : (k,) distances from the axis to the edges of the member.
    begin, end  : first and last arc length of the part that is built."""

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

    def frame_at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points, unit tangents and unit normals, (q, 3) each, at arc lengths (q,)."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = (self.s[i + 1] - self.s[i])[:, None]
        t = (np.asarray(s) - self.s[i])[:, None] / h
        P, Q, T, U = self.P[i], self.P[i + 1], h * self.T[i], h * self.T[i + 1]
        chord = Q - P
        place = P + t * (T + t * (3 * chord - 2 * T - U + t * (T + U - 2 * chord)))
        T = T + t * (2 * (3 * chord - 2 * T - U) + 3 * t * (T + U - 2 * chord))
        N = self.N[i] + t * (self.N[i + 1] - self.N[i])
        N = N / np.linalg.norm(N, axis=1)[:, None]
        T = T - np.einsum("qi,qi->q", T, N)[:, None] * N
        return place, T / np.linalg.norm(T, axis=1)[:, None], N

    def repeated_stations(self, s: Floats) -> Floats:
        """Return the arc lengths s (q,). For a closed axis of length L, return s - L, s and s + L (3 q,)."""
        around = self.end - self.begin
        return np.concatenate([s - around, s, s + around]) if self.closed else s

    def width(self, s: Floats) -> Floats:
        """Return the widths of the member (q,) at arc lengths (q,) (m)."""
        return np.asarray(np.interp(s, self.s, self.left + self.right))

    def wrapped_station(self, s: float) -> float:
        """Return the arc length `s`. On a closed axis, add whole rounds so that `begin` <= s < `end`."""
        if not self.closed:
            return s
        return self.begin + float(np.mod(s - self.begin, self.end - self.begin))


def member_course(graph: MemberGraph, member: Member, overhang: float, extra_length: float) -> StripCourse:
    """Return a member's course: stations along the axis, and distances to the edges.
    overhang     : least length beyond the first node and beyond the last node, metres.
    extra_length : length beyond the built part, metres."""
    axis = member.curve
    left_edge, right_edge = smooth_edge_distances(axis, member.sides)
    node_places = np.array([node.at[node.members.index(member.id)] for node in graph.nodes_along[member.id]])
    if axis.closed:
        return _course_of_ring(axis, left_edge, right_edge, node_places, extra_length)
    before = overhang - float(node_places[0]) if len(node_places) and node_places[0] < overhang else 0.0
    last = axis.length - float(node_places[-1]) if len(node_places) else overhang
    after = overhang - last if last < overhang else 0.0
    begin, end = uncurled_span(member)
    parts = [_extension(axis, 0, -(before + extra_length)), axis, _extension(axis, -1, after + extra_length)]
    names = ("s", "P", "T", "N", "kg", "kn", "tg")
    rows = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    pad = (EXTENSION_STATIONS, EXTENSION_STATIONS)
    rows |= {"left": np.pad(left_edge, pad, mode="edge"), "right": np.pad(right_edge, pad, mode="edge")}
    end = end if end < axis.length else axis.length + after
    return StripCourse(**rows, begin=begin or -before, end=end, closed=False)


def turns_within_its_width(member: Member) -> Bools:
    """Return a mask (k,) of stations where the axis turns sharply in the surface."""
    return np.asarray(np.abs(member.curve.kg) * member.width / 2 >= 0.9)


def uncurled_span(member: Member) -> tuple[float, float]:
    """Return the first and the last arc length of a member after its sharply turning ends are cut off."""
    axis = member.curve
    reach = OBLIQUE_WIDTHS * float(np.median(member.width))
    if axis.closed or axis.length < 4 * reach:
        return 0.0, axis.length
    curl = turns_within_its_width(member)
    head, tail = np.flatnonzero(curl & (axis.s < reach)), np.flatnonzero(curl & (axis.s > axis.length - reach))
    begin = float(axis.s[head[-1] + 1]) if len(head) else 0.0
    return begin, float(axis.s[tail[0] - 1]) if len(tail) else axis.length


def smooth_edge_distances(axis: MemberAxis, sides: Floats) -> tuple[Floats, Floats]:
    """Return the smoothed distances (k,) from a member's axis to its left and right edge (m).
    sides : (k, 2) distances before smoothing, metres."""
    if not axis.closed:
        sides = _square_ends(axis.s, sides)
    per_station = axis.length / (len(axis.s) - 1)
    reach = min(4 * float(np.median(sides.sum(axis=1))), axis.length / 4) / per_station  # smoothing range, in stations
    mode: Literal["wrap", "nearest"] = "wrap" if axis.closed else "nearest"
    calm = median_filter(sides, size=(2 * round(reach / 2) + 1, 1), mode=mode)
    calm = gaussian_filter1d(calm, max(reach, 0.5), axis=0, mode=mode)
    low, high = np.percentile(calm.sum(axis=1), [5, 95])
    if high - low < PARALLEL_SHARE * high:
        medians = np.median(sides, axis=0)
        even = np.full(2, np.median(sides.sum(axis=1)) / 2)
        calm = np.tile(even if np.ptp(medians) < PARALLEL_SHARE * high else medians, (len(sides), 1))
    return calm[:, 0], calm[:, 1]


def _square_ends(s: Floats, sides: Floats) -> Floats:
    past = min(OBLIQUE_WIDTHS * float(np.median(sides.sum(axis=1))), s[-1] / 3)
    inner = np.clip(s, past, s[-1] - past)
    return np.stack([np.interp(inner, s, side) for side in sides.T], axis=1)


def _course_of_ring(
    axis: MemberAxis, left_edge: Floats, right_edge: Floats, node_places: Floats, extra_length: float
) -> StripCourse:
    L = axis.length
    begin = 0.0
    if len(node_places):
        bays = np.diff(node_places, append=node_places[0] + L)
        begin = float(np.mod(node_places[bays.argmax()] + bays.max() / 2, L))
    extra_length = min(extra_length, L / 2)
    s = np.concatenate([axis.s[:-1] + turn * L for turn in (-1, 0, 1, 2)])
    keep = (s > begin - extra_length - L / len(axis.s)) & (s < begin + L + extra_length + L / len(axis.s))
    rows = {name: np.tile(getattr(axis, name)[:-1], (4, 1))[keep] for name in ("P", "T", "N")}
    rows |= {name: np.tile(getattr(axis, name)[:-1], 4)[keep] for name in ("kg", "kn", "tg")}
    rows |= {"left": np.tile(left_edge[:-1], 4)[keep], "right": np.tile(right_edge[:-1], 4)[keep]}
    return StripCourse(s=s[keep], **rows, begin=begin, end=begin + L, closed=True)


def _extension(axis: MemberAxis, end_index: int, distance: float) -> MemberAxis:
    u = distance * np.arange(1, EXTENSION_STATIONS + 1) / EXTENSION_STATIONS
    u = u[::-1] if distance < 0 else u
    P, T, N, B = axis.P[end_index], axis.T[end_index], axis.N[end_index], axis.B[end_index]
    kg, kn, tg = (float(getattr(axis, name)[end_index]) for name in ("kg", "kn", "tg"))
    bend = kg * B + kn * N
    tangents = T + u[:, None] * bend
    normals = N + u[:, None] * (-kn * T - tg * B)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    tangents -= np.einsum("ki,ki->k", tangents, normals)[:, None] * normals
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    s, P = axis.s[end_index] + u, P + u[:, None] * T + (u**2)[:, None] / 2 * bend
    values = {"kg": kg, "kn": kn, "tg": tg, "traced": 0.0}
    rows: dict[str, Any] = {name: np.full(EXTENSION_STATIONS, value) for name, value in values.items()}
    return replace(axis, s=s, P=P, T=tangents, N=normals, **rows)


CHORD_TOLERANCE = 2e-5  # largest distance between an outline's chord and its arc (m)


@dataclass(frozen=True, eq=False)
class Development:
    """Strip of a member, developed into the plane.    height : height of the strip above the member's axis (m).
    The developed middle line x (k, 2) begins at the origin along +x."""

    course: StripCourse
    height: float

    @cached_property
    def length_ratio(self) -> Floats:
        """Length of the strip's middle line, divided by the length of the member's axis, at each station (k,)."""
        c, h = self.course, self.height
        return np.asarray(np.hypot(1 - h * c.kn, h * c.tg))

    @cached_property
    def turn(self) -> Floats:
        """Angle phi (k,) from the member's axis to the strip's middle line (radians)."""
        c, h = self.course, self.height
        return np.asarray(np.arctan2(-h * c.tg, 1 - h * c.kn))

    @cached_property
    def length(self) -> Floats:
        """Arc length (k,) of the strip's middle line at the stations (m)."""
        steps = (self.length_ratio[1:] + self.length_ratio[:-1]) / 2 * np.diff(self.course.s)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def angle(self) -> Floats:
        """Direction (k,) of the flat middle line at the stations (radians)."""
        kg = self.course.kg
        bent = np.concatenate([[0.0], np.cumsum((kg[1:] + kg[:-1]) / 2 * np.diff(self.course.s))])
        return np.asarray(bent + self.turn - self.turn[0])

    @cached_property
    def x(self) -> Floats:
        """Points (k, 2) of the flat middle line at the stations."""
        arcs = _chords(np.diff(self.length), self.angle[:-1], self.angle[1:])
        return np.concatenate([np.zeros((1, 2)), np.cumsum(arcs, axis=0)])

    def middle_line_at(self, s: Floats) -> tuple[Floats, Floats]:
        """Return points (q, 2) and angles (q,) of the flat middle line at arc lengths s (q,)."""
        s = np.atleast_1d(s)
        i = np.clip(np.searchsorted(self.course.s, s, side="right") - 1, 0, len(self.course.s) - 2)
        step = np.interp(s, self.course.s, self.length) - self.length[i]
        angle = np.interp(s, self.course.s, self.angle)
        return self.x[i] + _chords(step, self.angle[i], angle), angle

    def to_plane(self, s: Floats, y: Floats) -> Floats:
        """Return points (q, 2) of the developed strip at arc lengths s (q,), y (q,) metres left of the middle line."""
        x, angle = self.middle_line_at(s)
        return np.asarray(x + np.asarray(y)[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1))

    def frame(self, s: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return points, tangents, left directions and normals, (q, 3) each, of the strip at arc lengths s (q,)."""
        P, T, N = self.course.frame_at(s)
        B = cross(N, T)
        turn = np.interp(s, self.course.s, self.turn)[:, None]
        return P + self.height * N, np.cos(turn) * T + np.sin(turn) * B, np.cos(turn) * B - np.sin(turn) * T, N

    def piercing_point(self, point: Floats, normal: Floats, s: float) -> tuple[float, float]:
        """Return the point where the line through a point (3,) along a unit normal (3,) meets the strip near `s`:
        the arc length, and the distance left of the strip's middle line (m)."""
        y = 0.0
        for _ in range(4):  # Newton steps
            P, T, B, N = (row[0] for row in self.frame(np.array([s])))
            pierced = point + normal * ((P - point) @ N) / (normal @ N)
            y = float((pierced - P) @ B)
            step = float(np.interp(s, self.course.s, self.length_ratio)) - y * self._bend(s)
            s += float((pierced - P) @ T) / step
            if abs((pierced - P) @ T) < 1e-9:
                break
        return s, y

    def outline(self, begin: float, end: float) -> Floats:
        """Return the flat outline (k, 2) between two arc lengths, counter-clockwise from the right edge at `begin`."""
        s = self.stations(begin, end)
        left_edge, right_edge = (np.interp(s, self.course.s, side) for side in (self.course.left, self.course.right))
        x, angle = self.middle_line_at(s)  # computed once for both edges, to save time
        across = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        return np.concatenate([x - right_edge[:, None] * across, (x + left_edge[:, None] * across)[::-1]])

    def stations(self, begin: float, end: float) -> Floats:
        """Return arc lengths (k,) from `begin` to `end` in small steps."""
        longest_step = float(np.diff(self.course.s).max())
        count = int(np.ceil((end - begin) / min(longest_step, np.sqrt(8 * CHORD_TOLERANCE / self._largest_bend)))) + 1
        return np.linspace(begin, end, max(count, 2))

    @cached_property
    def _largest_bend(self) -> float:
        return float(np.abs(np.gradient(self.angle, self.length)).max(initial=1e-9))

    def _bend(self, s: float) -> float:
        i = int(np.clip(np.searchsorted(self.course.s, s, side="right") - 1, 0, len(self.course.s) - 2))
        return float((self.angle[i + 1] - self.angle[i]) / (self.course.s[i + 1] - self.course.s[i]))


def _chords(step: Floats, begin: Floats, end: Floats) -> Floats:
    middle, half = (begin + end) / 2, (end - begin) / 2
    chord = step * np.sinc(half / np.pi)
    return np.asarray(chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1))
