"""DXF drawings (AutoCAD): the curves, points and meshes of the model space, read with ezdxf."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import SurfaceError
from dsfab.surface.formats.curves import FLAT, LARGEST, Drawing, DrawingBudget, flattened
from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.surface.formats.record import TriangleFile
from dsfab.surface.places import equal_merged
from dsfab.surface.polygons import Polygons, triangles
from dsfab.units import metres_per
from dsfab.wording import counted

UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 14: "dm"}
"""$INSUNITS."""
TAIL = 512
"""Bytes at the end of a file within which it says that this is its end."""
SOLIDS = ("3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "REVOLVEDSURFACE", "SWEPTSURFACE")
"""Entities with shapes that only AutoCAD reads."""


def read_dxf(path: Path, budget: DrawingBudget) -> Drawing:
    """The curves of a DXF file, text or binary, blocks opened, its layers and its unit.

    Raises MalformedFileError for what is no whole DXF file, SurfaceError beyond the budget.
    """
    document = _document(path)
    runs, dots, count = list[tuple[str, Floats]](), list[tuple[str, Floats]](), 0
    for entity in _Entities(budget).leaves(document.modelspace(), 0):
        layer = entity.dxf.layer
        for curve in _curves(entity):
            count += len(curve)
            budget.require("points", count)
            runs.append((layer, curve))
        if entity.dxftype() == "POINT":
            dots.append((layer, np.array([[*entity.dxf.location]])))
    layers = sorted({layer.dxf.name for layer in document.layers} | {name for name, _ in (*runs, *dots)})
    return Drawing(tuple(runs), tuple(layers), _unit(document), tuple(dots))


def read_dxf_meshes(path: Path, budget: Budget) -> TriangleFile:
    """The meshes of a DXF file: 3DFACE, MESH, polyface and polygon meshes, blocks opened; vertices at exactly the same
    place become one.

    Raises SurfaceError for a file without any and beyond the budget, MalformedFileError as `read_dxf` does.
    """
    document = _document(path)
    V, corners, sizes, count, solids = list[Floats](), list[Ints](), list[Ints](), 0, 0
    drawing = DrawingBudget(entities=budget.triangles, seconds=budget.seconds)
    for entity in _Entities(drawing).leaves(document.modelspace(), 0):
        solids += entity.dxftype() in SOLIDS
        for mesh in _polygons(entity):
            V.append(mesh.V)
            corners.append(mesh.corners + count)
            sizes.append(mesh.sizes)
            count += len(mesh.V)
            budget.require_vertices(count)
    if not V:
        what = f"{counted(solids, 'solid')} or surface and no mesh" if solids else "no mesh"
        raise SurfaceError(f"it holds {what}: no 3DFACE, MESH or polyface; export the surface as a mesh, or as STEP")
    whole = triangles(Polygons(np.concatenate(V), np.concatenate(corners), np.concatenate(sizes)))
    points, faces = equal_merged(np.concatenate(V), whole.F)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    unit = _unit(document)
    dropped = (f"{counted(solids, 'solid')} or surface",) if solids else ()
    return TriangleFile(points, faces, unit, metres_per(unit or "m"), (), dropped)


def _document(path: Path) -> Any:
    """The drawing in a file; raises MalformedFileError for what is none.

    Sound files are read plainly, in half the time of a recovery, which is for those that are not.
    """
    import ezdxf
    from ezdxf import recover

    if b"EOF" not in path.read_bytes()[-TAIL:]:
        raise MalformedFileError("its end, EOF, is missing: it is no DXF file, or it is cut off")
    with suppress(ezdxf.DXFError, OSError, ValueError, LookupError, TypeError, AttributeError):
        return ezdxf.readfile(path)
    try:
        return recover.readfile(path)[0]
    except ezdxf.DXFError as error:
        raise MalformedFileError((str(error).splitlines() or ["ezdxf says no more"])[0][:120]) from None


def _unit(document: Any) -> str | None:
    return UNITS.get(int(document.header.get("$INSUNITS", 0)))


def _polygons(entity: Any) -> Iterator[Polygons]:
    """The faces of an entity: none of what is no mesh."""
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
    """Walks through what is drawn and counts it: a block within blocks may be there a million times."""

    def __init__(self, budget: DrawingBudget) -> None:
        self.budget, self.count = budget, 0

    def leaves(self, entities: Any, depth: int) -> Iterator[Any]:
        """All that is drawn, blocks opened."""
        if depth > self.budget.depth:
            raise MalformedFileError(f"its blocks lie in one another, more than {self.budget.depth} deep")
        for entity in entities:
            self.count += 1
            self.budget.require("entities", self.count)
            _require_numbers(entity)
            if entity.dxftype() == "INSERT":
                yield from self._inserted(entity, depth)
            else:
                yield entity

    def _inserted(self, insert: Any, depth: int) -> Iterator[tuple[str, Floats]]:
        """What a block holds, once for each place of a grid of insertions."""
        self.budget.require("entities", self.count + insert.mcount)
        for one in insert.multi_insert() if insert.mcount > 1 else (insert,):
            yield from self.leaves(one.virtual_entities(), depth + 1)


def _require_numbers(entity: Any) -> None:
    """Raise MalformedFileError for an entity with a number that is none, or beyond all drawings."""
    for key, value in entity.dxf.all_existing_dxf_attribs().items():
        numbers = value if hasattr(value, "xyz") else [value] if isinstance(value, float) else []
        if not all(abs(x) < LARGEST for x in numbers):
            raise MalformedFileError(f"a {entity.dxftype()} has {key} = {value}")


def _curves(entity: Any) -> Iterator[Floats]:
    """(k, 3) points of each part of what is drawn; nothing for texts, points and dimensions."""
    from ezdxf import path as paths

    if entity.dxftype() == "SPLINE":
        yield _spline_points(entity)
        return
    try:
        drawn = paths.make_path(entity)
    except TypeError:
        return
    closed = bool(getattr(entity, "closed", False) or getattr(entity, "is_closed", False))
    yield from (_path_points(part, closed) for part in drawn.sub_paths())


def _path_points(part: Any, closed: bool) -> Floats:
    """(k, 3) points of lines and arcs one after the other."""
    size = float(np.linalg.norm(np.ptp(np.array([[*point] for point in part.control_vertices()]), axis=0)))
    if not size:
        return np.empty((0, 3))
    points = np.array([[*point] for point in part.flattening(FLAT * size, segments=4)])
    return np.concatenate([points, points[:1]]) if closed and (points[0] != points[-1]).any() else points


def _spline_points(spline: Any) -> Floats:
    """(k, 3) points of a spline between its first and its last knot that count: paths of ezdxf go beyond these where
    knots are not repeated at the ends, as of closed splines."""
    tool = spline.construction_tool()
    knots = np.array(tool.knots())
    spans = np.unique(knots[tool.degree : len(knots) - tool.degree])
    return flattened(spans, lambda t: np.array([[*point] for point in tool.points(t)]))
