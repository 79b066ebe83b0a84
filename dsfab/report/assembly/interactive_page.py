"""The interactive page of a structure, which shows the flat parts of each member."""

import json
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.core.units import MM_PER_M
from dsfab.design import Design
from dsfab.render import PAPER, up_axis
from dsfab.report.assembly.axonometry import MemberFaces, drawn_faces
from dsfab.report.assembly.overview import piece_length, strip_quads
from dsfab.report.html_pages import page_style
from dsfab.surface import simplified_line
from dsfab.workshop import FlatPart, WorkshopPlan, bar_table, file_stem, refolded_plan


def colour_scales(plan: WorkshopPlan, names: list[str], judged_design: Design | None) -> list[dict[str, Any]]:
    """Return the colour scales of the page. A scale has a name, a unit, and a value or None for each member.
    names : names of the members.    judged_design : design with utilisation and forces, or None.
    Raises StaticsError for a design without a strength, or if nothing carries the loads."""
    assert plan.graph is not None
    members = plan.graph.by_id
    longest: dict[str, float] = {}
    for part in plan.parts:
        for name in (part.member, part.id):
            longest[name] = max(longest.get(name, 0.0), float(np.max(part.size)))
    axes = {name: members[name].length for name in names if name in members and members[name].axis}
    widths = {name: MM_PER_M * members[name].mean_width for name in axes}
    scales = [
        _colour_scale("length", "m", {**{name: longest[name] for name in names if name in longest}, **axes}, names, 2),
        _colour_scale("width", "mm", widths, names, 0),
    ]
    if judged_design:
        scales += _force_scales(judged_design, names)
    return [scale for scale in scales if len({*scale["values"]} - {None}) > 1]


def _force_scales(design: Design, names: list[str]) -> list[dict[str, Any]]:
    normal = {
        name: max((float(table[np.abs(table[:, 0]).argmax(), 0]) / 1e3 for table in forces.forces.values()), key=abs)
        for name, forces in design.member_forces.items()
        if len(forces.s)
    }
    full = {name: 100 * value for name, value in design.member_utilisation.by_member.items()}
    return [_colour_scale("utilisation", "%", full, names, 1), _colour_scale("normal force N", "kN", normal, names, 2)]


def _colour_scale(name: str, unit: str, values: dict[str, float], names: list[str], digits: int) -> dict[str, Any]:
    listed = [round(values[member], digits) if member in values else None for member in names]
    return {"name": name, "unit": unit, "values": listed}


def key_figures(design: Design, judged: bool) -> list[tuple[str, str]]:
    """Return names and values of a structure's key figures. judged : True to add the member with most utilisation."""
    statics, box = design.preset.statics, np.ptp(design.surface.V, axis=0)
    sheet = design.sheet.surface
    mass = sheet.area * statics.thickness * statics.density  # approximate, because making the solid takes long
    figures = [
        ("size", " x ".join(length(float(side)) for side in box)),
        ("mass", f"{mass:,.0f} kg" if mass >= 100 else f"{mass:.3g} kg"),
        ("made of", f"{statics.material or 'a material of the preset'}, {length(statics.thickness)} thick"),
        ("sheet", f"{sheet.area:.4g} m2, {sheet.area / design.surface.area:.0%} of the surface"),
    ]
    if judged:
        worst = design.member_utilisation.by_member
        name = max(worst, key=lambda member: worst[member])
        figures.append(("most used", f"{name}: {worst[name]:.0%} of its capacity"))
    return figures


