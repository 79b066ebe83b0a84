"""Exact geodesic distances along a triangle mesh [Mitchell, Mount and Papadimitriou 1987].

The faces between a source and an edge are laid flat in a plane. A window is the part of the edge that straight paths
from the source reach."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from dsfab.core.arrays import Bools, Floats, Ints, sorted_order
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import next_half_edge

SLACK = 1e-10  # Allowed rounding errors, divided by the compared lengths, areas or angles.


@dataclass(frozen=True, eq=False)
class Windows:
    """k windows: parts of edges that straight paths from a source reach, after the faces are laid flat in a plane.
    names  : (k, 5) columns `edge`, `face`, `a`, `b`, `parallel`.
    values : (k, 7) columns `at_a` and `at_b` (two columns each), `start`, `end`, `offset`."""

    names: Ints
    values: Floats

    @classmethod
    def from_columns(
        cls, names: Sequence[Ints | Bools], A: Floats, B: Floats, start: Floats, end: Floats, offset: Floats
    ) -> "Windows":
        """Return windows from arrays (k,) of their properties. names : edge, face, a, b, parallel.
        A, B : (k, 2) ends of the edges in the plane."""
        return cls(np.stack(names, axis=1), np.stack([*A.T, *B.T, start, end, offset], axis=1))

    @property
    def edge(self) -> Ints:
        """Number (k,) of the edge that contains each window."""
        return self.names[:, 0]

    @property
    def face(self) -> Ints:
        """Number (k,) of the face that paths to each window cross last; -1 for paths across no face."""
        return self.names[:, 1]

    @property
    def a(self) -> Ints:
        """Number (k,) of the first vertex of each window's edge."""
        return self.names[:, 2]

    @property
    def b(self) -> Ints:
        """Number (k,) of the second vertex of each window's edge."""
        return self.names[:, 3]

    @property
    def parallel(self) -> Bools:
        """True (k,) if the source is the line y = 0, with parallel rays; False if the source is the point (0, 0)."""
        return np.asarray(self.names[:, 4] > 0)

    @property
    def at_a(self) -> Floats:
        """Positions A (k, 2) of the edges' first vertices in the plane. Sources lie right of the line from A to B."""
        return self.values[:, 0:2]

    @property
    def at_b(self) -> Floats:
        """Positions B (k, 2) of the edges' second vertices in the plane."""
        return self.values[:, 2:4]

    @property
    def start(self) -> Floats:
        """Start (k,) of each window, as a fraction of its edge from the first vertex."""
        return self.values[:, 4]

    @property
    def end(self) -> Floats:
        """End (k,) of each window, as a fraction of its edge from the first vertex."""
        return self.values[:, 5]

    @property
    def offset(self) -> Floats:
        """Length (k,), metres, of the path from the origin of the distances to each window's source."""
        return self.values[:, 6]

    def select(self, which: Ints | Bools) -> "Windows":
        """Return the windows selected by indices or a mask."""
        return Windows(self.names[which], self.values[which])

    @classmethod
    def concatenate(cls, parts: Sequence["Windows"]) -> "Windows":
        """Return several sets of windows as one set."""
        return cls(np.concatenate([part.names for part in parts]), np.concatenate([part.values for part in parts]))

    def place(self, t: Floats) -> Floats:
        """Return the points (k, 2) in the plane at fractions t (k,) along the edges."""
        return np.asarray(self.at_a + t[:, None] * (self.at_b - self.at_a))

    def distance(self, P: Floats) -> Floats:
        """Return the lengths (k,), metres, of paths from the origin through the windows to points P (k, 2)."""
        return np.asarray(self.offset + np.where(self.parallel, P[:, 1], np.hypot(P[:, 0], P[:, 1])))

    def nearest(self) -> Floats:
        """Return the length (k,), metres, of the shortest path from the origin to each window."""
        P, Q = self.place(self.start), self.place(self.end)
        along = Q - P
        foot = np.clip(-dot2(P, along) / np.maximum(dot2(along, along), np.finfo(float).tiny), 0, 1)
        foot[self.parallel] = along[self.parallel, 1] < 0
        return self.distance(P + foot[:, None] * along)

    def rays(self, P: Floats) -> Floats:
        """Return the directions (k, 2) of paths from each window's source through P (k, 2)."""
        return np.where(self.parallel[:, None], (0.0, 1.0), P)

    def left_offset(self, t: Floats, C: Floats) -> Floats:
        """Return the distance (..., k) of points C (..., k, 2) to the left of rays, multiplied by the rays' lengths.
        t : (k,) fractions along the edges, where the rays cross the edges."""
        P = self.place(t)
        ray = self.rays(P)
        offsets = cross2(ray, C - P)
        return np.where(np.abs(offsets) <= SLACK * size2(ray) * (size2(C) + size2(P)), 0.0, offsets)


