"""The interactive page of a structure: a click on a member shows its flat parts and their sheets."""

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
from dsfab.report.assembly.axonometry import MemberFaces, bar_faces, member_faces, plank_faces, skin_faces
from dsfab.report.assembly.overview import piece_length, strip_quads
from dsfab.report.html_pages import style
from dsfab.surface import simplified_line
from dsfab.workshop import FlatPart, WorkshopPlan, bar_table, file_stem, refolded


def page_shades(plan: WorkshopPlan, names: list[str], judged: Design | None) -> list[dict[str, Any]]:
    """Return the scales by which the page colours members: name, unit, and a value or None for each of `names`.

    judged : design whose member forces give more scales, which takes seconds. Raises StaticsError then without a
    strength, or if nothing carries its loads.
    """
    assert plan.graph is not None
    members = plan.graph.by_id
    longest: dict[str, float] = {}
    for part in plan.parts:
        for name in (part.member, part.id):
            longest[name] = max(longest.get(name, 0.0), float(np.max(part.size)))
    axes = {name: members[name].length for name in names if name in members and members[name].axis}
    wide = {name: MM_PER_M * members[name].mean_width for name in axes}
    found = [
        _shade("length", "m", {**{name: longest[name] for name in names if name in longest}, **axes}, names, 2),
        _shade("width", "mm", wide, names, 0),
    ]
    if judged:
        found += _judged(judged, names)
    return [one for one in found if len({*one["values"]} - {None}) > 1]


def _judged(design: Design, names: list[str]) -> list[dict[str, Any]]:
    normal = {
        name: max((float(table[np.abs(table[:, 0]).argmax(), 0]) / 1e3 for table in one.forces.values()), key=abs)
        for name, one in design.member_forces.items()
        if len(one.s)
    }
    full = {name: 100 * value for name, value in design.member_utilisation.by_member.items()}
    return [_shade("utilisation", "%", full, names, 1), _shade("normal force N", "kN", normal, names, 2)]


def _shade(name: str, unit: str, values: dict[str, float], names: list[str], digits: int) -> dict[str, Any]:
    return {
        "name": name,
        "unit": unit,
        "values": [round(values[one], digits) if one in values else None for one in names],
    }


def page_figures(plan: WorkshopPlan, design: Design, judged: bool) -> list[tuple[str, str]]:
    """Return the key figures: names and values."""
    statics, box = design.preset.statics, np.ptp(design.surface.V, axis=0)
    sheet = design.sheet.surface
    mass = sheet.area * statics.thickness * statics.density  # making the solid would take longer than the page
    found = [
        ("size", " x ".join(length(float(side)) for side in box)),
        ("mass", f"{mass:,.0f} kg" if mass >= 100 else f"{mass:.3g} kg"),
        ("made of", f"{statics.material or 'a material of the preset'}, {length(statics.thickness)} thick"),
        ("sheet", f"{sheet.area:.4g} m2, {sheet.area / design.surface.area:.0%} of the surface"),
    ]
    if judged:
        worst = design.member_utilisation.by_member
        name = max(worst, key=lambda one: worst[one])
        found.append(("most used", f"{name}: {worst[name]:.0%} of what it can bear"))
    return found


