"""Triangles of the solids in a STEP file according to OCCT. A program of its own, like `step_facts`.

    python -P step_triangles.py FILE FOLDER [DEFLECTION [FACES]]

reads a STEP file, or a `.bin` shape of its own, and writes to FOLDER `mesh.npz`: V (n, 3) millimetres, F (m, 3)
counter-clockwise from outside, and the face (m,) of each triangle, counted through all solids. It prints one line of
JSON: {"solids": 1, "deflection": 0.1}, where DEFLECTION 0 means `DEFLECTION_SHARE`. FACES is a `.npy` file of face
numbers to draw. From a STEP file it also writes `shape.bin`, OCCT's binary shape, which loads 50 times as fast.
Neighbouring faces share no vertices. It imports nothing from dsfab. `piece_check` uses its functions for shapes that it
has read.
"""

import gc
import json
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

DEFLECTION_SHARE = 1e-4
"""Default deflection over the diagonal of the bounding box."""


def read(path: Path) -> Any:
    """Read the shape in a STEP or `.bin` file, millimetres; raises ValueError if OCCT finds none."""
    if path.suffix == ".bin":
        return read_binary(path)
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise ValueError("OCCT does not read it")
    reader.TransferRoots()
    if not reader.NbShapes():
        raise ValueError("OCCT finds no shape in it")
    return reader.OneShape()


def read_binary(path: Path) -> Any:
    """Read a shape that `write_binary` wrote; raises ValueError if that fails."""
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    if not BinTools.Read_s(shape, str(path)):
        raise ValueError("OCCT does not read it")
    return shape


def write_binary(shape: Any, path: Path) -> None:
    """Write OCCT's binary shape, without triangles."""
    from OCP.BinTools import BinTools, BinTools_FormatVersion

    if not BinTools.Write_s(shape, str(path), False, False, BinTools_FormatVersion.BinTools_FormatVersion_CURRENT):
        raise OSError(f"{path} cannot be written")


def triangles_of(shape: Any, deflection: float = 0.0, only: Any = None) -> tuple[dict[str, Any], dict[str, float]]:
    """Return V, F and `face` as in `mesh.npz`, of the faces `only` (k,) or all; number of solids and deflection.

    Selected faces are drawn together, so that neighbours share the points of their edges.
    """
    from OCP.TopAbs import TopAbs_ShapeEnum

    solids, deflection = (
        list(_parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID)),
        deflection or DEFLECTION_SHARE * _diagonal(shape),
    )
    faces = [face for solid in solids for face in _parts(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
    numbers = list(range(len(faces)) if only is None else map(int, only))
    for solid in solids if only is None else [_compound([faces[k] for k in numbers])]:
        draw(solid, deflection)
    return _mesh(faces, numbers), {"solids": len(solids), "deflection": deflection}


def draw(shape: Any, deflection: float) -> None:
    """Let OCCT triangulate a shape; it stores the triangles with the faces."""
    angle = 0.2  # largest turn between neighbouring triangles, radians
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    BRepMesh_IncrementalMesh(shape, deflection, False, angle, True)


def keep_drawn(shape: Any, folder: Path) -> None:
    """Write a triangulated shape as `write_results` does, with its number of solids. `mesh.npz` appears last, and only
    complete."""
    from OCP.TopAbs import TopAbs_ShapeEnum

    solids = list(_parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID))
    faces = [face for solid in solids for face in _parts(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
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


def _compound(faces: list[Any]) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for face in faces:
        builder.Add(compound, face)
    return compound


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _diagonal(shape: Any) -> float:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box)
    return float(box.SquareExtent() ** 0.5)


def _triangles(face: Any) -> tuple[Any, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(TopoDS.Face(face), place)
    if mesh is None:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    nodes: Iterable[Any] = map(mesh.Node, range(1, mesh.NbNodes() + 1))
    if not place.IsIdentity():  # moving points takes as long as reading them
        move = place.Transformation()
        nodes = (node.Transformed(move) for node in nodes)
    V = np.array([node.Coord() for node in nodes])
    F = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3) - 1
    return V, F[:, ::-1] if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED else F


def write_results(path: str, folder: str, deflection: str = "0", faces: str = "") -> str:
    """Read a file, write its results to a folder, and return one line of JSON; raises ValueError if OCCT cannot read
    it."""
    file, place = Path(path), Path(folder)
    shape = read(file)
    if file.suffix != ".bin":
        write_binary(shape, place / "shape.bin")
    mesh, facts = triangles_of(shape, float(deflection), np.load(faces) if faces else None)
    np.savez(place / "mesh.npz", **mesh)
    return json.dumps(facts)


if __name__ == "__main__":
    gc.disable()  # a tenth of the time that importing OCCT takes
    try:
        said = write_results(*sys.argv[1:])
    except ValueError as error:
        sys.exit(str(error))  # the caller shows this sentence without a traceback
    sys.stdout.write(said + "\n")
    sys.stdout.flush()
    os._exit(0)  # taking the solids apart takes a quarter of a second
