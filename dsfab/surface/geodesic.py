"""Exact geodesic distances along a triangle mesh from vertices, edges and faces."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from dsfab.core.arrays import Bools, Floats, Ints, sorted_order
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import next_half_edge

SLACK = 1e-10
"""Rounding, as a share of the lengths, areas and angles that are compared."""


@dataclass(frozen=True, eq=False)
class Windows:
    """What sources see through edges, in the plane of each source: rows of numbers that are moved together.

    names  : (k, 5) see `edge` to `parallel`.    values : (k, 7) see `at_a` to `offset`.
    """

    names: Ints
    values: Floats

    @classmethod
    def of(
        cls, names: Sequence[Ints | Bools], A: Floats, B: Floats, start: Floats, end: Floats, offset: Floats
    ) -> "Windows":
        """Windows of five names (k,) each, from A (k, 2) to B (k, 2), metres, with start, end and offset (k,)."""
        numbers = np.stack([*A.T, *B.T, start, end, offset], axis=1)
        return cls(np.stack(names, axis=1), numbers)

    @property
    def edge(self) -> Ints:
        """(k,) the edges."""
        return self.names[:, 0]

    @property
    def face(self) -> Ints:
        """(k,) the faces that they are seen through; -1 for none."""
        return self.names[:, 1]

    @property
    def a(self) -> Ints:
        """(k,) the first vertices of the edges."""
        return self.names[:, 2]

    @property
    def b(self) -> Ints:
        """(k,) the other vertices."""
        return self.names[:, 3]

    @property
    def parallel(self) -> Bools:
        """(k,) whether the source is the line y = 0; it is the point (0, 0) otherwise."""
        return np.asarray(self.names[:, 4] > 0)

    @property
    def at_a(self) -> Floats:
        """(k, 2) where the first vertices are; sources are on the right of the way from A to B."""
        return self.values[:, 0:2]

    @property
    def at_b(self) -> Floats:
        """(k, 2) where the other vertices are."""
        return self.values[:, 2:4]

    @property
    def start(self) -> Floats:
        """(k,) P0 = A + start (B - A)."""
        return self.values[:, 4]

    @property
    def end(self) -> Floats:
        """(k,) P1 = A + end (B - A)."""
        return self.values[:, 5]

    @property
    def offset(self) -> Floats:
        """(k,) metres to be added to the distance from the source."""
        return self.values[:, 6]

    def at(self, which: Ints | Bools) -> "Windows":
        """Those that are marked (k,), or of these numbers."""
        return Windows(self.names[which], self.values[which])

    @classmethod
    def together(cls, some: Sequence["Windows"]) -> "Windows":
        """All windows of several, one behind the other."""
        return cls(np.concatenate([part.names for part in some]), np.concatenate([part.values for part in some]))

    def place(self, t: Floats) -> Floats:
        """(k, 2) A + t (B - A)."""
        return np.asarray(self.at_a + t[:, None] * (self.at_b - self.at_a))

    def distance(self, P: Floats) -> Floats:
        """(k,) of places (k, 2)."""
        return np.asarray(self.offset + np.where(self.parallel, P[:, 1], np.hypot(P[:, 0], P[:, 1])))

    def nearest(self) -> Floats:
        """(k,) the least distance within each."""
        P, Q = self.place(self.start), self.place(self.end)
        along = Q - P
        foot = np.clip(-dot2(P, along) / np.maximum(dot2(along, along), np.finfo(float).tiny), 0, 1)
        foot[self.parallel] = along[self.parallel, 1] < 0
        return self.distance(P + foot[:, None] * along)

    def rays(self, P: Floats) -> Floats:
        """(k, 2) the ways that rays go at places (k, 2)."""
        return np.where(self.parallel[:, None], (0.0, 1.0), P)

    def left(self, t: Floats, C: Floats) -> Floats:
        """(..., k) how far C (..., k, 2) is on the left of the ray through A + t (B - A), times a length; 0 within
        rounding."""
        P = self.place(t)
        ray = self.rays(P)
        off = cross2(ray, C - P)
        return np.where(np.abs(off) <= SLACK * size2(ray) * (size2(C) + size2(P)), 0.0, off)


def share(one: Floats, two: Floats) -> Floats:
    """(k,) where something that goes from one sign to the other, linearly, is zero, of the way from `one` (k,) to
    `two` (k,)."""
    span = one - two
    return np.divide(one, span, out=np.zeros_like(one), where=span != 0)


def size2(a: Floats) -> Floats:
    """(...) lengths of a (..., 2), roughly: |x| + |y|."""
    return np.asarray(np.abs(a[..., 0]) + np.abs(a[..., 1]))


def cross2(a: Floats, b: Floats) -> Floats:
    """(...) cross products of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def dot2(a: Floats, b: Floats) -> Floats:
    """(...) scalar products of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


class Origins(NamedTuple):
    """What distances are measured from: marked vertices (n,), edges (e,) and faces (m,).

    With a face its edges are marked too, and with an edge its ends.
    """

    vertices: Bools
    edges: Bools
    faces: Bools


class Distances(NamedTuple):
    """Metres at the vertices (n,) and at the middles of the edges (e,), and which faces (m,) are partly within reach.

    They are exact on these faces, and bounds from above elsewhere, or infinite.
    """

    vertex: Floats
    middle: Floats
    reached: Bools


def geodesic_distances(surface: Surface, origins: Origins, reach: float = np.inf) -> Distances:
    """Lengths of the shortest paths along a surface to the nearest marked part; infinite where none leads there.

    reach : metres; faces that are farther away are not looked at. On those that are partly nearer all is exact.
    """
    front = _Front(surface, origins, reach)
    waiting = front.advanced([front.strips(), front.fans(_Bends.marked(origins))], reach)
    reached = front.reached.copy()
    front.advanced(waiting, reach + front.size[front.edges.of[reached]].max(initial=0.0))
    along = front.vertex[front.edges.ends].min(axis=1) + front.size / 2
    return Distances(front.vertex, np.minimum(front.middle, along), reached)


class _Bends(NamedTuple):
    """Vertices (k,) that send out rays, `offset` (k,) metres from the source.

    None is wanted within `bound` radians of a direction that is (k, 2) `angle` radians from two edges (k, 2) there.
    """

    vertex: Ints
    offset: Floats
    edge: Ints
    angle: Floats
    bound: float

    def at(self, which: Ints | Bools) -> "_Bends":
        return _Bends(self.vertex[which], self.offset[which], self.edge[which], self.angle[which], self.bound)

    @classmethod
    def marked(cls, origins: Origins) -> "_Bends":
        """Sources: what is nearest to an edge among them is told by `_Front.fans`."""
        vertex = np.flatnonzero(origins.vertices)
        none = np.full((len(vertex), 2), -1)
        return cls(vertex, np.zeros(len(vertex)), none, np.full(none.shape, np.inf), np.pi / 2)


class _Front:
    """Distances as they are known so far; see `Distances`.

    size    : (e,) lengths of the edges.    reached : (m,) faces that are partly within reach.
    bending : (n,) whether paths may bend.  bent : (n,) the distance at which each vertex sent out rays.
    waiting : vertices that are to do so.
    """

    def __init__(self, surface: Surface, origins: Origins, reach: float) -> None:
        self.F, self.edges, self.origins, self.reach = surface.F, surface.edges, origins, reach
        self.size = surface.edge_lengths
        self.middle = np.where(origins.edges, 0.0, np.inf)
        self.reached = origins.faces.copy()
        self.vertex = self._along_edges(surface.n, 2 * reach + self.size.max())
        self.bent, self.waiting = np.where(origins.vertices, 0.0, np.inf), list[_Bends]()
        ab, bc, ca = (np.roll(self.size[self.edges.of], -k, axis=1) for k in range(3))
        along, high = (ab**2 + ca**2 - bc**2) / (2 * ab**2), 2 * surface.areas[:, None] / ab**2
        self.third = np.stack([along, high], axis=2).reshape(-1, 2)  # where c is, if a is (0, 0) and b is (1, 0)
        self.turn = np.arctan2(high, along).ravel()  # the angle at a
        total = np.bincount(self.F.ravel(), self.turn, surface.n)
        full = np.full(surface.n, 2 * np.pi)
        full[self.edges.ends[self.edges.count != 2]] = np.pi
        self.bending = total > full + SLACK
        self.bending[surface.pinches] = True
        self.corners = sorted_order(self.F.ravel())
        self.first_corner = np.searchsorted(self.F.ravel()[self.corners], np.arange(surface.n + 1))

    def _along_edges(self, n: int, limit: float) -> Floats:
        """(n,) lengths of the shortest ways along edges: bounds from above."""
        i, j = self.edges.ends.T
        graph = csr_array((self.size, (i, j)), shape=(n, n))
        if not self.origins.vertices.any():
            return np.full(n, np.inf)
        marked = np.flatnonzero(self.origins.vertices)
        return np.asarray(dijkstra(graph, directed=False, indices=marked, min_only=True, limit=limit))

    def strips(self) -> Windows:
        """What marked edges send out."""
        edge = np.flatnonzero(self.origins.edges)
        zero, a, b = np.zeros(len(edge)), *self.edges.ends[edge].T
        A, B = np.zeros((len(edge), 2)), np.stack([self.size[edge], zero], axis=1)
        return Windows.of((edge, np.full(len(edge), -1), a, b, zero == 0), A, B, zero, zero + 1, zero)

    def advanced(self, windows: list[Windows], limit: float) -> list[Windows]:
        """Windows sent on until all are farther away than the limit, metres; returns those."""
        far: list[Windows] = []
        while windows:
            some = Windows.together(windows)
            some = some.at(self._useful(some))
            least = some.nearest()
            far.append(some.at(least > limit))
            within = least <= limit
            windows = self._crossed(some.at(within), least[within] <= self.reach) if within.any() else []
            bends, self.waiting = self.waiting, []
            for some_bends in bends:
                near = some_bends.offset <= limit
                self.waiting.append(some_bends.at(~near))
                if near.any():
                    windows.append(self.fans(some_bends.at(near)))
        return far

    def _useful(self, w: Windows) -> Bools:
        """(k,) windows that are nearer to what they show than the two ends of their edge are."""
        size = self.size[w.edge]
        low, high = w.distance(w.place(w.start)), w.distance(w.place(w.end))
        room = SLACK * (size + high + low)
        better = high <= self.vertex[w.a] + w.end * size + room
        return better & (low <= self.vertex[w.b] + (1 - w.start) * size + room) & (w.end - w.start > SLACK)

    def _crossed(self, w: Windows, near: Bools) -> list[Windows]:
        """What is seen through windows on the other edges of the faces behind them; near : (k,) see `reached`."""
        i, half = _ranged(self.edges.start[w.edge], self.edges.start[w.edge + 1], self.edges.order)
        face = half // 3
        there = (face != w.face[i]) & ~self.origins.faces[face]
        i, half, face = i[there], half[there], face[there]
        self.reached[face[near[i]]] = True
        w, ahead, back = w.at(i), next_half_edge(half, 1), next_half_edge(half, 2)
        same = self.F.ravel()[half] == w.a
        c, of = self.F.ravel()[back], self.edges.of.ravel()
        along, high = self.third[half].T
        AB = w.at_b - w.at_a
        across = np.stack([-AB[:, 1], AB[:, 0]], axis=1)
        C = w.at_a + np.where(same, along, 1 - along)[:, None] * AB + high[:, None] * across
        edges = np.where(same, of[back], of[ahead]), np.where(same, of[ahead], of[back])
        corners = np.stack([C, w.at_a, w.at_b])
        (one, a0, b0), (two, a1, b1) = w.left(w.start, corners), w.left(w.end, corners)
        start, end = share(a0, one), np.where(two < 0, share(a1, two), 1.0)
        first = Windows.of((edges[0], face, w.a, c, w.parallel), w.at_a, C, start, end, w.offset).at(one < 0)
        start, end = np.where(one > 0, share(one, b0), 0.0), share(two, b1)
        second = Windows.of((edges[1], face, c, w.b, w.parallel), C, w.at_b, start, end, w.offset).at(two > 0)
        for new in (first, second):
            self._note_middles(new)
        seen = (one <= 0) & (two >= 0)
        self._arrive(w.at(seen), C[seen], c[seen], np.stack(edges, axis=1)[seen])
        return [first, second]

    def _note_middles(self, w: Windows) -> None:
        shown = (w.start <= 0.5 + SLACK) & (w.end >= 0.5 - SLACK)
        w = w.at(shown)
        np.minimum.at(self.middle, w.edge, w.distance((w.at_a + w.at_b) / 2))

    def _arrive(self, w: Windows, C: Floats, c: Ints, edges: Ints) -> None:
        """Note the distances to vertices c that are seen at C (k, 2), between edges (k, 2)."""
        back = -w.rays(C)
        sides = np.stack([w.at_a - C, w.at_b - C])
        angle = np.abs(np.arctan2(cross2(sides, back), dot2(sides, back))).T
        self._bend(_Bends(c, w.distance(C), edges, angle, np.pi))

    def _bend(self, bends: _Bends) -> None:
        """Note the distances to vertices, and those at which paths bend."""
        c, found = bends.vertex, bends.offset
        np.minimum.at(self.vertex, c, found)
        room = 1 + SLACK
        new = np.flatnonzero(self.bending[c] & (found <= room * self.vertex[c]) & (room * found < self.bent[c]))
        if len(new):
            new = new[np.unique(c[new], return_index=True)[1]]
            self.bent[c[new]] = found[new]
            self.waiting.append(bends.at(new))

    def fans(self, bends: _Bends) -> Windows:
        """What vertices send out, as far as it is wanted."""
        vertex = bends.vertex
        i, half = _ranged(self.first_corner[vertex], self.first_corner[vertex + 1], self.corners)
        of, face = self.edges.of.ravel(), half // 3
        p, q = of[half], of[next_half_edge(half, 2)]  # the edges at the vertex, and the vertices there
        ahead, back = self.F.ravel()[next_half_edge(half, 1)], self.F.ravel()[next_half_edge(half, 2)]
        turn = self.turn[half]
        off_p, off_q = self._bearings(bends, i, p, q, turn)
        low, high = np.maximum(0, bends.bound - off_p), np.minimum(turn, turn - bends.bound + off_q)
        A = self.size[p][:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        B = np.stack([self.size[q], np.zeros(len(q))], axis=1)
        start, end = (_met(A, B, turn - angle) for angle in (low, high))
        start, end = np.where(low > 0, start, 0.0), np.where(high < turn, end, 1.0)
        offset = bends.offset[i]
        w = Windows.of((of[next_half_edge(half, 1)], face, ahead, back, np.zeros_like(i)), A, B, start, end, offset)
        w = w.at((high - low > SLACK) & ~self.origins.faces[face])
        self.reached[face[bends.offset[i] <= self.reach]] = True
        self._note_middles(w)
        for edge, end_, bearing in ((p, ahead, off_p), (q, back, off_q)):
            at = bearing >= bends.bound - SLACK
            here, size = edge[at], self.size[edge[at]]
            np.minimum.at(self.middle, here, offset[at] + size / 2)
            along = np.stack([here, here], axis=1)
            self._bend(_Bends(end_[at], offset[at] + size, along, np.zeros(along.shape), np.pi))
        return w

    def _bearings(self, bends: _Bends, i: Ints, p: Ints, q: Ints, turn: Floats) -> tuple[Floats, Floats]:
        """Radians, around vertices i, from edges p and q to the nearest direction that nothing is wanted from."""
        count = len(self.size)
        keys, place = np.unique(np.concatenate([i, i]) * count + np.concatenate([p, q]), return_inverse=True)
        one, two = place.ravel().reshape(2, -1)
        off = np.full(len(keys), np.inf)
        if bends.bound < np.pi:
            off[self.origins.edges[keys % count]] = 0.0
        else:
            known = np.searchsorted(keys, np.arange(len(bends.vertex))[:, None] * count + bends.edge)
            np.minimum.at(off, known, bends.angle)
        while True:
            before = off.copy()
            np.minimum.at(off, one, off[two] + turn)
            np.minimum.at(off, two, off[one] + turn)
            if np.array_equal(before, off):
                return off[one], off[two]


def _ranged(begins: Ints, ends: Ints, values: Ints) -> tuple[Ints, Ints]:
    """Of ranges (k,) of values: which range each value is from, and the values."""
    count = ends - begins
    i = np.repeat(np.arange(len(count)), count)
    return i, values[np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + begins[i]]


def _met(A: Floats, B: Floats, angle: Floats) -> Floats:
    """(k,) where rays from (0, 0) meet lines from A to B (k, 2), as shares of these."""
    ray = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.clip(share(cross2(ray, A), cross2(ray, B)), 0, 1)
