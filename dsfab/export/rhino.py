"""3DM (openNURBS) for Rhino and Grasshopper: the mesh, and edges and centre lines as curves on named layers.

Millimetres, and the file says so.
The library rhino3dm (extra `rhino`) keeps vertices of meshes in single precision; curves are in double. Every curve has
its id as its name, and its family, number and length as user text.
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
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import check_lines, check_mesh
from dsfab.export.text import one_line
from dsfab.surface.lines import Line

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
        points = [rhino3dm.Point3d(*point) for point in line.points.tolist()]
        model.Objects.AddPolyline(points, _about(line, layers[line.layer]))
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


def _about(line: Line, layer: int) -> Any:
    import rhino3dm

    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex = line.id, layer
    for key, value in (("family", line.family), ("number", str(line.number)), ("length_mm", f"{line.length:.3f}")):
        about.SetUserString(key, value)
    return about


def check(part: Part, path: Path) -> None:
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
    check_mesh(part, *_arrays(meshes[0]))
    check_lines(part, [_points(shape) for shape in shapes if shape.ObjectType == rhino3dm.ObjectType.Curve])


def _arrays(mesh: Any) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3); openNURBS holds a triangle as a quad with its last corner twice."""
    V = np.array([(v.X, v.Y, v.Z) for v in (mesh.Vertices[i] for i in range(len(mesh.Vertices)))])
    F = np.array([mesh.Faces[i] for i in range(mesh.Faces.Count)], dtype=np.int64)
    return V, F[:, :3]


def _points(curve: Any) -> Floats:
    points = (curve.Point(i) for i in range(curve.PointCount)) if hasattr(curve, "PointCount") else ()
    return np.array([(p.X, p.Y, p.Z) for p in points])
