"""Readers of DXF and 3DM drawings: closed curves, and layers that mark supports, loads and regions."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SurfaceError, did_you_mean
from dsfab.core.messages import count_phrase
from dsfab.core.units import METRES_PER, metres_per
from dsfab.surface.clean.seams import equal_merged
from dsfab.surface.files.polygons import Polygons, triangles
from dsfab.surface.files.reading import (
    CURVE_TOLERANCE,
    LARGEST_NUMBER,
    Budget,
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
    mark,
    readable,
    selected_parts,
)
from dsfab.surface.files.separate_process import read_rhino_in_process

SOLIDS = ("3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "REVOLVEDSURFACE", "SWEPTSURFACE")
"""DXF entities with shapes in AutoCAD's own format. Only AutoCAD can read them."""
CURVES = ("LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE", "HELIX", "XLINE", "RAY")
FLAT = ("SOLID", "TRACE", "IMAGE", "UNDERLAY", "WIPEOUT", "ACAD_PROXY_ENTITY", "OLE2FRAME")
"""DXF entities that show areas but contain no mesh. dsfab tells the user that it ignored them."""


def read_dxf(path: Path, budget: DrawingBudget) -> Drawing:
    """Return the curves and points of a DXF file, the names of its layers, and its unit.
    Raises MalformedFileError for an invalid file, and SurfaceError for a file above the limits of `budget`."""
    document = _document(path)
    runs, dots, count = list[tuple[str, Floats, bool]](), list[tuple[str, Floats, bool]](), 0
    drawing = _Entities(document, budget, hidden_layers=True)
    for entity, (layer, *_), _, hidden in drawing.leaves(document.modelspace()):
        for curve in _curves(entity):
            count += len(curve)
            budget.require("points", count)
            runs.append((layer, curve, hidden))
        if entity.dxftype() == "POINT":
            dots.append((layer, np.array([[*entity.dxf.location]]), hidden))
    layers = sorted({layer.dxf.name for layer in document.layers} | {name for name, _, _ in (*runs, *dots)})
    return Drawing(tuple(runs), tuple(layers), _unit(document), tuple(dots))


def read_dxf_meshes(path: Path, budget: Budget, only: Sequence[str] = ()) -> TriangleFile:
    """Return the meshes in a DXF file. only : names of the layers and blocks to read; by default all.
    Raises MalformedFileError for an invalid file, and SurfaceError for a file without meshes or above `budget`."""
    document = _document(path)
    V, corners, sizes, count = list[Floats](), list[Ints](), list[Ints](), 0
    drawing = _Entities(document, DrawingBudget(entities=budget.triangles, seconds=budget.seconds))
    parts = drawing.meshes(document.modelspace())
    for mesh, mirrored, content in selected_parts(parts, only, drawing.counts):
        drawing.counts[content] += 1
        V.append(mesh.V)
        corners.append((mesh.corners[::-1] if mirrored else mesh.corners) + count)
        sizes.append(mesh.sizes[::-1] if mirrored else mesh.sizes)
        count += len(mesh.V)
        budget.require_vertices(count)
    pages = (page for page in document.layouts if not page.is_modelspace)
    on_paper = sum(entity.dxftype() != "VIEWPORT" for page in pages for entity in page)
    inventory = contents(drawing.counts + Counter({Content("object", "beside", "in paper space"): on_paper}))
    if not V:
        many = sum(thing.count for thing in inventory if thing.kind == "shape")
        shape_words = f"the file has {count_phrase(many, 'shape')} in AutoCAD's own format, such as solids, but no mesh"
        over = ignored_clause(thing.text for thing in inventory if thing.fate == "dropped" and thing.kind != "shape")
        what = shape_words if many else "the file has no mesh"
        raise SurfaceError(f"{what}: no 3DFACE, MESH or polyface{over}; export the surface as a mesh, or as STEP")
    cut_mesh = triangles(Polygons(np.concatenate(V), np.concatenate(corners), np.concatenate(sizes)))
    points, faces = equal_merged(np.concatenate(V), cut_mesh.F)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    return TriangleFile(points, faces, _unit(document), content=inventory)


