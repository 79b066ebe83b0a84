"""Reader of mesh files in any format."""

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, distinct, first_few
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import count_phrase
from dsfab.core.units import METRES_PER
from dsfab.surface.clean.seams import in_reach
from dsfab.surface.files import DEFAULT_TRIANGLES, NOTHING_READ, Budget, FileRecord, TriangleFile
from dsfab.surface.files.drawings import read_dxf_meshes
from dsfab.surface.files.gltf import read_glb, read_gltf
from dsfab.surface.files.obj_and_off import read_obj, read_off
from dsfab.surface.files.ply import read_ply
from dsfab.surface.files.polygons import Polygons, triangles
from dsfab.surface.files.reading import (
    ONLY_OPTION,
    UNSELECTED,
    Content,
    MalformedFileError,
    PolygonFile,
    ignored_clause,
    number_steps,
    readable,
)
from dsfab.surface.files.separate_process import read_3dm, read_cad
from dsfab.surface.files.stl_and_3mf import read_3mf, read_stl

OVERFLOW = float(np.finfo(np.float64).max) ** 0.25  # Squares of areas overflow for larger coordinates.


def with_shared_vertices(file: PolygonFile) -> tuple[PolygonFile, tuple[str, ...]]:
    """Merge vertices with equal positions if only the file's format separates them. Return the file, and messages."""
    mesh = file.mesh
    corners, V = mesh.corners, mesh.V
    if not len(corners) or corners.min() < 0 or corners.max() >= len(V):
        return file, ()
    used = np.zeros(len(V), dtype=bool)
    used[corners] = True
    if not _some_places_twice(V[used]):
        return file, ()
    soup = len(mesh.sizes) > 1 and len(distinct(corners)) == len(corners)
    if not soup and not _free_edges(mesh, corners).any():
        return file, ()
    fewer, became = _first_at_each_place(V)
    welded = became[corners]
    crowded = np.unique(_edge_numbers(mesh, welded), return_counts=True)[1].max() > 2
    gone = len(distinct(corners)) - len(distinct(welded))
    if crowded or not gone or not (soup or not _free_edges(mesh, welded).any()):
        return file, ()
    words = f"{count_phrase(gone, 'vertex')} merged with other vertices at exactly the same place"
    return replace(file, mesh=replace(mesh, corners=fewer[welded])), (words,)


def _some_places_twice(V: Floats) -> bool:
    if not np.isfinite(V).all():
        return False
    numbers = V[:, 0] * 0.5298 + V[:, 1] * 0.6741 + V[:, 2] * 0.5144  # single numbers sort faster than rows of three
    numbers.sort()
    return bool((numbers[1:] == numbers[:-1]).any())


def _first_at_each_place(V: Floats) -> tuple[Ints, Ints]:
    _, first_vertices, became = np.unique(V + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first_vertices)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first_vertices[order], rank[became.ravel()]


def _edge_numbers(mesh: Polygons, corners: Ints) -> Ints:
    last_corners = np.cumsum(mesh.sizes) - 1
    following = np.roll(corners, -1)
    has_corners = mesh.sizes > 0
    following[last_corners[has_corners]] = corners[(last_corners - mesh.sizes + 1)[has_corners]]
    low, high = np.minimum(corners, following), np.maximum(corners, following)
    numbers: Ints = low * (len(mesh.V) + 1) + high
    return numbers


def _free_edges(mesh: Polygons, corners: Ints) -> Bools:
    return np.asarray(np.unique(_edge_numbers(mesh, corners), return_counts=True)[1] == 1)


@dataclass(frozen=True, eq=False)
class RawMesh:
    """The mesh in a file: vertices V (n, 3) in the file's unit, and triangles F (m, 3).
    polygons : number of faces in the file, before they were cut into triangles.
    unit     : unit that the file declares, or None.
    up       : vertical axis, "y" or "z", that is usual in the program that wrote the file; None if unknown."""

    V: Floats
    F: Ints
    polygons: int
    unit: str | None = None
    record: FileRecord = NOTHING_READ
    up: str | None = None

    @property
    def metres(self) -> float:
        """Length of the file's unit in metres; 1 if the file declares no unit."""
        return METRES_PER[self.unit] if self.unit else 1.0


