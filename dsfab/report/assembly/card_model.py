"""The page on how to cut and build a model from card."""

from collections.abc import Callable, Iterator

import numpy as np

from dsfab.core.messages import count_phrase, length
from dsfab.core.units import MM_PER_M
from dsfab.report.assembly.flat_parts import PartsPage, sheet_figures
from dsfab.report.assembly.paper import HAIR, INK, PAGE, QUIET, DrawingTransform, Paper, PaperBox, usual_scale
from dsfab.workshop import FlatPart, WorkshopPlan

MODEL_UNCHECKED = (
    "whether the model stands without glue; dsfab checked the material of the full structure, not card",
    "the width of your laser's cut: slots are 0.2 mm wider than tabs, so first cut one slot and one tab as a trial",
    "the direction of the card's grain: long strips bend more evenly along the grain",
    "overlaps of members in one layer, as at a crown: trim these members with a knife",
)
"""Risks of a card model that dsfab does not check, for the last page of `assembly.pdf`."""
PANEL_STEPS = (
    (
        "Sort",
        "Each panel has an engraved name: B07.3 is the third panel of member B07, counted from the beginning of the "
        "member. The pages of each family show in which order members cross.",
    ),
    (
        "Bend",
        "Pull panels over a table's edge, engraved face up, until the panels keep about the structure's curvature.",
    ),
    (
        "Build from the base",
        "First glue the members that lie along the ground onto the engraved lines. Then put each end that stands on "
        "the ground into the slot with the name of its part.",
    ),
    (
        "Then from the edges",
        "Build edges and kept material around supports and loads first, then family A. Glue the panels of a member end "
        "to end, with the tab of each panel beneath the next panel. Then put the members of family B between the "
        "members of family A. The panels of family B end at short marks on the edges of family A, with tabs beneath "
        "these edges. Put a drop of glue on each tab.",
    ),
    ("Plates", "Glue each plate beneath the ends of its members, with the middle of the plate between these ends."),
)
"""Steps for a model of panels, after cutting: title and instruction."""

TEXT_WIDTH = 150.0  # Width of the text, mm; the drawing of the base plate is beside it.
FAMILY_WORDS = {"major": "A", "minor": "B", "rim": "rim", "keep": "rings and bands around supports and loads"}


def model_figures(plan: WorkshopPlan) -> list[tuple[str, str]]:
    """Return names and values of the key figures of a model."""
    assert plan.graph is not None
    size = MM_PER_M * np.ptp(plan.graph.sheet.surface.V, axis=0)
    pins = {hole.bolt for part in plan.parts for hole in part.holes}
    longest = max(plan.parts, key=lambda part: part.size[0])
    layering = plan.layering
    joints = (
        [("Nodes and splices that are joined with pins", f"{len(pins)}, holes of {length(layering.bolt)}")]
        if layering
        else []
    )
    return [
        ("Model", f"1:{plan.model:g}"),
        ("Size over all", " x ".join(f"{x:.0f}" for x in size) + " mm"),
        ("Members", f"{len({part.member for part in plan.parts} - {''})}"),
        ("Parts", f"{len(plan.parts)}, {len(plan.equal_parts)} different"),
        ("Longest part", f"{longest.id}, {MM_PER_M * longest.size[0]:,.0f} mm"),
        *sheet_figures(plan, "Sheets of card"),
        ("Thickness of the card", length(plan.thickness)),
        *joints,
    ]


