"""Closed curves in a plane, as polygons: how deep points lie in them, where they bend, where they cross themselves."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.surface.nearest import nearest

BEND = 15.0
"""Degrees from which on a polygon has a corner; by less turn the sides that stand for a curve."""
LOOKED = 4_000_000
"""Pairs of a point and a side that are looked at together."""


def depth_in(loops: Sequence[Floats], P: Floats) -> Floats:
    """(p,) distance of points P (p, 2) from polygons (k, 2), in their unit; positive within, negative outside.

    Within is what an odd number of the polygons is around: one in another is an island.
    """
    start = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    space = np.zeros((2 * len(start), 3))
    space[:, :2] = np.concatenate([start, end])
    sides = np.arange(2 * len(start)).reshape(2, -1).T
    points = np.zeros((len(P), 3))
    points[:, :2] = P
    away = nearest(points, space, sides).distance
    return np.asarray(np.where(_within(start, end, P), away, -away))


def _within(start: Floats, end: Floats, P: Floats) -> Bools:
    """(p,) whether a ray from points P (p, 2) along x crosses an odd number of sides, from start to end (s, 2)."""
    odd, some = np.zeros(len(P), dtype=bool), max(LOOKED // len(start), 1)
    rise = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    for k in range(0, len(P), some):
        x, y = P[k : k + some].T[:, :, None]
        spans = (start[:, 1] <= y) != (end[:, 1] <= y)
        there = start[:, 0] + (y - start[:, 1]) / rise * (end[:, 0] - start[:, 0])
        odd[k : k + some] = (spans & (there > x)).sum(axis=1) % 2 == 1
    return odd


def without_repeats(P: Floats) -> Floats:
    """The corners (k, d) of a polygon without those at the place of the one before, the first after the last too."""
    return np.asarray(P[(np.roll(P, 1, axis=0) != P).any(axis=1)])


def enclosed_area(P: Floats) -> float:
    """Area within a polygon (k, 2), positive however it runs, in its unit squared."""
    (x, y), (u, v) = P.T, np.roll(P, -1, axis=0).T
    return float(abs(x @ v - u @ y) / 2)


def bends(P: Floats) -> Bools:
    """(k,) the corners of a polygon (k, 2) at which it turns by `BEND` or more."""
    came, goes = P - np.roll(P, 1, axis=0), np.roll(P, -1, axis=0) - P
    cross = came[:, 0] * goes[:, 1] - came[:, 1] * goes[:, 0]
    angle = np.abs(np.arctan2(cross, np.einsum("ki,ki->k", came, goes)))
    return np.asarray(angle >= np.radians(BEND))


def self_crossing(P: Floats) -> tuple[int, int, Floats] | None:
    """The first two sides of a polygon (k, 2) that cross or touch, neighbours apart, and where (2,); None: none do."""
    k, Q = len(P), np.roll(P, -1, axis=0)
    for i in range(k - 2):
        j = np.arange(i + 2, k - (i == 0))
        a, b, c, d = P[i], Q[i], P[j], Q[j]
        one, two = _turns(a, b, c), _turns(a, b, d)
        three, four = _turns(c, d, a), _turns(c, d, b)
        across = (one * two <= 0) & (three * four <= 0)
        on_line = (one == 0) & (two == 0)
        ahead, span = (c - a) @ (b - a), (d - a) @ (b - a)
        across &= ~on_line | ((np.maximum(ahead, span) >= 0) & (np.minimum(ahead, span) <= (b - a) @ (b - a)))
        if across.any():
            n = int(across.argmax())
            share = three[n] / (three[n] - four[n]) if three[n] != four[n] else 0.0
            return i, int(j[n]), a + share * (b - a)
    return None


def _turns(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed areas of triangles (..., 2)."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
