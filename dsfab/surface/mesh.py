"""`Surface`, the triangle mesh of every stage. Enclosed volume and area of a mesh, and its nearest points."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, cross, edge_lengths, first_few, lengths, lock, polygon_perimeter
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import POSSIBLE_SIZE
from dsfab.core.messages import count_phrase
from dsfab.surface.topology import EdgeTable, boundary_loops, edge_table, pieces, pinches

if TYPE_CHECKING:
    import compas.datastructures
    import pyvista
    import trimesh


def bounding_box(V: Floats, F: Ints) -> Floats:
    """Return the lowest and the highest corner (2, 3) of the vertices V (n, 3) that faces F (m, 3) use."""
    used = np.zeros(len(V), dtype=bool)
    used[F.ravel()] = True
    points = V if used.all() else V[used]
    return np.array([[f(column) for column in points.T] for f in (np.min, np.max)])


def signed_volume(V: Floats, F: Ints) -> float:
    """Return the volume inside closed faces F (m, 3) on V (n, 3), in the cubed unit of V; negative for inward normals.
    Method: divergence theorem, as a sum of tetrahedra with one common corner in the middle of the bounding box."""
    return float(_tetrahedron_volumes(V, F).sum())


def signed_volumes(V: Floats, F: Ints, shell: Ints, count: int) -> Floats:
    """Return each closed shell's volume (count,), negative for inward normals. shell : (m,) shell of each face."""
    return np.bincount(shell, _tetrahedron_volumes(V, F), count).astype(np.float64)


def total_area(V: Floats, F: Ints) -> float:
    """Return the area of all faces F (m, 3) on vertices V (n, 3), in the unit of V squared."""
    return sum(float(np.sqrt((N**2).sum(axis=0)).sum()) / 2 for _, _, N in _face_blocks(V, F))


def _tetrahedron_volumes(V: Floats, F: Ints) -> Floats:
    volumes = np.zeros(len(F))
    for block, a, N in _face_blocks(V, F):
        volumes[block] = (a * N).sum(axis=0) / 6
    return volumes


def _face_blocks(V: Floats, F: Ints) -> Iterator[tuple[slice, Floats, Floats]]:
    """Yield blocks of k faces: slice of F, first corner (3, k) of each face, and twice the area vectors (3, k).
    The corners are relative to the middle of the bounding box."""
    if not len(F):
        return
    columns = np.ascontiguousarray((V - bounding_box(V, F).mean(axis=0)).T)
    for k in range(0, len(F), 1 << 15):
        block = slice(k, k + (1 << 15))
        a, b, c = (np.stack([column.take(corner) for column in columns]) for corner in F[block].T)
        (x, y, z), (u, v, w) = b - a, c - a
        yield block, a, np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


class NearestPlaces(NamedTuple):
    """For k given points: the nearest points `place` (k, 3) of a mesh, and the squared distances (k,).
    simplex : (k,) index of the triangle, edge or vertex at each nearest point."""

    squared: Floats
    simplex: Ints
    place: Floats

    @property
    def distance(self) -> Floats:
        """Distances (k,) from the given points to the mesh, in the mesh's unit."""
        return np.sqrt(self.squared)


