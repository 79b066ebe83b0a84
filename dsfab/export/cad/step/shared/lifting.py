"""Mapping of mesh points to both skins of a sheet, also at creases."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, face_angles, unit_vectors
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.shared.skins import DenseSurface, dense_surface
from dsfab.export.part import Curved
from dsfab.surface import CREASE, Surface, corner_fans, link_components

LEAST_BEND = 8.0  # degrees; smallest angle between faces along a crease
BEND_RATIO = 4.0  # smallest angle at a crease / angles at the edges beside the crease
STRAIGHT = np.cos(np.radians(30.0))  # cosine of the largest angle between a crease and its continuation
OTHER_EDGES = [[1, 2], [2, 0], [0, 1]]  # the two other edges of a face, for each of its three edges


def crease_edges(surface: Surface) -> Bools:
    """Return a mask (e,) of the edges on creases, which are rows of sharp edges."""
    shortest = 6  # a crease has at least 6 edges; single sharp edges are noise of the mesh
    edges = surface.edges
    inner = edges.count == 2
    bend = np.zeros(len(edges.ends))
    normals_left, normals_right = surface.normals[edges.pairs // 3].transpose(1, 0, 2)
    bend[inner] = np.degrees(np.arccos(np.clip(np.einsum("ei,ei->e", normals_left, normals_right), -1, 1)))
    crease = np.zeros(len(bend), dtype=bool)
    for _ in range(2):  # the second round ignores known creases, to find the second sharp edge of a face
        rest = np.where(crease | ~inner, 0.0, bend)
        sharper_other = rest[edges.of[:, OTHER_EDGES]].max(axis=2)  # (m, 3) larger bend of a face's two remaining edges
        around = np.zeros(len(bend))
        np.maximum.at(around, edges.of, sharper_other)
        crease |= inner & (bend >= np.maximum(LEAST_BEND, BEND_RATIO * around))
    crease = _extended_creases(surface, bend, inner, crease)
    crease_numbers = np.flatnonzero(crease)
    _, part = link_components(surface.n, *edges.ends[crease_numbers].T)
    run = part[edges.ends[crease_numbers, 0]]
    long = np.bincount(run, minlength=surface.n) >= shortest
    sharpest = np.zeros(surface.n)
    np.maximum.at(sharpest, run, bend[crease_numbers])
    crease[crease_numbers] = (long & (sharpest >= CREASE))[run]
    return crease


def _extended_creases(surface: Surface, bend: Floats, inner: Bools, crease: Bools) -> Bools:
    edges = surface.edges
    around = np.zeros(len(bend))
    np.maximum.at(around, edges.of, np.where(inner, bend, 0.0)[edges.of[:, OTHER_EDGES]].min(axis=2))
    maybe = inner & ~crease & (bend >= np.maximum(LEAST_BEND, BEND_RATIO * around))
    direction = surface.V[edges.ends[:, 1]] - surface.V[edges.ends[:, 0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    added = crease
    while added.any():
        ends, tip = edges.ends[crease], np.zeros((surface.n, 3))
        np.add.at(tip, ends, direction[crease][:, None])
        tip[np.bincount(ends.ravel(), minlength=surface.n) != 1] = 0
        added = maybe & (np.abs(np.einsum("eci,ei->ec", tip[edges.ends], direction)) >= STRAIGHT).any(axis=1)
        crease, maybe = crease | added, maybe & ~added
    return crease


ZERO_WEIGHT = 1e-9  # barycentric weights below this count as zero


@dataclass(frozen=True, eq=False)
class CreaseSides:
    """Creases of a surface, with a copy of each crease vertex for each side of the crease.
    creases : (k, 2) edges, smaller vertex number first.    corner : (m, 3) index in `vertex` of each face's corners.
    vertex  : (s,) numbers of all n vertices, then the number of each copy's original.
    normals : (s, 3) unit normals.    half : (s,) half the thickness, m.
    mitre   : (s, 3) m; half * normal + mitre leads from a vertex to the common point of the skins of all sides."""

    surface: Surface
    creases: Ints
    vertex: Ints
    corner: Ints
    normals: Floats
    half: Floats
    mitre: Floats

    @classmethod
    def from_skins(cls, skins: DenseSurface) -> "CreaseSides":
        """Find the creases of a surface, and copy each crease vertex for each side of the crease."""
        surface, crease = skins.surface, crease_edges(skins.surface)
        vertex, creases = np.arange(surface.n), surface.edges.ends[crease]
        if not len(creases):
            return cls(surface, creases, vertex, surface.F, skins.normals, skins.half, np.zeros((surface.n, 3)))
        corner = _corner_sides(surface, crease)
        on_side = corner >= surface.n
        sides = np.zeros(int(corner.max()) + 1 - surface.n, dtype=np.int64)
        sides[corner[on_side] - surface.n] = surface.F[on_side]
        vertex = np.concatenate([vertex, sides])
        N = np.zeros((len(vertex), 3))
        np.add.at(N, corner, face_angles(surface.V, surface.F)[..., None] * surface.normals[:, None])
        N[: surface.n] = skins.normals
        N = unit_vectors(N)
        half = skins.half[vertex]
        mitre = np.zeros_like(N)
        mitre[surface.n :] = _mitres(sides, N[surface.n :], half[surface.n :])
        return cls(surface, creases, vertex, corner, N, half, mitre)

    def rows(self, weights: csr_array) -> tuple[csr_array, csr_array]:
        """Convert weights (k, n) of vertices to two matrices (k, s) of vertices and copies, for both crease sides."""
        weights = csr_array(weights)
        row, is_beside = self._beside_creases(weights)
        columns = np.tile(weights.indices, (2, 1)).astype(np.int64)
        faces = self._faces(weights.indices[is_beside].astype(np.int64), row[is_beside], len(weights.indptr) - 1)
        for i in range(2):
            face = faces[row, i]
            has_face = face >= 0
            for c in range(3):
                matches = has_face & (self.surface.F[face, c] == weights.indices)
                columns[i, matches] = self.corner[face[matches], c]
        shape = (weights.shape[0], len(self.vertex))
        first_rows, second_rows = (csr_array((weights.data, c, weights.indptr), shape=shape) for c in columns)
        return first_rows, second_rows

    def between_faces(self, weights: csr_array) -> Ints:
        """Return the rows (j,) of weights (k, n) with a crease vertex, but with no face that contains all vertices."""
        weights = csr_array(weights)
        row, is_beside = self._beside_creases(weights)
        faces = self._faces(weights.indices[is_beside].astype(np.int64), row[is_beside], weights.shape[0])
        special = np.unique(row[is_beside])
        return np.asarray(special[faces[special, 0] < 0])

    def _beside_creases(self, weights: csr_array) -> tuple[Ints, Bools]:
        split = np.zeros(self.surface.n, dtype=bool)
        split[self.vertex[self.surface.n :]] = True
        row = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
        real = np.abs(weights.data) > ZERO_WEIGHT
        return row, np.isin(row, row[split[weights.indices] & real]) & real

    def _faces(self, vertices: Ints, row: Ints, count: int) -> Ints:
        row_faces = np.full((count, 2), -1)
        order = np.lexsort([vertices, row])
        vertices, row = vertices[order], row[order]
        rows, row_start, many = np.unique(row, return_index=True, return_counts=True)
        F, edges, n = np.sort(self.surface.F, axis=1), self.surface.edges, self.surface.n
        for size in (1, 2, 3):
            r, begin = rows[many == size], row_start[many == size]
            key = _keys(np.stack([vertices[begin + i] for i in range(size)], axis=1), n)
            if size == 1:
                face = np.zeros(n, dtype=np.int64)
                face[self.surface.F] = np.arange(self.surface.m)[:, None]
                row_faces[r] = face[key][:, None]
            elif size == 2:
                e = _positions_of(_keys(edges.ends, n), key)
                exists = e >= 0
                row_faces[r[exists], 0] = edges.order[edges.start[e[exists]]] // 3
                row_faces[r[exists], 1] = edges.order[edges.start[e[exists] + 1] - 1] // 3
            else:
                row_faces[r] = _positions_of(_keys(F, n), key)[:, None]
        return row_faces

    def on_creases(self, weights: csr_array) -> Bools:
        """Return a mask (k,) that is True for points on creases. weights : (k, n) barycentric weights of the points."""
        low, high = ends_of_rows(weights)
        n, split = self.surface.n, self.vertex[self.surface.n :]
        on_edge = _positions_of(_keys(self.creases, n), low * n + high) >= 0
        return np.asarray((low >= 0) & (on_edge | ((low == high) & np.isin(low, split))))

    def lines_on_creases(self, weights: csr_array, start: Ints, end: Ints) -> Bools:
        """Return a mask (e,), True for lines on creases. start, end : (e,) rows of the end points in `weights`."""
        low, high = ends_of_rows(weights)
        n, is_on_edge = self.surface.n, (low[start] >= 0) & (low[end] >= 0)
        a, b = np.minimum(low[start], low[end]), np.maximum(high[start], high[end])
        among = [(x[y] == a) | (x[y] == b) for x in (low, high) for y in (start, end)]
        return np.asarray(is_on_edge & np.all(among, axis=0) & (_positions_of(_keys(self.creases, n), a * n + b) >= 0))


def ends_of_rows(weights: csr_array) -> tuple[Ints, Ints]:
    """Return the end vertices (k,) of the edge through each point, smaller number first; -1 inside faces."""
    row = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    real = np.abs(weights.data) > ZERO_WEIGHT
    row, vertex = row[real], weights.indices[real].astype(np.int64)
    low = np.full(weights.shape[0], np.iinfo(np.int64).max)
    high = np.full(weights.shape[0], -1)
    np.minimum.at(low, row, vertex)
    np.maximum.at(high, row, vertex)
    few = (np.bincount(row, minlength=weights.shape[0]) <= 2) & (high >= 0)
    return np.where(few, low, -1), np.where(few, high, -1)


def _corner_sides(surface: Surface, crease: Bools) -> Ints:
    F, edges = surface.F, surface.edges
    fan = corner_fans(F, edges, apart=crease).ravel()
    fans = np.bincount(np.unique(np.stack([F.ravel(), fan], axis=1), axis=0)[:, 0], minlength=surface.n)
    on_crease = np.zeros(surface.n, dtype=bool)
    on_crease[edges.ends[crease]] = True
    several = (fans > 1) & on_crease
    corner = F.ravel().copy()
    is_split = several[corner]
    _, side = np.unique(fan[is_split], return_inverse=True)
    corner[is_split] = surface.n + side
    return np.asarray(corner.reshape(F.shape))


def _mitres(vertex: Ints, N: Floats, half: Floats) -> Floats:
    longest = 3.0  # largest distance from mid-surface to end of mitre, divided by half the thickness
    mitres = np.zeros_like(N)
    for v in np.unique(vertex):
        is_same = vertex == v
        D = np.linalg.pinv(N[is_same], rcond=0.05) @ half[is_same]
        D *= min(1.0, longest * float(half[is_same].max()) / max(float(np.linalg.norm(D)), 1e-300))
        mitres[is_same] = D - half[is_same, None] * N[is_same]
    return mitres


def _keys(vertices: Ints, n: int) -> Ints:
    key = vertices[:, 0].astype(np.int64)
    for column in vertices.T[1:]:
        key = key * n + column
    return np.asarray(key)


def _positions_of(numbers: Ints, sought: Ints) -> Ints:
    if not len(numbers):
        return np.full(len(sought), -1)
    order = np.argsort(numbers, kind="stable")
    position = order[np.clip(np.searchsorted(numbers, sought, sorter=order), 0, len(numbers) - 1)]
    return np.where(numbers[position] == sought, position, -1)


@dataclass(frozen=True, eq=False)
class Lifting:
    """Mapping of mesh points to the outer and inner skin of the uncut surface."""

    skins: DenseSurface

    @classmethod
    def from_sheet(cls, surface: Surface, curved: Curved) -> "Lifting":
        """Return the mapping for the uncut surface of a sheet."""
        return cls(dense_surface(surface, curved))

    def points(self, weights: csr_array) -> Floats:
        """Return points (k, 6) on the outer and inner skin, mm, at mesh points with barycentric weights (k, n)."""
        if not len(self.sides.creases):
            return self._points(weights)
        left_weights, right_weights = self.sides.rows(self._in_faces(weights))
        return np.asarray((self._points(left_weights) + self._points(right_weights)) / 2)

    def _in_faces(self, weights: csr_array) -> csr_array:
        between = self.sides.between_faces(weights)
        if not len(between):
            return weights
        nearest = self.weights_at(np.asarray(weights[between] @ self.skins.points))
        row = np.arange(weights.shape[0])
        row[between] = len(row) + np.arange(len(between))
        return csr_array(vstack([weights, nearest], format="csr")[row])

    def _points(self, weights: csr_array) -> Floats:
        most_lift = 1 / 5  # largest distance of points from the mesh / thickness; less than `MOST_CHORD`
        V, N = self.skins.points[self.sides.vertex], self.sides.normals
        P, n = np.asarray(weights @ V), np.asarray(weights @ N)
        along = np.einsum("ni,ni->n", V, N)
        outer = (N[:, :, None] * N[:, None, :]).reshape(-1, 9)
        pull = weights @ (along[:, None] * N)
        half = MM_PER_M * np.asarray(weights @ self.sides.half)[:, None]
        lift = (pull - np.einsum("kij,kj->ki", (weights @ outer).reshape(-1, 3, 3), P)) / 2
        lift *= np.minimum(2 * most_lift * half / np.maximum(np.linalg.norm(lift, axis=1, keepdims=True), 1e-300), 1)
        D = half * unit_vectors(n)
        if len(self.sides.creases):
            D = D + MM_PER_M * np.asarray(weights @ self.sides.mitre)
        middle = P + lift + self.skins.shift * D
        return np.concatenate([middle + D, middle - D], axis=1)

    def vectors_to_skins(self, Q: Floats) -> Floats:
        """Return vectors (k, 6), mm, normal to the sheet, from pairs of points Q (k, 6) to the outer and inner skin."""
        targets = self.points(self.weights_at((Q[:, :3] + Q[:, 3:]) / 2))
        across = targets[:, :3] - targets[:, 3:]
        is_flipped = np.einsum("ki,ki->k", across, Q[:, :3] - Q[:, 3:]) < 0  # on a one-sided surface, skins may swap
        targets[is_flipped], across[is_flipped] = np.roll(targets[is_flipped], 3, axis=1), -across[is_flipped]
        across = unit_vectors(across)
        vectors = [np.einsum("ki,ki->k", (targets - Q)[:, s : s + 3], across)[:, None] * across for s in (0, 3)]
        return np.concatenate(vectors, axis=1)

    def weights_at(self, points: Floats) -> csr_array:
        """Return barycentric weights (k, n) of the mesh points nearest to points (k, 3), millimetres."""
        V, F = self.skins.points, self.skins.surface.F
        _, simplex, place = self._tree.squared_distance(V, F, np.ascontiguousarray(points))
        corners = F[np.asarray(simplex)]
        a, b, c = (V[corners[:, i]] for i in range(3))
        across = np.cross(b - a, c - a)
        area = np.einsum("ki,ki->k", across, across)
        weight_a = np.einsum("ki,ki->k", np.cross(c - b, place - b), across) / area
        weight_b = np.einsum("ki,ki->k", np.cross(a - c, place - c), across) / area
        share = np.clip(np.stack([weight_a, weight_b, 1 - weight_a - weight_b], axis=1), 0, 1)
        share /= share.sum(axis=1, keepdims=True)
        rows = np.arange(0, 3 * len(points) + 1, 3)
        return csr_array((share.ravel(), corners.ravel(), rows), shape=(len(points), len(V)))

    @cached_property
    def sides(self) -> CreaseSides:
        """Creases of the surface, with the copies of their vertices."""
        return CreaseSides.from_skins(self.skins)

    @cached_property
    def _tree(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self.skins.points, self.skins.surface.F)
        return tree