def _content(entity: Any, layer: str) -> Content:
    kind = entity.dxftype()
    if kind in SOLIDS:
        return Content("shape", "dropped", "in AutoCAD's own format, such as a solid")
    if kind in CURVES or kind == "POINT":
        return mark("point" if kind == "POINT" else "curve", layer)
    return Content(f"{kind} object", "dropped" if kind in FLAT else "beside")


def _document(path: Path) -> Any:
    import ezdxf
    from ezdxf import recover

    if b"EOF" not in path.read_bytes()[-512:]:
        raise MalformedFileError("the last word EOF is missing: the file is not DXF, or the file is cut off")
    with suppress(ezdxf.DXFError, OSError, ValueError, LookupError, TypeError, AttributeError):
        return ezdxf.readfile(path)
    try:
        return recover.readfile(path)[0]
    except ezdxf.DXFError as error:
        raise MalformedFileError((str(error).splitlines() or ["ezdxf gives no reason"])[0][:120]) from None


def _unit(document: Any) -> str | None:
    from ezdxf.units import InsertUnits

    code = int(document.header.get("$INSUNITS", 0))
    return declared_unit(InsertUnits(code).name) if code in [*InsertUnits] else f"$INSUNITS {code}"


def _polygons(entity: Any) -> Iterator[Polygons]:
    from ezdxf.render import MeshBuilder

    kind = entity.dxftype()
    if kind == "3DFACE":
        corners = np.array([[*point] for point in entity.wcs_vertices()])
        yield Polygons(corners, np.arange(len(corners)), np.array([len(corners)]))
        return
    if kind == "MESH":
        mesh = MeshBuilder.from_mesh(entity)
    elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        mesh = MeshBuilder.from_polyface(entity)
    else:
        return
    V = np.array([[*point] for point in mesh.vertices], dtype=np.float64).reshape(-1, 3)
    faces = [list(face) for face in mesh.faces if len(face) > 2]
    sizes = np.array([len(face) for face in faces], dtype=np.int64)
    if faces:
        yield Polygons(V, np.array([k for face in faces for k in face], dtype=np.int64), sizes)


class _Entities:
    """The entities of a DXF drawing that are visible, including entities in blocks."""

    def __init__(self, document: Any, budget: DrawingBudget, hidden_layers: bool = False) -> None:
        self.budget, self.count, self.counts = budget, 0, Counter[Content]()
        self.frozen = {layer.dxf.name.lower() for layer in document.layers if layer.is_frozen()}
        self.hidden = self.frozen | {layer.dxf.name.lower() for layer in document.layers if layer.is_off()}
        self.hidden_layers = hidden_layers

    def meshes(self, entities: Any) -> Iterator[tuple[tuple[str, ...], tuple[Polygons, bool, Content]]]:
        for entity, names, mirrored, _ in self.leaves(entities):
            meshes = [*_polygons(entity)]
            if not meshes:
                self.counts[_content(entity, names[0])] += 1
            content = Content("face" if entity.dxftype() == "3DFACE" else "mesh")
            yield from ((names, (mesh, mirrored, content)) for mesh in meshes)

    def leaves(
        self, entities: Any, outer_names: tuple[str, ...] = (), mirrored: bool = False, hidden: bool = False
    ) -> Iterator[tuple[Any, tuple[str, ...], bool, bool]]:
        if len(outer_names) > 2 * self.budget.depth:
            raise MalformedFileError(f"the file's blocks are nested more than {self.budget.depth} deep")
        for entity in entities:
            self.count += 1
            self.budget.require("entities", self.count)
            _require_numbers(entity)
            layer = outer_names[0] if outer_names and entity.dxf.layer == "0" else entity.dxf.layer
            is_block = entity.dxftype() == "INSERT"
            is_hidden = hidden or layer.lower() in (self.frozen if is_block else self.hidden)
            if (is_hidden and not self.hidden_layers) or entity.dxf.get("invisible", 0):
                self.counts[hidden_on(layer)] += 1
            elif is_block:
                yield from self._block_entities(entity, (layer, entity.dxf.name, *outer_names), mirrored, is_hidden)
            else:
                yield entity, (layer, *outer_names), mirrored, is_hidden

    def _block_entities(
        self, insert: Any, names: tuple[str, ...], mirrored: bool, hidden: bool
    ) -> Iterator[tuple[Any, tuple[str, ...], bool, bool]]:
        self.budget.require("entities", self.count + insert.mcount)
        block = insert.block()
        if block is None or block.block.is_xref:
            words = f"{insert.dxf.name!r}, whose content is elsewhere"
            self.counts[Content("external reference", "dropped", words)] += 1
            return
        turned = insert.matrix44().determinant() < 0  # includes mirrors of enclosing blocks
        self.counts[Content("block insertion" if turned == mirrored else "mirrored block insertion")] += insert.mcount
        for copy in insert.multi_insert() if insert.mcount > 1 else (insert,):
            yield from self.leaves(copy.virtual_entities(), names, turned, hidden)


