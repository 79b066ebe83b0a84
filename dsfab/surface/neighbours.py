"""Which vertices are neighbours of which, over the edges of a mesh."""

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Bools, Ints
from dsfab.surface.topology import EdgeTable


def adjacency(edges: EdgeTable, n: int) -> csr_array:
    """(n, n) ones between the ends of edges."""
    i, j = _both_ways(edges)
    return csr_array(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)))


def on_boundary(edges: EdgeTable, n: int) -> Bools:
    """(n,) whether a vertex is an end of an edge with one face."""
    rim = np.zeros(n, dtype=bool)
    rim[edges.ends[edges.boundary]] = True
    return rim


def corners_of(F: Ints, faces: Bools, n: int) -> Bools:
    """(n,) whether a vertex is a corner of a marked face (m,)."""
    marks = np.zeros(n, dtype=bool)
    marks[F[faces]] = True
    return marks


def faces_at(F: Ints, marks: Bools) -> Bools:
    """(m,) whether a corner of a face is a marked vertex (n,): `any` over rows of three takes five times as long."""
    a, b, c = marks[F.T]
    return np.asarray(a | b | c)


def spanned_edges(F: Ints, edges: EdgeTable, marks: Bools) -> Bools:
    """(e, ...) the edges that marked vertices (n, ...) span: those with both ends marked.

    An edge within the sheet that joins two vertices of its boundary does so by the mesh alone: what is marked there is
    the boundary. It counts beside a face with all corners marked, but no face with two free edges (an ear of the mesh).
    """
    found = marks[edges.ends].all(axis=1)
    rim = on_boundary(edges, len(marks))
    chord = rim[edges.ends].all(axis=1) & ~edges.boundary
    beside = np.zeros_like(found)
    ears = edges.boundary[edges.of].sum(axis=1) > 1
    for k in range(3):
        np.logical_or.at(beside, edges.of[~ears, k], marks[F[~ears]].all(axis=1))
    return np.asarray(found & (beside | ~chord.reshape(-1, *[1] * (marks.ndim - 1))))


def smoothing_pairs(edges: EdgeTable, n: int) -> tuple[Ints, Ints]:
    """(p,) vertices and neighbours (p,), to whose mean they may move: for those on the boundary only along it."""
    i, j = _both_ways(edges)
    used = np.concatenate([edges.boundary, edges.boundary]) | ~on_boundary(edges, n)[i]
    return i[used], j[used]


def _both_ways(edges: EdgeTable) -> tuple[Ints, Ints]:
    i, j = np.concatenate([edges.ends, edges.ends[:, ::-1]]).T
    return i, j
