"""3DM (openNURBS) for Rhino and Grasshopper: the mesh, and edges and centre lines as curves on named layers.

Millimetres, and the file says so.
The library rhino3dm (extra `rhino`) keeps vertices of meshes in single precision; curves are in double. A line is a
NURBS curve within the tolerance of the lines, or a polycurve where it has corners; straight ones stay polylines. Each
has its id as its name, and its family, number, length and tolerance as user text.

openNURBS gives all things made-up ids and writes the time into the file. Here ids follow from what the file holds, and
the time is one that says nothing, as archives that can be made again have it: the same design has the same bytes.
"""

import base64
import hashlib
import importlib.util
import struct
import uuid
import zlib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.along import chains, check_curves, joined, sampled, within
from dsfab.export.curves import Curve
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh
from dsfab.export.text import one_line
from dsfab.surface import StructureLine

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

_HEADER = 32
"""Bytes before the first chunk of an archive: a chunk is its code (4 bytes), its length (8), its content."""
_PROPERTIES, _HISTORY, _SHORT = 0x10000014, 0x20008021, 0x80000000
"""Codes of chunks: what the file is, who changed it when; a chunk with this bit has a value in place of a length."""
_TIME = struct.pack("<8i", 0, 0, 0, 1, 0, 80, 2, 0)
"""1 January 1980, a Tuesday, as C's `struct tm`."""


