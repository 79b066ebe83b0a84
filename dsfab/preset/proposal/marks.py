"""Marks in the user's surface file: points and curves on named layers."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import SurfaceError
from dsfab.core.units import metres_per
from dsfab.preset.proposal.reading import Decision, UserMesh
from dsfab.preset.proposal.readings import SupportPlace
from dsfab.preset.proposal.sizes import Sizes
from dsfab.surface import MARK_LAYERS, Marks, marks_on_layers, polyline_length

DRAWINGS = (".3dm", ".dxf")
FORCE = 1000.0  # Placeholder for loads: N at points, N/m on lines, Pa in closed curves.
TABLES = {"support": "[[surface.support]]", "load": "[[surface.load]]"}


def drawn_marks(user_mesh: UserMesh) -> dict[str, Marks]:
    """Return the marks by layer: support, load, keep and void; {} for file formats without layers.
    Raises SurfaceError if the file has marks and its z axis does not point upwards."""
    path = Path(str(user_mesh.keys.get("file", "")))
    if path.suffix.lower() not in DRAWINGS:
        return {}
    by_layer = marks_on_layers(path, MARK_LAYERS, metres_per(str(user_mesh.keys["unit"])))
    if by_layer and user_mesh.keys.get("up", "z") != "z":
        raise SurfaceError(
            f"{path} has marks on layer {next(iter(by_layer))!r}, but z does not point up; turn and save the drawing"
        )
    origin = user_mesh.keys.get("origin")
    return {word: layer_marks.about(origin) for word, layer_marks in by_layer.items()} if origin else by_layer


def mark_tables(marks: Mapping[str, Marks], file: str, unit: str, size: Sizes, edge: float) -> Iterator[list[str]]:
    """Yield the lines of each table of a preset that describes the marks. edge : mean edge length of the mesh (m).
    file : path of the marks' file relative to the preset's folder, or "" to write the curves into the preset."""
    radius = round(0.6 * edge, 3)
    for word, layer_marks in marks.items():
        head = TABLES.get(word, "[[pattern.region]]")
        areas = layer_marks.closed_runs if word != "support" else []
        lines = layer_marks.open_runs if word != "support" else layer_marks.curves
        if len(layer_marks.points) and word != "void":
            reach = f"points = {_points(layer_marks.points)}"
            dots = f'pick = "nearest", {reach}' if word in TABLES else f'pick = "brush", {reach}, radius = {size.keep}'
            yield [head, *_kind_lines(word, layer_marks, FORCE * len(layer_marks.points)), f"at = {{ {dots} }}"]
        for line in lines if word != "void" else ():
            stroke = f'pick = "brush", points = {_points(_evenly_spaced(line, 1.5 * radius))}, radius = {radius}'
            yield [head, *_kind_lines(word, layer_marks, FORCE * polyline_length(line)), f"at = {{ {stroke} }}"]
        if areas and (word in TABLES or not file):
            for area in areas:
                curve = f'pick = "curve", curves = [{_points(area[:-1])}]'
                yield [head, *_kind_lines(word, layer_marks, FORCE * _plan_area(area)), f"at = {{ {curve} }}"]
        elif areas:
            picker = f'pick = "curve", file = {_word(file)}, layer = {_word(layer_marks.layer)}, unit = {_word(unit)}'
            yield [head, *_kind_lines(word, layer_marks, 0.0), f"at = {{ {picker} }}"]


def mark_decisions(marks: Mapping[str, Marks]) -> Iterator[Decision]:
    changes = {"support": "surface.support", "load": "surface.load"}
    for word, layer_marks in marks.items():
        parts = [
            (len(layer_marks.points), "point"),
            (len(layer_marks.closed_runs), "closed curve"),
            (len(layer_marks.open_runs), "line"),
        ]
        counts = ", ".join(f"{count} {thing}{'s' if count > 1 else ''}" for count, thing in parts if count)
        value = (
            "; the loads are placeholders: 1 kN at each point, 1 kN/m along each line, 1 kPa within each curve"
            if word == "load"
            else ""
        )
        lost = len(layer_marks.points) + len(layer_marks.open_runs) if word == "void" else 0
        value += f"; {lost} of these points and lines enclose no area and are ignored" if lost else ""
        yield Decision(f"layer {layer_marks.layer}", counts + value, changes.get(word, "pattern.region"))


def drawn_feet(marks: Mapping[str, Marks]) -> tuple[SupportPlace, ...]:
    """Return all marks on the layer `support` as a single support; () if the layer has no marks."""
    if "support" not in marks:
        return ()
    layer_marks = marks["support"]
    return (SupportPlace("support as drawn", np.concatenate([layer_marks.points, *layer_marks.curves])),)


def _kind_lines(word: str, layer_marks: Marks, newtons: float) -> list[str]:
    if word == "support":
        return [f"name = {_word(layer_marks.layer)}", 'hold = "xyz"']
    if word == "load":
        return ['kind = "force"', f"force = [0.0, 0.0, {-newtons:.6g}]  # N, a placeholder"]
    return [f'do = "{word}"']


def _word(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _points(points: Floats) -> str:
    return str([[round(x, 3) + 0.0 for x in point] for point in points.tolist()])


def _plan_area(curve: Floats) -> float:
    middle = curve - curve.mean(axis=0)
    return float(np.linalg.norm(np.cross(middle[:-1], middle[1:]).sum(axis=0)) / 2)


def _evenly_spaced(line: Floats, step: float) -> Floats:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    lengths = np.linspace(0.0, along[-1], max(2, int(np.ceil(along[-1] / step)) + 1))
    return np.stack([np.interp(lengths, along, line[:, axis]) for axis in range(3)], axis=1)
