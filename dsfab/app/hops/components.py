"""Components for Grasshopper. The outputs are in the unit of the model."""

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from dsfab.app.hops.protocol import HopsComponent, HopsError, HopsParameter, HopsRequest
from dsfab.core.arrays import Floats
from dsfab.core.messages import coordinates
from dsfab.core.toml_files import TomlError, toml_table
from dsfab.design import Design
from dsfab.design.output import design_lines
from dsfab.export import mesh_json, polyline_json
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.preset.proposal import preset_for
from dsfab.study import METRICS
from dsfab.surface import Surface
from dsfab.workshop import workshop_plan

INPUTS = (
    HopsParameter("mesh", "M", "The surface, as a mesh.", "Mesh", is_required=True),
    HopsParameter(
        "supports",
        "S",
        "Points near which the surface is supported. Default: supports that dsfab proposes.",
        "Point",
        is_list=True,
    ),
    HopsParameter(
        "snow", "Sn", "Snow load in Pa on the plan. Default: the usual load for this kind of surface.", "Number"
    ),
    HopsParameter("spacing", "Sp", "Distance between neighbouring members, in the unit of the model.", "Number"),
    HopsParameter("thickness", "T", "Thickness of the sheet, in the unit of the model.", "Number"),
    HopsParameter("share", "Sh", "Share of the surface that is material, 0 to 1.", "Number"),
    HopsParameter(
        "preset", "P", "Lines of a preset; metres and pascals. Example: pattern.rotate = 45.", "Text", is_list=True
    ),
)
NOTES = HopsParameter("notes", "N", "Notes on the design.", "Text", is_list=True)
LINES = HopsParameter("lines", "L", "Centre lines of the members.", "Curve", is_list=True)
_DESIGNS: OrderedDict[str, Design] = OrderedDict()


def preset_of_request(request: HopsRequest) -> Preset:
    """Return the preset for the inputs of a request. Raises DsfabError."""
    proposed = preset_for(Surface(request.surface.V - request.origin, request.surface.F), up="z")
    return with_overrides(proposed, dict(_changes(request, proposed)))


def _changes(request: HopsRequest, proposed: Preset) -> Iterator[tuple[str, Any]]:
    values, metre = request.values, request.metre
    if values["supports"]:
        reach = 2 * float(getattr(proposed.surface, "edge", 0.0)) or 1e-3  # twice the edge of the mesh, metres
        feet = [(metre * np.array(point) - request.origin).tolist() for point in values["supports"]]
        pickers = [{"pick": "ball", "center": foot, "radius": reach} for foot in feet]
        supports = [{"at": picker, "hold": "xyz", "name": f"foot {k}"} for k, picker in enumerate(pickers, 1)]
        yield "surface.support", supports
    if values["snow"] is not None:
        yield "surface.load", [{"kind": "self_weight"}, {"kind": "snow", "pressure": values["snow"]}]
    for name, key, factor in (("thickness", "statics.thickness", metre), ("share", "pattern.width.solid_fraction", 1)):
        if values[name] is not None:
            yield key, factor * values[name]
    if values["spacing"] is not None:
        yield from ((f"pattern.{family}.spacing", metre * values["spacing"]) for family in ("major", "minor"))
    yield from changes_from_toml("\n".join(values["preset"])).items()


def changes_from_toml(text: str) -> Mapping[str, Any]:
    """Return values by dotted key from lines of TOML. Raises HopsError for invalid lines."""
    try:
        table = toml_table(text)
    except TomlError as error:
        raise HopsError(f"preset: {error}; write lines such as pattern.rotate = 45") from None
    return dict(_dotted_items(table, ""))


def _dotted_items(table: Mapping[str, Any], key: str) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _dotted_items(value, f"{key}{name}.")
        else:
            yield key + name, value


def design_of_request(request: HopsRequest) -> Design:
    """Return the design of a request."""
    design = _DESIGNS.pop(request.key, None) or Design.from_preset(preset_of_request(request))
    _DESIGNS[request.key] = design
    while len(_DESIGNS) > 4:
        _DESIGNS.popitem(last=False)
    return design


def _note_texts(design: Design, request: HopsRequest) -> list[str]:
    mesh = request.values["mesh"]
    taken = [f"taken: {', '.join(thing.text for thing in mesh.content)}"]
    if request.origin.any():
        taken.append(
            f"the lines of the preset have their origin at the model's point {coordinates(request.origin.tolist())} m"
        )
    return [*taken, *(note.text for note in design.notes)]


def _curves_and_names(design: Design, kind: str, request: HopsRequest) -> tuple[list[str], list[str]]:
    lines_of_kind = [line for line in design_lines(design, design.preset.statics.thickness / 40) if line.kind == kind]
    return [polyline_json(request.in_model(line.points)) for line in lines_of_kind], [line.id for line in lines_of_kind]


