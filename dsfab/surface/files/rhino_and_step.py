"""Readers of 3DM (Rhino), STEP and BREP files."""

import importlib.util
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import count_phrase, names_and_count
from dsfab.surface.files.polygons import Polygons, triangles
from dsfab.surface.files.reading import (
    Content,
    Drawing,
    DrawingBudget,
    MalformedFileError,
    TriangleFile,
    contents,
    curve_points,
    declared_unit,
    hidden_on,
    ignored_clause,
    is_mirrored,
    mark,
    mesh_at,
    placed_points,
    selected_parts,
)

_KINDS = {
    **dict.fromkeys(("Brep", "Extrusion", "SubD", "NurbsSurface", "PlaneSurface", "RevSurface", "Surface"), "surface"),
    **dict.fromkeys(("PolylineCurve", "LineCurve", "ArcCurve", "NurbsCurve", "PolyCurve"), "curve"),
    "Mesh": "mesh", "Point": "point", "TextDot": "text dot", "Light": "light",
}  # fmt: skip
"""Kind of each Rhino object, by the name of its class in rhino3dm."""


def read_rhino(path: Path, budget: DrawingBudget) -> Drawing:
    """Return the curves and points of a 3DM file, with the names of its layers and its unit.
    Raises MalformedFileError for an invalid file; SurfaceError above the limits of `budget`, or without rhino3dm."""
    require_rhino()
    import rhino3dm

    model = _model(path)
    runs, dots, count = list[tuple[str, Floats, bool]](), list[tuple[str, Floats, bool]](), 0
    drawing = _DrawnObjects(model, budget, hidden_layers=True)
    for (layers, *_), thing, place, hidden in drawing.all():
        layer = layers[1]
        if isinstance(thing, rhino3dm.Curve):
            runs.append((layer, placed_points(_points(thing), place), hidden))
            count += len(runs[-1][1])
            budget.require("points", count)
        elif isinstance(thing, rhino3dm.Point):
            location = np.array([[getattr(thing.Location, axis) for axis in "XYZ"]])
            dots.append((layer, placed_points(location, place), hidden))
    layers = tuple(sorted(layer.Name for layer in model.Layers))
    return Drawing(tuple(runs), layers, declared_unit(model.Settings.ModelUnitSystem.name), tuple(dots))


def read_rhino_meshes(path: Path, budget: DrawingBudget, only: Sequence[str] = ()) -> TriangleFile:
    """Return the meshes of a 3DM file. only : names of layers, blocks and objects to read; by default all.
    Raises MalformedFileError for a damaged file; SurfaceError for a file without meshes or above the `budget`."""
    model = _model(path)
    drawing, parts, bare = _DrawnObjects(model, budget), list[tuple[Floats, Ints]](), 0
    named_parts = _by_selectable_names(list(drawing.surfaces())) if only else (((), x) for _, x in drawing.surfaces())
    for thing, meshes, place in selected_parts(named_parts, only, drawing.counts):
        bare += meshes is None
        without_mesh = Content("surface", "dropped", "saved without its mesh")
        drawing.counts[without_mesh if meshes is None else Content(_KINDS[type(thing).__name__])] += 1
        parts += [mesh_at(*_mesh_arrays(mesh), place) for mesh in meshes or ()]
    inventory = contents(drawing.counts)
    if not parts:
        what = f"{count_phrase(bare, 'surface')} without a mesh" if bare else "no mesh"
        over = ignored_clause(thing.text for thing in inventory if thing.kind == "hidden object")
        raise SurfaceError(f"the file has {what}{over}; make a mesh in Rhino (Mesh), or export the surface as STEP")
    unit = declared_unit(model.Settings.ModelUnitSystem.name)
    return TriangleFile(*concatenated_mesh(parts), unit, content=inventory)


def _meshes(thing: Any) -> list[Any] | None:
    """Return the meshes of a Rhino object: [] if the object is not a surface, None for a surface without a mesh."""
    import rhino3dm

    if isinstance(thing, rhino3dm.Mesh):
        return [thing]
    if isinstance(thing, rhino3dm.Brep):
        meshes = [face.GetMesh(rhino3dm.MeshType.Any) for face in thing.Faces]
        return meshes if all(meshes) else None
    if isinstance(thing, rhino3dm.Extrusion):
        mesh = thing.GetMesh(rhino3dm.MeshType.Any)
        return [mesh] if mesh else None
    return None if isinstance(thing, rhino3dm.Surface | rhino3dm.SubD) else []


