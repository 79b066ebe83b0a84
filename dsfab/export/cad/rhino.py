"""3DM (openNURBS) for Rhino and Grasshopper: meshes, curves and members; also Rhino's JSON."""

import base64
import hashlib
import importlib.util
import json
import struct
import uuid
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.curves import (
    Curve,
    chains,
    check_curves,
    curve_tolerance,
    curves_along,
    joined_segments,
    sample_parameters,
)
from dsfab.export.members import facts_of_members, graph_of, rounded_lists
from dsfab.export.part import Part
from dsfab.export.readback import COLOURS, ReadBack, check_mesh, check_shapes, layer_colour, require_equal
from dsfab.export.writing import one_line

BLACK, GREY = (0, 0, 0), (150, 150, 150)
MESH = "sheet"  # name of the layer of the mesh
_PROPERTIES, _HISTORY, _SHORT = 0x10000014, 0x20008021, 0x80000000
"""Codes of the chunks with a file's properties and with its history. A chunk with bit `_SHORT` in its code is empty."""
_TIME = struct.pack("<8i", 0, 0, 0, 1, 0, 80, 2, 0)  # 1 January 1980, a Tuesday, as C's `struct tm`


def require_rhino3dm(what: str = ".3dm files need") -> None:
    """Raise ExportError if rhino3dm is not installed."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise ExportError(f'{what} the library rhino3dm; install it with: pip install "dsfab[rhino]"')


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a 3DM file with the mesh and the curves of a part."""
    model = empty_model()
    ids = ids_of(part.name, (part.V, part.F, *(line.points for line in part.details.lines)))
    layers = {MESH: new_layer(model, ids, MESH, GREY)}
    for line in part.details.lines:
        if line.layer not in layers:
            layers[line.layer] = new_layer(model, ids, line.layer, COLOURS.get(line.family, BLACK))
    about = _about(one_line(part.name), layers[MESH], ids("mesh"))
    model.Objects.AddMesh(rhino_mesh(part.V, part.F), about)
    for number, (line, chain) in enumerate(zip(part.details.lines, chains(part), strict=True)):
        facts = {"family": line.family, "number": str(line.number), "length_mm": f"{line.length:.3f}"}
        facts["tolerance_mm"] = f"{curve_tolerance(part):.2g}"
        about = _about(line.id, layers[line.layer], ids(f"line {number}"), facts)
        model.Objects.AddCurve(rhino_curve(chain), about)
    yield archive(model)


def empty_model() -> Any:
    """Return an empty rhino3dm model in millimetres."""
    import rhino3dm

    model = rhino3dm.File3dm()
    model.ApplicationName, model.ApplicationDetails = "dsfab", f"dsfab {__version__}"
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters
    model.Settings.ModelAbsoluteTolerance = 0.001
    return model


def archive(model: Any) -> bytes:
    """Return a model as the bytes of a 3DM file, with constant time stamps."""
    version = 7  # Rhino 7 and newer versions read the file
    import rhino3dm

    how = rhino3dm.File3dmWriteOptions()
    how.Version = version
    return without_times(base64.b64decode(model.Encode(how)))


Ids = Callable[[str], uuid.UUID]


