"""OCCT's triangles of the solids in a STEP file.

`mesh.npz` contains points V (n, 3), mm, triangles F (m, 3), and the number `face` (m,) of each triangle's face.
Triangles are counter-clockwise seen from outside. Faces share no points. `shape.bin` is OCCT's binary shape."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.export.cad.step.worker.shapes import compound, diagonal, faces_of, parts, read, write_binary

DEFLECTION_SHARE = 1e-4  # default deflection, as a fraction of the diagonal of the bounding box


def write_triangles(path: Path, folder: Path, deflection: float = 0.0, faces: str = "") -> dict[str, Any]:
    """Write the triangles of a STEP or `.bin` file to `folder` as `mesh.npz`; for a STEP file, write also `shape.bin`.
    faces : name of a `.npy` file with numbers of faces; all faces by default.
    Return the number of solids and the deflection. Raises ValueError."""
    shape = read(path)
    if path.suffix != ".bin":
        write_binary(shape, folder / "shape.bin")
    mesh, facts = triangles_of(shape, deflection, np.load(faces) if faces else None)
    np.savez(folder / "mesh.npz", **mesh)
    return facts


def triangles_of(shape: Any, deflection: float = 0.0, only: Any = None) -> tuple[dict[str, Any], dict[str, float]]:
    """Return triangles of a shape (`V` points in mm, `F` triangles, `face` of each), number of solids, and deflection.
    deflection : largest distance of triangles from curved faces, mm; 0 for the default.
    only : (k,) numbers of the faces to triangulate; None for all faces."""
    solids, deflection = parts(shape, "SOLID"), deflection or DEFLECTION_SHARE * diagonal(shape)
    faces = [face for solid in solids for face in faces_of(solid)]
    numbers = list(range(len(faces)) if only is None else map(int, only))
    for solid in solids if only is None else [compound([faces[k] for k in numbers])]:
        draw(solid, deflection)
    return _mesh(faces, numbers), {"solids": len(solids), "deflection": deflection}


def draw(shape: Any, deflection: float) -> None:
    """Let OCCT triangulate a shape. deflection : largest distance of triangles from curved faces, mm."""
    angle = 0.2  # largest angle (radians) between neighbouring triangles
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    BRepMesh_IncrementalMesh(shape, deflection, False, angle, True)


def keep_drawn(shape: Any, folder: Path) -> None:
    """Write a triangulated shape to `folder`: the shape as `shape.bin`, and its triangles as `mesh.npz`."""
    solids = parts(shape, "SOLID")
    faces = [face for solid in solids for face in faces_of(solid)]
    write_binary(shape, folder / "shape.bin")
    part = folder / "part.npz"
    np.savez(part, **_mesh(faces, range(len(faces))), solids=len(solids))
    part.replace(folder / "mesh.npz")


def _mesh(faces: list[Any], numbers: Iterable[int]) -> dict[str, Any]:
    V, F, face_numbers, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)], 0
    for k in numbers:
        points, corners = _triangles(faces[k])
        V.append(points)
        F.append(corners + count)
        face_numbers.append(np.full(len(corners), k))
        count += len(points)
    return {"V": np.concatenate(V), "F": np.concatenate(F), "face": np.concatenate(face_numbers)}


def _triangles(face: Any) -> tuple[Any, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location

    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    nodes: Iterable[Any] = map(mesh.Node, range(1, mesh.NbNodes() + 1))
    if not place.IsIdentity():  # skip a needless move, which takes as long as reading the nodes
        move = place.Transformation()
        nodes = (node.Transformed(move) for node in nodes)
    V = np.array([node.Coord() for node in nodes])
    F = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3) - 1
    return V, F[:, ::-1] if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED else F