def zero_share(start: Floats, end: Floats) -> Floats:
    """Return the zeros (k,) of linear functions with the values `start` (k,) at 0 and `end` (k,) at 1."""
    span = start - end
    return np.divide(start, span, out=np.zeros_like(start), where=span != 0)


def size2(a: Floats) -> Floats:
    """Return |x| + |y| (...) of vectors a (..., 2)."""
    return np.asarray(np.abs(a[..., 0]) + np.abs(a[..., 1]))


def cross2(a: Floats, b: Floats) -> Floats:
    """Return the cross products (...) of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def dot2(a: Floats, b: Floats) -> Floats:
    """Return the scalar products (...) of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


class Origins(NamedTuple):
    """Places from which distances are measured: masks of vertices (n,), edges (e,) and faces (m,).
    The masks must also contain the edges of marked faces, and the ends of marked edges."""

    vertices: Bools
    edges: Bools
    faces: Bools


class Distances(NamedTuple):
    """Distances along a surface, metres, to vertices (n,) and to the middles of edges (e,).
    reached : (m,) mask of faces where distances are exact. Elsewhere, distances are upper bounds or infinite."""

    vertex: Floats
    middle: Floats
    reached: Bools


def geodesic_distances(surface: Surface, origins: Origins, reach: float = np.inf) -> Distances:
    """Return the lengths of the shortest paths along a surface to the nearest origin; infinite without a path.
    reach : largest distance to calculate, metres."""
    front = _Front(surface, origins, reach)
    waiting = front.advance([front.edge_windows(), front.vertex_windows(_Bends.from_origins(origins))], reach)
    reached = front.reached.copy()
    front.advance(waiting, reach + front.size[front.edges.of[reached]].max(initial=0.0))
    along = front.vertex[front.edges.ends].min(axis=1) + front.size / 2
    return Distances(front.vertex, np.minimum(front.middle, along), reached)


class _Bends(NamedTuple):
    """Vertices (k,) where shortest paths bend. offset : (k,) distance of each vertex from the origin, metres."""

    vertex: Ints
    offset: Floats
    edge: Ints
    angle: Floats
    bound: float

    def select(self, which: Ints | Bools) -> "_Bends":
        return _Bends(self.vertex[which], self.offset[which], self.edge[which], self.angle[which], self.bound)

    @classmethod
    def from_origins(cls, origins: Origins) -> "_Bends":
        vertex = np.flatnonzero(origins.vertices)
        none = np.full((len(vertex), 2), -1)
        return cls(vertex, np.zeros(len(vertex)), none, np.full(none.shape, np.inf), np.pi / 2)