def _mesh_arrays(mesh: Any) -> tuple[Floats, Ints]:
    points = map(mesh.Vertices.Point3dAt, range(len(mesh.Vertices)))  # mesh.Vertices itself has single precision
    V = np.array([(p.X, p.Y, p.Z) for p in points], dtype=np.float64).reshape(-1, 3)
    quads = np.array([mesh.Faces[k] for k in range(len(mesh.Faces))], dtype=np.int64).reshape(-1, 4)
    sizes = np.where(quads[:, 2] == quads[:, 3], 3, 4)
    return V, triangles(Polygons(V, quads[np.arange(4) < sizes[:, None]], sizes)).F


def read_rhino_json(text: str) -> TriangleFile:
    """Return the mesh in a JSON text of a Rhino geometry (rhino3dm: `CommonObject.Encode`). The mesh has no unit.
    Raises SurfaceError for a text without a mesh."""
    require_rhino()
    import rhino3dm

    try:
        thing = rhino3dm.CommonObject.Decode(json.loads(text))
    except Exception:  # rhino3dm does not document its exceptions
        thing = None
    if thing is None:
        raise SurfaceError("the text is not Rhino's JSON of a geometry; send the result of CommonObject.Encode")
    if not isinstance(thing, rhino3dm.Mesh):
        raise SurfaceError(f"the geometry is a {type(thing).__name__}, not a mesh; convert it to a mesh in Grasshopper")
    V, F = _mesh_arrays(thing)
    return TriangleFile(V, F, content=(Content("mesh"), Content("face", count=len(thing.Faces))))


def _model(path: Path) -> Any:
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None:
        raise MalformedFileError("the file is damaged, or not a 3DM file")
    return model


_Groups = tuple[tuple[str, ...], ...]
_Surface = tuple[Any, list[Any] | None, Floats]


def _by_selectable_names(parts: list[tuple[_Groups, _Surface]]) -> Iterator[tuple[tuple[str, ...], _Surface]]:
    outermost = {layer[-1] for groups, _ in parts for layer in groups[::2]}
    for groups, part in parts:
        layers = [(x[0], *(name for name in x[1:-1] if name not in outermost), x[-1]) for x in groups[::2]]
        yield tuple(name for pair in zip(layers, groups[1::2], strict=True) for names in pair for name in names), part


class _DrawnObjects:
    """Iterator over the visible objects of a 3DM file."""

    def __init__(self, model: Any, budget: DrawingBudget, hidden_layers: bool = False) -> None:
        self.model, self.budget, self.count = model, budget, 0
        self.layers, self.hidden, self.hidden_layers = dict[int, tuple[str, ...]](), set[int](), hidden_layers
        above = {str(layer.Id): layer for layer in model.Layers}
        for layer in model.Layers:
            chain = [layer]
            while (outer := above.get(str(chain[-1].ParentLayerId))) is not None and outer not in chain:
                chain.append(outer)
            names = [entry.Name for entry in chain]
            self.layers[layer.Index] = ("::".join(names[::-1]), *names)
            if not all(entry.Visible for entry in chain):
                self.hidden.add(layer.Index)
        self.counts = Counter[Content]()

    def surfaces(self) -> Iterator[tuple[_Groups, _Surface]]:
        """Yield each surface or mesh: names of its layers and blocks, (geometry, meshes, transformation (4, 4))."""
        for groups, thing, place, _ in self.all():
            meshes, name = _meshes(thing), type(thing).__name__
            if meshes or meshes is None:
                yield groups, (thing, meshes, place)
            else:
                kind = _KINDS.get(name, f"{name} object")
                self.counts[mark(kind, groups[0][1]) if name in _KINDS else Content(kind, "dropped")] += 1

    def all(self) -> Iterator[tuple[_Groups, Any, Floats, bool]]:
        """Yield each object: names of its layers and blocks, geometry, transformation (4, 4), True if hidden."""
        self.budget.require("entities", len(self.model.Objects))
        objects = (thing for thing in self.model.Objects if not thing.Attributes.IsInstanceDefinitionObject)
        return self.objects(objects, np.eye(4), ())

    def objects(
        self, things: Iterable[Any], place: Floats, blocks: _Groups, hidden: bool = False
    ) -> Iterator[tuple[_Groups, Any, Floats, bool]]:
        import rhino3dm

        if len(blocks) > 2 * self.budget.depth:  # `blocks` has two groups of names for each level of nested blocks
            raise MalformedFileError(f"the file's blocks are nested more than {self.budget.depth} deep")
        for thing in things:
            self.count += 1
            self.budget.require("entities", self.count)
            layers, name = self.layers.get(thing.Attributes.LayerIndex, ("", "")), thing.Attributes.Name
            is_hidden = hidden or thing.Attributes.LayerIndex in self.hidden
            if not thing.Attributes.Visible or (is_hidden and not self.hidden_layers):
                self.counts[hidden_on(layers[1])] += 1
            elif isinstance(thing.Geometry, rhino3dm.InstanceReference):
                matrix = _matrix(thing.Geometry.Xform)
                self.counts[Content("mirrored block insertion" if is_mirrored(matrix) else "block insertion")] += 1
                block = self.model.InstanceDefinitions.FindId(thing.Geometry.ParentIdefId)
                inside = self._block_objects(block)
                yield from self.objects(inside, place @ matrix, (layers, (name, block.Name), *blocks), is_hidden)
            else:
                yield (layers, (name,), *blocks), thing.Geometry, place, is_hidden

    def _block_objects(self, block: Any) -> list[Any]:
        inside = [self.model.Objects.FindId(object_id) for object_id in block.GetObjectIds()] if block else []
        if not inside or None in inside:
            name = f"the block {block.Name!r}" if block else "a block"
            raise MalformedFileError(f"the file inserts {name} but lacks its content; explode or embed it in Rhino")
        return inside