def model_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return the page for a model of members; [] for a structure at full size."""
    return [(f"Building the model at 1:{plan.model:g}", _model_page(plan))] if plan.model and plan.graph else []


def _model_page(plan: WorkshopPlan) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        x, y = PAGE.x, PAGE.y + PAGE.high - 8
        for number, (head, words) in enumerate(_model_steps(plan), 1):
            paper.text((x, y), f"{number}", 12, bold=True)
            paper.text((x + 8, y), head, 10, bold=True)
            y -= 5.5
            for line in paper.wrapped_lines(words, TEXT_WIDTH - 8, 9):
                paper.text((x + 8, y), line, 9)
                y -= 4.4
            y -= 5
        plates = [part for part in plan.parts if part.id.startswith("base")]
        if plates:
            _base_plate_drawing(paper, plates)

    return draw


def _model_steps(plan: WorkshopPlan) -> Iterator[tuple[str, str]]:
    yield (
        "Cut",
        f"Send the files sheet_1, sheet_2 and so on (DXF or SVG, millimetres) to the laser, on card of "
        f"{length(plan.thickness)}. Use this order of layers: ENGRAVE (green) at low power, HOLES (blue) and SLOTS "
        "(magenta), then CUT (red). STOCK (grey) is the edge of the sheet and is not cut. Names are on the outer face.",
    )
    if plan.layering is None:
        stands = any(part.id.startswith("base") for part in plan.parts)
        yield from (step for step in PANEL_STEPS if stands or step[0] != "Build from the base")
        return
    pins = length(plan.layering.bolt)
    yield (
        "Sort",
        "Each part has an engraved name: A01.2 is the second piece of member A01, and A01.c1 is the cover of its "
        "first splice. Beside each hole is the name of its node: holes with the same name belong together.",
    )
    yield (
        "Bend",
        "Pull strips over a table's edge, engraved face up, until the strips keep about the structure's curvature.",
    )
    yield (
        "Splice",
        "Glue the pieces of a strip end to end. Glue a cover across each splice: on the outside for family A, and on "
        "the inside for all other members.",
    )
    names = {part.member for part in plan.parts if part.member}
    yield (
        "Build from the base",
        f"{_layer_order(plan, names)} Put each tab into the slot that bears its name. At each node put glue between "
        f"strips, and push a {pins} pin through both holes.{_packing_words(plan)} Pull the pins when the glue is dry.",
    )


def _layer_order(plan: WorkshopPlan, names: set[str]) -> str:
    graph, layering = plan.graph, plan.layering
    assert graph is not None
    assert layering is not None
    families = {member.family for member in graph.members if member.id in names and member.family}
    ordered = sorted(families, key=lambda family: -layering.family_layers(family)[-1])
    shown = ", then ".join(FAMILY_WORDS.get(family, family) for family in ordered)
    plates = sorted(part.id for part in plan.parts if part.member and not len(part.axis))
    below = f"Plates ({', '.join(plates[:4])}{', ...' if len(plates) > 4 else ''}) are innermost. " if plates else ""
    return f"Layers from the inside: {shown}. {below}"


def _packing_words(plan: WorkshopPlan) -> str:
    squares = [part.id for part in plan.parts if not part.member and part.holes]
    if not squares:
        return ""
    nodes = count_phrase(len({name.partition(".")[0] for name in squares}), "node")
    return f" At {nodes}, squares ({squares[0]}, ...) go between the strips."


def _base_plate_drawing(paper: Paper, plates: list[FlatPart]) -> None:
    room = PaperBox(PAGE.x + TEXT_WIDTH + 12, PAGE.y, PAGE.wide - TEXT_WIDTH - 12, PAGE.high - 10)
    wide, high = max(part.size[0] for part in plates), max(part.size[1] for part in plates)
    across = min(len(plates), max(1, round(float(np.sqrt(len(plates) * high / wide * room.wide / room.high)))))
    down = -(-len(plates) // across)
    largest_scale = min((room.wide / across - 6) / wide, (room.high / down - 10) / high)
    scale, scale_name = usual_scale(largest_scale)
    for part, cell in zip(plates, room.cells(across, down, 6.0), strict=False):
        middle = (part.outline.min(axis=0) + part.outline.max(axis=0)) / 2
        fitted = DrawingTransform.fit_to_box(middle - part.size / 2, middle + part.size / 2, cell, scale)
        paper.polylines([fitted.to_paper(mark) for mark in part.marks], QUIET, 0.3)
        if part.slots:
            paper.polylines([fitted.to_paper(slot) for slot in part.slots], INK, 0.5, closed=True)
        paper.polylines([fitted.to_paper(part.outline)], INK, 0.7, closed=True)
    names = ", ".join(part.id for part in plates[:6])
    words = f"{names}, {scale_name}: slots, with the names of the parts that stand in the slots"
    paper.text((room.x, PAGE.y + PAGE.high - 6), words, 8)
    paper.polylines([np.array([[room.x - 6, PAGE.y], [room.x - 6, PAGE.y + PAGE.high]])], HAIR, 0.4)
