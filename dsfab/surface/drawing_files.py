"""Closed curves out of DXF and 3DM files, as polygons: what an architect draws to say where something is."""

import importlib.util
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import SurfaceError, did_you_mean
from dsfab.units import METRES_PER, metres_per

CLOSE = 1e-6
"""Ends of curves that are nearer than this share of the drawing's size are at one place."""
FLAT = 2e-4
"""How far the sides of a polygon may be off the curve, as a share of the curve's size."""
FINEST = 1024
"""Points at most between two knots of a curve."""
DXF_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 14: "dm"}
"""$INSUNITS of a DXF file."""
RHINO_UNITS = {
    "Millimeters": "mm", "Centimeters": "cm", "Decimeters": "dm", "Meters": "m", "Kilometers": "km",
    "Inches": "in", "Feet": "ft",
}  # fmt: skip
LAYERS_TOLD = 12
"""Layers of a file that are listed where the one that was asked for is not among them."""


def closed_curves(path: Path, layer: str | None, unit: str | None) -> tuple[Floats, ...]:
    """The closed curves (k, 3) of a drawing, metres: of one layer, or of all. Lines and arcs that meet end to end are
    one curve.

    unit : of the file's numbers; left out, what the file says.

    Raises SurfaceError for a file or a layer that is not there, one without closed curves, curves that are open, and a
    file that does not say its unit.
    """
    path = Path(path)
    if path.suffix.lower() not in (".dxf", ".3dm"):
        raise SurfaceError(f"{path} is no drawing that dsfab reads; give a .dxf or a .3dm file")
    try:
        about = path.stat()
    except OSError as error:
        raise SurfaceError(f"the drawing {path} cannot be read: {error.strerror}") from None
    return _read_once(path, layer, unit, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=16)
def _read_once(path: Path, layer: str | None, unit: str | None, _changed: int, _size: int) -> tuple[Floats, ...]:
    """The curves of a file as it is now: pickers ask for them again and again."""
    kind = path.suffix.lower()
    runs, layers, own = _rhino_runs(path) if kind == ".3dm" else _dxf_runs(path)
    if layer is not None and layer not in layers:
        told = ", ".join(layers[:LAYERS_TOLD]) + (", ..." if len(layers) > LAYERS_TOLD else "")
        raise SurfaceError(f"{path} has no layer {layer!r}{did_you_mean(layer, layers)}; its layers are: {told}")
    if unit is None and own is None:
        raise SurfaceError(f'{path} does not say its unit; give unit = "mm", or one of {", ".join(METRES_PER)}')
    where = f"{path}" + (f", layer {layer!r}," if layer is not None else "")
    found = [run for name, run in runs if layer in (None, name) and len(run) > 1]
    if not found:
        raise SurfaceError(
            f"{where} has no curve; draw a closed one, as polyline, circle, ellipse, spline, lines or arcs"
        )
    metres = metres_per(unit or own or "m")
    return tuple(metres * loop for loop in _loops(found, where))


def _dxf_runs(path: Path) -> tuple[list[tuple[str, Floats]], list[str], str | None]:
    """Layer and points (k, 3) of each curve of a DXF file, its layers, and its unit."""
    import ezdxf
    from ezdxf import recover

    try:
        document, _ = recover.readfile(path)
    except (OSError, ezdxf.DXFError, ValueError) as error:
        what = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise SurfaceError(f"{path} cannot be read as DXF ({what}); export it again") from None
    runs = list(_entities(document.modelspace()))
    layers = sorted({layer.dxf.name for layer in document.layers} | {name for name, _ in runs})
    return runs, layers, DXF_UNITS.get(int(document.header.get("$INSUNITS", 0)))


def _entities(entities: Any) -> Iterator[tuple[str, Floats]]:
    """Layer and points of what is drawn, blocks opened."""
    from ezdxf import path as paths

    for entity in entities:
        if entity.dxftype() == "INSERT":
            yield from _entities(entity.virtual_entities())
        elif entity.dxftype() == "SPLINE":
            yield entity.dxf.layer, _spline_points(entity)
        else:
            try:
                drawn = paths.make_path(entity)
            except TypeError:  # text, points, dimensions
                continue
            for part in drawn.sub_paths():
                yield entity.dxf.layer, _path_points(part, _says_closed(entity))


