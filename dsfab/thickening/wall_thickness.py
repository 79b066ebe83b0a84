"""Thinnest wall of a solid, along straight lines inwards from its faces."""

from dataclasses import dataclass

import igl
import numpy as np

from dsfab.core.arrays import Floats, Ints, lock
from dsfab.surface import edge_table, link_components
from dsfab.thickening.solid import Solid

INSIDE = 0.02  # A test line starts at a face's corner, moved by this fraction of the way to the face's centre.
OPPOSED = float(np.cos(np.radians(20)))  # Opposite faces form a wall if the angle between them is up to 20 degrees.
LARGE = 1e6  # Size of the scaled mesh, because libigl's rays miss triangles with areas below 1e-6.
FLAT = float(np.cos(1e-3))  # Least cosine of the angle between neighbours in one flat facet.


@dataclass(frozen=True, eq=False)
class Wall:
    """The thinnest wall of a solid: thickness (m), and the vertex (3,) at which it is measured (m)."""

    thickness: float
    place: Floats

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


class Rays:
    """Intersections of straight lines with the triangles V (n, 3), F (m, 3)."""

    def __init__(self, V: Floats, F: Ints) -> None:
        self._middle = V.mean(axis=0)
        self._scale = LARGE / float(np.linalg.norm(np.ptp(V, axis=0)))
        self._V, self._F = (V - self._middle) * self._scale, np.array(F)
        self._tree = igl.AABB()
        self._tree.init(self._V, self._F)

    def first_hits(self, start: Floats, direction: Floats) -> Ints:
        """Return the first face (k,) hit by each ray, or -1. start, direction : (k, 3) points and unit vectors."""
        start = (start - self._middle) * self._scale + 1e-9 * LARGE * direction  # the ray must miss its own face
        return np.asarray(self._tree.intersect_ray_first(self._V, self._F, start, direction)[0], dtype=np.int64)


class Facets:
    """The flat facets (groups of coplanar faces) of a closed mesh F (m, 3) with unit normals N (m, 3)."""

    def __init__(self, F: Ints, N: Floats) -> None:
        pairs = edge_table(F).pairs // 3
        f, g = pairs[np.einsum("ek,ek->e", N[pairs[:, 0]], N[pairs[:, 1]]) > FLAT].T
        self._F, self._facet = F, link_components(len(F), f, g)[1]
        self._order = np.argsort(self._facet, kind="stable")
        self._first = np.searchsorted(self._facet, np.arange(len(F) + 1), sorter=self._order)

    def nearest_separate_pair(self, size: Floats, start_face: Ints, end_face: Ints) -> int | None:
        """Return the index of the pair of faces with the smallest size (k,), or None. Pairs of touching facets do
        not count. start_face, end_face : (k,) the two faces of each pair."""
        for k in np.argsort(size, kind="stable").tolist():
            if not np.isfinite(size[k]):
                break
            if not self._meet(start_face[k], end_face[k]):
                return int(k)
        return None

    def _meet(self, face_a: int, face_b: int) -> bool:
        a, b = int(self._facet[face_a]), int(self._facet[face_b])
        return a != b and bool(np.isin(self._corners(a), self._corners(b)).any())

    def _corners(self, facet: int) -> Ints:
        return np.asarray(self._F[self._order[self._first[facet] : self._first[facet + 1]]])


def thinnest_wall(solid: Solid) -> Wall | None:
    """Return the thinnest wall of a solid, or None. Touching facets (tip of a wedge) do not count as a wall."""
    V, F = np.array(solid.V), np.array(solid.F)
    face = _largest_faces(V, F)
    corner = np.arange(len(V))[face >= 0]
    face = face[face >= 0]
    N = _normals(V, F)
    start = (1 - INSIDE) * V[corner] + INSIDE * V[F[face]].mean(axis=1)
    hit = Rays(V, F).first_hits(start, -N[face])
    opposed = (hit >= 0) & (-np.einsum("ki,ki->k", N[face], N[hit]) > OPPOSED)
    depth = np.einsum("ki,ki->k", V[F[hit, 0]] - start, N[hit])  # libigl's own distance has only six digits
    thickness = np.where(opposed, depth, np.inf)
    k = Facets(F, N).nearest_separate_pair(thickness, face, hit)
    return None if k is None else Wall(float(thickness[k]), V[corner[k]])


def _normals(V: Floats, F: Ints) -> Floats:
    N = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    return np.asarray(N / np.linalg.norm(N, axis=1, keepdims=True))


def _largest_faces(V: Floats, F: Ints) -> Ints:
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1)
    order = np.argsort(area, kind="stable")
    largest = np.full(len(V), -1)
    for corner in F[order].T:  # if indices repeat, numpy keeps the last face, which is the largest
        current = largest[corner]
        better = (current < 0) | (area[np.maximum(current, 0)] <= area[order])
        largest[corner[better]] = order[better]
    return largest
