"""`Surface`, the triangle mesh of every stage; enclosed volume, area, and the nearest points of a mesh."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, closed_length, cross, edge_lengths, first, lengths, lock
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import POSSIBLE_SIZE
from dsfab.surface.topology import EdgeTable, boundary_loops, edge_table, pieces, pinches

if TYPE_CHECKING:
    import compas.datastructures
    import pyvista
    import trimesh


ENCLOSED_CHUNK = 1 << 15
"""Faces measured together."""


def box(V: Floats, F: Ints) -> Floats:
    """(2, 3) lowest and highest corner of the vertices V (n, 3) that faces F (m, 3) use."""
    used = np.zeros(len(V), dtype=bool)
    used[F.ravel()] = True
    points = V if used.all() else V[used]
    return np.array([[f(column) for column in points.T] for f in (np.min, np.max)])


def signed_volume(V: Floats, F: Ints) -> float:
    """Volume inside closed faces F (m, 3) of vertices V (n, 3), in their unit cubed; negative where they face inwards.

    By the divergence theorem: signed tetrahedra from the middle of the box, so that no digits are lost far out.
    """
    return float(_tetrahedra(V, F).sum())


def signed_volumes(V: Floats, F: Ints, shell: Ints, count: int) -> Floats:
    """(count,) the same of each closed shell of faces, `shell` (m,) the number of each face's; negative for voids."""
    return np.bincount(shell, _tetrahedra(V, F), count).astype(np.float64)


def total_area(V: Floats, F: Ints) -> float:
    """Area of all faces F (m, 3) of vertices V (n, 3), in their unit squared."""
    return sum(float(np.sqrt((N**2).sum(axis=0)).sum()) / 2 for _, _, N in _faces(V, F))


def _tetrahedra(V: Floats, F: Ints) -> Floats:
    """(m,) signed volumes of the tetrahedra from the middle of the box to each face."""
    found = np.zeros(len(F))
    for some, a, N in _faces(V, F):
        found[some] = (a * N).sum(axis=0) / 6
    return found


def _faces(V: Floats, F: Ints) -> Iterator[tuple[slice, Floats, Floats]]:
    """Some faces, their first corners from the middle of the box (3, k), and twice their area vectors (3, k)."""
    if not len(F):
        return
    columns = np.ascontiguousarray((V - box(V, F).mean(axis=0)).T)
    for k in range(0, len(F), ENCLOSED_CHUNK):
        some = slice(k, k + ENCLOSED_CHUNK)
        a, b, c = (np.stack([column.take(corner) for column in columns]) for corner in F[some].T)
        (x, y, z), (u, v, w) = b - a, c - a
        yield some, a, np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


class NearestPlaces(NamedTuple):
    """Of points (k,): squared distance, in the mesh's unit squared; the simplex that is nearest; the place (k, 3)."""

    squared: Floats
    simplex: Ints
    place: Floats

    @property
    def distance(self) -> Floats:
        """(k,) in the mesh's unit."""
        return np.sqrt(self.squared)


