"""3DM drawings (Rhino): the curves of the model, read with rhino3dm, which need not be there."""

import importlib.util
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
    """The curves of a 3DM file, its layers and its unit.

    Raises SurfaceError without the library and beyond the budget, MalformedFileError for what is no 3DM file. The
    library may crash on a damaged file: `apart.read_rhino_apart` reads what comes from elsewhere.
    """
    require_rhino()
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None:
        raise MalformedFileError("it is damaged, or no 3DM file")
    names = {layer.Index: layer.Name for layer in model.Layers}
    budget.require("entities", len(model.Objects))
    runs, points = [], 0
    for thing in model.Objects:
        if isinstance(thing.Geometry, rhino3dm.Curve):
            runs.append((names.get(thing.Attributes.LayerIndex, ""), _points(thing.Geometry)))
            points += len(runs[-1][1])
            budget.require("points", points)
    return Drawing(tuple(runs), tuple(sorted(names.values())), UNITS.get(model.Settings.ModelUnitSystem.name))


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