def _matrix(moved: Any) -> Floats:
    return np.array([[getattr(moved, f"M{i}{j}") for j in range(4)] for i in range(4)], dtype=np.float64)


def require_rhino() -> None:
    """Raise SurfaceError if rhino3dm is not installed."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise SurfaceError('.3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"')


def _points(curve: Any) -> Floats:
    line = curve.TryGetPolyline()
    if curve.IsPolyline() and line is not None:
        return np.array([[p.X, p.Y, p.Z] for p in line])
    spans = np.linspace(curve.Domain.T0, curve.Domain.T1, 4 * max(curve.SpanCount, 1) + 1)
    return curve_points(spans, lambda t: np.array([[p.X, p.Y, p.Z] for p in map(curve.PointAt, t)]))


def read_occt(path: Path, only: Sequence[str] = ()) -> TriangleFile:
    """Return triangles of a STEP file (in millimetres) or BREP file (without a unit).
    Neighbouring CAD faces share no vertices.    only : names of STEP parts to read; by default all.
    Raises MalformedFileError for an invalid file, and for a file without faces."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer

    counts, box, other_files = Counter[Content](), Bnd_Box(), _other_files(path)
    if other_files:
        counts[Content("part", "dropped", f"in other files: {names_and_count(other_files)}")] = len(other_files)
    shape = _shape(path, only, counts)
    BRepBndLib.Add_s(shape, box)
    faces = TopExp_Explorer(shape, TopAbs_FACE)
    if not faces.More() or box.IsVoid():
        over = ignored_clause(thing.text for thing in contents(counts))
        if other_files:
            raise SurfaceError(f"the file has no faces{over}; export the assembly as one file")
        what = "no shapes" if box.IsVoid() else "no faces, only curves or points"
        raise MalformedFileError(f"it has {what}{over}")
    # limits: distance between triangles and face, 2e-4 of the box's diagonal; angle between neighbours, 0.2 radians
    BRepMesh_IncrementalMesh(shape, 2e-4 * box.SquareExtent() ** 0.5, False, 0.2, False)
    parts, lost = list[tuple[Floats, Ints]](), 0
    while faces.More():
        parts.append(_triangles(faces.Current()))
        lost += not len(parts[-1][1])
        faces.Next()
    if lost == len(parts):
        raise MalformedFileError("none of the faces in the file can be meshed")
    unit = None if path.suffix.lower() == ".brep" else "mm"
    return TriangleFile(
        *concatenated_mesh(parts), unit, content=contents(_shape_counts(shape, len(parts), lost) + counts)
    )


