"""The thinnest wall of a solid: straight lines from its faces inward, square to them, until they leave it."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.core.arrays import Floats, Ints, lock
from dsfab.surface import edge_table
from dsfab.thickening.solid import Solid

INSIDE = 0.02
"""Lines start this share of the way from a corner to the centre of a face: tapering walls are thinnest at corners."""
LIFT = 1e-9
"""And this share of the solid's size under the face, or they would meet the face itself."""
OPPOSED = float(np.cos(np.radians(20)))
"""Faces count as opposite where they are parallel to 20 degrees; others make an edge, where the way through is zero."""
LARGE = 1e6
"""Size that a mesh is scaled to: libigl's rays overlook triangles of less than 1e-6 or so in area, in any unit."""
FLAT = float(np.cos(1e-3))
"""Neighbours that are parallel to a thousandth of a radian are one flat facet."""


@dataclass(frozen=True, eq=False)
class Wall:
    """The thinnest wall: metres, and where it is (3,)."""

    thickness: float
    place: Floats

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


class Rays:
    """Straight lines against the triangles V (n, 3), F (m, 3)."""

    def __init__(self, V: Floats, F: Ints) -> None:
        self._middle = V.mean(axis=0)
        self._scale = LARGE / float(np.linalg.norm(np.ptp(V, axis=0)))
        self._V, self._F = (V - self._middle) * self._scale, np.array(F)
        self._tree = igl.AABB()
        self._tree.init(self._V, self._F)

    def first(self, start: Floats, way: Floats) -> Ints:
        """(k,) the first face met from a little after `start` (k, 3) along unit vectors `way`, or -1."""
        start = (start - self._middle) * self._scale + LIFT * LARGE * way
        return np.asarray(self._tree.intersect_ray_first(self._V, self._F, start, way)[0], dtype=np.int64)


class Facets:
    """The flat facets of a closed mesh F (m, 3) with unit normals N (m, 3)."""

    def __init__(self, F: Ints, N: Floats) -> None:
        pairs = edge_table(F).pairs // 3
        f, g = pairs[np.einsum("ek,ek->e", N[pairs[:, 0]], N[pairs[:, 1]]) > FLAT].T
        joined = coo_array((np.ones(len(f), dtype=bool), (f, g)), shape=(len(F), len(F)))
        self._F, self._facet = F, connected_components(joined, directed=False)[1]
        self._order = np.argsort(self._facet, kind="stable")
        self._first = np.searchsorted(self._facet, np.arange(len(F) + 1), sorter=self._order)

    def first_apart(self, size: Floats, one: Ints, other: Ints) -> int | None:
        """Of pairs of faces (k,) that are `size` apart, the place of the nearest whose facets do not meet in a point;
        None where none is finite."""
        for k in np.argsort(size, kind="stable").tolist():
            if not np.isfinite(size[k]):
                break
            if not self._meet(one[k], other[k]):
                return int(k)
        return None

    def _meet(self, one: int, other: int) -> bool:
        a, b = int(self._facet[one]), int(self._facet[other])
        return a != b and bool(np.isin(self._corners(a), self._corners(b)).any())

    def _corners(self, facet: int) -> Ints:
        return np.asarray(self._F[self._order[self._first[facet] : self._first[facet + 1]]])


def thinnest_wall(solid: Solid) -> Wall | None:
    """The thinnest wall of a solid, from one line at each vertex; None where no faces lie opposite each other.

    The thickness is the distance of a line's start from the plane of the face that it meets: between flat faces it is
    exact, wherever they end. Facets that meet in a point make a tip there, which tapers to nothing and is no wall: a
    sheet that crosses itself has such where its parts are fused.
    """
    V, F = np.array(solid.V), np.array(solid.F)
    face = _largest_faces(V, F)
    corner = np.arange(len(V))[face >= 0]
    face = face[face >= 0]
    N = _normals(V, F)
    start = (1 - INSIDE) * V[corner] + INSIDE * V[F[face]].mean(axis=1)
    hit = Rays(V, F).first(start, -N[face])
    opposed = (hit >= 0) & (-np.einsum("ki,ki->k", N[face], N[hit]) > OPPOSED)
    depth = np.einsum("ki,ki->k", V[F[hit, 0]] - start, N[hit])  # libigl's own distance has six digits
    thickness = np.where(opposed, depth, np.inf)
    k = Facets(F, N).first_apart(thickness, face, hit)
    return None if k is None else Wall(float(thickness[k]), V[corner[k]])


def _normals(V: Floats, F: Ints) -> Floats:
    N = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    return np.asarray(N / np.linalg.norm(N, axis=1, keepdims=True))


def _largest_faces(V: Floats, F: Ints) -> Ints:
    """(n,) the largest face at each vertex, -1 where there is none: of skin and wall, most often the skin."""
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1)
    order = np.argsort(area, kind="stable")
    largest = np.full(len(V), -1)
    for corner in F[order].T:  # of equal indices the last one stays: the largest of the faces with this corner
        held = largest[corner]
        better = (held < 0) | (area[np.maximum(held, 0)] <= area[order])
        largest[corner[better]] = order[better]
    return largest