def ids_of(name: str, arrays: Iterable[NDArray[Any]]) -> Ids:
    """Return a function that makes a UUID from a text. The UUID also depends on `name` and `arrays`."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return partial(uuid.uuid5, uuid.uuid5(uuid.NAMESPACE_URL, f"dsfab {name} {digest.hexdigest()}"))


def new_layer(model: Any, ids: Ids, name: str, colour: tuple[int, int, int]) -> int:
    """Add a layer and return its index."""
    import rhino3dm

    layer = rhino3dm.Layer()
    layer.Name, layer.Color, layer.Id = name, (*colour, 255), ids(f"layer {name}")
    return int(model.Layers.Add(layer))


def without_times(data: bytes) -> bytes:
    """Replace the time stamps in a 3DM file by constants. Raises ExportError for an unknown layout."""
    header = 32  # 32 bytes precede the first chunk: code (4 bytes), length (8), content
    content = bytearray(data)
    properties = _chunk(data, header, len(data), _PROPERTIES)
    history = _chunk(data, *properties, _HISTORY) if properties else None
    if history is None:
        raise ExportError(
            "rhino3dm writes .3dm files in a layout that dsfab does not know; write .dxf and .stl instead"
        )
    start, end = history
    position = start + 1
    for _ in range(2):
        position += 4 + 2 * int.from_bytes(content[position : position + 4], "little")
        content[position : position + len(_TIME)] = _TIME
        position += len(_TIME)
    content[end - 4 : end] = zlib.crc32(content[start : end - 4]).to_bytes(4, "little")
    return bytes(content)


def _chunk(data: bytes, start: int, end: int, kind: int) -> tuple[int, int] | None:
    while start + 12 <= end:
        code, size = struct.unpack_from("<Iq", data, start)
        size = 0 if code & _SHORT else size
        start += 12
        if not 0 <= size <= end - start:
            return None
        if code == kind:
            return start, start + size
        start += size
    return None


def rhino_mesh(V: Floats, F: Ints) -> Any:
    """Build a rhino3dm mesh with normals from vertices (n, 3) in any unit and triangles (m, 3)."""
    import rhino3dm

    mesh = rhino3dm.Mesh()
    add = mesh.Vertices.Add if np.array_equal(V, V.astype(np.float32)) else mesh.Vertices.AddPoint3d
    for vertex in V.tolist():
        add(*vertex)
    for face in F.tolist():
        mesh.Faces.AddFace(*face)
    mesh.Normals.ComputeNormals()
    return mesh


def rhino_polyline(points: Floats) -> Any:
    """Build a rhino3dm polyline through points (k, 3)."""
    import rhino3dm

    return rhino3dm.PolylineCurve(rhino3dm.Point3dList([rhino3dm.Point3d(*point) for point in points.tolist()]))


def rhino_curve(chain: list[Curve]) -> Any:
    """Build a single rhino3dm curve from consecutive curves."""
    import rhino3dm

    segments = list[Any]()
    for run in joined_segments(chain):
        if isinstance(run, Curve):
            curve = rhino3dm.NurbsCurve(3, False, run.degree + 1, len(run.poles))
            for i, pole in enumerate(run.poles.tolist()):
                curve.Points[i] = rhino3dm.Point4d(*pole, 1.0)
            for i, knot in enumerate(run.knots[1:-1].tolist()):  # openNURBS omits both end knots
                curve.Knots[i] = knot
            segments.append(curve)
        else:
            segments.append(rhino_polyline(run))
    if len(segments) == 1:
        return segments[0]
    polycurve = rhino3dm.PolyCurve()
    for curve in segments:
        polycurve.AppendSegment(curve)
    return polycurve


def _about(name: str, layer: int, identity: uuid.UUID, facts: Mapping[str, str] = MappingProxyType({})) -> Any:
    import rhino3dm

    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex, about.Id = name, layer, identity
    for key, value in facts.items():
        about.SetUserString(key, value)
    return about


def check(part: Part, path: Path) -> ReadBack:
    """Read the file back. Raises ExportError for an invalid or missing object."""
    import rhino3dm

    items = _valid_items(part, path, ".dxf and .stl")
    meshes = [shape for _, shape in items if shape.ObjectType == rhino3dm.ObjectType.Mesh]
    require_equal(part, "meshes", 1, len(meshes))
    V, F = rhino_arrays(meshes[0])
    result = check_mesh(part, V, F[:, :3])
    check_curves(part, {name: _points(x) for name, x in items if x.ObjectType == rhino3dm.ObjectType.Curve})
    return result


def _valid_items(part: Part, path: Path, instead: str) -> list[tuple[str, Any]]:
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None or model.Settings.ModelUnitSystem != rhino3dm.UnitSystem.Millimeters:
        raise ExportError(f"the .3dm file of {part.name!r} has lengths that are not in millimetres; write {instead}")
    if not all(item.Geometry.IsValid for item in model.Objects):
        raise ExportError(f"rhino3dm finds the .3dm file of {part.name!r} invalid; write {instead} instead")
    return [(item.Attributes.Name, item.Geometry) for item in model.Objects]


def rhino_arrays(mesh: Any) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) and face corners (m, 4) of a rhino3dm mesh; a triangle has its last corner twice."""
    V = np.array([(v.X, v.Y, v.Z) for v in map(mesh.Vertices.Point3dAt, range(len(mesh.Vertices)))]).reshape(-1, 3)
    return V, np.array([mesh.Faces[i] for i in range(mesh.Faces.Count)], dtype=np.int64).reshape(-1, 4)