def _require_numbers(entity: Any) -> None:
    for key, value in entity.dxf.all_existing_dxf_attribs().items():
        numbers = value if hasattr(value, "xyz") else [value] if isinstance(value, float) else []
        if not all(abs(x) < LARGEST_NUMBER for x in numbers):
            raise MalformedFileError(f"a {entity.dxftype()} has {key} = {value}")


def _curves(entity: Any) -> Iterator[Floats]:
    from ezdxf import path as paths

    if entity.dxftype() == "SPLINE":
        yield _spline_points(entity)
        return
    try:
        path = paths.make_path(entity)
    except TypeError:
        return
    closed = bool(getattr(entity, "closed", False) or getattr(entity, "is_closed", False))
    yield from (_path_points(part, closed) for part in path.sub_paths())


def _path_points(part: Any, closed: bool) -> Floats:
    size = float(np.linalg.norm(np.ptp(np.array([[*point] for point in part.control_vertices()]), axis=0)))
    if not size:
        return np.empty((0, 3))
    points = np.array([[*point] for point in part.flattening(CURVE_TOLERANCE * size, segments=4)])
    return np.concatenate([points, points[:1]]) if closed and (points[0] != points[-1]).any() else points


def _spline_points(spline: Any) -> Floats:
    tool = spline.construction_tool()
    knots = np.array(tool.knots())
    spans = np.unique(knots[tool.degree : len(knots) - tool.degree])
    return curve_points(spans, lambda t: np.array([[*point] for point in tool.points(t)]))


SAME_PLACE = 1e-6  # Two ends of curves meet if they are closer than this fraction of the drawing's size.


@dataclass(frozen=True, eq=False)
class Marks:
    """Content of a layer in a drawing: its name, points (k, 3), and curves as polylines (k, 3), in metres."""

    layer: str
    points: Floats
    curves: tuple[Floats, ...]

    def about(self, origin: Sequence[float]) -> "Marks":
        """Return the points and curves relative to the point `origin`, metres."""
        return Marks(self.layer, self.points - origin, tuple(run - origin for run in self.curves))

    @property
    def closed_runs(self) -> list[Floats]:
        """Closed curves of the layer, whose first and last points coincide."""
        return [run for run in self.curves if _ends_meet(run)]

    @property
    def open_runs(self) -> list[Floats]:
        """Open curves of the layer."""
        return [run for run in self.curves if not _ends_meet(run)]


def _ends_meet(run: Floats) -> bool:
    size = float(np.linalg.norm(np.ptp(run, axis=0)))
    return len(run) > 3 and float(np.linalg.norm(run[0] - run[-1])) <= SAME_PLACE * size


def closed_curves(path: Path, layer: str | None, unit: str | None) -> tuple[Floats, ...]:
    """Return the closed curves (k, 3) in a drawing, metres. layer : name of the layer; None for all layers.
    unit : unit of the file's numbers; by default the unit that the file declares. Raises SurfaceError if this fails."""
    path = Path(path)
    if path.suffix.lower() not in (".dxf", ".3dm"):
        raise SurfaceError(f"{path} is not a drawing that dsfab reads; give a .dxf or a .3dm file")
    try:
        about = path.stat()
    except OSError as error:
        raise SurfaceError(f"the drawing {path} cannot be read: {error.strerror}") from None
    return _cached_curves(path, layer, unit, about.st_mtime_ns, about.st_size)


