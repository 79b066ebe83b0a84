"""Conversion of meshes of trimesh, pyvista and compas to surfaces and back."""

import importlib.util
import warnings
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.core.errors import SurfaceError
from dsfab.core.units import metres_per
from dsfab.surface.clean.seams import equal_merged, merged_vertices
from dsfab.surface.files.polygons import Polygons, polygons, triangles
from dsfab.surface.files.reader import oriented_surface
from dsfab.surface.mesh import Surface

if TYPE_CHECKING:
    import compas.datastructures
    import compas.geometry
    import pyvista
    import trimesh


def surface_from(V: Any, F: Iterable[Any], unit: str = "m") -> Surface:
    """Return a surface with the vertices V (n, 3), in `unit`, and the polygons F: (m, 3), (m, 4), or lists of corners.
    Polygons are cut into triangles. Vertex numbers do not change. Raises SurfaceError for an unusable mesh."""
    mesh = _polygons(V, F)
    return oriented_surface(mesh.V * metres_per(unit), triangles(mesh).F)


def _merged_surface(V: Any, F: Iterable[Any], unit: str) -> Surface:
    mesh = _polygons(V, F)
    fewer, became = merged_vertices(mesh.V)
    mesh = replace(mesh, V=fewer, corners=became[mesh.corners])
    return oriented_surface(mesh.V * metres_per(unit), triangles(mesh).F)


def _polygons(V: Any, F: Iterable[Any]) -> Polygons:
    try:
        faces = [[int(corner) for corner in face] for face in F]
        mesh = polygons(np.asarray(V, dtype=np.float64).reshape(-1, 3).tolist(), faces)
    except (TypeError, ValueError) as error:
        raise SurfaceError(f"the mesh needs vertices (n, 3), and faces as lists of indices: {error}") from None
    if faces and not (mesh.corners.min() >= 0 and mesh.corners.max() < len(mesh.V) and mesh.sizes.min() >= 3):
        raise SurfaceError(f"each face needs three or more vertex numbers from 0 to {len(mesh.V) - 1}; repair the mesh")
    return mesh


def surface_of(mesh: Any, unit: str | None = None) -> Surface:
    """Convert a mesh of trimesh, pyvista, compas or meshio, or any object with vertices and faces, to a surface.
    unit : unit of the coordinates; by default the unit of a trimesh mesh, or metres.
    Vertices with equal positions are merged. Raises SurfaceError for an unusable mesh."""
    if isinstance(mesh, Surface):
        return mesh
    own_unit = getattr(mesh, "units", None)
    unit = unit or (own_unit if isinstance(own_unit, str) and own_unit else "m")
    if hasattr(mesh, "to_vertices_and_faces"):  # a compas mesh
        V, F = mesh.to_vertices_and_faces()
        return _merged_surface(V, F, unit)
    if hasattr(mesh, "extract_surface") and hasattr(mesh, "points"):  # a pyvista mesh
        shell = mesh.extract_surface(algorithm=None) if not hasattr(type(mesh), "regular_faces") else mesh
        return _merged_surface(shell.points, shell.irregular_faces, unit)
    if hasattr(mesh, "cells_dict") and hasattr(mesh, "points"):  # a meshio mesh
        cells = [face for kind in ("triangle", "quad") for face in mesh.cells_dict.get(kind, ())]
        return _merged_surface(mesh.points, cells, unit)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return _merged_surface(mesh.vertices, mesh.faces, unit)
    raise SurfaceError(
        f"an object of type {type(mesh).__name__} is not a mesh; give a mesh with vertices and faces, or call from_mesh"
    )


def stl_by_trimesh(path: Path) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) and faces (m, 3) of an STL file. Raises SurfaceError if trimesh fails."""
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh: Any = trimesh.load(path, file_type="stl", force="mesh", process=False)
        return equal_merged(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))
    except Exception:  # trimesh raises many types of errors for a bad file
        raise SurfaceError(f"{path}: trimesh cannot read this file, but dsfab can; export the file again") from None


def threemf_by_lib3mf(path: Path) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) and faces (m, 3) of a 3MF file. Raises SurfaceError if lib3mf fails."""
    import lib3mf

    model, parts = lib3mf.get_wrapper().CreateModel(), list[tuple[Floats, Ints]]()
    try:
        model.QueryReader("3mf").ReadFromFile(str(path))
        objects = model.MergeToModel().GetMeshObjects()
        while objects.MoveNext():
            mesh = objects.GetCurrentMeshObject()
            V = np.frombuffer(b"".join(mesh.GetVertices()), dtype="<f4").reshape(-1, 3).astype(np.float64)
            F = np.frombuffer(b"".join(mesh.GetTriangleIndices()), dtype="<u4").reshape(-1, 3).astype(np.int64)
            parts.append((V, F))
    except lib3mf.ELib3MFException:
        raise SurfaceError(f"{path}: lib3mf cannot read this file, but dsfab can; export the file again") from None
    return concatenated_mesh(parts)


def as_trimesh(V: Floats, F: Ints) -> "trimesh.Trimesh":
    """Return a trimesh mesh with vertices V (n, 3), metres, and faces F (m, 3)."""
    import trimesh

    mesh = trimesh.Trimesh(V, F, process=False)
    mesh.units = "m"
    return mesh


def as_pyvista(V: Floats, F: Ints) -> "pyvista.PolyData":
    """Return a pyvista mesh with vertices V (n, 3), metres, and faces F (m, 3)."""
    import pyvista

    build: Any = pyvista.PolyData.from_regular_faces  # pyvista's annotations forbid numpy arrays
    mesh: pyvista.PolyData = build(np.asarray(V), np.asarray(F))
    return mesh


def as_compas(V: Floats, F: Ints) -> "compas.datastructures.Mesh":
    """Return a compas mesh of vertices V (n, 3), metres, and faces F (m, 3). Raises SurfaceError without compas."""
    require_compas()
    from compas.datastructures import Mesh

    mesh: compas.datastructures.Mesh = Mesh.from_vertices_and_faces(V.tolist(), F.tolist())
    return mesh


def as_polyline(points: Floats) -> "compas.geometry.Polyline":
    """Return a compas polyline through points (k, 2) or (k, 3), metres. Raises SurfaceError without compas."""
    require_compas()
    from compas.geometry import Polyline

    return Polyline(_in_space(points).tolist())


def as_circle(middle: Floats, radius: float) -> "compas.geometry.Circle":
    """Return a compas circle with the centre `middle` (2,) in the plane, metres. Raises SurfaceError without compas."""
    require_compas()
    from compas.geometry import Circle, Frame

    return Circle(radius, frame=Frame(_in_space(middle[None])[0].tolist(), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))


def require_compas() -> None:
    """Raise SurfaceError if compas is not installed."""
    if importlib.util.find_spec("compas") is None:
        raise SurfaceError('compas is not installed; install it with: pip install "dsfab[compas]"')


def _in_space(points: Floats) -> Floats:
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
