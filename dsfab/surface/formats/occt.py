"""STEP and BREP: the faces of a CAD file as triangles, by OCCT, within a share of its size. Run it apart (`apart`)."""

from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.surface.formats.limits import MalformedFileError
from dsfab.surface.formats.record import TriangleFile

ACROSS = 2e-4
"""Largest distance of a triangle from a curved face, as a share of the diagonal of the bounding box."""
ANGLE = 0.2
"""Largest turn from one triangle to the next, radians."""


def read_occt(path: Path) -> TriangleFile:
    """The triangles of all faces; those of neighbours stand at the same places and are not joined.

    STEP files are turned into millimetres by OCCT; BREP files do not say their unit. Raises MalformedFileError for what
    OCCT cannot read, and for a file without faces.
    """
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer

    shape, box = _shape(path), Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    faces = TopExp_Explorer(shape, TopAbs_FACE)
    if not faces.More() or box.IsVoid():
        raise MalformedFileError("it holds no faces, only curves or points")
    BRepMesh_IncrementalMesh(shape, ACROSS * box.SquareExtent() ** 0.5, False, ANGLE, False)
    V, F, count, lost = list[Floats](), list[Ints](), 0, 0
    while faces.More():
        points, corners = _triangles(faces.Current())
        V.append(points)
        F.append(corners + count)
        count, lost = count + len(points), lost + (not len(corners))
        faces.Next()
    if not count:
        raise MalformedFileError("none of its faces can be meshed")
    dropped = (f"{lost} of {len(V)} faces that OCCT cannot mesh",) if lost else ()
    unit, metres = (None, 1.0) if path.suffix.lower() == ".brep" else ("mm", 1e-3)
    return TriangleFile(np.concatenate(V), np.concatenate(F), unit, metres, (), dropped)


def _shape(path: Path) -> Any:
    """What a file holds."""
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    if path.suffix.lower() == ".brep":
        from OCP.BRep import BRep_Builder
        from OCP.BRepTools import BRepTools
        from OCP.TopoDS import TopoDS_Shape

        shape = TopoDS_Shape()
        if not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
            raise MalformedFileError("it is no BREP file, or it is cut off")
        return shape
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
        raise MalformedFileError("it is no STEP file with shapes, or it is cut off")
    return reader.OneShape()


def _triangles(face: Any) -> tuple[Floats, Ints]:
    """V (n, 3) and F (m, 3) of a face, as seen from its outside."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(TopoDS.Face(face), place)
    if mesh is None:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    move = place.Transformation()
    nodes = (mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1))
    V = np.array([(p.X(), p.Y(), p.Z()) for p in nodes])
    F = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3) - 1
    return V, F[:, ::-1] if face.Orientation() == TopAbs_REVERSED else F
