"""3DM (openNURBS) for Rhino and Grasshopper: the mesh, and edges and centre lines as curves on named layers.

Millimetres, and the file says so.
The library rhino3dm (extra `rhino`) keeps vertices of meshes in single precision; curves are in double. A line is a
NURBS curve within the tolerance of the lines, or a polycurve where it has corners; straight ones stay polylines. Each
has its id as its name, and its family, number, length and tolerance as user text.
"""

import importlib.util
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.along import check_curves, curves_along, joined, sampled, within
from dsfab.export.curves import Curve
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh
from dsfab.export.text import one_line
from dsfab.surface.lines import StructureLine

VERSION = 7
"""Of Rhino: the oldest in wide use; newer ones read it."""
COLOURS = {
    "major": (31, 78, 156, 255),
    "minor": (179, 38, 30, 255),
    "keep": (46, 125, 50, 255),
    "rim": (0, 121, 134, 255),
}
BLACK, GREY = (0, 0, 0, 255), (150, 150, 150, 255)
MESH = "sheet"
"""The layer of the mesh."""


def ready() -> None:
    """Raise ExportError if rhino3dm is not installed."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise ExportError('.3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"')


def prepare(part: Part) -> Part:
    """The part in single precision."""
    return in_single_precision(part)


def encode(part: Part) -> Iterator[bytes]:
    """The archive as rhino3dm writes it, which is to a file only; it holds identifiers that differ from run to run."""
    import rhino3dm

    model = rhino3dm.File3dm()
    model.ApplicationName, model.ApplicationDetails = "dsfab", f"dsfab {__version__}"
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters
    model.Settings.ModelAbsoluteTolerance = 0.001
    layers = {MESH: model.Layers.AddLayer(MESH, GREY)}
    for line in part.details.lines:
        if line.layer not in layers:
            layers[line.layer] = model.Layers.AddLayer(line.layer, COLOURS.get(line.family, BLACK))
    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex = one_line(part.name), layers[MESH]
    model.Objects.AddMesh(_mesh(part), about)
    for line in part.details.lines:
        model.Objects.AddCurve(_curve(line, within(part)), _about(line, layers[line.layer], within(part)))
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "model.3dm"
        if not model.Write(str(path), VERSION):
            raise ExportError(f"rhino3dm could not write {part.name!r}; free some space for temporary files")
        yield path.read_bytes()


def _mesh(part: Part) -> Any:
    import rhino3dm

    mesh = rhino3dm.Mesh()
    for vertex in part.V.tolist():
        mesh.Vertices.Add(*vertex)
    for face in part.F.tolist():
        mesh.Faces.AddFace(*face)
    mesh.Normals.ComputeNormals()
    return mesh


def _curve(line: StructureLine, tolerance: float) -> Any:
    """A NURBS curve, a polyline, or one after the other."""
    import rhino3dm

    made = list[Any]()
    for run in joined(curves_along(line.points, tolerance)):
        if isinstance(run, Curve):
            curve = rhino3dm.NurbsCurve(3, False, run.degree + 1, len(run.poles))
            for i, pole in enumerate(run.poles.tolist()):
                curve.Points[i] = rhino3dm.Point4d(*pole, 1.0)
            for i, knot in enumerate(run.knots[1:-1].tolist()):  # openNURBS leaves out the first and the last
                curve.Knots[i] = knot
            made.append(curve)
        else:
            made.append(rhino3dm.PolylineCurve(rhino3dm.Point3dList([rhino3dm.Point3d(*x) for x in run.tolist()])))
    if len(made) == 1:
        return made[0]
    whole = rhino3dm.PolyCurve()
    for curve in made:
        whole.AppendSegment(curve)
    return whole


def _about(line: StructureLine, layer: int, tolerance: float) -> Any:
    import rhino3dm

    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex = line.id, layer
    facts = {"family": line.family, "number": str(line.number)}
    facts |= {"length_mm": f"{line.length:.3f}", "tolerance_mm": f"{tolerance:.2g}"}
    for key, value in facts.items():
        about.SetUserString(key, value)
    return about


def check(part: Part, path: Path) -> ReadBack:
    """Read back with rhino3dm, the only reader there is: one mesh and as many curves, valid, in millimetres."""
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None or model.Settings.ModelUnitSystem != rhino3dm.UnitSystem.Millimeters:
        raise ExportError(
            f"the .3dm file of {part.name!r} does not read back in millimetres; write .dxf and .stl instead"
        )
    shapes = [item.Geometry for item in model.Objects]
    meshes = [shape for shape in shapes if shape.ObjectType == rhino3dm.ObjectType.Mesh]
    if len(meshes) != 1 or not all(shape.IsValid for shape in shapes):
        raise ExportError(f"rhino3dm finds the .3dm file of {part.name!r} invalid; write .dxf and .stl instead")
    found = check_mesh(part, *_arrays(meshes[0]))
    curves = [item for item in model.Objects if item.Geometry.ObjectType == rhino3dm.ObjectType.Curve]
    check_curves(part, {item.Attributes.Name: _points(item.Geometry) for item in curves})
    return found


def _arrays(mesh: Any) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3); openNURBS holds a triangle as a quad with its last corner twice."""
    V = np.array([(v.X, v.Y, v.Z) for v in (mesh.Vertices[i] for i in range(len(mesh.Vertices)))])
    F = np.array([mesh.Faces[i] for i in range(mesh.Faces.Count)], dtype=np.int64)
    return V, F[:, :3]


def _points(curve: Any) -> list[Floats]:
    """Points (k, 3) along a curve, or along each of those that a polycurve is made of."""
    if hasattr(curve, "SegmentCount"):
        return [points for i in range(curve.SegmentCount) for points in _points(curve.SegmentCurve(i))]
    if hasattr(curve, "Knots"):
        knots = np.array([curve.Knots[i] for i in range(len(curve.Knots))])
        found = (curve.PointAt(x) for x in sampled(knots).tolist())
    else:
        found = (curve.Point(i) for i in range(curve.PointCount))
    return [np.array([(p.X, p.Y, p.Z) for p in found])]