def ready(what: str = ".3dm files need") -> None:
    """Raise ExportError if rhino3dm is not installed; `what` begins the sentence."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise ExportError(f'{what} the library rhino3dm; install it with: pip install "dsfab[rhino]"')


def prepare(part: Part) -> Part:
    """The part in single precision."""
    return in_single_precision(part)


def encode(part: Part) -> Iterator[bytes]:
    """The archive as rhino3dm writes it in memory (to a file it would write the file's name too), its times unset."""
    import rhino3dm

    model, ids = empty_model(), _ids(part)
    layers = {MESH: new_layer(model, ids, MESH, GREY)}
    for line in part.details.lines:
        if line.layer not in layers:
            layers[line.layer] = new_layer(model, ids, line.layer, COLOURS.get(line.family, BLACK))
    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex, about.Id = one_line(part.name), layers[MESH], ids("mesh")
    model.Objects.AddMesh(rhino_mesh(part.V, part.F), about)
    for number, (line, chain) in enumerate(zip(part.details.lines, chains(part), strict=True)):
        about = _about(line, layers[line.layer], within(part))
        about.Id = ids(f"line {number}")
        model.Objects.AddCurve(rhino_curve(chain), about)
    yield archive(model)


def empty_model() -> Any:
    """A model of rhino3dm in millimetres."""
    import rhino3dm

    model = rhino3dm.File3dm()
    model.ApplicationName, model.ApplicationDetails = "dsfab", f"dsfab {__version__}"
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters
    model.Settings.ModelAbsoluteTolerance = 0.001
    return model


def archive(model: Any) -> bytes:
    """The file of a model, its times unset."""
    import rhino3dm

    how = rhino3dm.File3dmWriteOptions()
    how.Version = VERSION
    return without_times(base64.b64decode(model.Encode(how)))


Ids = Callable[[str], uuid.UUID]


def _ids(part: Part) -> Ids:
    return ids_of(part.name, (part.V, part.F, *(line.points for line in part.details.lines)))


def ids_of(name: str, arrays: Iterable[NDArray[Any]]) -> Ids:
    """Ids by name, that differ between files that differ: those of two designs may meet in one model."""
    held = hashlib.sha256()
    for array in arrays:
        held.update(np.ascontiguousarray(array).tobytes())
    return partial(uuid.uuid5, uuid.uuid5(uuid.NAMESPACE_URL, f"dsfab {name} {held.hexdigest()}"))


def new_layer(model: Any, ids: Ids, name: str, colour: tuple[int, int, int, int]) -> int:
    """The index of a new layer."""
    import rhino3dm

    layer = rhino3dm.Layer()
    layer.Name, layer.Color, layer.Id = name, colour, ids(f"layer {name}")
    index: int = model.Layers.Add(layer)
    return index


def without_times(written: bytes) -> bytes:
    """An archive whose history says `_TIME` in place of when it was made and changed, its checksum right.

    The history: a byte of version; who made it (a count of letters of two bytes each, and these) and when (8 numbers);
    who changed it, and when; how often; CRC-32 of all this. Raises ExportError for an archive without it.
    """
    content = bytearray(written)
    properties = _chunk(written, _HEADER, len(written), _PROPERTIES)
    history = _chunk(written, *properties, _HISTORY) if properties else None
    if history is None:
        raise ExportError("rhino3dm writes .3dm files in another way than dsfab knows; write .dxf and .stl instead")
    start, end = history
    at = start + 1
    for _ in range(2):
        at += 4 + 2 * int.from_bytes(content[at : at + 4], "little")
        content[at : at + len(_TIME)] = _TIME
        at += len(_TIME)
    content[end - 4 : end] = zlib.crc32(content[start : end - 4]).to_bytes(4, "little")
    return bytes(content)


def _chunk(written: bytes, start: int, end: int, wanted: int) -> tuple[int, int] | None:
    """Where the content of the first chunk of that code begins and ends, of the chunks from `start` to `end`."""
    while start + 12 <= end:
        code, size = struct.unpack_from("<Iq", written, start)
        size = 0 if code & _SHORT else size
        start += 12
        if not 0 <= size <= end - start:
            return None
        if code == wanted:
            return start, start + size
        start += size
    return None


def rhino_mesh(V: Floats, F: Ints) -> Any:
    """A mesh of rhino3dm of vertices (n, 3) and triangles (m, 3), with normals, in whatever unit they are."""
    import rhino3dm

    mesh = rhino3dm.Mesh()
    for vertex in V.tolist():
        mesh.Vertices.Add(*vertex)
    for face in F.tolist():
        mesh.Faces.AddFace(*face)
    mesh.Normals.ComputeNormals()
    return mesh


def rhino_polyline(points: Floats) -> Any:
    """A polyline of rhino3dm through points (k, 3)."""
    import rhino3dm

    return rhino3dm.PolylineCurve(rhino3dm.Point3dList([rhino3dm.Point3d(*point) for point in points.tolist()]))


def rhino_curve(chain: list[Curve]) -> Any:
    """Curves that follow each other: a NURBS curve, a polyline, or one after the other."""
    import rhino3dm

    made = list[Any]()
    for run in joined(chain):
        if isinstance(run, Curve):
            curve = rhino3dm.NurbsCurve(3, False, run.degree + 1, len(run.poles))
            for i, pole in enumerate(run.poles.tolist()):
                curve.Points[i] = rhino3dm.Point4d(*pole, 1.0)
            for i, knot in enumerate(run.knots[1:-1].tolist()):  # openNURBS leaves out the first and the last
                curve.Knots[i] = knot
            made.append(curve)
        else:
            made.append(rhino_polyline(run))
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
    V, F = rhino_arrays(meshes[0])
    found = check_mesh(part, V, F[:, :3])
    curves = [item for item in model.Objects if item.Geometry.ObjectType == rhino3dm.ObjectType.Curve]
    check_curves(part, {item.Attributes.Name: _points(item.Geometry) for item in curves})
    return found


def rhino_arrays(mesh: Any) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and corners (m, 4) of a mesh of rhino3dm, which holds a triangle with its last corner twice."""
    V = np.array([(v.X, v.Y, v.Z) for v in (mesh.Vertices[i] for i in range(len(mesh.Vertices)))]).reshape(-1, 3)
    F = np.array([mesh.Faces[i] for i in range(mesh.Faces.Count)], dtype=np.int64).reshape(-1, 4)
    return V, F


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
