"""Exact test for triangles of a mesh that intersect outside their shared vertices and edges [Shewchuk 1997]."""

import igl.predicates
import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, sorted_order


def intersecting_pairs(V: Floats, F: Ints, among: Bools | None = None) -> Ints:
    """Return the pairs of faces (k, 2), in ascending order, that meet or touch outside shared corners and edges.
    V : (n, 3) vertices in any unit.    F : (m, 3) faces of an oriented manifold.
    among : (m,) mask of the faces to test. Unmarked faces must be known to meet no face."""
    if among is not None and not among.all():
        which = np.flatnonzero(among)
        used, corner = np.unique(F[which], return_inverse=True)
        hits = intersecting_pairs(V[used], corner.reshape(-1, 3)) if len(which) else np.empty((0, 2), dtype=np.int64)
        return np.asarray(which[hits])
    V, F = np.array(V, dtype=np.float64), np.array(F, dtype=np.int64)
    _, hits, _ = igl.predicates.find_self_intersections(V, F)
    apart = np.asarray(hits, dtype=np.int64).reshape(-1, 2)
    strangers = ~(F[apart[:, 0]][:, :, None] == F[apart[:, 1]][:, None, :]).any(axis=(1, 2))
    pairs = np.concatenate([apart[strangers], _around_vertices(V, F), _over_edges(V, F)])
    pairs = np.sort(pairs, axis=1)
    return pairs[np.lexsort(pairs.T[::-1])]  # libigl uses threads, so its order is random


def pairs_after_moves(V: Floats, F: Ints, before: Ints, moved: Bools) -> Ints:
    """Return the pairs (q, 2) of intersecting faces after a move of some vertices.
    V      : (n, 3) vertices after the move.    moved : (n,) mask of the moved vertices.
    before : (k, 2) pairs of intersecting faces before the move."""
    changed = np.asarray(moved[F].any(axis=1))
    if not changed.any():
        return before
    corners = V[F]
    middle = corners.mean(axis=1)
    radius = np.sqrt(((corners - middle[:, None]) ** 2).sum(axis=2).max(axis=1)) * (1 + 1e-9)  # margin for rounding
    reach = radius[changed].max()
    distance, _ = cKDTree(middle[changed]).query(middle, distance_upper_bound=reach + radius.max())
    new_pairs = intersecting_pairs(V, F, changed | (distance <= radius + reach))
    pairs = np.concatenate([before[~changed[before].any(axis=1)], new_pairs[changed[new_pairs].any(axis=1)]])
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])])