def _shape_counts(shape: Any, faces: int, lost: int) -> Counter[Content]:
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
    from OCP.TopExp import TopExp_Explorer

    counts, explore = Counter[Content](), TopExp_Explorer
    free = explore(shape, TopAbs_EDGE, TopAbs_FACE), explore(shape, TopAbs_VERTEX, TopAbs_EDGE)
    bodies = explore(shape, TopAbs_SOLID), explore(shape, TopAbs_SHELL, TopAbs_SOLID)
    for shapes, kind in zip((*bodies, *free), ("solid", "open shell", "curve", "point"), strict=True):
        while shapes.More():
            counts[Content(kind, "beside" if shapes in free else "taken")] += 1
            shapes.Next()
    counts[Content("face")] = faces - lost
    counts[Content("face", "dropped", f"that OCCT cannot mesh, of {faces} faces")] = lost
    return counts


def _shape(path: Path, only: Sequence[str], counts: Counter[Content]) -> Any:
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    if path.suffix.lower() == ".brep":
        from OCP.BRep import BRep_Builder
        from OCP.BRepTools import BRepTools
        from OCP.TopoDS import TopoDS_Shape

        shape = TopoDS_Shape()
        if not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
            raise MalformedFileError("the file is not a BREP file, or the file is cut off")
        return shape
    if only or b"INVISIBILITY" in path.read_bytes():
        return _compound(selected_parts(_visible_parts(path, counts), only, counts))
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
        raise MalformedFileError(_NOT_STEP)
    return reader.OneShape()


_ELSEWHERE = re.compile(rb"\bAPPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT\s*\(\s*'([^']+)'")


def _other_files(path: Path) -> list[str]:
    """Return the names of other STEP files that contain parts of the assembly [AP 214, external references]."""
    references = [] if path.suffix.lower() == ".brep" else _ELSEWHERE.findall(path.read_bytes())
    names = (name.decode("utf-8", "replace") for name in dict.fromkeys(references))
    return [name for name in names if name.lower().endswith((".stp", ".step", ".p21"))]  # omits other formats


_NOT_STEP = "the file is not a STEP file with shapes, or the file is cut off"


def _compound(shapes: Iterable[Any]) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


def _visible_parts(path: Path, counts: Counter[Content]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield names and shape of each visible part of a STEP file. counts : counter, increased at each hidden part."""
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document, reader = TDocStd_Document(TCollection_ExtendedString("XCAF")), STEPCAFControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        raise MalformedFileError(_NOT_STEP)
    for label in _inner_labels(XCAFDoc_DocumentTool.ShapesLabel_s(document.Main())):
        if XCAFDoc_ShapeTool.IsFree_s(label):
            yield from _parts_in(label, TopLoc_Location(), (), counts)


def _parts_in(
    label: Any, place: Any, outer_names: tuple[str, ...], counts: Counter[Content]
) -> Iterator[tuple[tuple[str, ...], Any]]:
    from OCP.TDF import TDF_Label
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ShapeTool

    definition = TDF_Label()
    if not XCAFDoc_ShapeTool.GetReferredShape_s(label, definition):
        definition = label
    names = (_label_name(definition), _label_name(label), *outer_names)
    if not (XCAFDoc_ColorTool.IsVisible_s(label) and XCAFDoc_ColorTool.IsVisible_s(definition)):
        counts[hidden_on("")] += 1
    elif XCAFDoc_ShapeTool.IsAssembly_s(definition):
        inner_place = place * XCAFDoc_ShapeTool.GetLocation_s(label)
        for component in filter(XCAFDoc_ShapeTool.IsComponent_s, _inner_labels(definition)):
            yield from _parts_in(component, inner_place, names, counts)
    else:
        yield names, XCAFDoc_ShapeTool.GetShape_s(label).Moved(place)


def _inner_labels(label: Any) -> Iterator[Any]:
    from OCP.TDF import TDF_ChildIterator

    iterator = TDF_ChildIterator(label)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()


def _label_name(label: Any) -> str:
    from OCP.TCollection import TCollection_AsciiString
    from OCP.TDataStd import TDataStd_Name

    name = TDataStd_Name()
    text = TCollection_AsciiString(name.Get()).ToCString() if label.FindAttribute(name.GetID_s(), name) else ""
    return "" if text.startswith("=>[") else text  # OCCT's text for an instance without a name


def _triangles(face: Any) -> tuple[Floats, Ints]:
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
