"""Where surfaces of trimmed regions are parametrised: a quadrilateral around the outline in the mean plane.

.-------------.        What a surface does beside the outline nothing holds, and programs draw boxes around poles: those
|'.  .-'''':  |        at a corner that a region has not were 86 mm outside of a saddle of 5 m. Where a quadrilateral
|  '.'    '.  |        along its sides is far smaller than all rectangles around it, it is that. Between opposite sides
'---'-------'-'        it is bilinear, and polynomials of the plane are polynomials there, of the same degree.
"""

import numpy as np
from scipy.spatial import ConvexHull

from dsfab.arrays import Floats

TURNED = np.array([[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in np.radians(np.arange(0, 90, 5))])
"""(t, 2, 2) the axes of rectangles around a region, in a plane."""

SMALLER = 3 / 4
"""Share of its area that it then has at most: corners of turned ones are beyond the box around the region."""

BESIDE = 1.0
"""Millimetres that a region is away from its sides: curves go on between the points that are asked."""

TAPERED = 0.05
"""Least ratio of the areas of triangles at corners of a quadrilateral: at a flat corner a surface is folded."""


def domain(line: Floats) -> Floats:
    """(2, 2, 2) corners of the smallest quadrilateral around a line (k, 2), by both parameters, right-handed."""
    found = np.ptp(line @ TURNED.transpose(0, 2, 1), axis=1).prod(axis=1)
    best = int(np.argmin(found))
    axes, area = (TURNED[best], found[best]) if found[best] < SMALLER * found[0] else (TURNED[0], found[0])
    hull = ConvexHull(line)
    if hull.volume < SMALLER * area:  # in a plane that is its area
        four = _four_sided(line[hull.vertices])
        if four is not None and _area(four) < SMALLER * area:
            return np.stack([four[[0, 3]], four[[1, 2]]])
    at = line @ axes.T
    low, high = at.min(axis=0) - BESIDE, at.max(axis=0) + BESIDE
    return np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=2) @ axes


def grid(corners: Floats, degree: int) -> Floats:
    """(p + 1, p + 1, 2) poles of the bilinear surface between corners (2, 2, 2)."""
    x = np.linspace(0, 1, degree + 1)
    both = np.stack([1 - x, x], axis=1)
    return np.asarray(np.einsum("xa,yb,abi->xyi", both, both, corners))


def places(corners: Floats, points: Floats) -> Floats:
    """(k, 2) parameters of points (k, 2) between corners (2, 2, 2); of those beyond, some that are not from 0 to 1."""
    (a, c), (b, d) = corners
    B, C, D, H = b - a, c - a, a - b - c + d, points - a
    two, one, none = -_cross(C, D), _cross(H, D) + _cross(B, C), _cross(H, B)  # of a quadratic for the second
    root = one**2 - 4 * two * none
    more = np.where(root >= 0, one + np.sqrt(np.maximum(root, 0)), 0.0)  # over 0 between the corners
    v = np.where(more > 0, -2 * none / np.where(more > 0, more, 1.0), -1.0)
    way = B + v[:, None] * D
    u = np.einsum("ki,ki->k", H - v[:, None] * C, way) / np.maximum(np.einsum("ki,ki->k", way, way), 1e-300)
    return np.stack([u, v], axis=1)


def _four_sided(hull: Floats) -> Floats | None:
    """(4, 2) corners of a small quadrilateral beside a convex polygon (k, 2), counter-clockwise: of its sides the one
    whose neighbours meet in the smallest triangle over it is left out, again and again."""
    way = np.roll(hull, -1, axis=0) - hull
    way /= np.linalg.norm(way, axis=1)[:, None]
    away = np.stack([way[:, 1], -way[:, 0]], axis=1)
    at = np.einsum("ki,ki->k", away, hull) + BESIDE
    while len(way) > 4:
        corners = _corners(way, at)
        long = np.einsum("ki,ki->k", np.roll(corners, -1, axis=0) - corners, way)
        before, after = np.roll(way, 1, axis=0), np.roll(way, -1, axis=0)
        turns = _cross(before, way), _cross(way, after), _cross(before, after)
        over = np.where(turns[2] > 1e-9, long**2 * turns[0] * turns[1] / np.maximum(turns[2], 1e-9), np.inf)
        if not np.isfinite(over.min()):
            return None
        keep = np.arange(len(way)) != over.argmin()
        way, at = way[keep], at[keep]
    if len(way) < 4:
        return None
    four = _corners(way, at)
    ahead = np.roll(four, -1, axis=0) - four
    spanned = _cross(np.roll(ahead, 1, axis=0), ahead)
    return four if spanned.min() > TAPERED * spanned.max() else None


def _corners(way: Floats, at: Floats) -> Floats:
    """(k, 2) where each of the lines along `way` (k, 2), so far to the right of the origin, meets the one before it."""
    before, far = np.roll(way, 1, axis=0), np.roll(at, 1)
    return np.asarray((at[:, None] * before - far[:, None] * way) / _cross(before, way)[:, None])


def _area(polygon: Floats) -> float:
    return float(_cross(polygon, np.roll(polygon, -1, axis=0)).sum()) / 2


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
