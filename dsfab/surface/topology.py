"""Connectivity of a triangle mesh: edges, neighbours, boundary loops, pieces and faults of a manifold."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.core.arrays import Bools, Ints, complement, first

LONGEST_WALK = 100
"""Steps around a vertex; each asks all vertices that are not done."""


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """Every edge of a mesh once.

    ends   : (e, 2) vertex indices, the smaller first: this is the edge's global direction.
    of     : (m, 3) the edge of each half-edge.
    order  : (3 m,) half-edges sorted by edge; those of edge k are order[start[k] : start[k + 1]].
    start  : (e + 1,)
    """

    ends: Ints
    of: Ints
    order: Ints
    start: Ints

    @cached_property
    def count(self) -> Ints:
        """(e,) number of faces on each edge."""
        return np.diff(self.start)

    @cached_property
    def boundary(self) -> Bools:
        """(e,) whether an edge has one face only."""
        alone: Bools = self.count == 1
        return alone

    @cached_property
    def pairs(self) -> Ints:
        """(i, 2) the two half-edges of every edge that has exactly two."""
        at = self.start[:-1][self.count == 2]
        return np.stack([self.order[at], self.order[at + 1]], axis=1)

    @cached_property
    def twins(self) -> Ints:
        """(3 m,) the half-edge on the other side of each; -1 where there is none, or more than one."""
        twin = np.full(self.of.size, -1)
        one, two = self.pairs.T
        twin[one], twin[two] = two, one
        return twin

    def between(self, i: Ints, j: Ints) -> Ints:
        """(k,) the edges from vertices i (k,) to j (k,), which must be there."""
        n = int(self.ends.max()) + 1
        return np.searchsorted(self.ends[:, 0] * n + self.ends[:, 1], np.minimum(i, j) * n + np.maximum(i, j))


def half_edges(F: Ints) -> tuple[Ints, Ints]:
    """(3 m,) first and last vertex of every half-edge."""
    return F.ravel(), np.roll(F, -1, axis=1).ravel()


def next_half_edge(h: Ints, steps: int | Ints = 1) -> Ints:
    """(...) the half-edges so many steps, for all or (...), on from half-edges h (...), around their faces."""
    return h - h % 3 + (h + steps) % 3


def edge_table(F: Ints) -> EdgeTable:
    """The edges of faces F (m, 3), in ascending order of their vertices."""
    a, b = half_edges(F)
    n = int(F.max()) + 1
    low, high = np.minimum(a, b), np.maximum(a, b)
    by_high = _counted_order(high, n)
    order = by_high[_counted_order(low[by_high], n)]
    key = (low * n + high)[order]
    new = np.concatenate([[True], key[1:] != key[:-1]])
    of = np.empty(len(key), dtype=np.int64)
    of[order] = np.cumsum(new) - 1
    ends = np.stack(np.divmod(key[new], n), axis=1)
    return EdgeTable(ends, of.reshape(-1, 3), order, np.append(np.flatnonzero(new), len(key)))


def _counted_order(keys: Ints, count: int) -> Ints:
    """The order that sorts integers (k,) below `count`, equal ones in their order: a counting sort, which transposing a
    sparse matrix is [Gustavson 1978]; two of them sort pairs in half the time of sorting their numbers."""
    rows = csr_array((np.ones(len(keys), dtype=np.int8), keys, np.arange(len(keys) + 1)), shape=(len(keys), count))
    return rows.tocsc().indices.astype(np.int64)


def pieces(F: Ints, edges: EdgeTable) -> tuple[int, Ints]:
    """Number of edge-connected pieces, and the piece of each face (m,), largest pieces first by face count.

    Faces that meet in a vertex only belong to different pieces: such a contact carries no moment and cannot be built.
    """
    face = edges.order // 3
    same = np.diff(edges.of.ravel()[edges.order]) == 0
    count, label = connected(len(F), face[:-1][same], face[1:][same])
    rank = np.empty(count, dtype=np.int64)
    rank[np.argsort(-np.bincount(label, minlength=count), kind="stable")] = np.arange(count)
    return count, rank[label]


def connected(count: int, i: Ints, j: Ints) -> tuple[int, Ints]:
    """Number of parts that links between things i and j (k,) make of `count` things, and the part of each.

    Parts are in the order of their first things. The larger root of each link is hung on the smaller one, and all onto
    their roots, until no link leads from one tree to another [Shiloach and Vishkin 1982]. Without a matrix of the links
    that is five times as quick on the few hundred things of most questions.
    """
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
    first = root == things
    return int(first.sum()), (np.cumsum(first) - 1)[root]


def boundary_loops(F: Ints, edges: EdgeTable) -> list[Ints]:
    """Closed chains (k,) of boundary vertices of an oriented mesh F (m, 3), most vertices first; the surface lies
    left of each step.

    At a pinch the chain stays with the fan of faces it came along, so that two sheets touching in a vertex keep two
    loops. On a mesh that is not oriented some loops run the other way; on one that is not manifold chains may be open:
    look at `manifold_faults` first.
    """
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
        at = next(iter(onward))
        while at in onward:
            chain.append(at)
            at = onward.pop(at)
        loops.append(vertex[chain])
    return sorted(loops, key=lambda loop: (-len(loop), int(loop.min())))


def _turned_links(start: Ints, end: Ints) -> Bools:
    """(b,) the links of closed chains to turn round so that each begins where another ends."""
    link = np.arange(2 * len(start)) // 2  # its two ends in a row, those that meet made neighbours
    ends = np.stack([start, end], axis=1).ravel()
    order = np.argsort(ends, kind="stable")
    met = np.flatnonzero(ends[order][:-1] == ends[order][1:])
    i, j = order[met], order[met + 1]
    clash = i % 2 == j % 2
    k, e, f = len(start), link[i], link[j]
    rows, columns = np.concatenate([e, e + k]), np.concatenate([f + k * clash, f + k - k * clash])
    _, copy = connected(2 * k, rows, columns)
    turned: Bools = copy[:k] > copy[k:]
    return turned


def pinches(F: Ints, edges: EdgeTable, n: int) -> Ints:
    """(k,) vertices where the sheet F (m, 3) touches itself in a point: the faces around it are more than one fan."""
    if _whole_fans(F, edges, n):
        return np.empty(0, dtype=np.int64)
    count, fan = _fans(F, edges)
    vertex_of_fan = np.empty(count, dtype=np.int64)
    vertex_of_fan[fan] = F.ravel()
    return np.flatnonzero(np.bincount(vertex_of_fan, minlength=n) > 1)


def corner_fans(F: Ints, edges: EdgeTable, also: Ints | None = None, apart: Bools | None = None) -> Ints:
    """(m, 3) the faces on new vertices, one for each fan of faces: parts that touch in a point come apart, and so do
    faces on an edge of more than two, but for the pairs (k, 2) of half-edges in `also`, and at edges `apart` (e,)."""
    return _fans(F, edges, also, apart)[1].reshape(-1, 3)


def _fans(F: Ints, edges: EdgeTable, also: Ints | None = None, apart: Bools | None = None) -> tuple[int, Ints]:
    """Number of edge-connected fans of faces around vertices, and the fan of each corner (3 m,).

    Corner `h` is the one that half-edge h leaves from; the corners at both ends of every shared edge are glued.
    """
    pairs = edges.pairs if apart is None else edges.pairs[~apart[edges.count == 2]]
    h0, h1 = (pairs if also is None else np.concatenate([pairs, also])).T
    a, _ = half_edges(F)
    same_way = a[h0] == a[h1]
    at_a = np.where(same_way, h1, next_half_edge(h1))
    at_b = np.where(same_way, next_half_edge(h1), h1)
    i, j = np.concatenate([h0, next_half_edge(h0)]), np.concatenate([at_a, at_b])
    count, fan = connected(3 * len(F), i, j)
    return int(count), fan.astype(np.int64)


def _whole_fans(F: Ints, edges: EdgeTable, n: int) -> bool:
    """Whether one walk around each vertex surely meets all of its corners; walks need faces of one orientation.

    A walk starts at the boundary, where there is one, and goes from corner to corner over the edges between. Around a
    vertex of thousands of faces, as a fan has, walks are not gone to their end.
    """
    if len(misoriented_edges(F, edges)) or (edges.count > 2).any():
        return False
    start = np.full(n, -1)
    start[F] = np.arange(3 * len(F)).reshape(-1, 3)
    alone = edges.order[edges.start[:-1][edges.boundary]]
    start[F.ravel()[alone]] = alone
    onward = np.ascontiguousarray(edges.twins.reshape(-1, 3)[:, [2, 0, 1]]).ravel()
    start = start[start >= 0]
    at, met = start, 0
    for _ in range(LONGEST_WALK):
        if not len(at):
            break
        met += len(at)
        at = onward[at]
        still = np.flatnonzero((at != start) & (at >= 0))
        at, start = at[still], start[still]
    return met == 3 * len(F)


def misoriented_edges(F: Ints, edges: EdgeTable) -> Ints:
    """(k,) indices of the edges that both neighbours, of faces F (m, 3), run through in the same direction."""
    a = F.ravel()
    h0, h1 = edges.pairs.T
    same = np.flatnonzero(a[h0] == a[h1])
    return np.flatnonzero(edges.count == 2)[same] if len(same) else same


def euler_characteristic(F: Ints, edges: EdgeTable) -> int:
    """Vertices - edges + faces of F (m, 3), counting the vertices that have a face."""
    return int(np.count_nonzero(np.bincount(F.ravel()))) - len(edges.ends) + len(F)


def duplicate_faces(F: Ints) -> Ints:
    """(k,) indices of the faces of F (m, 3) that join the same three vertices as an earlier one, in either
    orientation."""
    seen = np.unique(np.sort(F, axis=1), axis=0, return_index=True)[1]
    return complement(seen, len(F))


def flips_to_orient(F: Ints, edges: EdgeTable) -> Bools | None:
    """(m,) faces to turn over so that neighbours agree: the smaller part of each piece; None if there is no such set.

    Two copies of the mesh, one turned over, are glued along all edges where they agree: a piece is orientable exactly
    when its two copies stay apart (the orientation double cover).
    """
    m = len(F)
    a, _ = half_edges(F)
    h0, h1 = edges.pairs.T
    f, g, clash = h0 // 3, h1 // 3, (a[h0] == a[h1]) * m
    i, j = np.concatenate([f, f + m]), np.concatenate([g + clash, g + m - clash])
    count, copy = connected(2 * m, i, j)
    upright, turned = copy[:m], copy[m:]
    if (upright == turned).any():
        return None
    size = np.bincount(upright, minlength=count)
    here, there = size[upright], size[turned]
    flips: Bools = (here < there) | ((here == there) & (upright > turned))
    return flips


def manifold_faults(F: Ints, edges: EdgeTable, n: int) -> tuple[str, ...]:
    """What keeps faces F (m, 3) on n vertices from being an oriented manifold, a sentence each; empty if nothing
    does."""
    crowded = np.flatnonzero(edges.count > 2)
    opposed = misoriented_edges(F, edges)
    twice = duplicate_faces(F)
    touching = pinches(F, edges, n)
    ways = "" if not len(opposed) or flips_to_orient(F, edges) is not None else "; the surface is not orientable"
    found = (
        (crowded, f"{len(crowded)} edges have more than two faces (first: {named_edges(crowded, edges)})"),
        (twice, f"{len(twice)} faces repeat an earlier face (first: {first(twice)})"),
        (
            opposed,
            f"{len(opposed)} edges have faces of opposite sides (first: {named_edges(opposed, edges)}){ways}",
        ),
        (touching, f"{len(touching)} vertices are pinches, where parts touch in a point (first: {first(touching)})"),
    )
    return tuple(sentence for where, sentence in found if len(where))


def named_edges(indices: Ints, edges: EdgeTable, count: int = 3) -> str:
    """The first few edges (k,) by their vertices, for messages: '3-17, 4-20, ...'."""
    shown = ", ".join(f"{a}-{b}" for a, b in edges.ends[indices[:count]].tolist())
    return shown + (", ..." if len(indices) > count else "")


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
