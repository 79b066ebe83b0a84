"""OCCT's facts about a STEP or BREP file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dsfab.export.cad.step.worker.shapes import (
    diagonal,
    faces_of,
    gauss_kronrod_volume,
    is_valid,
    parts,
    read,
    without_triangles,
)


def step_facts(path: Path) -> dict[str, Any]:
    """Return the numbers of solids and faces, OCCT's validity check, and the total volume, cubic millimetres.

    Solids give {"solids": 1, "faces": 6, "valid": true, "tessellates": true, "volume": 1000.0}, tessellated geometry
    {"triangles": 12, "volume": 1000.0}, and for lines {"lines": 3, "length": 12.0}. Raises ValueError if OCCT finds no
    shape.
    """
    accuracy = 1e-5
    shape = read(path)
    text = b"" if path.suffix == ".brep" else path.read_bytes()
    if b"TESSELLATED_SHAPE_REPRESENTATION" in text:
        return _triangles(shape)
    if b"WIREFRAME_SHAPE_REPRESENTATION" in text:
        return _lines(shape)
    solids, faces = parts(shape, "SOLID"), faces_of(shape)
    return {
        "solids": len(solids),
        "faces": len(faces),
        "valid": bool(solids) and all(map(is_valid, solids)),
        "tessellates": _tessellates(shape, faces),
        "volume": sum(gauss_kronrod_volume(solid, accuracy) for solid in solids),
    }


def _lines(shape: Any) -> dict[str, Any]:
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GCPnts import GCPnts_AbscissaPoint
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    curves = [shape]
    while len(curves) == 1 and curves[0].ShapeType() == TopAbs_ShapeEnum.TopAbs_COMPOUND:
        curves = list(_subshapes(curves[0]))
    edges = (BRepAdaptor_Curve(TopoDS.Edge(edge)) for edge in parts(shape, "EDGE"))
    return {"lines": len(curves), "length": sum(GCPnts_AbscissaPoint.Length_s(edge) for edge in edges)}


def _subshapes(shape: Any) -> Iterator[Any]:
    from OCP.TopoDS import TopoDS_Iterator

    iterator = TopoDS_Iterator(shape)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()


def _triangles(shape: Any) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    count, volume = 0, 0.0
    for face in faces_of(shape):
        mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = (mesh.Node(k).XYZ() for k in mesh.Triangle(i).Get())
            volume += a.Dot(b.Crossed(c)) / 6
        count += mesh.NbTriangles()
    return {"triangles": count, "volume": volume}


def _tessellates(shape: Any, faces: list[Any]) -> bool:
    """Return True if every face becomes triangles, which OCCT fails to make of a few valid curved faces."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GeomAbs import GeomAbs_SurfaceType

    if all(BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane for face in faces):
        return True
    BRepMesh_IncrementalMesh(shape, 1e-3 * diagonal(shape), False, 0.5, True)
    return not without_triangles(faces)