CAD_SUFFIXES = (
    *(".dwg", ".dgn", ".skp", ".iges", ".igs", ".sat", ".x_t", ".ifczip", ".ifcxml"),
    *(".fbx", ".dae", ".blend", ".rvt", ".gh"),
)
"""File suffixes of CAD programs that dsfab does not read."""


def raw_mesh(
    path: str | Path, most_triangles: int = DEFAULT_TRIANGLES, unit: str | None = None, only: Sequence[str] = ()
) -> RawMesh:
    """Read a mesh file in OBJ, PLY, STL, OFF, glTF, 3MF, 3DM, DXF, STEP, BREP or IFC format.
    glTF files, which have y up, are turned so that z is up.
    unit : unit of coordinates if the file declares no known unit.    only : names of parts to read; by default all.
    Raises SurfaceError for an unreadable file, a file beyond the limits, an unknown name, and an unknown unit."""
    path = Path(path)
    suffix = _suffix(path)
    budget = Budget(most_triangles)
    with readable(path, "make the mesh coarser", "the file is damaged, or its kind is unknown to dsfab"):
        budget.require_bytes(path.stat().st_size)
        if only and suffix in _WITHOUT_NAMES:
            raise SurfaceError(f"{suffix[1:].upper()} files have no names of parts; leave out {ONLY_OPTION}")
        raw = _read(path, suffix, budget, only)
    if raw.unit not in (None, *METRES_PER):
        if unit is None:
            raise SurfaceError(
                f"{path} is in {raw.unit}, a unit that dsfab does not read; write the unit with --unit, or "
                f"surface.unit in a preset: one of {', '.join(METRES_PER)}"
            )
        raw = replace(raw, unit=None)
    return _checked_mesh(path, raw)


def _read(path: Path, suffix: str, budget: Budget, only: Sequence[str]) -> RawMesh:
    if suffix in _BY_PATH:
        return _from_triangles(_BY_PATH[suffix](path, budget, only), suffix)
    data = path.read_bytes()
    if suffix == ".obj":
        return _from_polygons(read_obj(data, budget, only), suffix, budget)
    if suffix in _POLYGONS:
        return _from_polygons(_POLYGONS[suffix](data, budget), suffix, budget)
    if suffix == ".3mf":
        mesh = read_3mf(data, budget, only)
    elif suffix == ".stl":
        mesh = read_stl(data, budget)
    else:
        mesh = _GLTF[suffix](data, budget, lambda name: _neighbour_file(path, name, budget), only)
    return _from_triangles(mesh, suffix)


def _from_triangles(mesh: TriangleFile, suffix: str) -> RawMesh:
    record = _record(suffix, mesh, len(mesh.V), count_phrase(len(mesh.F), "triangle"))
    return RawMesh(mesh.V, mesh.F, len(mesh.F), mesh.unit, record)


def _from_polygons(file: PolygonFile, suffix: str, budget: Budget) -> RawMesh:
    budget.require_triangles(int(np.maximum(file.mesh.sizes - 2, 0).sum()))
    faces = np.flatnonzero(file.mesh.sizes >= 3)
    few = len(file.mesh.sizes) - len(faces)
    content = (Content("face", count=len(faces)), *file.content)
    if few:
        content = (*content, Content("face", "dropped", "with fewer than three corners", few))
    joined_file, repaired = with_shared_vertices(replace(file, mesh=file.mesh.part(faces)) if few else file)
    cut = triangles(joined_file.mesh)
    crossing = len(cut.fanned)
    if crossing:
        face_list = ", ".join(str(k) for k in faces[cut.fanned[:3]].tolist())
        what = f"{count_phrase(crossing, 'face')} that cross themselves"
        repaired = (*repaired, f"{what} divided into fans of triangles (first faces, counted from 0: {face_list})")
    face_count = count_phrase(len(file.mesh.sizes), "face")
    record = _record(suffix, replace(file, content=content), len(file.mesh.V), face_count).also(repaired)
    return RawMesh(joined_file.mesh.V, cut.F, len(file.mesh.sizes), file.unit, record, file.up)


