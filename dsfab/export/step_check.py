"""What build123d (OCCT) finds in a STEP or BREP file: a program of its own, because the check of a shape may not end.

    python -P step_check.py FILE

prints one line of JSON, {"solids": 1, "faces": 6, "valid": true, "tessellates": true, "volume": 1000.0}, the volume in
cubic millimetres; of a file of tessellated geometry, {"triangles": 12, "volume": 1000.0}, and of
lines only, {"lines": 3, "length": 12.0}.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import json
import sys
from pathlib import Path
from typing import Any


def step_facts(path: Path) -> dict[str, Any]:
    """Number of solids and faces, OCCT's validity check, and the volume of all solids together."""
    from build123d import import_brep, import_step
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    if path.suffix != ".brep" and b"TESSELLATED_SHAPE_REPRESENTATION" in path.read_bytes():
        return _triangles(path)
    if path.suffix != ".brep" and b"WIREFRAME_SHAPE_REPRESENTATION" in path.read_bytes():
        return _lines(path)
    shape = import_brep(path) if path.suffix == ".brep" else import_step(path)
    solids = shape.solids()
    return {
        "solids": len(solids),
        "faces": len(shape.faces()),
        "valid": bool(solids) and all(solid.is_valid for solid in solids),
        "tessellates": _tessellates(shape),
        "volume": sum(_volume(solid.wrapped) for solid in solids),
    }


def _lines(path: Path) -> dict[str, Any]:
    """Number of curves in a file of lines, a composite one counted once, and their length together."""
    from build123d import Compound, import_step

    found = import_step(path)
    curves = list(Compound.cast(found.wrapped))
    while len(curves) == 1 and isinstance(curves[0], Compound):
        curves = list(curves[0])
    return {"lines": len(curves), "length": sum(edge.length for edge in found.edges())}


def _triangles(path: Path) -> dict[str, Any]:
    """Number of triangles in a file of tessellated geometry, and the volume inside them."""
    from OCP.BRep import BRep_Tool
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    count, volume = 0, 0.0
    faces = TopExp_Explorer(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_FACE)
    while faces.More():
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face(faces.Current()), TopLoc_Location())
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = (mesh.Node(k).XYZ() for k in mesh.Triangle(i).Get())
            volume += a.Dot(b.Crossed(c)) / 6
        count += mesh.NbTriangles()
        faces.Next()
    return {"triangles": count, "volume": volume}


def _tessellates(shape: Any) -> bool:
    """Whether every face becomes triangles: a few valid curved ones do not. Planar faces alone are not asked."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location

    faces = shape.faces()
    if all(face.geom_type.name == "PLANE" for face in faces):
        return True
    BRepMesh_IncrementalMesh(shape.wrapped, 1e-3 * shape.bounding_box().diagonal, False, 0.5, True)
    return all(BRep_Tool.Triangulation_s(face.wrapped, TopLoc_Location()) is not None for face in faces)


def _volume(shape: Any) -> float:
    """Volume by the Gauss-Kronrod rule: the other calls are wrong on faces with many holes or curved edges.

    Measured on a plate with 65 holes and curved walls: 7e-9, and 1e-3 for the adaptive `VolumeProperties_s`.
    """
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumePropertiesGK_s(shape, properties, 1e-5, False, False, False, False, False)
    return float(properties.Mass())


if __name__ == "__main__":
    sys.stdout.write(json.dumps(step_facts(Path(sys.argv[1]))) + "\n")
