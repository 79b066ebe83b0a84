"""Functions that read, write and measure shapes of the CAD kernel OCCT."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any


def read(path: Path) -> Any:
    """Read the shape in a STEP, `.brep` or `.bin` file, millimetres. Raises ValueError if OCCT finds no shape."""
    from OCP.BinTools import BinTools
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    if path.suffix == ".bin":
        BinTools.Read_s(shape, str(path))
    elif path.suffix == ".brep":
        BRepTools.Read_s(shape, str(path), BRep_Builder())
    else:
        reader = step_reader(path)
        if reader is None:  # None would crash OCCT
            raise ValueError("OCCT cannot read the file")
        reader.TransferRoots()
        shape = reader.OneShape()
    if shape.IsNull():
        raise ValueError("OCCT finds no shape in the file")
    return shape


def step_reader(path: Path) -> Any | None:
    """Return OCCT's reader object after it read a STEP file; None if OCCT cannot read the file."""
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    return reader if reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone else None


def write_binary(shape: Any, path: Path) -> None:
    """Write a shape to a file in OCCT's binary format, without its triangles."""
    from OCP.BinTools import BinTools, BinTools_FormatVersion

    if not BinTools.Write_s(shape, str(path), False, False, BinTools_FormatVersion.BinTools_FormatVersion_CURRENT):
        raise OSError(f"{path} cannot be written")


def parts(shape: Any, kind: str) -> list[Any]:
    """Return all parts of one kind ("SOLID", "FACE", "EDGE" ...) in a shape."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    explorer, parts_list = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}")), []
    while explorer.More():
        parts_list.append(explorer.Current())
        explorer.Next()
    return parts_list


def faces_of(shape: Any) -> list[Any]:
    """Return the faces of a shape."""
    from OCP.TopoDS import TopoDS

    return [TopoDS.Face(face) for face in parts(shape, "FACE")]


def compound(shapes: list[Any]) -> Any:
    """Return the shapes as a compound (a group of shapes in OCCT)."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, shapes_compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(shapes_compound)
    for shape in shapes:
        builder.Add(shapes_compound, shape)
    return shapes_compound


def bounds(shape: Any, with_triangles: bool = True) -> list[float]:
    """Return the lowest and highest corner of OCCT's bounding box of a shape: six numbers, mm."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, with_triangles)
    low, high = box.CornerMin(), box.CornerMax()
    return [low.X(), low.Y(), low.Z(), high.X(), high.Y(), high.Z()]


def diagonal(shape: Any, optimal: bool = True) -> float:
    """Return the diagonal of a shape's bounding box, mm. optimal : True for the smallest box."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    (BRepBndLib.AddOptimal_s if optimal else BRepBndLib.Add_s)(shape, box)
    return float(box.SquareExtent() ** 0.5)


def is_valid(shape: Any) -> bool:
    """Return True if OCCT finds a shape valid."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    return bool(BRepCheck_Analyzer(shape).IsValid())


def gauss_kronrod_volume(shape: Any, accuracy: float) -> float:
    """Return the volume of a shape (mm3) by the Gauss-Kronrod rule. accuracy : largest relative error."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumePropertiesGK_s(shape, properties, accuracy, False, False, False, False, False)
    return float(properties.Mass())


def without_triangles(faces: list[Any]) -> list[Any]:
    """Return the faces for which OCCT's last triangulation failed."""
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    return [face for face in faces if BRep_Tool.Triangulation_s(face, TopLoc_Location()) is None]


def step_facts(path: Path) -> dict[str, Any]:
    """Return the counts and measures of a STEP, `.brep` or `.bin` file, mm. Raises ValueError if OCCT finds no shape.
    Solids: {"solids": 1, "faces": 6, "valid": true, "tessellates": true, "volume": 1000.0}.
    Triangles: {"triangles": 12, "volume": 1000.0}.    Lines: {"lines": 3, "length": 12.0}."""
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
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GeomAbs import GeomAbs_SurfaceType

    if all(BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane for face in faces):
        return True
    BRepMesh_IncrementalMesh(shape, 1e-3 * diagonal(shape), False, 0.5, True)
    return not without_triangles(faces)
