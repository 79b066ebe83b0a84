"""The components for Grasshopper. Each function maps a request to the values of its outputs, in the unit of the
model.
"""

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from dsfab.app.hops.protocol import HopsComponent, HopsError, Parameter, Request
from dsfab.core.arrays import Floats
from dsfab.core.toml_files import TomlError, toml_table
from dsfab.design import Design
from dsfab.design.output import design_lines
from dsfab.export import mesh_json, polyline_json
from dsfab.preset.file import overridden
from dsfab.preset.model import Preset
from dsfab.preset.proposal import preset_for
from dsfab.study import METRICS
from dsfab.workshop import workshop_plan

INPUTS = (
    Parameter("mesh", "M", "The surface, as a mesh.", "Mesh", wanted=True),
    Parameter("supports", "S", "Points that hold the surface near them; left out: its feet.", "Point", many=True),
    Parameter("snow", "Sn", "Pa on the plan; left out: 750, a placeholder for your code.", "Number"),
    Parameter("spacing", "Sp", "From one member to the next, in the unit of the model.", "Number"),
    Parameter("thickness", "T", "Of the sheet, in the unit of the model.", "Number"),
    Parameter("share", "Sh", "Of the surface that is material, 0 to 1.", "Number"),
    Parameter("preset", "P", "Lines of a preset, such as pattern.rotate = 45; metres and pascals.", "Text", many=True),
)
NOTES = Parameter("notes", "N", "Notes on the design.", "Text", many=True)
LINES = Parameter("lines", "L", "Middles of the members.", "Curve", many=True)

_DESIGNS: OrderedDict[str, Design] = OrderedDict()


def requested_preset(request: Request) -> Preset:
    """Return the preset that dsfab proposes for the mesh, with the changes of the other inputs.

    Raises HopsError, PresetError and SurfaceError for impossible inputs.
    """
    V, F = request.values["mesh"]
    proposed = preset_for((V, F), unit=request.unit, up="z")
    return overridden(proposed, dict(_changes(request, proposed)))


def _changes(request: Request, proposed: Preset) -> Iterator[tuple[str, Any]]:
    given, metre = request.values, request.metre
    if given["supports"]:
        reach = 2 * float(getattr(proposed.surface, "edge", 0.0)) or 1e-3  # two edges of the mesh
        feet = [[metre * x for x in point] for point in given["supports"]]
        ball = [{"pick": "ball", "center": foot, "radius": reach} for foot in feet]
        yield "surface.support", [{"at": at, "hold": "xyz", "name": f"foot {k}"} for k, at in enumerate(ball, 1)]
    if given["snow"] is not None:
        yield "surface.load", [{"kind": "self_weight"}, {"kind": "snow", "pressure": given["snow"]}]
    for name, key, factor in (("thickness", "statics.thickness", metre), ("share", "pattern.width.solid_fraction", 1)):
        if given[name] is not None:
            yield key, factor * given[name]
    if given["spacing"] is not None:
        yield from ((f"pattern.{family}.spacing", metre * given["spacing"]) for family in ("major", "minor"))
    yield from written_changes("\n".join(given["preset"])).items()


def written_changes(text: str) -> Mapping[str, Any]:
    """Return dotted keys and values of lines of TOML; raise HopsError for invalid lines."""
    try:
        table = toml_table(text)
    except TomlError as error:
        raise HopsError(f"preset: {error}; write lines such as pattern.rotate = 45") from None
    return dict(_dotted(table, ""))


def _dotted(table: Mapping[str, Any], key: str) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _dotted(value, f"{key}{name}.")
        else:
            yield key + name, value


def requested_design(request: Request) -> Design:
    """Return the design of a request; components with the same inputs share one of the last four."""
    design = _DESIGNS.pop(request.key, None) or Design.of(requested_preset(request))
    _DESIGNS[request.key] = design
    while len(_DESIGNS) > 4:
        _DESIGNS.popitem(last=False)
    return design


def _notes(design: Design) -> list[str]:
    return [note.text for note in design.notes]


def _lines(design: Design, kind: str, request: Request) -> tuple[list[str], list[str]]:
    chosen = [line for line in design_lines(design, design.preset.statics.thickness / 40) if line.kind == kind]
    return [polyline_json(line.points / request.metre) for line in chosen], [line.id for line in chosen]