def _points(curve: Any) -> list[Floats]:
    if hasattr(curve, "SegmentCount"):
        return [points for i in range(curve.SegmentCount) for points in _points(curve.SegmentCurve(i))]
    if hasattr(curve, "Knots"):
        knots = np.array([curve.Knots[i] for i in range(len(curve.Knots))])
        samples = (curve.PointAt(x) for x in sample_parameters(knots).tolist())
    else:
        samples = (curve.Point(i) for i in range(curve.PointCount))
    return [np.array([(p.X, p.Y, p.Z) for p in samples])]


NODES = "nodes"  # name of the layer of the nodes


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a 3DM file with meshes, axes and nodes of the members."""
    import rhino3dm

    model, facts, shapes = empty_model(), facts_of_members(part), part.details.shapes
    ids = ids_of(part.name, (array for shape in shapes for array in (shape.V, shape.F)))
    bodies = list(dict.fromkeys(shape.layer for shape in shapes))
    with_axes = dict.fromkeys(shape.layer for shape in shapes if len(shape.axis))
    names = [(name, name) for name in bodies] + [(f"{name} axes", name) for name in with_axes] + [(NODES, "")]
    layers = {name: new_layer(model, ids, name, layer_colour(family)) for name, family in names}
    for shape in shapes:
        about = _about(shape.id, layers[shape.layer], ids(f"body {shape.id}"), facts[shape.id].words)
        model.Objects.AddMesh(rhino_mesh(shape.V, shape.F), about)
        if len(shape.axis):
            about = _about(shape.id, layers[f"{shape.layer} axes"], ids(f"axis {shape.id}"))
            model.Objects.AddCurve(rhino_curve(curves_along(shape.axis, curve_tolerance(part))), about)
    for node in graph_of(part).nodes:
        about = _about(node.id, layers[NODES], ids(f"node {node.id}"), {"members": " ".join(node.members)})
        model.Objects.AddPoint(rhino3dm.Point3d(*rounded_lists(MM_PER_M * node.point)), about)
    yield archive(model)


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back. Raises ExportError for an invalid or missing object."""
    import rhino3dm

    things, kinds = _valid_items(part, path, ".members.dxf"), rhino3dm.ObjectType
    names = {kind: [name for name, x in things if x.ObjectType == kind] for kind in (kinds.Curve, kinds.Point)}
    axes = [shape.id for shape in part.details.shapes if len(shape.axis)]
    nodes = [node.id for node in graph_of(part).nodes]
    for what, kind, expected in (("axes", kinds.Curve, axes), ("nodes", kinds.Point, nodes)):
        require_equal(part, what, expected, names[kind])
    meshes = {name: rhino_arrays(shape) for name, shape in things if shape.ObjectType == kinds.Mesh}
    return check_shapes(part, {name: (V, np.ascontiguousarray(F[:, :3])) for name, (V, F) in meshes.items()})


def mesh_json(V: Floats, F: Ints) -> str:
    """Encode a mesh of vertices (n, 3) and triangles (m, 3) as JSON. Raises ExportError without rhino3dm."""
    require_rhino3dm()
    return json.dumps(rhino_mesh(V, F).Encode())


def polyline_json(points: Floats) -> str:
    """Encode a polyline through points (k, 3) or (k, 2) as JSON. Raises ExportError without rhino3dm."""
    require_rhino3dm()
    full = np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points
    return json.dumps(rhino_polyline(full).Encode())