class _Front:
    def __init__(self, surface: Surface, origins: Origins, reach: float) -> None:
        self.F, self.edges, self.origins, self.reach = surface.F, surface.edges, origins, reach
        self.size = surface.edge_lengths
        self.middle = np.where(origins.edges, 0.0, np.inf)
        self.reached = origins.faces.copy()
        self.vertex = self._along_edges(surface.n, 2 * reach + self.size.max())
        self.bent, self.waiting = np.where(origins.vertices, 0.0, np.inf), list[_Bends]()
        ab, bc, ca = (np.roll(self.size[self.edges.of], -k, axis=1) for k in range(3))
        along, high = (ab**2 + ca**2 - bc**2) / (2 * ab**2), 2 * surface.areas[:, None] / ab**2
        self.third = np.stack([along, high], axis=2).reshape(-1, 2)  # position of c if a is (0, 0) and b is (1, 0)
        self.turn = np.arctan2(high, along).ravel()  # the angle of the face at its corner a
        total = np.bincount(self.F.ravel(), self.turn, surface.n)
        full = np.full(surface.n, 2 * np.pi)
        full[self.edges.ends[self.edges.count != 2]] = np.pi
        self.bending = total > full + SLACK
        self.bending[surface.pinches] = True
        self.corners = sorted_order(self.F.ravel())
        self.first_corner = np.searchsorted(self.F.ravel()[self.corners], np.arange(surface.n + 1))

    def _along_edges(self, n: int, limit: float) -> Floats:
        i, j = self.edges.ends.T
        graph = csr_array((self.size, (i, j)), shape=(n, n))
        if not self.origins.vertices.any():
            return np.full(n, np.inf)
        marked = np.flatnonzero(self.origins.vertices)
        return np.asarray(dijkstra(graph, directed=False, indices=marked, min_only=True, limit=limit))

    def edge_windows(self) -> Windows:
        edge = np.flatnonzero(self.origins.edges)
        zero, a, b = np.zeros(len(edge)), *self.edges.ends[edge].T
        A, B = np.zeros((len(edge), 2)), np.stack([self.size[edge], zero], axis=1)
        return Windows.from_columns((edge, np.full(len(edge), -1), a, b, zero == 0), A, B, zero, zero + 1, zero)

    def advance(self, windows: list[Windows], limit: float) -> list[Windows]:
        beyond: list[Windows] = []
        while windows:
            current = Windows.concatenate(windows)
            current = current.select(self._useful(current))
            least = current.nearest()
            beyond.append(current.select(least > limit))
            within = least <= limit
            windows = self._windows_behind(current.select(within), least[within] <= self.reach) if within.any() else []
            bends, self.waiting = self.waiting, []
            for some_bends in bends:
                is_near = some_bends.offset <= limit
                self.waiting.append(some_bends.select(~is_near))
                if is_near.any():
                    windows.append(self.vertex_windows(some_bends.select(is_near)))
        return beyond

    def _useful(self, w: Windows) -> Bools:
        size = self.size[w.edge]
        low, high = w.distance(w.place(w.start)), w.distance(w.place(w.end))
        room = SLACK * (size + high + low)
        better = high <= self.vertex[w.a] + w.end * size + room
        return better & (low <= self.vertex[w.b] + (1 - w.start) * size + room) & (w.end - w.start > SLACK)

    def _windows_behind(self, w: Windows, is_near: Bools) -> list[Windows]:
        i, half = _range_values(self.edges.start[w.edge], self.edges.start[w.edge + 1], self.edges.order)
        face = half // 3
        is_behind = (face != w.face[i]) & ~self.origins.faces[face]
        i, half, face = i[is_behind], half[is_behind], face[is_behind]
        self.reached[face[is_near[i]]] = True
        w, ahead, back = w.select(i), next_half_edge(half, 1), next_half_edge(half, 2)
        alike = self.F.ravel()[half] == w.a
        c, edge_of = self.F.ravel()[back], self.edges.of.ravel()
        along, high = self.third[half].T
        AB = w.at_b - w.at_a
        across = np.stack([-AB[:, 1], AB[:, 0]], axis=1)
        C = w.at_a + np.where(alike, along, 1 - along)[:, None] * AB + high[:, None] * across
        edges = (np.where(alike, edge_of[back], edge_of[ahead]), np.where(alike, edge_of[ahead], edge_of[back]))
        corners = np.stack([C, w.at_a, w.at_b])
        (start_side, a0, b0), (end_side, a1, b1) = w.left_offset(w.start, corners), w.left_offset(w.end, corners)
        start, end = zero_share(a0, start_side), np.where(end_side < 0, zero_share(a1, end_side), 1.0)
        names = (edges[0], face, w.a, c, w.parallel)
        start_windows = Windows.from_columns(names, w.at_a, C, start, end, w.offset).select(start_side < 0)
        start, end = np.where(start_side > 0, zero_share(start_side, b0), 0.0), zero_share(end_side, b1)
        names = (edges[1], face, c, w.b, w.parallel)
        end_windows = Windows.from_columns(names, C, w.at_b, start, end, w.offset).select(end_side > 0)
        for windows in (start_windows, end_windows):
            self._note_middles(windows)
        seen = (start_side <= 0) & (end_side >= 0)
        self._arrive(w.select(seen), C[seen], c[seen], np.stack(edges, axis=1)[seen])
        return [start_windows, end_windows]

    def _note_middles(self, w: Windows) -> None:
        w = w.select((w.start <= 0.5 + SLACK) & (w.end >= 0.5 - SLACK))
        np.minimum.at(self.middle, w.edge, w.distance((w.at_a + w.at_b) / 2))

    def _arrive(self, w: Windows, C: Floats, c: Ints, edges: Ints) -> None:
        back = -w.rays(C)
        sides = np.stack([w.at_a - C, w.at_b - C])
        angle = np.abs(np.arctan2(cross2(sides, back), dot2(sides, back))).T
        self._note_vertices(_Bends(c, w.distance(C), edges, angle, np.pi))

    def _note_vertices(self, bends: _Bends) -> None:
        c, offsets = bends.vertex, bends.offset
        np.minimum.at(self.vertex, c, offsets)
        room = 1 + SLACK
        bending = np.flatnonzero(self.bending[c] & (offsets <= room * self.vertex[c]) & (room * offsets < self.bent[c]))
        if len(bending):
            bending = bending[np.unique(c[bending], return_index=True)[1]]
            self.bent[c[bending]] = offsets[bending]
            self.waiting.append(bends.select(bending))

    def vertex_windows(self, bends: _Bends) -> Windows:
        vertex = bends.vertex
        i, half = _range_values(self.first_corner[vertex], self.first_corner[vertex + 1], self.corners)
        edge_of, face = self.edges.of.ravel(), half // 3
        p, q = edge_of[half], edge_of[next_half_edge(half, 2)]  # the two edges of the face at the vertex
        ahead, back = self.F.ravel()[next_half_edge(half, 1)], self.F.ravel()[next_half_edge(half, 2)]
        turn = self.turn[half]
        bearing_p, bearing_q = self._bearings(bends, i, p, q, turn)
        low, high = np.maximum(0, bends.bound - bearing_p), np.minimum(turn, turn - bends.bound + bearing_q)
        A = self.size[p][:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        B = np.stack([self.size[q], np.zeros(len(q))], axis=1)
        start, end = (_ray_positions(A, B, turn - angle) for angle in (low, high))
        start, end = np.where(low > 0, start, 0.0), np.where(high < turn, end, 1.0)
        offset = bends.offset[i]
        names = (edge_of[next_half_edge(half, 1)], face, ahead, back, np.zeros_like(i))
        w = Windows.from_columns(names, A, B, start, end, offset)
        w = w.select((high - low > SLACK) & ~self.origins.faces[face])
        self.reached[face[bends.offset[i] <= self.reach]] = True
        self._note_middles(w)
        for edge, end_, bearing in ((p, ahead, bearing_p), (q, back, bearing_q)):
            is_beyond = bearing >= bends.bound - SLACK
            beyond_edges, size = edge[is_beyond], self.size[edge[is_beyond]]
            np.minimum.at(self.middle, beyond_edges, offset[is_beyond] + size / 2)
            along = np.stack([beyond_edges, beyond_edges], axis=1)
            self._note_vertices(_Bends(end_[is_beyond], offset[is_beyond] + size, along, np.zeros(along.shape), np.pi))
        return w

    def _bearings(self, bends: _Bends, i: Ints, p: Ints, q: Ints, turn: Floats) -> tuple[Floats, Floats]:
        count = len(self.size)
        keys, place = np.unique(np.concatenate([i, i]) * count + np.concatenate([p, q]), return_inverse=True)
        first_key, second_key = place.ravel().reshape(2, -1)
        bearings = np.full(len(keys), np.inf)
        if bends.bound < np.pi:
            bearings[self.origins.edges[keys % count]] = 0.0
        else:
            start_positions = np.searchsorted(keys, np.arange(len(bends.vertex))[:, None] * count + bends.edge)
            np.minimum.at(bearings, start_positions, bends.angle)
        while True:
            before = bearings.copy()
            np.minimum.at(bearings, first_key, bearings[second_key] + turn)
            np.minimum.at(bearings, second_key, bearings[first_key] + turn)
            if np.array_equal(before, bearings):
                return bearings[first_key], bearings[second_key]


def _range_values(begins: Ints, ends: Ints, values: Ints) -> tuple[Ints, Ints]:
    count = ends - begins
    i = np.repeat(np.arange(len(count)), count)
    return i, values[np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + begins[i]]


def _ray_positions(A: Floats, B: Floats, angle: Floats) -> Floats:
    ray = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.clip(zero_share(cross2(ray, A), cross2(ray, B)), 0, 1)
