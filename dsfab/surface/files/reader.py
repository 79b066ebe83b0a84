"""Reader of mesh files: a checked, oriented `Surface`, and facts about the file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, face_angles, first_few, lengths, polygon_perimeter
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import count_phrase
from dsfab.core.units import metres_per
from dsfab.surface.clean.overlaps import overlap_remarks
from dsfab.surface.clean.repair import mended_mesh, repaired_scan
from dsfab.surface.clean.seams import in_reach
from dsfab.surface.files import DEFAULT_TRIANGLES, FileRecord
from dsfab.surface.files.mesh_files import RawMesh, raw_mesh
from dsfab.surface.files.reading import LARGEST_STEP, number_steps
from dsfab.surface.mesh import ZERO_AREA, Surface, signed_volume, signed_volumes
from dsfab.surface.orientation import Up, flips_along_tree, upright_vertices
from dsfab.surface.topology import (
    EdgeTable,
    boundary_loops,
    crowded_edge_fault,
    duplicate_faces,
    edge_table,
    euler_characteristic,
    flips_to_orient,
    manifold_faults,
    misoriented_edges,
    on_boundary,
    pieces,
    pinches,
)


@dataclass(frozen=True, eq=False)
class SurfaceInFile:
    """The surface in a file, in metres, and messages about reading and repairs (`record`)."""

    surface: Surface
    record: FileRecord


def read_surface(
    path: str | Path,
    unit: str | None = None,
    up: Up = "z",
    mend: bool = False,
    max_triangles: int = DEFAULT_TRIANGLES,
    repair: bool = False,
    only: Sequence[str] = (),
) -> Surface:
    """Return the surface in a mesh file, or in a file of a CAD program (`MESH_SUFFIXES`), in metres.
    unit          : unit of the numbers in the file; by default the unit that the file declares, or metres.
    up            : vertical axis of the file's coordinates; for glTF files, z is up after reading.
    mend          : True to repair small faults first, such as small holes and repeated faces.
    max_triangles : largest number of triangles; it also determines the limits on bytes and time.
    repair        : True to convert a raw 3D scan to a clean sheet first.
    only          : names of the parts to read: layers, blocks, nodes, objects, assemblies; by default all parts.

    Faces are flipped so that neighbours have equal orientations and normals of closed pieces point outward. A Moebius
    strip has edges at which orientations differ. The surface may have several pieces.

    Raises SurfaceError for
    - an unreadable file, and coordinates that are not finite;
    - collapsed or repeated faces, and edges with more than two faces;
    - parts that touch in a point inside the surface;
    - a name in `only` that the file lacks, or a format without names."""
    return surface_in_file(path, unit, up, mend, max_triangles, repair, only).surface


def surface_in_file(
    path: str | Path,
    unit: str | None = None,
    up: Up = "z",
    mend: bool = False,
    max_triangles: int = DEFAULT_TRIANGLES,
    repair: bool = False,
    only: Sequence[str] = (),
) -> SurfaceInFile:
    """Return the surface in a file, and messages about reading and repairs. For parameters, see `read_surface`."""
    raw = raw_mesh(path, max_triangles, unit, only)
    return surface_of_file(path, mended_raw_mesh(raw, repair, unit) if mend or repair else raw, unit, up)


def mended_raw_mesh(raw: RawMesh, scan: bool = False, unit: str | None = None) -> RawMesh:
    """Repair small faults of a mesh from a file, and add a message for each repair. scan : True to repair a 3D scan.
    unit : unit of the vertices, for messages; by default the unit of the file."""
    metres = metres_per(unit) if unit else raw.metres
    better = (repaired_scan if scan else mended_mesh)(raw.V, raw.F, metres)
    if not better.repairs:
        return raw
    return replace(raw, V=better.V, F=better.F, record=raw.record.also(better.repairs))


def surface_of_file(path: str | Path, raw: RawMesh, unit: str | None = None, up: Up = "z") -> SurfaceInFile:
    """Return the surface of a mesh from a file, and messages about reading. For parameters, see `read_surface`."""
    if not len(raw.F):
        raise SurfaceError(f"{path}: the repair removed all faces: {'; '.join(raw.record.repaired)}; check the mesh")
    V = upright_vertices(raw.V * (metres_per(unit) if unit else raw.metres), up)
    share, steps = number_steps(raw.V, raw.F, unit or raw.unit or "m")
    if share > LARGEST_STEP:
        raise SurfaceError(f"{path}: {steps}")
    try:
        surface = oriented_surface(V, raw.F)
    except SurfaceError as error:
        raise SurfaceError(f"{path}: {error}") from None
    return SurfaceInFile(surface, raw.record.also(flip_remark(raw.F, surface.F)))


def flip_remark(before: Ints, after: Ints) -> tuple[str, ...]:
    """Return a message with the number of faces (m, 3) that differ before and after orientation; () if none differs."""
    count = int((before != after).any(axis=1).sum())
    if not count:
        return ()
    why = "neighbours are oriented alike" if count < len(before) else "they face outward"
    return (f"{count_phrase(count, 'face')} of {len(before):,} turned over, so that {why}",)


def oriented_surface(V: Floats, F: Ints) -> Surface:
    """Return the surface of vertices V (n, 3), metres, and faces F (m, 3), oriented alike; closed pieces face outward.
    Raises SurfaceError for repeated faces, edges with more than two faces, and parts that touch in an inner point."""
    surface = Surface(V, F)
    _check_manifold(F, surface.edges)
    turned = _oriented_faces(V, F, surface.edges)
    return surface if turned is F else Surface(V, turned)


def normalized_surface(surface: Surface) -> Surface:
    """Return the surface without unused vertices. Its faces are oriented as by `oriented_surface`."""
    used, F = np.unique(surface.F, return_inverse=True)
    if len(used) < surface.n:
        return oriented_surface(surface.V[used], F.reshape(-1, 3))
    turned = oriented_surface(surface.V, surface.F)
    return surface if np.array_equal(turned.F, surface.F) else turned


def _check_manifold(F: Ints, edges: EdgeTable) -> None:
    twice = duplicate_faces(F)
    if len(twice):
        raise SurfaceError(
            f"{count_phrase(len(twice), 'face', 'repeat')} an earlier face (first: {first_few(twice)}; the mesh has "
            f"{len(F):,} faces); remove the repeated faces, or set surface.mend = true"
        )
    if fault := crowded_edge_fault(edges):
        raise SurfaceError(f"{fault}; dsfab needs a manifold: remove inner faces, or split the surface at these edges")
    n = int(F.max()) + 1
    points = pinches(F, edges, n)
    bad = points[~on_boundary(edges, n)[points]]
    if len(bad):
        raise SurfaceError(
            f"parts touch in a point inside the surface (first: vertex {bad[0]}); join or separate these parts"
        )


def _oriented_faces(V: Floats, F: Ints, edges: EdgeTable) -> Ints:
    flips = flips_to_orient(F, edges)
    if flips is None:
        flips = flips_along_tree(F, edges)
    flips = flips ^ _inside_out(V, _flipped_faces(F, flips), edges)
    return _flipped_faces(F, flips) if flips.any() else F


def _flipped_faces(F: Ints, flips: Bools) -> Ints:
    return np.where(flips[:, None], F[:, ::-1], F)


def _inside_out(V: Floats, F: Ints, edges: EdgeTable) -> Bools:
    count, piece = pieces(F, edges)
    is_open = np.bincount(piece, edges.boundary[edges.of].any(axis=1), minlength=count) > 0
    inward: Bools = np.logical_and(~is_open, signed_volumes(V, F, piece, count) < 0)
    return np.asarray(inward[piece])


@dataclass(frozen=True)
class MeshFacts:
    """Facts about the mesh in a file, which may have faults. Lengths are in metres, converted from `unit`.
    unit_guess     : unit that the file declares (if `unit_said`), or a guess from the size of the numbers.
    faces          : number of triangles. All other facts ignore faces with vertices that are not finite.
    polygons       : number of faces in the file.    box, low : size, and smallest coordinates along x, y, z.
    volume         : cubic metres; None unless the mesh is closed and oriented.
    genus          : number of handles; None unless the mesh is a single oriented manifold piece.
    faults         : reasons why the mesh is not an oriented manifold.
    smallest_angle : smallest angle of a face, degrees, without degenerate faces."""

    path: str
    unit: str
    unit_guess: str
    unit_said: bool
    vertices: int
    faces: int
    polygons: int
    box: tuple[float, float, float]
    low: tuple[float, float, float]
    area: float
    volume: float | None
    closed: bool
    pieces: int
    boundary_lengths: tuple[float, ...]
    euler: int
    genus: int | None
    faults: tuple[str, ...]
    non_manifold_edges: int
    misoriented_edges: int
    duplicate_faces: int
    degenerate_faces: int
    nonfinite_vertices: int
    pinches: int
    smallest_angle: float
    mean_edge: float
    record: FileRecord

    @property
    def manifold(self) -> bool:
        """True if the mesh is an oriented manifold without repeated faces and without parts that touch in a vertex."""
        return not self.faults

    @property
    def boundary_loops(self) -> int:
        """Number of closed curves that form the boundary of the mesh."""
        return len(self.boundary_lengths)


def describe(path: str | Path, unit: str | None = None, max_triangles: int = DEFAULT_TRIANGLES) -> MeshFacts:
    """Return the facts about a mesh file, even if `read_surface` refuses the file.
    Raises SurfaceError if the file is unreadable or has no face with finite corners."""
    return mesh_facts(path, raw_mesh(path, max_triangles, unit), unit)


def mesh_facts(path: str | Path, raw: RawMesh, unit: str | None = None) -> MeshFacts:
    """Return the sizes, the topology and the faults of a mesh from a file. unit : default: the unit of the file."""
    V = raw.V * (metres_per(unit) if unit else raw.metres)
    finite: Bools = np.asarray(np.isfinite(V).all(axis=1))
    F = finite_faces(path, raw)
    edges = edge_table(F)
    low, high = V[finite].min(axis=0), V[finite].max(axis=0)
    faults = manifold_faults(F, edges, len(V))
    encloses = not edges.boundary.any() and not len(misoriented_edges(F, edges)) and not (edges.count > 2).any()
    count, _ = pieces(F, edges)
    if faults or encloses or count > 1:  # one open piece without faults seldom overlaps itself
        faults = (*faults, *overlap_remarks(V, F, duplicate_faces(F)))
    lengths = _boundary_lengths(V, F, edges)
    euler = euler_characteristic(F, edges)
    areas, angle = _areas_and_smallest_angle(V, F, float(np.linalg.norm(high - low)))
    return MeshFacts(
        path=str(path),
        unit=unit or raw.unit or "m",
        unit_guess=unit_guess(raw),
        unit_said=raw.unit is not None,
        vertices=len(V),
        faces=len(raw.F),
        polygons=raw.polygons,
        box=_triple(high - low),
        low=_triple(low),
        area=float(areas.sum()),
        volume=signed_volume(V, F) if encloses else None,
        closed=not edges.boundary.any(),
        pieces=count,
        boundary_lengths=lengths,
        euler=euler,
        genus=(2 - euler - len(lengths)) // 2 if count == 1 and not faults else None,
        faults=faults,
        non_manifold_edges=int((edges.count > 2).sum()),
        misoriented_edges=len(misoriented_edges(F, edges)),
        duplicate_faces=len(duplicate_faces(F)),
        degenerate_faces=int((areas <= ZERO_AREA * ((high - low) ** 2).sum()).sum()),
        nonfinite_vertices=int((~finite).sum()),
        pinches=len(pinches(F, edges, len(V))),
        smallest_angle=angle,
        mean_edge=float(np.linalg.norm(V[edges.ends[:, 0]] - V[edges.ends[:, 1]], axis=1).mean()),
        record=raw.record,
    )


def finite_faces(path: str | Path, raw: RawMesh) -> Ints:
    """Return the faces (k, 3) of a mesh that have finite corners. Raises SurfaceError if there are none."""
    finite: Bools = np.asarray(np.isfinite(raw.V).all(axis=1))
    F = raw.F[finite[raw.F].all(axis=1)]
    if not len(F):
        raise SurfaceError(f"{path}: no face has three finite corners; repair the mesh")
    return F


def _triple(x: Floats) -> tuple[float, float, float]:
    return float(x[0]), float(x[1]), float(x[2])


def _boundary_lengths(V: Floats, F: Ints, edges: EdgeTable) -> tuple[float, ...]:
    flips = flips_to_orient(F, edges)
    turned = F if flips is None else _flipped_faces(F, flips)
    loops = boundary_loops(turned, edge_table(turned))
    return tuple(sorted((polygon_perimeter(V[loop]) for loop in loops), reverse=True))


def _areas_and_smallest_angle(V: Floats, F: Ints, size: float) -> tuple[Floats, float]:
    areas = lengths(area_vectors(V, F)) / 2
    sound = areas > ZERO_AREA * size**2
    return areas, float(np.degrees(face_angles(V, F[sound])).min()) if sound.any() else 0.0


def unit_guess(raw: RawMesh) -> str:
    """Return the unit that the file declares, or a guess: "m" if the mesh is at most 250 units long, else "mm"."""
    V = raw.V[in_reach(raw.V)]
    return raw.unit or ("m" if np.ptp(V, axis=0).max() <= 250.0 else "mm")
