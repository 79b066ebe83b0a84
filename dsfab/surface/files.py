"""Mesh files to raw arrays: one function per format, all behind `raw_mesh`.

A raw mesh is what the file says and may be bad in every way; `dsfab.surface.reader` judges it.
"""

import difflib
import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints, first
from dsfab.errors import SurfaceError
from dsfab.surface.orientation import upright
from dsfab.surface.ply import read_ply
from dsfab.surface.polygons import Polygons, read_obj, read_off, triangles
from dsfab.units import metres_per


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Vertices V (n, 3) in the file's own numbers, faces F (m, 3), and the polygons and the unit the file declares.

    polygons : number of faces in the file, before they were cut into triangles.
    unit     : the unit the file declares for them, None if it does not say.
    metres   : in one of the file's units; 1 where it does not say.
    """

    V: Floats
    F: Ints
    polygons: int
    unit: str | None = None
    metres: float = 1.0


def raw_mesh(path: str | Path) -> RawMesh:
    """Read OBJ, PLY, STL, OFF, GLB or 3MF, by the suffix; glTF's y axis (up, by its specification) becomes z.

    Quads are cut along the shorter diagonal, STL and GLB vertices at exactly the same place become one, vertices
    without a face are dropped. Raises SurfaceError for a path that is no readable mesh file.
    """
    path = Path(path)
    read = _READERS[_suffix(path)]
    try:
        with _silence():
            raw = read(path)
    except SurfaceError:
        raise
    except MemoryError:
        raise SurfaceError(f"{path} announces more data than fits in memory; the file is damaged") from None
    except Exception as error:  # whatever a foreign parser throws at a bad file
        what = f"{type(error).__name__}: {error}".splitlines()[0][:160]
        raise SurfaceError(f"{path} cannot be read as {_suffix(path)[1:].upper()} ({what}); export it again") from None
    if not len(raw.F):
        raise SurfaceError(f"{path} holds {len(raw.V)} vertices and no faces; give a mesh with at least one triangle")
    n = len(raw.V)
    bad = np.flatnonzero((raw.F.min(axis=1) < 0) | (raw.F.max(axis=1) >= n))
    if len(bad):
        raise SurfaceError(
            f"{path}: {len(bad)} faces name vertices outside the file's {n} vertices (first triangles: {first(bad)}); "
            "export it again"
        )
    used, F = np.unique(raw.F, return_inverse=True)
    return replace(raw, V=raw.V[used], F=F.reshape(-1, 3).astype(np.int64))


def _suffix(path: Path) -> str:
    """The known suffix of an existing file with something in it."""
    suffix = path.suffix.lower()
    known = ", ".join(_READERS)
    if path.is_dir():
        raise SurfaceError(f"{path} is a folder; give a mesh file ({known})")
    if suffix not in _READERS:
        near = difflib.get_close_matches(suffix, _READERS, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}? " if near else ""
        raise SurfaceError(f"{path} has the suffix {suffix!r}, which dsfab does not read; {hint}use one of {known}")
    if not path.exists():
        near = difflib.get_close_matches(path.name, _siblings(path), n=1)
        raise SurfaceError(f"{path} does not exist; " + (f"did you mean {near[0]}?" if near else "check the path"))
    if not path.stat().st_size:
        raise SurfaceError(f"{path} is empty; export it again")
    return suffix


def _siblings(path: Path) -> list[str]:
    return [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []


@contextmanager
def _silence() -> Iterator[None]:
    """No log lines and no warnings of foreign parsers: what matters becomes a SurfaceError."""
    logger = logging.getLogger("trimesh")
    was = logger.disabled
    logger.disabled = True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = was


def _from_polygons(read: Callable[[Path], Polygons]) -> Callable[[Path], RawMesh]:
    def reader(path: Path) -> RawMesh:
        mesh = read(path)
        F, _ = triangles(mesh)
        return RawMesh(mesh.V, F, len(mesh.sizes))

    return reader


def _stl(path: Path) -> RawMesh:
    """An STL file is triangles without shared vertices, 32-bit: the same corner has the same bits everywhere."""
    import trimesh

    soup = trimesh.load(path, file_type="stl", force="mesh", process=False)
    V, F = _merged(soup)
    return RawMesh(V, F, len(F))


def _glb(path: Path) -> RawMesh:
    import trimesh

    if path.read_bytes()[:4] != b"glTF":
        raise ValueError("there is no glTF header")
    V, F = _merged(trimesh.load(path, file_type="glb", force="mesh", process=False))
    return RawMesh(upright(V, "y"), F, len(F), "m")


def _merged(mesh: Any) -> tuple[Floats, Ints]:
    """Vertices at exactly the same place made one (+ 0.0 turns -0.0 into 0.0)."""
    V = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3) + 0.0
    V, index = np.unique(V, axis=0, return_inverse=True)
    return V, index.ravel()[np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)]


_MICROMETRE = 1e-6
"""Metres; 3MF alone knows this unit."""

_UNITS_3MF = {
    "MicroMeter": "um",
    "MilliMeter": "mm",
    "CentiMeter": "cm",
    "Meter": "m",
    "Inch": "in",
    "Foot": "ft",
}


def _3mf(path: Path) -> RawMesh:
    """All objects that the build plate holds, moved to their places (lib3mf, the consortium's own reader)."""
    import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(path))
    unit = _UNITS_3MF[model.GetUnit().name]
    merged = model.MergeToModel().GetMeshObjects()
    parts: list[tuple[Floats, Ints]] = []
    n = 0
    while merged.MoveNext():
        mesh = merged.GetCurrentMeshObject()
        V = np.array([v.Coordinates[:] for v in mesh.GetVertices()], dtype=np.float64).reshape(-1, 3)
        F = np.array([t.Indices[:] for t in mesh.GetTriangleIndices()], dtype=np.int64).reshape(-1, 3)
        parts.append((V, F + n))
        n += len(V)
    if not parts:
        return RawMesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), 0, unit)
    V, F = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    return RawMesh(V, F, len(F), unit, _MICROMETRE if unit == "um" else metres_per(unit))


_READERS: dict[str, Callable[[Path], RawMesh]] = {
    ".obj": _from_polygons(read_obj),
    ".ply": _from_polygons(read_ply),
    ".stl": _stl,
    ".off": _from_polygons(read_off),
    ".glb": _glb,
    ".3mf": _3mf,
}
MESH_SUFFIXES = tuple(_READERS)
"""Of the mesh files that are read."""
