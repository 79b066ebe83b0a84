"""How far parts on a sheet are from each other and from its edges, by their own outlines."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from dsfab.arrays import Bools, Floats


def least_clearance(outlines: Sequence[Floats], size: tuple[float, float], enough: float) -> float:
    """The least distance, metres, between closed polygons (k, 2) each, and from them to the edges of their sheet.

    It is 0 where two overlap, and less where one is beyond an edge.
    size : of the sheet, whose edges count too.    enough : pairs whose boxes are farther apart are not measured.
    """
    boxes = [(P.min(axis=0), P.max(axis=0)) for P in outlines]
    found = [float(min(low.min(), (np.array(size) - high).min())) for low, high in boxes]
    for (P, (a, b)), (Q, (c, d)) in combinations(zip(outlines, boxes, strict=True), 2):
        if float(np.maximum(c - b, a - d).max()) < enough:
            found.append(polygon_distance(P, Q))
    return min(found, default=np.inf)


def polygon_distance(P: Floats, Q: Floats) -> float:
    """Metres between two closed polygons (p, 2) and (q, 2), as areas; 0 where they overlap or touch."""
    if _inside(P[:1], Q)[0] or _inside(Q[:1], P)[0] or _cross(P, Q):
        return 0.0
    return min(_from_sides(P, Q), _from_sides(Q, P))


def _from_sides(points: Floats, polygon: Floats) -> float:
    """Metres from points (p, 2) to the sides of a polygon (q, 2), of the nearest pair."""
    a, side = polygon, np.roll(polygon, -1, axis=0) - polygon
    way = points[:, None] - a
    t = np.clip((way * side).sum(axis=2) / np.maximum((side**2).sum(axis=1), 1e-30), 0, 1)
    return float(np.linalg.norm(way - t[..., None] * side, axis=2).min())


def _inside(points: Floats, polygon: Floats) -> Bools:
    """(p,) whether points (p, 2) are inside of a polygon: a ray crosses its sides an odd number of times."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray((spans & (x < at)).sum(axis=1) % 2 == 1)


def _cross(P: Floats, Q: Floats) -> bool:
    """Whether a side of one polygon crosses one of the other: each has its ends on both sides of the other."""
    a, b, c, d = P[:, None], np.roll(P, -1, axis=0)[:, None], Q[None], np.roll(Q, -1, axis=0)[None]
    return bool(((_turn(a, b, c) * _turn(a, b, d) < 0) & (_turn(c, d, a) * _turn(c, d, b) < 0)).any())


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the area of the triangles a, b, c, positive where they turn to the left."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
