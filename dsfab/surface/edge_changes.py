"""Turning and collapsing edges, what is decided by integers alone: the quads around edges, which changes keep the
topology, and which of them can be made at once.

         c                    c
       /   \\                / | \\
      a --- b      ->      a  |  b
       \\   /                \\ | /
         d                    d
"""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Ints
from dsfab.surface.neighbours import adjacency
from dsfab.surface.topology import EdgeTable, next_half_edge


def quads(F: Ints, pairs: Ints) -> Ints:
    """(q, 4) vertices a, b, c, d around edges a-b of faces F (m, 3), of which pairs (q, 2) are the half-edges."""
    h0, h1 = pairs.T
    corners: Ints = np.stack([h0, next_half_edge(h0), next_half_edge(h0, 2), next_half_edge(h1, 2)], axis=1)
    return np.asarray(F.ravel()[corners])


def with_other_diagonals(F: Ints, pairs: Ints, quad: Ints) -> Ints:
    """Faces F (m, 3) with edges c-d in place of a-b in quads (q, 4), no two of which share a face; see `quads`."""
    a, b, c, d = quad.T
    F = F.copy()
    F[pairs[:, 0] // 3] = np.stack([a, d, c], axis=1)
    F[pairs[:, 1] // 3] = np.stack([d, b, c], axis=1)
    return F


def has_new_diagonal(quad: Ints, edges: EdgeTable, n: int) -> Bools:
    """(q,) whether the other diagonal c-d of a quad (q, 4) is no edge yet, on n vertices."""
    keys, wanted = edges.ends @ (n, 1), np.sort(quad[:, 2:], axis=1) @ (n, 1)
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.asarray((keys[at] != wanted) & (quad[:, 2] != quad[:, 3]))


def meets_link_condition(edges: EdgeTable, chosen: Ints, n: int) -> Bools:
    """(c,) whether the ends of edges (c,) share no neighbours but the corners opposite: then collapsing one keeps the
    topology [link condition: Dey et al. 1999]."""
    A: csr_array = adjacency(edges, n)
    a, b = edges.ends[chosen].T
    common = np.asarray(A[a].multiply(A[b]).sum(axis=1)).ravel()
    return np.asarray(common == edges.count[chosen])


def contracted(F: Ints, onto: Ints) -> Ints:
    """Faces F (m, 3) where each vertex has become another one, onto (n,), without those that lost a corner."""
    F = onto[F]
    return np.asarray(F[has_three_corners(F)])


def has_three_corners(F: Ints) -> Bools:
    """(m,) whether the corners of faces F (m, 3) differ."""
    a, b, c = F.T
    return np.asarray((a != b) & (b != c) & (c != a))


def winners(order: Ints, touched: Ints, n: int, beside: Ints | None = None) -> Bools:
    """(c,) candidates that come before all others near them, so that no two touch the same vertex.

    order   : (c,) the candidates, the best first.
    touched : (c, k) of n vertices that each candidate touches.
    beside  : (e, 2) edges of the mesh: where given, no two touch neighbours either.
    """
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    best = np.full(n, len(order))
    np.minimum.at(best, touched.ravel(), np.repeat(rank, touched.shape[1]))
    if beside is not None:
        near = best.copy()
        np.minimum.at(near, beside.ravel(), best[beside[:, ::-1]].ravel())
        best = near
    return np.asarray((best[touched] >= rank[:, None]).all(axis=1))