def _path_points(part: Any, closed: bool) -> Floats:
    """(k, 3) points of lines and arcs one after the other."""
    size = float(np.linalg.norm(np.ptp(np.array([[*point] for point in part.control_vertices()]), axis=0)))
    if not size:
        return np.empty((0, 3))
    points = np.array([[*point] for point in part.flattening(FLAT * size, segments=4)])
    return np.concatenate([points, points[:1]]) if closed else points


def _spline_points(spline: Any) -> Floats:
    """(k, 3) points of a spline between its first and its last knot that count: paths of ezdxf go beyond these where
    knots are not repeated at the ends, as of closed splines."""
    tool = spline.construction_tool()
    knots = np.array(tool.knots())
    spans = np.unique(knots[tool.degree : len(knots) - tool.degree])
    return _flattened(spans, lambda t: np.array([[*point] for point in tool.points(t)]))


def _flattened(spans: Floats, at: Callable[[Floats], Floats]) -> Floats:
    """(k, 3) points `at` the ends of spans (s,) of a curve and at as many between as it takes to be within `FLAT`."""
    count = 4
    while True:
        t = np.interp(np.arange(2 * count * (len(spans) - 1) + 1) / (2 * count), np.arange(len(spans)), spans)
        points = at(t)
        off = np.linalg.norm(points[1::2] - (points[:-1:2] + points[2::2]) / 2, axis=1).max()
        if off <= FLAT * np.linalg.norm(np.ptp(points, axis=0)) or count >= FINEST:
            return np.asarray(points[::2])
        count *= 2


def _says_closed(entity: Any) -> bool:
    return bool(getattr(entity, "closed", False) or getattr(entity, "is_closed", False))


def _rhino_runs(path: Path) -> tuple[list[tuple[str, Floats]], list[str], str | None]:
    """Layer and points (k, 3) of each curve of a 3DM file, its layers, and its unit."""
    if importlib.util.find_spec("rhino3dm") is None:
        raise SurfaceError(f'{path}: .3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"')
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None:
        raise SurfaceError(f"{path} cannot be read as 3DM; save it again")
    names = {layer.Index: layer.Name for layer in model.Layers}
    runs = [
        (names.get(thing.Attributes.LayerIndex, ""), _rhino_points(thing.Geometry))
        for thing in model.Objects
        if isinstance(thing.Geometry, rhino3dm.Curve)
    ]
    return runs, sorted(names.values()), RHINO_UNITS.get(model.Settings.ModelUnitSystem.name)


def _rhino_points(curve: Any) -> Floats:
    """(k, 3) points of a curve, as many as it takes to be within `FLAT` of it; the corners of a polyline."""
    line = curve.TryGetPolyline()
    if curve.IsPolyline() and line is not None:
        return np.array([[p.X, p.Y, p.Z] for p in line])
    spans = np.linspace(curve.Domain.T0, curve.Domain.T1, 4 * max(curve.SpanCount, 1) + 1)
    return _flattened(spans, lambda t: np.array([[p.X, p.Y, p.Z] for p in map(curve.PointAt, t)]))


def _loops(runs: list[Floats], where: str) -> Iterator[Floats]:
    """Runs joined where their ends meet: the closed curves, without their last point, which is the first.

    Raises SurfaceError for what stays open.
    """
    points = np.concatenate(runs)
    close = CLOSE * float(np.linalg.norm(np.ptp(points, axis=0)))
    left = list(runs)
    while left:
        run = left.pop(0)
        while np.linalg.norm(run[0] - run[-1]) > close or len(run) < 3:
            onward = [_continued(run, other, close) for other in left]
            k = next((k for k, longer in enumerate(onward) if longer is not None), None)
            if k is None:
                raise SurfaceError(_open(run, where))
            run, _ = onward[k], left.pop(k)  # type: ignore[assignment]
        yield run[:-1]


def _continued(run: Floats, other: Floats, close: float) -> Floats | None:
    """A run with another one behind it, turned round if that fits; None where they do not meet."""
    for way in (other, other[::-1]):
        if np.linalg.norm(run[-1] - way[0]) <= close:
            return np.concatenate([run, way[1:]])
    return None


def _open(run: Floats, where: str) -> str:
    ends = " and ".join(f"({', '.join(f'{x:.6g}' for x in end)})" for end in (run[0], run[-1]))
    gap = float(np.linalg.norm(run[0] - run[-1]))
    return (
        f"{where} has a curve that is open: its ends at {ends} are {gap:.3g} apart, in the file's unit; close it, or "
        "name the layer of the closed ones"
    )