def nearest_places(points: Floats, V: Floats, simplices: Ints) -> NearestPlaces:
    """Return the nearest points of a mesh to `points` (k, 3). V : (n, 3) vertices of the mesh.
    simplices : triangles (m, 3), edges (m, 2) or vertices (m, 1), at least one.
    Method: a tree of boxes [Jacobson et al. 2018, libigl]."""
    if not len(points):
        return NearestPlaces(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    arrays = (np.ascontiguousarray(x) for x in (points, V, simplices))
    squared, simplex, place = igl.point_mesh_squared_distance(*arrays)
    return NearestPlaces(np.asarray(squared), np.asarray(simplex, dtype=np.int64), np.asarray(place))


def weights_at(places: Floats, V: Floats, corners: Ints) -> Floats:
    """Return the barycentric weights (k, 3) of points `places` (k, 3) in triangles. corners : (k, 3) indices in V."""
    return np.asarray(igl.barycentric_coordinates(places, *(np.ascontiguousarray(V[corners[:, i]]) for i in range(3))))


ZERO_AREA = 1e-20  # Largest area of a collapsed face, divided by the surface's squared size.


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh in space: a sheet without thickness.
    V : (n, 3) vertex positions, metres.
    F : (m, 3) vertex indices of each face, counter-clockwise around the face's normal.
    Raises SurfaceError for invalid coordinates or indices, impossible sizes, and faces without area.
    `dsfab.surface.topology.manifold_faults` reports other faults."""

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
                f"the coordinates of {len(bad)} of {self.n} vertices are not finite numbers (first: "
                f"{first_few(bad)}); repair the mesh"
            )
        smallest, largest = POSSIBLE_SIZE
        reach = float(np.abs(self.V).max(initial=0.0))
        size = float(np.ptp(self.V, axis=0).max()) if self.n and reach <= largest else reach
        if size > largest or 0 < size < smallest:  # `_check_faces` reports a size of 0 as faces without area
            raise SurfaceError(
                f"the surface is {size:.3g} m large or far from the origin; dsfab accepts {smallest:g} to {largest:g} "
                "m; check the unit and the coordinates"
            )

    def _check_faces(self) -> None:
        if self.F.min() < 0 or self.F.max() >= self.n:
            bad = np.flatnonzero((self.F.min(axis=1) < 0) | (self.F.max(axis=1) >= self.n))
            raise SurfaceError(
                f"{count_phrase(len(bad), 'face', 'name')} vertex numbers outside 0..{self.n - 1} (first faces: "
                f"{first_few(bad)}); repair the mesh"
            )
        bad = np.flatnonzero(self.areas <= ZERO_AREA * self.size**2)
        if len(bad):
            raise SurfaceError(f"{len(bad)} of {self.m} faces have no area (first: {first_few(bad)}); remove them")

    @classmethod
    def from_mesh(cls, V: Any, F: Iterable[Any], unit: str = "m") -> "Surface":
        """Return a surface from vertices V (n, 3), in `unit`, and polygons F, as lists of vertex indices."""
        from dsfab.surface.files.other_libraries import surface_from

        return surface_from(V, F, unit)

    @classmethod
    def of(cls, mesh: Any, unit: str | None = None) -> "Surface":
        """Return a surface from a mesh of trimesh, pyvista, compas, meshio, or any object with vertices and faces.
        unit : unit of the coordinates; by default the unit of a trimesh mesh, else metres."""
        from dsfab.surface.files.other_libraries import surface_of

        return surface_of(mesh, unit)

    def to_trimesh(self) -> "trimesh.Trimesh":
        """Return the surface as a mesh of trimesh, metres."""
        from dsfab.surface.files.other_libraries import as_trimesh

        return as_trimesh(self.V, self.F)

    def to_pyvista(self) -> "pyvista.PolyData":
        """Return the surface as a mesh of pyvista, metres."""
        from dsfab.surface.files.other_libraries import as_pyvista

        return as_pyvista(self.V, self.F)

    def to_compas(self) -> "compas.datastructures.Mesh":
        """Return the surface as a mesh of compas, metres; raises SurfaceError if compas is not installed."""
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
        """Diagonal of the bounding box, metres; tolerances are fractions of this length."""
        return float(np.linalg.norm([np.ptp(column) for column in self.V.T]))

    @cached_property
    def _area_vectors(self) -> Floats:
        result, chunk = np.empty((self.m, 3)), 1 << 13
        for k in range(0, self.m, chunk):
            a, b, c = (self.V.take(corner, axis=0) for corner in self.F[k : k + chunk].T)
            result[k : k + chunk] = cross(b - a, c - a)
        result *= 0.5
        return result

    @cached_property
    def areas(self) -> Floats:
        """Face areas (m,), square metres."""
        return lengths(self._area_vectors)

    @cached_property
    def area(self) -> float:
        """Total area, square metres."""
        return float(self.areas.sum())

    @cached_property
    def normals(self) -> Floats:
        """Unit normals (m, 3) of the faces."""
        return self._area_vectors / self.areas[:, None]

    @cached_property
    def centroids(self) -> Floats:
        """Centroids (m, 3) of the faces, metres."""
        a, b, c = (self.V.take(corner, axis=0) for corner in self.F.T)
        means: Floats = (a + b + c) / 3
        return means

    @cached_property
    def edges(self) -> EdgeTable:
        """Table of edges, each listed once with its faces."""
        return edge_table(self.F)

    @cached_property
    def pieces(self) -> tuple[int, Ints]:
        """Number of pieces of the surface that are connected across edges, and the piece number (m,) of each face."""
        return pieces(self.F, self.edges)

    @cached_property
    def vertex_pieces(self) -> Ints:
        """Piece number (n,) of a face at each vertex; -1 for a vertex without faces."""
        piece = np.full(self.n, -1, dtype=np.int64)
        piece[self.F] = self.pieces[1][:, None]
        return piece

    @cached_property
    def pinches(self) -> Ints:
        """Vertices (k,) where the surface touches itself in a point."""
        return pinches(self.F, self.edges, self.n)

    @cached_property
    def is_closed(self) -> bool:
        """True if no edge is a boundary edge."""
        return not bool(self.edges.boundary.any())

    @cached_property
    def volume(self) -> float:
        """Enclosed volume of a closed surface, cubic metres (negative if its normals point inwards)."""
        return signed_volume(self.V, self.F)

    @cached_property
    def loops(self) -> list[Ints]:
        """Boundary loops as vertex indices (k,), sorted by their lengths in metres, longest first."""
        return sorted(boundary_loops(self.F, self.edges), key=lambda loop: -polygon_perimeter(self.V[loop]))

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area of the faces around each vertex (n,), square metres."""
        return np.bincount(self.F.ravel(), np.repeat(self.areas / 3, 3), minlength=self.n).astype(np.float64)

    @cached_property
    def vertex_normals(self) -> Floats:
        """Area-weighted unit normals (n, 3) at the vertices; zero at a vertex without faces."""
        total = np.zeros((self.n, 3))
        for corner in range(3):
            np.add.at(total, self.F[:, corner], self._area_vectors)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        units: Floats = np.divide(total, length, out=np.zeros_like(total), where=length > 0)
        return units

    @cached_property
    def is_flat(self) -> bool:
        """True if all vertices lie in one plane, within 1e-9 of the size."""
        centred = self.V - self.V.mean(axis=0)
        normal = np.linalg.svd(centred[: min(self.n, 10_000)], full_matrices=False)[2][-1]
        return bool(np.abs(centred @ normal).max() <= 1e-9 * self.size)

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length, metres: the mesh width."""
        return float(self.edge_lengths.mean())

    @property
    def edge_lengths(self) -> Floats:
        """Lengths (e,) of the edges, metres; computed at each call."""
        return edge_lengths(self.V, self.edges.ends)

    def faces_of(self, vertices: Bools) -> Bools:
        """Return a mask (m,) of the faces whose three corners are all in a mask of vertices (n,)."""
        return np.asarray(vertices[self.F].all(axis=1))
