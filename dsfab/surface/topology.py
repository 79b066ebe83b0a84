"""Connectivity of a triangle mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.core.arrays import Bools, Ints, complement, first_few
from dsfab.core.messages import count_phrase

LONGEST_WALK = 100  # Largest number of steps of a walk around a vertex.


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """Edges of a mesh. A half-edge is a side of a face: side k of face f has the number 3 f + k.
    ends   : (e, 2) numbers of the two vertices of each edge, the lower number first.
    of     : (m, 3) edge number of each side of each face.    start : (e + 1,) positions in `order`.
    order  : (3 m,) half-edges sorted by edge; the half-edges of edge k are order[start[k] : start[k + 1]]."""

    ends: Ints
    of: Ints
    order: Ints
    start: Ints

    @cached_property
    def count(self) -> Ints:
        """Number of faces (e,) on each edge."""
        return np.diff(self.start)

    @cached_property
    def boundary(self) -> Bools:
        """Mask (e,) of the edges with exactly one face."""
        alone: Bools = self.count == 1
        return alone

    @cached_property
    def pairs(self) -> Ints:
        """The two half-edges (i, 2) of each edge with exactly two faces."""
        starts = self.start[:-1][self.count == 2]
        return np.stack([self.order[starts], self.order[starts + 1]], axis=1)

    @cached_property
    def outline(self) -> Ints:
        """Half-edges (k,) on the boundary."""
        return np.asarray(self.order[self.start[:-1][self.boundary]])

    @cached_property
    def twins(self) -> Ints:
        """Opposite half-edge (3 m,) of each half-edge; -1 on edges without exactly two faces."""
        twin = np.full(self.of.size, -1)
        first_half, second_half = self.pairs.T
        twin[first_half], twin[second_half] = second_half, first_half
        return twin

    def edges_between(self, i: Ints, j: Ints) -> Ints:
        """Return the number (k,) of the edge between vertices i (k,) and j (k,). Every edge must exist."""
        n = int(self.ends.max()) + 1
        return np.searchsorted(self.ends[:, 0] * n + self.ends[:, 1], np.minimum(i, j) * n + np.maximum(i, j))


def half_edges(F: Ints) -> tuple[Ints, Ints]:
    """Return the start vertex and the end vertex, (3 m,), of every side of faces F (m, 3)."""
    return F.ravel(), np.roll(F, -1, axis=1).ravel()


def next_half_edge(h: Ints, steps: int | Ints = 1) -> Ints:
    """Return the half-edges (...) that lie `steps` steps after h (...) around the same face."""
    return h - h % 3 + (h + steps) % 3


def edge_table(F: Ints) -> EdgeTable:
    """Return the table of edges of faces F (m, 3)."""
    a, b = half_edges(F)
    n = int(F.max()) + 1
    low, high = np.minimum(a, b), np.maximum(a, b)
    by_high = _counted_order(high, n)
    order = by_high[_counted_order(low[by_high], n)]
    key = (low * n + high)[order]
    is_first = np.concatenate([[True], key[1:] != key[:-1]])
    edge = np.empty(len(key), dtype=np.int64)
    edge[order] = np.cumsum(is_first) - 1
    ends = np.stack(np.divmod(key[is_first], n), axis=1)
    return EdgeTable(ends, edge.reshape(-1, 3), order, np.append(np.flatnonzero(is_first), len(key)))


def _counted_order(keys: Ints, count: int) -> Ints:
    """Return the indices (k,) that sort integers `keys` (k,) below `count` (stable) [Gustavson 1978]."""
    rows = csr_array((np.ones(len(keys), dtype=np.int8), keys, np.arange(len(keys) + 1)), shape=(len(keys), count))
    return rows.tocsc().indices.astype(np.int64)


def pieces(F: Ints, edges: EdgeTable) -> tuple[int, Ints]:
    """Return the number of connected pieces of a mesh, and the piece (m,) of each face, largest piece first."""
    face = edges.order // 3
    is_shared = np.diff(edges.of.ravel()[edges.order]) == 0
    count, label = link_components(len(F), face[:-1][is_shared], face[1:][is_shared])
    rank = np.empty(count, dtype=np.int64)
    rank[np.argsort(-np.bincount(label, minlength=count), kind="stable")] = np.arange(count)
    return count, rank[label]


def link_components(count: int, i: Ints, j: Ints) -> tuple[int, Ints]:
    """Return the number of components of a graph, and the component (count,) of each node [Shiloach and Vishkin 1982].
    i, j : (k,) nodes of each link between `count` nodes. Components are numbered in the order of their first nodes."""
    things = np.arange(count)
    root = things
    while len(i):
        i, j = root[i], root[j]
        apart = i != j
        i, j = i[apart], j[apart]
        root = root.copy()
        np.minimum.at(root, np.maximum(i, j), np.minimum(i, j))
        while not np.array_equal(onward := root[root], root):
            root = onward
    is_root = root == things
    return int(is_root.sum()), (np.cumsum(is_root) - 1)[root]


def boundary_loops(F: Ints, edges: EdgeTable) -> list[Ints]:
    """Return the boundary loops of a mesh F (m, 3) as vertex numbers (k,), most vertices first. On an oriented mesh,
    the surface lies left of each loop. Loops may be open if the mesh is not manifold."""
    a, _ = half_edges(F)
    _, fan = _fans(F, edges)
    boundary = np.flatnonzero(edges.boundary[edges.of.ravel()])
    start, end = fan[boundary], fan[next_half_edge(boundary)]
    if len(misoriented_edges(F, edges)):
        turned = _turned_links(start, end)
        start, end = np.where(turned, end, start), np.where(turned, start, end)
    vertex = np.empty(int(fan.max()) + 1, dtype=np.int64)
    vertex[fan] = a
    onward = dict(zip(start.tolist(), end.tolist(), strict=True))
    loops = []
    while onward:
        chain: list[int] = []
        node = next(iter(onward))
        while node in onward:
            chain.append(node)
            node = onward.pop(node)
        loops.append(vertex[chain])
    return sorted(loops, key=lambda loop: (-len(loop), int(loop.min())))


def _turned_links(start: Ints, end: Ints) -> Bools:
    link = np.arange(2 * len(start)) // 2
    ends = np.stack([start, end], axis=1).ravel()
    order = np.argsort(ends, kind="stable")
    met = np.flatnonzero(ends[order][:-1] == ends[order][1:])
    i, j = order[met], order[met + 1]
    clash = i % 2 == j % 2
    k, e, f = len(start), link[i], link[j]
    rows, columns = np.concatenate([e, e + k]), np.concatenate([f + k * clash, f + k - k * clash])
    _, copy = link_components(2 * k, rows, columns)
    turned: Bools = copy[:k] > copy[k:]
    return turned


def pinches(F: Ints, edges: EdgeTable, n: int) -> Ints:
    """Return the vertices (k,) of the mesh F (m, 3) at which parts touch only in a point.    n : number of vertices."""
    if _walks_meet_all_corners(F, edges, n):
        return np.empty(0, dtype=np.int64)
    count, fan = _fans(F, edges)
    vertex_of_fan = np.empty(count, dtype=np.int64)
    vertex_of_fan[fan] = F.ravel()
    return np.flatnonzero(np.bincount(vertex_of_fan, minlength=n) > 1)


def corner_fans(F: Ints, edges: EdgeTable, also: Ints | None = None, apart: Bools | None = None) -> Ints:
    """Return the faces (m, 3) with separate vertices for each fan: faces at a vertex that are joined by edges.
    also  : (k, 2) further pairs of half-edges that join faces.
    apart : (e,) marks of further edges that separate faces."""
    return _fans(F, edges, also, apart)[1].reshape(-1, 3)


def _fans(F: Ints, edges: EdgeTable, also: Ints | None = None, apart: Bools | None = None) -> tuple[int, Ints]:
    pairs = edges.pairs if apart is None else edges.pairs[~apart[edges.count == 2]]
    h0, h1 = (pairs if also is None else np.concatenate([pairs, also])).T
    a, _ = half_edges(F)
    same_way = a[h0] == a[h1]
    at_a = np.where(same_way, h1, next_half_edge(h1))
    at_b = np.where(same_way, next_half_edge(h1), h1)
    i, j = np.concatenate([h0, next_half_edge(h0)]), np.concatenate([at_a, at_b])
    count, fan = link_components(3 * len(F), i, j)
    return int(count), fan.astype(np.int64)


def _walks_meet_all_corners(F: Ints, edges: EdgeTable, n: int) -> bool:
    """Return True if the faces at each vertex are certainly connected by edges."""
    if len(misoriented_edges(F, edges)) or (edges.count > 2).any():
        return False
    start = np.full(n, -1)
    start[F] = np.arange(3 * len(F)).reshape(-1, 3)
    alone = edges.outline
    start[F.ravel()[alone]] = alone
    onward = np.ascontiguousarray(edges.twins.reshape(-1, 3)[:, [2, 0, 1]]).ravel()
    start = start[start >= 0]
    corner, met = start, 0
    for _ in range(LONGEST_WALK):
        if not len(corner):
            break
        met += len(corner)
        corner = onward[corner]
        still = np.flatnonzero((corner != start) & (corner >= 0))
        corner, start = corner[still], start[still]
    return met == 3 * len(F)


def misoriented_edges(F: Ints, edges: EdgeTable) -> Ints:
    """Return the edges (k,) whose two faces in F (m, 3) have opposite orientations."""
    a = F.ravel()
    h0, h1 = edges.pairs.T
    clashes = np.flatnonzero(a[h0] == a[h1])
    return np.flatnonzero(edges.count == 2)[clashes] if len(clashes) else clashes


def euler_characteristic(F: Ints, edges: EdgeTable) -> int:
    """Return vertices - edges + faces of F (m, 3), counting the vertices that have a face."""
    return int(np.count_nonzero(np.bincount(F.ravel()))) - len(edges.ends) + len(F)


def duplicate_faces(F: Ints) -> Ints:
    """Return the faces (k,) of F (m, 3) with the three vertices of an earlier face."""
    return complement(np.unique(np.sort(F, axis=1), axis=0, return_index=True)[1], len(F))


def flips_to_orient(F: Ints, edges: EdgeTable) -> Bools | None:
    """Return a mask (m,) of the fewest faces to flip for an oriented mesh; None for a one-sided surface."""
    m = len(F)
    a, _ = half_edges(F)
    h0, h1 = edges.pairs.T
    f, g, clash = h0 // 3, h1 // 3, (a[h0] == a[h1]) * m
    i, j = np.concatenate([f, f + m]), np.concatenate([g + clash, g + m - clash])
    count, copy = link_components(2 * m, i, j)
    upright, turned = copy[:m], copy[m:]
    if (upright == turned).any():
        return None
    size = np.bincount(upright, minlength=count)
    upright_size, turned_size = size[upright], size[turned]
    flips: Bools = (upright_size < turned_size) | ((upright_size == turned_size) & (upright > turned))
    return flips


def crowded_edge_fault(edges: EdgeTable) -> str:
    """Return a message on edges with more than two faces; "" without a fault."""
    crowded = np.flatnonzero(edges.count > 2)
    if not len(crowded):
        return ""
    return f"{count_phrase(len(crowded), 'edge', 'have')} more than two faces (first: {named_edges(crowded, edges)})"


def repeated_face_fault(F: Ints) -> str:
    """Return a message on repeated faces of F (m, 3); "" without a fault."""
    twice = duplicate_faces(F)
    if not len(twice):
        return ""
    return f"{count_phrase(len(twice), 'face', 'repeat')} an earlier face (first: {first_few(twice)})"


def manifold_faults(F: Ints, edges: EdgeTable, n: int) -> tuple[str, ...]:
    """Return messages on why faces F (m, 3) are not an oriented manifold; empty without a fault."""
    opposed = misoriented_edges(F, edges)
    touching = pinches(F, edges, n)
    faults = [crowded_edge_fault(edges), repeated_face_fault(F)]
    if len(opposed):
        note = "" if flips_to_orient(F, edges) is not None else "; the surface is not orientable"
        count, names = count_phrase(len(opposed), "edge", "have"), named_edges(opposed, edges)
        faults.append(f"{count} two faces of opposite orientation (first: {names}){note}")
    if len(touching):
        places = count_phrase(len(touching), "vertex")
        faults.append(f"parts touch in a point at {places} (first: {first_few(touching)})")
    return tuple(filter(None, faults))


def named_edges(indices: Ints, edges: EdgeTable, count: int = 3) -> str:
    """Return a text with the first `count` edges, as pairs of vertices: "3-17, 4-20, ..."."""
    shown = ", ".join(f"{a}-{b}" for a, b in edges.ends[indices[:count]].tolist())
    return shown + (", ..." if len(indices) > count else "")


def adjacency(edges: EdgeTable, n: int) -> csr_array:
    """Return the adjacency matrix (n, n) of the vertices: 1 where an edge joins two vertices."""
    i, j = _directed_edges(edges)
    return csr_array(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)))


def on_boundary(edges: EdgeTable, n: int) -> Bools:
    """Return a mask (n,) of the vertices on the boundary."""
    rim = np.zeros(n, dtype=bool)
    rim[edges.ends[edges.boundary]] = True
    return rim


def corners_of(F: Ints, faces: Bools, n: int) -> Bools:
    """Return a mask (n,) of the vertices that are corners of marked faces (m,)."""
    marks = np.zeros(n, dtype=bool)
    marks[F[faces]] = True
    return marks


def faces_at(F: Ints, marks: Bools) -> Bools:
    """Return a mask (m,) of the faces F (m, 3) with at least one marked vertex (n,)."""
    a, b, c = marks[F.T]
    return np.asarray(a | b | c)


def spanned_edges(F: Ints, edges: EdgeTable, marks: Bools) -> Bools:
    """Return a mask (e, ...) of the edges between marked vertices (n, ...). Inner edges between boundary vertices
    count only at a face with three marked corners."""
    is_spanned = marks[edges.ends].all(axis=1)
    chord = on_boundary(edges, len(marks))[edges.ends].all(axis=1) & ~edges.boundary
    beside_marked_face = np.zeros_like(is_spanned)
    ears = edges.boundary[edges.of].sum(axis=1) > 1
    for k in range(3):
        np.logical_or.at(beside_marked_face, edges.of[~ears, k], marks[F[~ears]].all(axis=1))
    return np.asarray(is_spanned & (beside_marked_face | ~chord.reshape(-1, *[1] * (marks.ndim - 1))))


def smoothing_neighbours(edges: EdgeTable, n: int) -> tuple[Ints, Ints]:
    """Return pairs for smoothing: vertex (p,), neighbour (p,). Boundary vertices have only boundary neighbours."""
    i, j = _directed_edges(edges)
    used = np.concatenate([edges.boundary, edges.boundary]) | ~on_boundary(edges, n)[i]
    return i[used], j[used]


def _directed_edges(edges: EdgeTable) -> tuple[Ints, Ints]:
    i, j = np.concatenate([edges.ends, edges.ends[:, ::-1]]).T
    return i, j
