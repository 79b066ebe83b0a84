"""3DM drawings (Rhino): the curves of the model, read with rhino3dm, which need not be there."""

import importlib.util
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import SurfaceError
from dsfab.surface.formats.curves import Drawing, DrawingBudget, flattened
from dsfab.surface.formats.limits import MalformedFileError

UNITS = {
    "Millimeters": "mm", "Centimeters": "cm", "Decimeters": "dm", "Meters": "m", "Kilometers": "km",
    "Inches": "in", "Feet": "ft",
}  # fmt: skip
"""Names of rhino3dm."""


def read_rhino(path: Path, budget: DrawingBudget) -> Drawing:
    """The curves of a 3DM file, blocks opened, its layers and its unit.

    Raises SurfaceError without the library and beyond the budget, MalformedFileError for what is no 3DM file. The
    library may crash on a damaged file: `apart.read_rhino_apart` reads what comes from elsewhere.
    """
    require_rhino()
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None:
        raise MalformedFileError("it is damaged, or no 3DM file")
    budget.require("entities", len(model.Objects))
    runs, points = [], 0
    drawn = (thing for thing in model.Objects if not thing.Attributes.IsInstanceDefinitionObject)
    for layer, curve in _Model(model, budget).runs(drawn, np.eye(4), 0):
        runs.append((layer, curve))
        points += len(curve)
        budget.require("points", points)
    layers = tuple(sorted(layer.Name for layer in model.Layers))
    return Drawing(tuple(runs), layers, UNITS.get(model.Settings.ModelUnitSystem.name))


class _Model:
    """Walks through what is drawn and counts it: what a block holds lies among all objects, and is drawn where the
    block is inserted, moved by its matrix."""

    def __init__(self, model: Any, budget: DrawingBudget) -> None:
        self.model, self.budget, self.count = model, budget, 0
        self.layers = {layer.Index: layer.Name for layer in model.Layers}

    def runs(self, things: Iterable[Any], place: Floats, depth: int) -> Iterator[tuple[str, Floats]]:
        """Layer and points (k, 3) of each curve, moved by a matrix (4, 4)."""
        import rhino3dm

        if depth > self.budget.depth:
            raise MalformedFileError(f"its blocks lie in one another, more than {self.budget.depth} deep")
        for thing in things:
            self.count += 1
            self.budget.require("entities", self.count)
            if isinstance(thing.Geometry, rhino3dm.InstanceReference):
                inside = self._block(thing.Geometry.ParentIdefId)
                yield from self.runs(inside, place @ _matrix(thing.Geometry.Xform), depth + 1)
            elif isinstance(thing.Geometry, rhino3dm.Curve):
                points = _points(thing.Geometry) @ place[:3, :3].T + place[:3, 3]
                yield self.layers.get(thing.Attributes.LayerIndex, ""), points

    def _block(self, number: Any) -> list[Any]:
        """What a block holds; raises MalformedFileError for one that is not in the file, as of a linked one."""
        block = self.model.InstanceDefinitions.FindId(number)
        inside = [self.model.Objects.FindId(one) for one in block.GetObjectIds()] if block else []
        if not inside or None in inside:
            name = f"the block {block.Name!r}" if block else "a block"
            raise MalformedFileError(f"{name} is inserted and not in the file; explode it, or embed it in Rhino")
        return inside


def _matrix(moved: Any) -> Floats:
    """(4, 4) of Rhino's transformation."""
    return np.array([[getattr(moved, f"M{i}{j}") for j in range(4)] for i in range(4)], dtype=np.float64)


def require_rhino() -> None:
    """Raise SurfaceError if rhino3dm is not installed."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise SurfaceError('.3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"')


def _points(curve: Any) -> Floats:
    """(k, 3) points of a curve, as many as it takes to be within `FLAT` of it; the corners of a polyline."""
    line = curve.TryGetPolyline()
    if curve.IsPolyline() and line is not None:
        return np.array([[p.X, p.Y, p.Z] for p in line])
    spans = np.linspace(curve.Domain.T0, curve.Domain.T1, 4 * max(curve.SpanCount, 1) + 1)
    return flattened(spans, lambda t: np.array([[p.X, p.Y, p.Z] for p in map(curve.PointAt, t)]))