def marks_on_layers(path: Path, words: Iterable[str], metres: float) -> dict[str, Marks]:
    """Return the visible points and curves on layers of a drawing, by layer, without empty layers. Raises SurfaceError.
    words  : names of the layers, in lower case.    metres : length of the file's unit in metres."""
    path = Path(path)
    drawing = _drawing(path, path.stat().st_size, DrawingBudget())
    marks = {}
    for word in words:
        points = [metres * place for layer, place, hidden in drawing.points if layer.lower() == word and not hidden]
        runs = [metres * run for layer, run, hidden in drawing.runs if layer.lower() == word and not hidden]
        curves = [run for run in runs if len(run) > 1]
        layer = next((name for name in drawing.layers if name.lower() == word), word)
        if points or curves:
            marks[word] = Marks(layer, np.concatenate(points) if points else np.empty((0, 3)), tuple(curves))
    return marks


@lru_cache(maxsize=16)
def _cached_curves(path: Path, layer: str | None, unit: str | None, _changed: int, size: int) -> tuple[Floats, ...]:
    budget = DrawingBudget()
    drawing = _drawing(path, size, budget)
    if layer is not None and layer not in drawing.layers:
        layer_names = ", ".join(drawing.layers[:12]) + (", ..." if len(drawing.layers) > 12 else "")
        raise SurfaceError(
            f"{path} has no layer {layer!r}{did_you_mean(layer, drawing.layers)}; its layers are: {layer_names}"
        )
    if unit is None and drawing.unit is None:
        raise SurfaceError(f'{path} does not say its unit; give unit = "mm", or one of {", ".join(METRES_PER)}')
    runs = [(run, layer is None and hidden) for name, run, hidden in drawing.runs if layer in (None, name)]
    some_hidden = any(hidden for _, hidden in runs)
    where = f"{path}" + (f", layer {layer!r}," if layer is not None else ", visible layers," if some_hidden else "")
    curves = [run for run, hidden in runs if len(run) > 1 and not hidden]
    if not curves:
        raise SurfaceError(
            f"{where} has no curve; draw a closed polyline, circle, ellipse or spline, or closed lines and arcs"
        )
    if not all((np.abs(run) < LARGEST_NUMBER).all() for run in curves):
        raise SurfaceError(f"{where} has a curve with invalid or infinite coordinates; draw the curve again")
    metres = metres_per(unit or drawing.unit or "m")
    return tuple(metres * loop for loop in closed_loops(curves, where, budget))


def _drawing(path: Path, size: int, budget: DrawingBudget) -> Drawing:
    with readable(path, "draw less into it", "it is damaged"):
        budget.require("bytes", size)
        return (read_dxf if path.suffix.lower() == ".dxf" else read_rhino_in_process)(path, budget)


def closed_loops(runs: list[Floats], where: str, budget: DrawingBudget) -> Iterator[Floats]:
    """Join curves (k, 3) at common ends to closed curves, and yield these. The first point is not repeated at the end.
    where : name of the drawing for error messages. Raises SurfaceError for a curve that stays open."""
    corners = np.concatenate([[run.min(axis=0), run.max(axis=0)] for run in runs])
    tolerance = SAME_PLACE * float(np.linalg.norm(np.ptp(corners, axis=0)))
    ends = cKDTree(np.concatenate([[run[0], run[-1]] for run in runs]))  # points 2 k, 2 k + 1 are the ends of runs[k]
    free = np.ones(len(runs), dtype=bool)
    for start in range(len(runs)):
        if not free[start]:
            continue
        free[start], chain = False, [runs[start]]
        while np.linalg.norm(chain[0][0] - chain[-1][-1]) > tolerance or (len(chain) == 1 and len(chain[0]) < 3):
            budget.require_time()
            candidates = (end for end in sorted(ends.query_ball_point(chain[-1][-1], tolerance)) if free[end // 2])
            if (end := next(candidates, None)) is None:
                raise SurfaceError(_open_curve_message(np.concatenate(chain), where))
            free[end // 2] = False
            chain.append(runs[end // 2][::-1] if end % 2 else runs[end // 2])
        yield np.concatenate([chain[0], *(run[1:] for run in chain[1:])])[:-1]


def _open_curve_message(run: Floats, where: str) -> str:
    ends = " and ".join(f"({', '.join(f'{x:.6g}' for x in end)})" for end in (run[0], run[-1]))
    gap = float(np.linalg.norm(run[0] - run[-1]))
    return (
        f"{where} has an open curve, whose ends at {ends} are {gap:.3g} apart, in the file's unit; close the curve, "
        f"or name the layer of the closed curves"
    )
