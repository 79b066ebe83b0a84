"""What OCCT finds in a STEP file of smooth solids, one by one: a program of its own, because a check may not end.

    python -P check.py FILE

prints one line of JSON, {"solids": [{...}, ...]}, in the order of the file; each with `valid`, `closed`, `tessellates`,
`faces`, `volume` (cubic millimetres), `gap` (millimetres: the largest distance between an edge and its curve on a face,
measured, whatever tolerance it was given), and `bad`, the ends (k, 3) of the edges that cross others.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import json
import sys
from collections.abc import Iterator
from typing import Any

ACROSS = 1e-3
"""Deflection of the triangles, as a share of a solid's size."""

SAMPLES = 24
"""Places along each edge where its gap is measured."""


def inspected(path: str) -> list[dict[str, Any]]:
    """The findings for each solid of a file; empty when it cannot be read."""
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_ReturnStatus.IFSelect_RetDone:
        return []
    reader.TransferRoots()
    return [_findings(solid) for solid in _parts(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID)]


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


def _findings(solid: Any) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    faces = [TopoDS.Face(face) for face in _parts(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
    valid = bool(BRepCheck_Analyzer(solid).IsValid())
    return {
        "valid": valid,
        "closed": all(BRep_Tool.IsClosed_s(shell) for shell in _parts(solid, TopAbs_ShapeEnum.TopAbs_SHELL)),
        "tessellates": _tessellates(solid, faces),
        "faces": len(faces),
        "volume": _volume(solid),
        "gap": max((_gap(face) for face in faces), default=0.0),
        "bad": [] if valid else _crossing(faces),
    }


def _tessellates(solid: Any, faces: list[Any]) -> bool:
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Tool
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box)
    BRepMesh_IncrementalMesh(solid, ACROSS * box.SquareExtent() ** 0.5, False, 0.5, True)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in faces)


def _volume(solid: Any) -> float:
    """By the Gauss-Kronrod rule, to 5e-4: another digit takes three times as long on skins with many holes."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumePropertiesGK_s(solid, properties, 1e-4, False, False, False, False, False)
    return float(properties.Mass())


def _gap(face: Any) -> float:
    """Largest distance between the face's edges and their curves on it, sampled at the same parameters."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    widest, surface = 0.0, BRep_Tool.Surface_s(face)
    for shape in _parts(face, TopAbs_ShapeEnum.TopAbs_EDGE):
        edge = TopoDS.Edge(shape)
        curve = BRepAdaptor_Curve(edge)
        first, last = curve.FirstParameter(), curve.LastParameter()
        flat = BRep_Tool.CurveOnSurface_s(edge, face, first, last)
        if flat is None:
            continue
        for k in range(SAMPLES + 1):
            at = first + (last - first) * k / SAMPLES
            uv = flat.Value(at)
            widest = max(widest, surface.Value(uv.X(), uv.Y()).Distance(curve.Value(at)))
    return widest


def _crossing(faces: list[Any]) -> list[list[float]]:
    """The ends of the edges that cross others of their wire; of all edges of invalid faces when none is named."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_Status, BRepCheck_Wire
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS, TopoDS_Edge

    found = list[list[float]]()
    for face in faces:
        if BRepCheck_Analyzer(face).IsValid():
            continue
        named = []
        for wire in _parts(face, TopAbs_ShapeEnum.TopAbs_WIRE):
            one, two = TopoDS_Edge(), TopoDS_Edge()
            status = BRepCheck_Wire(TopoDS.Wire(wire)).SelfIntersect(face, one, two)
            if status != BRepCheck_Status.BRepCheck_NoError:
                named += [edge for edge in (one, two) if not edge.IsNull()]
        for edge in named or [TopoDS.Edge(shape) for shape in _parts(face, TopAbs_ShapeEnum.TopAbs_EDGE)]:
            curve = BRepAdaptor_Curve(edge)
            for at in (curve.FirstParameter(), curve.LastParameter()):
                point = curve.Value(at)
                found.append([point.X(), point.Y(), point.Z()])
    return found


if __name__ == "__main__":
    sys.stdout.write(json.dumps({"solids": inspected(sys.argv[1])}) + "\n")
