"""`Development`: a strip that lies at a height over the surface, rolled out into the plane.

    ds_h = sqrt((1 - h kn)^2 + (h tg)^2) ds      phi = atan2(-h tg, 1 - h kn)      kg_h = (kg + phi') ds / ds_h

The curve P + h N has these lengths, turns by phi against the axis within the surface, and bends by kg_h in it: from
the derivative of N in the Darboux frame, N' = -kn T - tg B. Normals stay the same. With the lengths of the middle
surface, strips of two layers would miss each other by centimetres on a dome.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Floats, cross
from dsfab.workshop.course import StripCourse

STEPS = 4
"""Newton steps to a place beside an axis."""
EXACT = 1e-9
"""Metres along an axis that such a place may be off."""
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
        for _ in range(STEPS):
            P, T, B, N = (row[0] for row in self.frame(np.array([s])))
            on = point + normal * ((P - point) @ N) / (normal @ N)
            y = float((on - P) @ B)
            step = float(np.interp(s, self.course.s, self.speed)) - y * self._bend(s)
            s += float((on - P) @ T) / step
            if abs((on - P) @ T) < EXACT:
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