def nearest(points: Floats, V: Floats, simplices: Ints) -> NearestPlaces:
    """The places nearest to points (k, 3) on triangles (m, 3), edges (m, 2) or vertices (m, 1) of V (n, 3); m > 0.

    By a tree of boxes [Jacobson et al. 2018, libigl].
    """
    if not len(points):
        return NearestPlaces(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    given = (np.ascontiguousarray(x) for x in (points, V, simplices))
    squared, simplex, place = igl.point_mesh_squared_distance(*given)
    return NearestPlaces(np.asarray(squared), np.asarray(simplex, dtype=np.int64), np.asarray(place))


def weights_at(places: Floats, V: Floats, corners: Ints) -> Floats:
    """(k, 3) barycentric weights of places (k, 3) in triangles with corners (k, 3) of V (n, 3)."""
    return np.asarray(igl.barycentric_coordinates(places, *(np.ascontiguousarray(V[corners[:, i]]) for i in range(3))))


ZERO_AREA = 1e-20
"""Faces whose area is under this share of the squared size count as collapsed."""
SURFACE_CHUNK = 1 << 13
"""Faces measured together."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh in space: a sheet without thickness.

    V : (n, 3) vertex positions, metres.
    F : (m, 3) vertex indices of each face, counter-clockwise seen from the side its normal points to.

    Raises SurfaceError for coordinates that are not finite, sizes that no surface has, indices out of range and faces
    without area.
    Whether the mesh is manifold and oriented is asked with `dsfab.surface.topology.manifold_faults`.
    """

    V: Floats
    F: Ints

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        if not len(self.F):
            raise SurfaceError("the surface has no faces; give a mesh with at least one triangle")
        self._check_vertices()
        self._check_faces()

    def _check_vertices(self) -> None:
        if not np.isfinite(self.V).all():
            bad = np.flatnonzero(~np.isfinite(self.V).all(axis=1))
            raise SurfaceError(
                f"{len(bad)} of {self.n} vertices are not finite numbers (first: {first(bad)}); repair the mesh"
            )
        smallest, largest = POSSIBLE_SIZE
        reach = float(np.abs(self.V).max(initial=0.0))
        size = float(np.ptp(self.V, axis=0).max()) if self.n and reach <= largest else reach
        if size > largest or 0 < size < smallest:  # a point is told as faces without area
            raise SurfaceError(
                f"the surface is {size:.3g} m large, or as far from the origin, and dsfab makes what has {smallest:g} "
                f"to {largest:g} m; check the unit and the coordinates"
            )

    def _check_faces(self) -> None:
        if self.F.min() < 0 or self.F.max() >= self.n:
            bad = np.flatnonzero((self.F.min(axis=1) < 0) | (self.F.max(axis=1) >= self.n))
            raise SurfaceError(
                f"{len(bad)} faces name vertices outside 0..{self.n - 1} (first faces: {first(bad)}); repair the mesh"
            )
        bad = np.flatnonzero(self.areas <= ZERO_AREA * self.size**2)
        if len(bad):
            raise SurfaceError(
                f"{len(bad)} of {self.m} faces have no area (first: {first(bad)}); remove collapsed faces"
            )

    @classmethod
    def from_mesh(cls, V: Any, F: Iterable[Any], unit: str = "m") -> "Surface":
        """A surface of vertices (n, 3) in `unit` and triangles, quads or polygons; see
        `dsfab.surface.files.other_libraries`."""
        from dsfab.surface.files.other_libraries import surface_from

        return surface_from(V, F, unit)

    @classmethod
    def of(cls, mesh: Any, unit: str | None = None) -> "Surface":
        """The surface that a mesh of trimesh, pyvista, compas or the like is; see
        `dsfab.surface.files.other_libraries`."""
        from dsfab.surface.files.other_libraries import surface_of

        return surface_of(mesh, unit)

    def to_trimesh(self) -> "trimesh.Trimesh":
        """The same vertices, metres, and faces."""
        from dsfab.surface.files.other_libraries import as_trimesh

        return as_trimesh(self.V, self.F)

    def to_pyvista(self) -> "pyvista.PolyData":
        """The same vertices, metres, and faces."""
        from dsfab.surface.files.other_libraries import as_pyvista

        return as_pyvista(self.V, self.F)

    def to_compas(self) -> "compas.datastructures.Mesh":
        """The same vertices, metres, and faces; raises SurfaceError where compas is not installed."""
        from dsfab.surface.files.other_libraries import as_compas

        return as_compas(self.V, self.F)

    @property
    def n(self) -> int:
        """Number of vertices."""
        return len(self.V)

    @property
    def m(self) -> int:
        """Number of faces."""
        return len(self.F)

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, metres: the length that tolerances are relative to."""
        return float(np.linalg.norm([np.ptp(column) for column in self.V.T]))

    @cached_property
    def _area_vectors(self) -> Floats:
        """(m, 3), some faces at a time: as many as stay in the processor's cache."""
        result = np.empty((self.m, 3))
        for k in range(0, self.m, SURFACE_CHUNK):
            a, b, c = (self.V.take(corner, axis=0) for corner in self.F[k : k + SURFACE_CHUNK].T)
            result[k : k + SURFACE_CHUNK] = cross(b - a, c - a)
        result *= 0.5
        return result

    @cached_property
    def areas(self) -> Floats:
        """(m,) face areas, square metres."""
        return lengths(self._area_vectors)

    @cached_property
    def area(self) -> float:
        """Whole area, square metres."""
        return float(self.areas.sum())

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) unit normals of the faces."""
        return self._area_vectors / self.areas[:, None]

    @cached_property
    def centroids(self) -> Floats:
        """(m, 3) centroids of the faces, metres."""
        a, b, c = (self.V.take(corner, axis=0) for corner in self.F.T)
        means: Floats = (a + b + c) / 3
        return means

    @cached_property
    def edges(self) -> EdgeTable:
        """Every edge once, with the faces on it."""
        return edge_table(self.F)

    @cached_property
    def pieces(self) -> tuple[int, Ints]:
        """Number of edge-connected pieces, and the piece of each face (m,): see `topology.pieces`."""
        return pieces(self.F, self.edges)

    @cached_property
    def pinches(self) -> Ints:
        """(k,) vertices where the surface touches itself in a point: see `topology.pinches`."""
        return pinches(self.F, self.edges, self.n)

    @cached_property
    def is_closed(self) -> bool:
        """Whether no edge is a boundary edge."""
        return not bool(self.edges.boundary.any())

    @cached_property
    def volume(self) -> float:
        """Enclosed volume of a closed surface, cubic metres (negative when its normals point inwards)."""
        return signed_volume(self.V, self.F)

    @cached_property
    def loops(self) -> list[Ints]:
        """The boundary loops as vertex indices (k,), longest first (in metres)."""
        loops = boundary_loops(self.F, self.edges)
        return sorted(loops, key=lambda loop: -closed_length(self.V[loop]))

    @cached_property
    def vertex_areas(self) -> Floats:
        """(n,) a third of the area of the faces around each vertex, square metres."""
        return np.bincount(self.F.ravel(), np.repeat(self.areas / 3, 3), minlength=self.n).astype(np.float64)

    @cached_property
    def vertex_normals(self) -> Floats:
        """(n, 3) unit normals, area-weighted; zero at a vertex without faces."""
        total = np.zeros((self.n, 3))
        for corner in range(3):
            np.add.at(total, self.F[:, corner], self._area_vectors)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        units: Floats = np.divide(total, length, out=np.zeros_like(total), where=length > 0)
        return units

    @cached_property
    def is_flat(self) -> bool:
        """Whether all vertices lie in one plane (to 1e-9 of the size)."""
        centred = self.V - self.V.mean(axis=0)
        normal = np.linalg.svd(centred[: min(self.n, 10_000)], full_matrices=False)[2][-1]
        return bool(np.abs(centred @ normal).max() <= 1e-9 * self.size)

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length, metres: the mesh width."""
        return float(self.edge_lengths.mean())

    @property
    def edge_lengths(self) -> Floats:
        """(e,) metres; not kept."""
        return edge_lengths(self.V, self.edges.ends)

    def faces_of(self, vertices: Bools) -> Bools:
        """(m,) whether all three corners of a face are among the (n,) marked vertices."""
        return np.asarray(vertices[self.F].all(axis=1))