def structure(request: Request) -> Sequence[Any]:
    """The solid, its lines, its mass and its stiffness."""
    design = requested_design(request).until("thickening")
    lines, names = _lines(design, "centre", request)
    edges, _ = _lines(design, "edge", request)
    stiffness = float(METRICS["compliance_quick"](design))
    solid = mesh_json(design.solid.V / request.metre, design.solid.F)
    return solid, lines, edges, names, stiffness, float(design.mass), _notes(design)


def preview(request: Request) -> Sequence[Any]:
    """The sheet before thickening."""
    design = requested_design(request).until("slicing")
    sheet = design.sheet.surface
    return mesh_json(sheet.V / request.metre, sheet.F), _lines(design, "centre", request)[0], _notes(design)


def members(request: Request) -> Sequence[Any]:
    """Axes with names, lengths and widths."""
    graph = requested_design(request).until("slicing").members
    chosen = [member for member in graph.members if member.axis is not None]
    axes = [polyline_json(member.axis.P / request.metre) for member in chosen if member.axis is not None]
    lengths = [float(member.length / request.metre) for member in chosen]
    widths = [float(member.width.mean() / request.metre) for member in chosen]
    return axes, [member.id for member in chosen], lengths, widths


def parts(request: Request) -> Sequence[Any]:
    """Flat parts on their sheets, which lie below each other in the plane."""
    plan = workshop_plan(requested_design(request).until("slicing"))
    curves: dict[str, list[Floats]] = {"stock": [], "cut": [], "holes": [], "marks": []}
    names, down = list[str](), 0.0
    for sheet in plan.sheets:
        length, width = sheet.size
        shift = np.array([0.0, -down])
        curves["stock"].append(shift + [(0, 0), (length, 0), (length, width), (0, width), (0, 0)])
        for placed in (one.placed for one in sheet.parts):
            names.append(placed.id)
            curves["cut"] += [shift + np.vstack([loop, loop[:1]]) for loop in (placed.outline, *placed.slots)]
            curves["holes"] += [shift + _circle(hole.at, hole.diameter / 2) for hole in placed.holes]
            curves["marks"] += [shift + mark for mark in placed.marks]
        down += width + 0.2  # metres between the sheets
    drawn = [[polyline_json(curve / request.metre) for curve in kind] for kind in curves.values()]
    return *drawn, names, list(plan.notes)


def _circle(center: Floats, radius: float, corners: int = 24) -> Floats:
    turn = np.linspace(0, 2 * np.pi, corners + 1)
    return center + radius * np.column_stack([np.cos(turn), np.sin(turn)])


COMPONENTS = {
    one.name: one
    for one in (
        HopsComponent(
            "structure",
            "A structure on a surface, along its forces.",
            INPUTS,
            (
                Parameter("solid", "So", "The watertight solid.", "Mesh"),
                LINES,
                Parameter("edges", "E", "Edges of the material.", "Curve", many=True),
                Parameter("names", "Na", "Of the lines.", "Text", many=True),
                Parameter("compliance", "C", "J, by one solve: less is stiffer.", "Number"),
                Parameter("mass", "Ma", "kg.", "Number"),
                NOTES,
            ),
            structure,
        ),
        HopsComponent(
            "preview",
            "The same, faster: the sheet before it has a thickness.",
            INPUTS,
            (Parameter("sheet", "Sh", "The cut sheet.", "Mesh"), LINES, NOTES),
            preview,
        ),
        HopsComponent(
            "members",
            "The members of the structure, by name.",
            INPUTS,
            (
                Parameter("axes", "A", "A curve along the middle of each.", "Curve", many=True),
                Parameter("names", "Na", "A01, A02 ...", "Text", many=True),
                Parameter("lengths", "L", "In the unit of the model.", "Number", many=True),
                Parameter("widths", "W", "In the mean, in the unit of the model.", "Number", many=True),
            ),
            members,
        ),
        HopsComponent(
            "parts",
            "Flat parts for the workshop, on their sheets.",
            INPUTS,
            (
                Parameter("stock", "St", "The sheets.", "Curve", many=True),
                Parameter("cut", "Cu", "Lines to cut.", "Curve", many=True),
                Parameter("holes", "Ho", "Holes to drill.", "Curve", many=True),
                Parameter("marks", "En", "Lines and letters to engrave.", "Curve", many=True),
                Parameter("names", "Na", "Of the parts.", "Text", many=True),
                NOTES,
            ),
            parts,
        ),
    )
}
"""Components by name."""