def assembly_page(plan: WorkshopPlan, design: Design, judged: bool = False) -> str:
    """Return the page as one HTML file that loads nothing from the network; the same plan gives the same page.

    judged : also colour members by force and utilisation: a page for clients, without the workshop's drawings.
    The plan must have members.
    """
    assert plan.graph is not None
    preset, graph = design.preset, plan.graph
    load = design.load if design.has("statics") else None
    faces, words = _faces(plan), _bar_words(plan) if plan.bars else {}
    facts = {
        "name": preset.name,
        "line": f"{len({part.member for part in plan.parts} - {''})} members, {len(plan.parts)} parts, "
        f"{len(plan.sheets)} sheets",
        "all": "All bars and plates" if plan.bars else "All members",
        "notes": list(plan.notes),
        "figures": page_figures(plan, design, judged),
        "shades": page_shades(plan, [one.id for one in faces], design if judged else None),
        "up": up_axis(graph.sheet.surface.V, design.surface, load).tolist(),
        "members": [
            {
                "id": one.id,
                "colour": [round(255 * x) for x in one.colour],
                "words": words[one.id] if plan.bars else _words(plan, one.id),
                "faces": one.quads.round(5 if plan.model else 3).ravel().tolist(),
            }
            for one in faces
        ],
        "built": _built(plan, faces),
        "parts": [_part(plan, number, drawn=not judged) for number in range(len(plan.parts))],
        "sheets": _sheets(plan),
    }
    template = files("dsfab.report.assembly").joinpath("page.html").read_text(encoding="utf-8")
    text = json.dumps(facts, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    title = escape(f"{preset.name}: {'structure' if judged else 'workshop'}")
    head = template.replace("{{title}}", title).replace("{{style}}", style())
    return head.replace("{{facts}}", text)


def _faces(plan: WorkshopPlan) -> list[MemberFaces]:
    if plan.planks:
        return plank_faces(plan, PAPER)
    if plan.route == "panels":
        return skin_faces(plan, PAPER)
    if plan.layering is None:
        return bar_faces(plan, PAPER)
    assert plan.graph is not None
    built = {part.member for part in plan.parts}
    return [one for one in member_faces(plan.graph, PAPER, plan.layering) if one.id in built]


def _built(plan: WorkshopPlan, faces: list[MemberFaces]) -> list[dict[str, Any]]:
    """Flat parts bent back into space, metres; none if the page shows members as their parts anyway."""
    if plan.bars:
        return []
    piece = piece_length(faces)
    return [
        {
            "id": one.id,
            "member": one.member,
            "faces": strip_quads(one, piece, plan.planks is not None).round(3).ravel().tolist(),
        }
        for one in refolded(plan).strips
    ]


def _chosen(part: FlatPart, plan: WorkshopPlan) -> str:
    return part.id if plan.bars else part.member


def _bar_words(plan: WorkshopPlan) -> dict[str, str]:
    assert plan.bars is not None
    found = {}
    for row in bar_table(plan).rows:
        name, one, two, _, long, wide, _, dip, _, other, twist, bow, _ = row
        found[str(name)] = (
            f"{long:,.1f} x {wide:.1f} mm, from {one} ({dip:z.1f} degrees below its plate) to {two} ({other:z.1f}); "
            f"turned by {twist:z.1f} degrees; {bow:.1f} mm from the curved axis"
        )
    bars = plan.bars.found.bars
    for joint in plan.bars.found.joints:
        found[joint.node.id] = "Plate with arms for " + ", ".join(bars[k].bay.id for k, _ in joint.bars)
    return found


def _words(plan: WorkshopPlan, name: str) -> str:
    assert plan.graph is not None
    member, nodes = plan.graph.by_id[name], plan.graph.along[name]
    size = f"{MM_PER_M * member.length:,.0f} x {MM_PER_M * member.mean_width:.0f} mm, " if member.axis else ""
    others = dict.fromkeys(other for node in nodes for other in node.members if other != name)
    return f"{size}{len(nodes)} nodes with {', '.join(others)}" if others else f"{size}no nodes"


def _part(plan: WorkshopPlan, number: int, drawn: bool) -> dict[str, Any]:
    """Facts of a flat part; `drawn`: a drawing lies beside the page."""
    part = plan.parts[number]
    same = next(group[0] for group in plan.same if number in group)
    return {
        "id": part.id,
        "member": _chosen(part, plan),
        "size": (MM_PER_M * part.size).round(1).tolist(),
        "sheet": plan.sheet_of[part.id],
        "file": f"{file_stem(plan.parts[same].id)}.dxf" if drawn else "",
        "loops": [_loop(part, loop) for loop in (part.outline, *part.slots)],
        "holes": [
            round(x, 1)
            for hole in part.holes
            for x in (*(MM_PER_M * (hole.at - _middle(part))).tolist(), MM_PER_M * hole.diameter)
        ],
    }


def _middle(part: FlatPart) -> Floats:
    return np.asarray((part.outline.min(axis=0) + part.outline.max(axis=0)) / 2)


def _loop(part: FlatPart, loop: Floats) -> list[float]:
    """x y of a closed line about the middle of the part's box, millimetres."""
    closed = np.pad(np.concatenate([loop, loop[:1]]) - _middle(part), ((0, 0), (0, 1)))
    flat: list[float] = (MM_PER_M * simplified_line(closed, 3e-4)[:-1, :2]).round(1).ravel().tolist()
    return flat


def _sheets(plan: WorkshopPlan) -> list[dict[str, Any]]:
    """Sheets with their parts: number, turn in degrees, and place of the middle of the box, millimetres."""
    number = {part.id: k for k, part in enumerate(plan.parts)}
    found = []
    for sheet in plan.sheets:
        parts = []
        for one in sheet.parts:
            c, s = np.cos(one.turn), np.sin(one.turn)
            x, y = (MM_PER_M * (_middle(one.part) @ np.array([[c, s], [-s, c]]) + one.shift)).round(2).tolist()
            parts.append([number[one.part.id], round(float(np.degrees(one.turn)), 3), x, y])
        found.append({"size": [MM_PER_M * x for x in sheet.size], "used": f"{sheet.used:.0%}", "parts": parts})
    return found
