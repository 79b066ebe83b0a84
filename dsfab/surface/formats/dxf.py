"""DXF drawings (AutoCAD): the curves of the model space, read with ezdxf."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface.formats.curves import FLAT, LARGEST, Drawing, DrawingBudget, flattened
from dsfab.surface.formats.limits import MalformedFileError

UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 14: "dm"}
"""$INSUNITS."""
TAIL = 512
"""Bytes at the end of a file within which it says that this is its end."""


def read_dxf(path: Path, budget: DrawingBudget) -> Drawing:
    """The curves of a DXF file, text or binary, blocks opened, its layers and its unit.

    Raises MalformedFileError for what is no whole DXF file, SurfaceError beyond the budget.
    """
    import ezdxf
    from ezdxf import recover

    if b"EOF" not in path.read_bytes()[-TAIL:]:
        raise MalformedFileError("its end, EOF, is missing: it is no DXF file, or it is cut off")
    try:
        document, _ = recover.readfile(path)
    except ezdxf.DXFError as error:
        raise MalformedFileError((str(error).splitlines() or ["ezdxf says no more"])[0][:120]) from None
    runs, points = [], 0
    for layer, curve in _Entities(budget).runs(document.modelspace(), 0):
        points += len(curve)
        budget.require("points", points)
        runs.append((layer, curve))
    layers = sorted({layer.dxf.name for layer in document.layers} | {name for name, _ in runs})
    return Drawing(tuple(runs), tuple(layers), UNITS.get(int(document.header.get("$INSUNITS", 0))))


class _Entities:
    """Walks through what is drawn and counts it: a block within blocks may be there a million times."""

    def __init__(self, budget: DrawingBudget) -> None:
        self.budget, self.count = budget, 0

    def runs(self, entities: Any, depth: int) -> Iterator[tuple[str, Floats]]:
        """Layer and points (k, 3) of each curve."""
        if depth > self.budget.depth:
            raise MalformedFileError(f"its blocks lie in one another, more than {self.budget.depth} deep")
        for entity in entities:
            self.count += 1
            self.budget.require("entities", self.count)
            _require_numbers(entity)
            if entity.dxftype() == "INSERT":
                yield from self._inserted(entity, depth)
            else:
                yield from ((entity.dxf.layer, points) for points in _curves(entity))

    def _inserted(self, insert: Any, depth: int) -> Iterator[tuple[str, Floats]]:
        """What a block holds, once for each place of a grid of insertions."""
        self.budget.require("entities", self.count + insert.mcount)
        for one in insert.multi_insert() if insert.mcount > 1 else (insert,):
            yield from self.runs(one.virtual_entities(), depth + 1)


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
