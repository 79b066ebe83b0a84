"""Changes of edges in a mesh: halving, flipping and collapsing."""

import igl
import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, cross, edge_lengths, lengths
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import MOST_TRIANGLES
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import EdgeTable, adjacency, edge_table, manifold_faults, misoriented_edges, next_half_edge

CREASE = 30.0  # Least angle between the normals of the faces at a crease, degrees.


def feature_edges(surface: Surface) -> Bools:
    """Return a mask (e,) of edges on the boundary, at a crease, or between faces of opposite orientation."""
    return border_edges(surface) | sharp_edges(surface)


def border_edges(surface: Surface) -> Bools:
    """Return a mask (e,) of edges on the boundary, or between faces of opposite orientation."""
    marks = surface.edges.boundary.copy()
    marks[misoriented_edges(surface.F, surface.edges)] = True
    return marks


def sharp_edges(surface: Surface) -> Bools:
    """Return a mask (e,) of edges at which the normals of the two faces differ by at least 30 degrees."""
    marks = np.zeros(len(surface.edges.ends), dtype=bool)
    first_normals, second_normals = surface.normals[surface.edges.pairs // 3].transpose(1, 0, 2)
    marks[surface.edges.count == 2] = np.einsum("ei,ei->e", first_normals, second_normals) < np.cos(np.radians(CREASE))
    return marks


def refined_surface(surface: Surface, target: float, smooth: bool = False) -> Surface:
    """Return the surface with triangles divided until no edge is longer than `target` metres. Old vertices come first.
    smooth : False: long edges are halved, and the shape stays the same [Rivara 1984]. True: every triangle is divided
    in four, and vertices move towards a smooth surface [Loop 1987].
    Raises SurfaceError for an invalid target, for too many triangles, and for `smooth` without an oriented manifold."""
    if not (np.isfinite(target) and target > 0):
        raise SurfaceError(f"the edge length {target} must be a positive length in metres; change surface.refine")
    if smooth and (faults := manifold_faults(surface.F, surface.edges, surface.n)):
        raise SurfaceError(f"only a manifold surface can be subdivided smoothly: {faults[0]}; set smooth to false")
    V, F = surface.V, surface.F
    edges = surface.edges
    fixed_edges = edges.ends[feature_edges(surface)] if smooth else edges.ends[:0]
    while (long := edge_lengths(V, edges.ends) > target).any():
        if smooth:
            _check_count(4 * len(F), target)
            V, F, fixed_edges = _loop_subdivision(V, F, edges, fixed_edges)
        else:
            _check_count(len(F) + int(long[edges.of].sum()), target)
            V, F, _ = halved_edges(V, F, edges, long)
        edges = edge_table(F)
    return surface if F is surface.F else Surface(V, F)


def _loop_subdivision(V: Floats, F: Ints, edges: EdgeTable, fixed_edges: Ints) -> tuple[Floats, Ints, Ints]:
    """Divide every triangle in four by Loop's scheme. Return vertices, faces, and the two halves of each fixed edge."""
    positions = np.searchsorted(edges.ends @ (len(V), 1), fixed_edges @ (len(V), 1))
    moved, finer = igl.loop(V, F, 1)
    middle = np.empty(len(edges.ends), dtype=np.int64)
    quarters = finer.reshape(-1, 4, 3)  # libigl puts quarters 0 and 1 at corners 0 and 1
    middle[edges.of] = np.stack([quarters[:, 0, 1], quarters[:, 1, 1], quarters[:, 0, 2]], axis=1)
    moved[fixed_edges] = V[fixed_edges]
    moved[middle[positions]] = V[fixed_edges].mean(axis=1)
    halves = np.stack([fixed_edges, np.stack([middle[positions], middle[positions]], axis=1)], axis=2).reshape(-1, 2)
    return moved, finer, np.sort(halves, axis=1)


def _check_count(count: int, target: float) -> None:
    if count > MOST_TRIANGLES:
        raise SurfaceError(
            f"refining to edges of {target:g} m needs more than {MOST_TRIANGLES:,} triangles; use longer edges"
        )


def halved_edges(V: Floats, F: Ints, edges: EdgeTable, halves: Bools) -> tuple[Floats, Ints, Ints]:
    r"""Divide the faces of V (n, 3), F (m, 3) at the midpoints of the edges marked in `halves` (e,).
    The longest edge of each divided face must be marked. Return the vertices, the faces, and the old face of each.

                 c                             c                          c
               / | \                         / | \                       / \
              /  |  \                      r   |  \                     r - q
             /   |   \                    /  \ |   \                   / \ / \
            a -- p -- b                  a -- p --- b                 a - p - b      rotated so that a-b is the longest
    """
    number = np.cumsum(halves) + len(V) - 1
    V = np.concatenate([V, V[edges.ends[halves]].mean(axis=1)])
    is_halved = halves[edges.of]
    ends = V[edges.ends]
    lengths = np.where(is_halved, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[edges.of], -1)
    turn = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(F, turn, axis=1).T
    p, q, r = np.take_along_axis(number[edges.of], turn, axis=1).T
    ab, bc, ca = np.take_along_axis(is_halved, turn, axis=1).T
    parts = [
        (~ab, (a, b, c)),
        *((ab & ~bc & ~ca, triangle) for triangle in ((a, p, c), (p, b, c))),
        *((ab & bc & ~ca, triangle) for triangle in ((p, b, q), (p, q, c), (a, p, c))),
        *((ab & ~bc & ca, triangle) for triangle in ((a, p, r), (p, c, r), (p, b, c))),
        *((ab & bc & ca, triangle) for triangle in ((a, p, r), (p, b, q), (p, q, r), (r, q, c))),
    ]
    faces = np.concatenate([np.stack(triangle, axis=1)[where] for where, triangle in parts])
    return V, faces, np.concatenate([np.flatnonzero(where) for where, _ in parts])


def with_longest_edges(V: Floats, edges: EdgeTable, halves: Bools) -> Bools:
    """Extend the mask `halves` (e,) until the longest edge is marked in each face with a marked edge [Rivara 1984]."""
    length = edge_lengths(V, edges.ends)[edges.of]
    longest = np.take_along_axis(edges.of, length.argmax(axis=1)[:, None], axis=1)[:, 0]
    while True:
        grown = halves.copy()
        grown[longest[halves[edges.of].any(axis=1)]] = True
        if np.array_equal(grown, halves):
            return halves
        halves = grown


def quads(F: Ints, pairs: Ints) -> Ints:
    """Return the vertices a, b, c, d (q, 4) of the two faces at each of q edges: ends a, b, and opposite corners c, d.
    pairs : (q, 2) half-edges, the two at each edge."""
    h0, h1 = pairs.T
    corners: Ints = np.stack([h0, next_half_edge(h0), next_half_edge(h0, 2), next_half_edge(h1, 2)], axis=1)
    return np.asarray(F.ravel()[corners])


def with_other_diagonals(F: Ints, pairs: Ints, quad: Ints) -> Ints:
    """Flip edges: replace the edge a-b of each quad by c-d in faces F (m, 3). Two quads must not share a face.
    pairs : (q, 2) the half-edges at each edge a-b.    quad : (q, 4) vertices a, b, c, d from `quads`."""
    a, b, c, d = quad.T
    F = F.copy()
    F[pairs[:, 0] // 3] = np.stack([a, d, c], axis=1)
    F[pairs[:, 1] // 3] = np.stack([d, b, c], axis=1)
    return F


def has_new_diagonal(quad: Ints, edges: EdgeTable, n: int) -> Bools:
    """Return a mask (q,) of quads whose diagonal c-d is not yet an edge of the mesh.
    quad : (q, 4) vertices a, b, c, d, see `quads`.    n : number of vertices of the mesh."""
    keys, diagonal_keys = edges.ends @ (n, 1), np.sort(quad[:, 2:], axis=1) @ (n, 1)
    positions = np.minimum(np.searchsorted(keys, diagonal_keys), len(keys) - 1)
    return np.asarray((keys[positions] != diagonal_keys) & (quad[:, 2] != quad[:, 3]))


def meets_link_condition(edges: EdgeTable, chosen: Ints, n: int) -> Bools:
    """Return a mask (c,) of edges that can collapse without a change of the topology [Dey et al. 1999].
    chosen : (c,) numbers of the edges to test.    n : number of vertices."""
    A: csr_array = adjacency(edges, n)
    a, b = edges.ends[chosen].T
    return np.asarray(np.asarray(A[a].multiply(A[b]).sum(axis=1)).ravel() == edges.count[chosen])


def contracted_faces(F: Ints, onto: Ints) -> Ints:
    """Replace each vertex k in faces F (m, 3) by onto[k], and remove faces without three different corners."""
    F = onto[F]
    return np.asarray(F[has_three_corners(F)])


def has_three_corners(F: Ints) -> Bools:
    """Return a mask (m,) of the faces F (m, 3) with three different corners."""
    a, b, c = F.T
    return np.asarray((a != b) & (b != c) & (c != a))


def leading_candidates(order: Ints, touched: Ints, n: int, edges: Ints | None = None) -> Bools:
    """Return a mask (c,) of candidate mesh changes that can be made together: the best ones at all their vertices.
    order   : (c,) numbers of the candidates, best first.
    touched : (c, k) vertices that each candidate changes.    n : number of vertices of the mesh.
    edges   : (e, 2) edges of the mesh, to compare also candidates at neighbouring vertices, or None."""
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    least_rank = np.full(n, len(order))
    np.minimum.at(least_rank, touched.ravel(), np.repeat(rank, touched.shape[1]))
    if edges is not None:
        neighbour_rank = least_rank.copy()
        np.minimum.at(neighbour_rank, edges.ravel(), least_rank[edges[:, ::-1]].ravel())
        least_rank = neighbour_rank
    return np.asarray((least_rank[touched] >= rank[:, None]).all(axis=1))


LEAST_ANGLE_GAIN = 1.0  # A flip must increase the smallest angle of its two faces by at least this, degrees.


def with_flipped_edges(surface: Surface, may: Bools, stays: Ints, tolerance: float) -> Surface:
    """Return the surface with edges flipped if this increases the smallest angle of their two faces.
    may       : (n,) mask; only faces with a marked vertex may change.    stays : (k, 2) ends of edges that do not flip.
    tolerance : largest distance between an old edge and the new edge, metres."""
    keys = _keys(surface.n, *stays.T)
    for _ in range(8):
        F = _flip_once(surface, may, keys, tolerance)
        if F is None:
            break
        surface = Surface(surface.V, F)
    return surface


def _keys(n: int, a: Ints, b: Ints) -> Ints:
    return np.asarray(np.minimum(a, b) * n + np.maximum(a, b))


def _flip_once(surface: Surface, may: Bools, stays: Ints, tolerance: float) -> Ints | None:
    V, F, edges = surface.V, surface.F, surface.edges
    h = edges.pairs
    quad = quads(F, h)
    a, b, c, d = quad.T
    may_flip = (F.ravel()[h[:, 1]] == b) & ~np.isin(_keys(surface.n, a, b), stays) & (may[a] | may[b] | may[c] | may[d])
    h, quad = h[may_flip], quad[may_flip]
    a, b, c, d = quad.T
    gain = np.minimum(_smallest_angle(V, d, c, a), _smallest_angle(V, c, d, b))
    gain -= np.minimum(_smallest_angle(V, a, b, c), _smallest_angle(V, b, a, d))
    gain[~_may_flip(surface, h // 3, quad, tolerance)] = -np.inf
    best_gain = np.full(surface.m, LEAST_ANGLE_GAIN)
    np.maximum.at(best_gain, (h // 3).ravel(), np.repeat(gain, 2))
    chosen = np.flatnonzero((gain > LEAST_ANGLE_GAIN) & (gain[:, None] == best_gain[h // 3]).all(axis=1))
    first_face, second_face = h[chosen].T // 3
    # if two chosen flips share a face, keep the first flip
    first_places = np.unique(np.concatenate([first_face, second_face]), return_index=True)[1]
    once = np.zeros(2 * len(chosen), dtype=bool)
    once[first_places] = True
    chosen = chosen[once[: len(chosen)] & once[len(chosen) :]]
    if not len(chosen):
        return None
    F = F.copy()
    F[h[chosen, 0] // 3] = np.column_stack([d, c, a])[chosen]
    F[h[chosen, 1] // 3] = np.column_stack([c, d, b])[chosen]
    return F


def _may_flip(surface: Surface, faces: Ints, quad: Ints, tolerance: float) -> Bools:
    a, b, c, d = (surface.V[k] for k in quad.T)
    across = cross(b - a, d - c)
    distance = np.abs(np.einsum("ki,ki->k", across, c - a)) / np.maximum(lengths(across), np.finfo(float).tiny)
    normal = surface.normals[faces].sum(axis=1)
    turns = [np.einsum("ki,ki->k", cross(q - p, r - p), normal) for p, q, r in ((d, c, a), (c, d, b))]
    is_new = has_new_diagonal(quad, surface.edges, surface.n)
    return np.asarray(is_new & (distance <= tolerance) & (turns[0] > 0) & (turns[1] > 0))


def _smallest_angle(V: Floats, a: Ints, b: Ints, c: Ints) -> Floats:
    P = np.stack([V[a], V[b], V[c]])
    sides = np.roll(P, -1, axis=0) - P
    size = np.maximum(lengths(sides), np.finfo(float).tiny)
    cosine = -np.einsum("ski,ski->sk", sides, np.roll(sides, 1, axis=0)) / (size * np.roll(size, 1, axis=0))
    return np.asarray(np.degrees(np.arccos(np.clip(cosine.max(axis=0), -1, 1))))