def _record(suffix: str, file: PolygonFile | TriangleFile, vertices: int, faces: str) -> FileRecord:
    what = f"{suffix[1:].upper()}: {count_phrase(vertices, 'vertex')}, {faces}"
    dropped = (*file.dropped, *(thing.text for thing in file.content if thing.fate == "dropped"))
    return FileRecord((what, *file.doubts), (), dropped, file.content)


def _neighbour_file(path: Path, name: str, budget: Budget) -> bytes:
    neighbour = path.parent / name
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise MalformedFileError(
            f"the coordinates are in {name[:60]!r}, outside the folder of the file: export everything as one file"
        )
    if not neighbour.is_file():
        raise SurfaceError(f"the coordinates are in the file {name[:60]!r}, which is missing; add it, or export .glb")
    budget.require_bytes(neighbour.stat().st_size)
    return neighbour.read_bytes()


def _checked_mesh(path: Path, raw: RawMesh) -> RawMesh:
    n, over = len(raw.V), ignored_clause(raw.record.dropped)
    if not len(raw.F):
        raise SurfaceError(
            f"{path} has {count_phrase(n, 'vertex')} and no faces{over}; give a mesh with at least one triangle"
        )
    bad = np.flatnonzero((raw.F.min(axis=1) < 0) | (raw.F.max(axis=1) >= n))
    if len(bad):
        raise SurfaceError(
            f"{path}: {count_phrase(len(bad), 'face')} {'name' if len(bad) > 1 else 'names'} vertices outside the "
            f"file's {n} vertices (first triangles: {first_few(bad)}){over}; export the file again"
        )
    used, F = np.unique(raw.F, return_inverse=True)
    largest = float(np.abs(raw.V[used][in_reach(raw.V[used])]).max(initial=0.0))
    if largest > OVERFLOW:
        raise SurfaceError(
            f"{path} has coordinates up to {largest:.3g}, which are too large in any unit; export the file again"
        )
    steps = number_steps(raw.V, raw.F, raw.unit)[1]
    record = replace(raw.record, read=(*raw.record.read, steps)) if steps else raw.record
    has_unselected = any(thing.kind == UNSELECTED for thing in record.content)  # unselected parts leave unused vertices
    if len(used) < n and not record.repaired and not has_unselected:
        record = record.also((), (f"{count_phrase(n - len(used), 'vertex')} without a face",))
    return replace(raw, V=raw.V[used], F=F.reshape(-1, 3).astype(np.int64), record=record)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    suffixes = ", ".join(MESH_SUFFIXES)
    if path.is_dir():
        raise SurfaceError(f"{path} is a folder; give a mesh file ({suffixes})")
    if suffix not in MESH_SUFFIXES:
        matches = difflib.get_close_matches(suffix, MESH_SUFFIXES, n=1, cutoff=0.5)
        hint = f"did you mean {matches[0]}? " if matches and suffix not in CAD_SUFFIXES else ""
        if suffix in CAD_SUFFIXES:
            hint = "export the surface as a mesh from your CAD program, preferably as OBJ; "
        raise SurfaceError(f"{path} has the suffix {suffix!r}, which dsfab does not read; {hint}use one of {suffixes}")
    if not path.exists():
        names = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        matches = difflib.get_close_matches(path.name, names, n=1)
        raise SurfaceError(f"{path} does not exist; {f'did you mean {matches[0]}?' if matches else 'check the path'}")
    if not path.stat().st_size:
        raise SurfaceError(f"{path} is empty; export the file again")
    return suffix


_POLYGONS: dict[str, Callable[[bytes, Budget], PolygonFile]] = {".ply": read_ply, ".off": read_off}
_GLTF: dict[str, Callable[[bytes, Budget, Callable[[str], bytes], Sequence[str]], TriangleFile]] = {
    ".glb": read_glb,
    ".gltf": read_gltf,
}
_BY_PATH: dict[str, Callable[[Path, Budget, Sequence[str]], TriangleFile]] = {
    ".3dm": read_3dm,
    ".dxf": read_dxf_meshes,
    **dict.fromkeys((".step", ".stp", ".brep", ".ifc"), read_cad),
}
_WITHOUT_NAMES = (".ply", ".off", ".stl", ".brep")
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", *_BY_PATH)
"""Suffixes of the mesh files that dsfab reads."""
