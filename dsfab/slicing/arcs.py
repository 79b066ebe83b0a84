"""Circles that touch two walls: the arcs that round a corner off."""

from dataclasses import dataclass, fields

import numpy as np

from dsfab.arrays import Bools, Floats, Ints

CHORD = float(np.radians(34))
"""Most that a chord turns by: it strays from its arc by 1 - cos(17 degrees) = 1/23 of the radius."""
MOST_CHORDS = 6
"""Of an arc, which turns by less than a half circle."""
STEPS = 12
"""Newton steps towards a circle; walls are nearly straight, and two or three are enough."""
TOUCHES = 5e-3
"""A circle touches a wall if it is so near to it, as a share of its radius."""
PARALLEL = 0.02
"""Walls that meet at a sine under this are not rounded off."""
TINY = 1e-300
"""What has no length is divided by this."""


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs in k planes, from wall a to wall b, counter-clockwise around `centre` (k, 2).

    foot_a, foot_b : (k, 2) where they touch.    way_a, way_b : (k,) metres from the corner to there, along the wall.
    touching       : (k,) whether there is such an arc.
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
        """(k,) the angle at which they begin, radians."""
        x, y = (self.foot_a - self.centre).T
        return np.asarray(np.arctan2(y, x))

    @property
    def angle(self) -> Floats:
        """(k,) how far they turn, radians."""
        x, y = (self.foot_b - self.centre).T
        return np.asarray((np.arctan2(y, x) - self.begin) % (2 * np.pi))

    def some(self, chosen: Bools | Ints) -> "Arcs":
        """Those that are marked (k,), or of these numbers."""
        return Arcs(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def rays(self) -> tuple[Floats, Floats]:
        """Unit normals (k, 2, 2) of the lines from the middle through both feet, away from the arc, and their distance
        (k, 2) from the origin: what an arc rounds off lies on the inner side of both."""
        a, b = (unit(foot - self.centre) for foot in (self.foot_a, self.foot_b))
        normal = np.stack([np.stack([a[:, 1], -a[:, 0]], axis=1), np.stack([-b[:, 1], b[:, 0]], axis=1)], axis=1)
        return normal, np.einsum("kci,ki->kc", normal, self.centre)

    def chords(self) -> tuple[Floats, Floats]:
        """Outward unit normals (k, c, 2) of equal chords of each arc, and their distance (k, c) from the origin.

        Where an arc has fewer, the others have a normal of 0 and a distance of 1: everything lies within them.
        """
        number = np.arange(MOST_CHORDS)
        count = np.maximum(np.ceil(self.angle / CHORD), 1)
        step = self.angle / count
        middle = self.begin[:, None] + (number + 0.5) * step[:, None]
        normal = np.stack([np.cos(middle), np.sin(middle)], axis=2)
        sagged = (self.radius * np.cos(step / 2))[:, None]
        there = number < count[:, None]
        distance = np.einsum("kci,ki->kc", normal, self.centre) + sagged
        return normal * there[:, :, None], np.where(there, distance, 1.0)


def touching_arcs(a: Floats, b: Floats, radius: Floats, first: Floats | None = None) -> Arcs:
    """Arcs of given radii (k,) that touch polylines a (k, p, 2) and b (k, q, 2), which lead away from their corners.

    first : (k, 2) middles to begin with; where the walls beside the corners would have them when left out.

    The void is on the right of a and on the left of b. Newton's method on both distances: the circle of the tangents
    at the nearest points is the next guess.
    """
    centre, good = _beside_corners(a, b, radius) if first is None else (first, np.ones(len(first), dtype=bool))
    for _ in range(STEPS):
        one, two = _nearest(a, centre)[0], _nearest(b, centre)[0]
        centre, regular = crossing(one, unit(centre - one), two, unit(centre - two), radius)
        good &= regular
    (one, way_a), (two, way_b) = _nearest(a, centre), _nearest(b, centre)
    for foot in (one, two):
        good &= np.abs(np.linalg.norm(foot - centre, axis=1) - radius) < TOUCHES * radius
    arcs = Arcs(centre, radius, one, two, way_a, way_b, good)
    good &= (arcs.angle > 0) & (arcs.angle < np.pi)
    return arcs


def _beside_corners(a: Floats, b: Floats, radius: Floats) -> tuple[Floats, Bools]:
    """(k, 2) middles of circles that touch the first walls, and which of them lie in the void."""
    u, v = _direction(a), _direction(b)
    left, right = np.stack([u[:, 1], -u[:, 0]], axis=1), np.stack([-v[:, 1], v[:, 0]], axis=1)
    centre, good = crossing(a[:, 0], left, b[:, 0], right, radius)
    good &= (np.einsum("ki,ki->k", left, v) > 0) & (np.einsum("ki,ki->k", right, u) > 0)
    return centre, good


def crossing(p: Floats, m: Floats, q: Floats, n: Floats, radius: Floats) -> tuple[Floats, Bools]:
    """(k, 2) the points at distance `radius` from lines through p and q with unit normals m and n; and which exist."""
    det = m[:, 0] * n[:, 1] - m[:, 1] * n[:, 0]
    good = np.abs(det) > PARALLEL
    det = np.where(good, det, 1.0)
    one, two = np.einsum("ki,ki->k", m, p) + radius, np.einsum("ki,ki->k", n, q) + radius
    x, y = one * n[:, 1] - two * m[:, 1], two * m[:, 0] - one * n[:, 0]
    return np.stack([x, y], axis=1) / det[:, None], good


def _nearest(line: Floats, point: Floats) -> tuple[Floats, Floats]:
    """(k, 2) the points of polylines (k, p, 2) nearest to points (k, 2), and the way along the line to them."""
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
    """(k, d) vectors x (k, d) with length 1, but for those without one."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), TINY))