def _around_vertices(V: Floats, F: Ints) -> Ints:
    s, a, b = (np.roll(F, -k, axis=1).ravel() for k in range(3))
    ahead, behind = _unit(V[a] - V[s]), _unit(V[b] - V[s])
    middle = _unit(ahead + behind)
    corner = sorted_order(s)
    around = s[corner]
    position, hits = np.arange(len(corner)), []
    for distance in range(1, len(corner)):  # stops after as many rounds as a vertex has faces
        position = position[position + distance < len(corner)]
        position = position[around[position] == around[position + distance]]
        if not len(position):
            break
        i, j = corner[position], corner[position + distance]
        once = (a[i] != b[j]) & (b[i] != a[j]) & (a[i] != a[j]) & (b[i] != b[j])
        i, j = i[once], j[once]
        unclear = ~_surely_separated(ahead, behind, middle, i, j)
        i, j = i[unclear], j[unclear]
        meet = _corners_meet(V, s[i], (a[i], b[i]), (a[j], b[j]))
        hits.append(np.stack([i[meet] // 3, j[meet] // 3], axis=1))
    return np.concatenate([*hits, np.empty((0, 2), dtype=np.int64)])


def _surely_separated(ahead: Floats, behind: Floats, middle: Floats, i: Ints, j: Ints) -> Bools:
    w = middle[i] - middle[j]
    least = np.minimum(np.einsum("ck,ck->c", ahead[i], w), np.einsum("ck,ck->c", behind[i], w))
    largest = np.maximum(np.einsum("ck,ck->c", ahead[j], w), np.einsum("ck,ck->c", behind[j], w))
    rounding = 1e-12
    sure: Bools = (least > rounding) & (largest < -rounding)
    return sure


def _corners_meet(V: Floats, s: Ints, first_edge: tuple[Ints, Ints], second_edge: tuple[Ints, Ints]) -> Bools:
    """Return a mask (k,) of pairs of triangles that meet outside their common vertex s (k,).
    first_edge, second_edge : the two remaining vertices of each triangle."""
    S, A, B, C, D = V[s], V[first_edge[0]], V[first_edge[1]], V[second_edge[0]], V[second_edge[1]]
    a, b, c, d = _side(S, C, D, A), _side(S, C, D, B), _side(S, A, B, C), _side(S, A, B, D)
    meet: Bools = (a * b <= 0) & (c * d <= 0)
    flat = meet & (a == 0) & (b == 0) & (c == 0) & (d == 0)
    solid = np.flatnonzero(meet & ~flat)
    S_, A_, B_, C_, D_ = (P[solid] for P in (S, A, B, C, D))
    meet[solid] = _stabs(A_, B_, (S_, C_, D_)) | _stabs(C_, D_, (S_, A_, B_))
    flat_at = np.flatnonzero(flat)
    meet[flat_at] = _angles_overlap(*(P[flat_at] for P in (S, A, B, C, D)))
    return meet


def _stabs(p: Floats, q: Floats, triangle: tuple[Floats, Floats, Floats]) -> Bools:
    x, y, z = triangle
    turns = np.stack([_side(p, q, x, y), _side(p, q, y, z), _side(p, q, z, x)])
    through = (turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)
    ends = _side(x, y, z, p), _side(x, y, z, q)
    crosses: Bools = through & (ends[0] * ends[1] <= 0) & ((ends[0] != 0) | (ends[1] != 0))
    return crosses


def _angles_overlap(S: Floats, A: Floats, B: Floats, C: Floats, D: Floats) -> Bools:
    axis = np.abs(np.cross(A - S, B - S)).argmax(axis=1)
    first_turned, second_turned = _turn(axis, S, A, B) < 0, _turn(axis, S, C, D) < 0
    A, B = np.where(first_turned[:, None], B, A), np.where(first_turned[:, None], A, B)
    C, D = np.where(second_turned[:, None], D, C), np.where(second_turned[:, None], C, D)

    def in_angle(P: Floats, start: Floats, end: Floats) -> Bools:
        inside: Bools = (_turn(axis, S, start, P) >= 0) & (_turn(axis, S, P, end) >= 0)
        return inside

    return in_angle(C, A, B) | in_angle(D, A, B) | in_angle(A, C, D) | in_angle(B, C, D)


def _over_edges(V: Floats, F: Ints) -> Ints:
    p, q, apex = F.ravel(), np.roll(F, -1, axis=1).ravel(), np.roll(F, 1, axis=1).ravel()
    order = sorted_order(np.minimum(p, q) * len(V) + np.maximum(p, q))
    h, g = order[:-1], order[1:]
    twins = (p[h] == q[g]) & (q[h] == p[g])
    h, g = h[twins], g[twins]
    N = _unit(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]))
    may_fold = ~(np.einsum("ek,ek->e", N[h // 3], N[g // 3]) > -0.9)
    h, g = h[may_fold], g[may_fold]
    P, Q, A, B = V[p[h]], V[q[h]], V[apex[h]], V[apex[g]]
    axis = np.abs(np.cross(Q - P, A - P)).argmax(axis=1)
    folded = (_side(P, Q, A, B) == 0) & (_turn(axis, P, Q, A) * _turn(axis, P, Q, B) >= 0)
    return np.stack([h[folded] // 3, g[folded] // 3], axis=1)


def _side(a: Floats, b: Floats, c: Floats, d: Floats) -> Ints:
    if not len(a):
        return np.empty(0, dtype=np.int64)
    return np.asarray(igl.predicates.orient3d(a, b, c, d), dtype=np.int64)


def _turn(axis: Ints, a: Floats, b: Floats, c: Floats) -> Ints:
    """Return the exact sign (k,) of the area of triangles a, b, c (k, 3), projected along the axes numbered `axis`."""
    keep = 1.0 - np.eye(3)[axis]
    return _side(a * keep, b * keep, c * keep, np.eye(3)[axis])


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Floats = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
    return unit