def solve_structure(request: HopsRequest) -> Sequence[Any]:
    """Return the outputs of the component `structure`: solid, centre lines, edges, names, compliance, mass, notes."""
    design = design_of_request(request).until("thickening")
    lines, names = _curves_and_names(design, "centre", request)
    edges, _ = _curves_and_names(design, "edge", request)
    stiffness = float(METRICS["compliance_quick"](design))
    solid = mesh_json(request.in_model(design.solid.V), design.solid.F)
    return solid, lines, edges, names, stiffness, float(design.mass), _note_texts(design, request)


def solve_preview(request: HopsRequest) -> Sequence[Any]:
    """Return the outputs of the component `preview`: cut sheet, centre lines and notes."""
    design = design_of_request(request).until("slicing")
    sheet, lines = design.sheet.surface, _curves_and_names(design, "centre", request)[0]
    return mesh_json(request.in_model(sheet.V), sheet.F), lines, _note_texts(design, request)


def solve_members(request: HopsRequest) -> Sequence[Any]:
    """Return the outputs of the component `members`: axis, name, length and mean width of each member."""
    graph = design_of_request(request).until("slicing").members
    with_axis = [member for member in graph.members if member.axis is not None]
    axes = [polyline_json(request.in_model(member.axis.P)) for member in with_axis if member.axis is not None]
    lengths = [float(member.length / request.metre) for member in with_axis]
    widths = [float(member.width.mean() / request.metre) for member in with_axis]
    return axes, [member.id for member in with_axis], lengths, widths


def solve_parts(request: HopsRequest) -> Sequence[Any]:
    """Return the outputs of the component `parts`: curves of stock, cuts, holes and marks; names of parts; notes."""
    plan = workshop_plan(design_of_request(request).until("slicing"))
    curves: dict[str, list[Floats]] = {"stock": [], "cut": [], "holes": [], "marks": []}
    names, depth = list[str](), 0.0
    for sheet in plan.sheets:
        length, width = sheet.size
        shift = np.array([0.0, -depth])
        curves["stock"].append(shift + [(0, 0), (length, 0), (length, width), (0, width), (0, 0)])
        for placed in (placement.placed_part for placement in sheet.parts):
            names.append(placed.id)
            curves["cut"] += [shift + np.vstack([loop, loop[:1]]) for loop in (placed.outline, *placed.slots)]
            curves["holes"] += [shift + _circle(hole.at, hole.diameter / 2) for hole in placed.holes]
            curves["marks"] += [shift + mark for mark in placed.marks]
        depth += width + 0.2  # the gap between two sheets is 0.2 metres
    outputs = [[polyline_json(curve / request.metre) for curve in kind] for kind in curves.values()]
    return *outputs, names, list(plan.notes)


def _circle(center: Floats, radius: float, corners: int = 24) -> Floats:
    turn = np.linspace(0, 2 * np.pi, corners + 1)
    return center + radius * np.column_stack([np.cos(turn), np.sin(turn)])


COMPONENTS = {
    one.name: one
    for one in (
        HopsComponent(
            "structure",
            "A structure on a surface; its members follow the forces.",
            INPUTS,
            (
                HopsParameter("solid", "So", "The watertight solid.", "Mesh"),
                LINES,
                HopsParameter("edges", "E", "Edges of the material.", "Curve", is_list=True),
                HopsParameter("names", "Na", "Names of the lines.", "Text", is_list=True),
                HopsParameter(
                    "compliance",
                    "C",
                    "Compliance in J, from a single solve; a smaller compliance means a stiffer structure.",
                    "Number",
                ),
                HopsParameter("mass", "Ma", "Mass in kg.", "Number"),
                NOTES,
            ),
            solve_structure,
        ),
        HopsComponent(
            "preview",
            "A faster preview of the structure: the cut sheet, without thickness.",
            INPUTS,
            (HopsParameter("sheet", "Sh", "The cut sheet.", "Mesh"), LINES, NOTES),
            solve_preview,
        ),
        HopsComponent(
            "members",
            "The members of the structure, by name.",
            INPUTS,
            (
                HopsParameter("axes", "A", "A curve along the middle of each member.", "Curve", is_list=True),
                HopsParameter("names", "Na", "Names of the members: A01, A02 ...", "Text", is_list=True),
                HopsParameter(
                    "lengths", "L", "Lengths of the members, in the unit of the model.", "Number", is_list=True
                ),
                HopsParameter(
                    "widths", "W", "Mean widths of the members, in the unit of the model.", "Number", is_list=True
                ),
            ),
            solve_members,
        ),
        HopsComponent(
            "parts",
            "Flat parts for the workshop, placed on the sheets of the stock.",
            INPUTS,
            (
                HopsParameter("stock", "St", "The sheets.", "Curve", is_list=True),
                HopsParameter("cut", "Cu", "Lines to cut.", "Curve", is_list=True),
                HopsParameter("holes", "Ho", "Holes to drill.", "Curve", is_list=True),
                HopsParameter("marks", "En", "Lines and letters to engrave on the parts.", "Curve", is_list=True),
                HopsParameter("names", "Na", "Names of the parts.", "Text", is_list=True),
                NOTES,
            ),
            solve_parts,
        ),
    )
}
"""The components of the server, by name."""