def assembly_page(plan: WorkshopPlan, design: Design, judged: bool = False) -> str:
    """Return the text of the interactive page, an HTML file. The plan must have members.
    judged : True for a page for clients, with utilisation and without links to drawings."""
    assert plan.graph is not None
    preset, graph = design.preset, plan.graph
    load = design.load if design.has("statics") else None
    faces, words = drawn_faces(plan, PAPER), _bar_words(plan) if plan.bars else {}
    facts = {
        "name": preset.name,
        "line": f"{len({part.member for part in plan.parts} - {''})} members, {len(plan.parts)} parts, "
        f"{len(plan.sheets)} sheets",
        "all": "All bars and plates" if plan.bars else "All members",
        "notes": list(plan.notes),
        "figures": key_figures(design, judged),
        "shades": colour_scales(plan, [face.id for face in faces], design if judged else None),
        "up": up_axis(graph.sheet.surface.V, design.surface, load).tolist(),
        "members": [
            {
                "id": face.id,
                "colour": [round(255 * x) for x in face.colour],
                "words": words[face.id] if plan.bars else _member_words(plan, face.id),
                "faces": face.quads.round(5 if plan.model else 3).ravel().tolist(),
            }
            for face in faces
        ],
        "built": _refolded_parts(plan, faces),
        "parts": [_part_facts(plan, number, has_drawing=not judged) for number in range(len(plan.parts))],
        "sheets": _sheet_facts(plan),
    }
    template = files("dsfab.report.assembly").joinpath("page.html").read_text(encoding="utf-8")
    text = json.dumps(facts, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    title = escape(f"{preset.name}: {'structure' if judged else 'workshop'}")
    return template.replace("{{title}}", title).replace("{{style}}", page_style()).replace("{{facts}}", text)


def _refolded_parts(plan: WorkshopPlan, faces: list[MemberFaces]) -> list[dict[str, Any]]:
    if plan.bars:
        return []
    piece, parts = piece_length(faces), []
    for strip in refolded_plan(plan).strips:
        quads = strip_quads(strip, piece, plan.planks is not None)
        parts.append({"id": strip.id, "member": strip.member, "faces": quads.round(3).ravel().tolist()})
    return parts


def _bar_words(plan: WorkshopPlan) -> dict[str, str]:
    assert plan.bars is not None
    words_by_name = {}
    for row in bar_table(plan).rows:
        name, start_node, end_node, _, bar_length, bar_width, _, dip, _, end_dip, twist, bow, _ = row
        words_by_name[str(name)] = (
            f"{bar_length:,.1f} x {bar_width:.1f} mm, from {start_node} ({dip:z.1f} degrees below the plate of the "
            f"node) to {end_node} ({end_dip:z.1f} degrees); twisted by {twist:z.1f} degrees; at most {bow:.1f} mm "
            f"from the curved axis"
        )
    bars = plan.bars.bar_lattice.bars
    for joint in plan.bars.bar_lattice.joints:
        words_by_name[joint.node.id] = "Plate with arms for " + ", ".join(bars[k].bay.id for k, _ in joint.bars)
    return words_by_name


def _member_words(plan: WorkshopPlan, name: str) -> str:
    assert plan.graph is not None
    member, nodes = plan.graph.by_id[name], plan.graph.nodes_along[name]
    size = f"{MM_PER_M * member.length:,.0f} x {MM_PER_M * member.mean_width:.0f} mm, " if member.axis else ""
    neighbours = dict.fromkeys(neighbour for node in nodes for neighbour in node.members if neighbour != name)
    return f"{size}{len(nodes)} nodes with {', '.join(neighbours)}" if neighbours else f"{size}no nodes"


def _part_facts(plan: WorkshopPlan, number: int, has_drawing: bool) -> dict[str, Any]:
    part = plan.parts[number]
    first_alike = next(group[0] for group in plan.equal_parts if number in group)
    return {
        "id": part.id,
        "member": part.id if plan.bars else part.member,
        "size": (MM_PER_M * part.size).round(1).tolist(),
        "sheet": plan.sheet_numbers[part.id],
        "file": f"{file_stem(plan.parts[first_alike].id)}.dxf" if has_drawing else "",
        "loops": [_loop_coordinates(part, loop) for loop in (part.outline, *part.slots)],
        "holes": [
            round(x, 1)
            for hole in part.holes
            for x in (*(MM_PER_M * (hole.at - _box_middle(part))).tolist(), MM_PER_M * hole.diameter)
        ],
    }


def _box_middle(part: FlatPart) -> Floats:
    return np.asarray((part.outline.min(axis=0) + part.outline.max(axis=0)) / 2)


def _loop_coordinates(part: FlatPart, loop: Floats) -> list[float]:
    closed = np.pad(np.concatenate([loop, loop[:1]]) - _box_middle(part), ((0, 0), (0, 1)))
    flat: list[float] = (MM_PER_M * simplified_line(closed, 3e-4)[:-1, :2]).round(1).ravel().tolist()
    return flat


def _sheet_facts(plan: WorkshopPlan) -> list[dict[str, Any]]:
    number = {part.id: k for k, part in enumerate(plan.parts)}
    facts = []
    for sheet in plan.sheets:
        parts = []
        for placement in sheet.parts:
            c, s = np.cos(placement.turn), np.sin(placement.turn)
            middle = _box_middle(placement.part) @ np.array([[c, s], [-s, c]]) + placement.shift
            x, y = (MM_PER_M * middle).round(2).tolist()
            parts.append([number[placement.part.id], round(float(np.degrees(placement.turn)), 3), x, y])
        facts.append({"size": [MM_PER_M * x for x in sheet.size], "used": f"{sheet.used_share:.0%}", "parts": parts})
    return facts
