"""Normals for thickening: at each vertex the one that its faces see best, and how much longer it is at a crease."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, cross, lengths, sorted_order
from dsfab.surface.mesh import Surface

VISIBILITY_GAP = 0.001
"""A normal is visible enough when its smallest cosine is within this share of the best possible one."""

VISIBILITY_ROUNDS = 200
"""Most steps towards the most visible normal. Few vertices need them all, and end within 5 % of the best cosine."""

CHUNK = 1 << 13
"""Faces looked at together: as many as the processor's cache takes."""

MITRE_LIMIT = 2.0
"""Longest offset at a crease, in half thicknesses."""


def visible_normals(surface: Surface, weights: Floats, faces: Floats) -> Floats:
    """(n, 3) unit normals with nearly (5 %) the largest possible smallest cosine to the faces around each vertex.

    The best one is the direction of the point nearest to the origin in the convex hull of the face normals
    [Gilbert 1966: step towards the worst face], and the length of any point there bounds the best cosine from above.
    Starts from the mean weighted by the corner angles (m, 3), and falls back to it where no direction sees all faces.
    faces : (m, 3, 3) normal of each face at each of its corners, turned to the side that the vertex is seen from.
    """
    vertex, normal = surface.F.ravel(), faces.reshape(-1, 3)
    mean = _corner_mean(surface, weights, normal)
    point = mean.copy()
    tight = np.flatnonzero(_open(surface, point, faces)[vertex])  # on a fine mesh few, or none
    by_vertex = tight[sorted_order(vertex[tight])]
    vertex, normal = vertex[by_vertex], normal[by_vertex]
    for _ in range(VISIBILITY_ROUNDS if len(tight) else 0):
        worst, lowest = _lowest_corner(vertex, np.einsum("ci,ci->c", normal, point[vertex]))
        here = vertex[worst]
        square = np.einsum("vi,vi->v", point[here], point[here])
        open_ = lowest < (1 - VISIBILITY_GAP) * square
        if not open_.any():
            break
        here, worst, square, lowest = here[open_], worst[open_], square[open_], lowest[open_]
        towards = normal[worst] - point[here]
        length2 = np.maximum(np.einsum("vi,vi->v", towards, towards), np.finfo(float).tiny)
        point[here] += np.clip((square - lowest) / length2, 0, 1)[:, None] * towards
        still = np.isin(vertex, here)
        vertex, normal = vertex[still], normal[still]
    return _settled(surface, point, mean, faces)


def _open(surface: Surface, point: Floats, faces: Floats) -> Bools:
    """(n,) where a step towards the worst face may be worth it, or nearly."""
    lowest = np.full(surface.n, np.inf)
    for corner, normal in zip(surface.F.T, faces.transpose(1, 0, 2), strict=True):
        np.minimum.at(lowest, corner, np.einsum("mi,mi->m", normal, point.take(corner, axis=0)))
    return np.asarray(lowest < (1 - 0.999 * VISIBILITY_GAP) * np.einsum("vi,vi->v", point, point))


def mitres(surface: Surface, N: Floats, weights: Floats, faces: Floats) -> Floats:
    """(n,) 1 / mean cosine between each normal N and the faces around it (see `visible_normals`), up to MITRE_LIMIT."""
    cosine = np.stack([np.einsum("mi,mi->m", N.take(surface.F[:, v], axis=0), faces[:, v]) for v in range(3)], axis=1)
    mean = _corner_mean(surface, weights, cosine.reshape(-1, 1))[:, 0]
    return 1 / np.clip(mean, 1 / MITRE_LIMIT, 1)


def _corner_mean(surface: Surface, weights: Floats, values: Floats) -> Floats:
    """(n, k) weighted mean over the corners at each vertex of values (3 m, k); zero without corners."""
    w, vertex = weights.ravel(), surface.F.ravel()
    total = np.stack([np.bincount(vertex, w * column, surface.n) for column in values.T], axis=1)
    whole = np.bincount(vertex, w, surface.n)[:, None]
    mean: Floats = np.divide(total, whole, out=np.zeros_like(total), where=whole > 0)
    return mean


def corner_angles(surface: Surface) -> Floats:
    """(m, 3) angles of the faces at their corners, radians."""
    angles = np.empty((surface.m, 3))
    for k in range(0, surface.m, CHUNK):
        a, b, c = (surface.V.take(F, axis=0) for F in surface.F[k : k + CHUNK].T)
        sides = b - a, c - b, a - c
        for v in range(3):
            sine, cosine = lengths(cross(sides[v - 1], sides[v])), -np.einsum("mi,mi->m", sides[v], sides[v - 1])
            angles[k : k + CHUNK, v] = np.arctan2(sine, cosine)
    return angles


def _lowest_corner(vertex: Ints, value: Floats) -> tuple[Ints, Floats]:
    """Index of the corner with the lowest value at each vertex of a sorted list, and that value."""
    start = np.flatnonzero(np.concatenate([[True], vertex[1:] != vertex[:-1]]))
    lowest = np.minimum.reduceat(value, start)
    run = np.cumsum(np.concatenate([[False], vertex[1:] != vertex[:-1]]))
    hits = np.flatnonzero(value == lowest[run])
    first_hit = np.diff(run[hits], prepend=-1) > 0
    return hits[first_hit], lowest


def _settled(surface: Surface, point: Floats, mean: Floats, faces: Floats) -> Floats:
    """Unit normals from the points found; the mean, or any face's normal, where a point sees a face from behind."""
    seen = _sees_all(surface, point, faces)
    N = np.where(seen[:, None], point, mean)
    lost = lengths(N) < 1e-6
    if lost.any():
        some_face = np.zeros_like(N)
        some_face[surface.F[:, ::-1].ravel()] = faces[:, ::-1].reshape(-1, 3)
        N = np.where(lost[:, None], some_face, N)
    length = lengths(N)[:, None]
    unit: Floats = np.divide(N, length, out=np.zeros_like(N), where=length > 0)
    return unit


def _sees_all(surface: Surface, N: Floats, faces: Floats) -> Bools:
    """(n,) whether each vector (n, 3) makes an acute angle with all faces around its vertex."""
    sees = np.ones(surface.n, dtype=bool)
    for corner, normal in zip(surface.F.T, faces.transpose(1, 0, 2), strict=True):
        sees[corner[np.einsum("mi,mi->m", normal, N.take(corner, axis=0)) <= 0]] = False
    return sees
