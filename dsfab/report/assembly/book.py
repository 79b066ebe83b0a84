"""The book `assembly.pdf` for cutting and assembly."""

import io
from collections.abc import Callable
from functools import partial

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.core.units import MM_PER_M
from dsfab.design import Design
from dsfab.render import PAPER, up_axis
from dsfab.report.assembly.axonometry import Axonometry, MemberFaces, drawn_faces, faces_by_member
from dsfab.report.assembly.bar_pages import BAR_RULE, BARS_UNCHECKED, bar_figures, bar_pages, bar_steps, joint_pages
from dsfab.report.assembly.card_model import MODEL_UNCHECKED, model_figures, model_pages
from dsfab.report.assembly.flat_parts import cut_list_pages, family_pages, nest_pages, node_pages, sheet_figures
from dsfab.report.assembly.overview import (
    LAYER_RULE,
    AssemblyStep,
    assembly_steps,
    draw_cover,
    draw_named_view,
    plank_rule,
    plank_steps,
    refolded_pages,
    step_pages,
)
from dsfab.report.assembly.paper import HAIR, INK, MARGIN, PAGE, PAPER_HEIGHT, PAPER_WIDTH, QUIET, Paper
from dsfab.report.pdf_pages import MM, fonts
from dsfab.workshop import WorkshopPlan

BookPage = tuple[str, Callable[[Paper], None]]

LAYERS_UNCHECKED = (
    "whether bolts and splices are strong enough, and whether layers slide on each other: dsfab checked the design as "
    "one sheet",
    "the strength of the structure during assembly, and of props and scaffolding",
    "springback and creep of bent layers",
    "effects of moisture, grain and knots; required distances of bolts from edges and ends (see the material's "
    "standard)",
    "the bearings, which hold the structure at its supports",
)
"""Risks of bent layers that dsfab does not check, for the last page of `assembly.pdf`."""


def assembly_pdf(plan: WorkshopPlan, design: Design) -> bytes:
    """Return the bytes of `assembly.pdf`."""
    from reportlab.pdfgen.canvas import Canvas

    name, file = design.preset.name, io.BytesIO()
    canvas = Canvas(file, pagesize=(PAPER_WIDTH * MM, PAPER_HEIGHT * MM), invariant=1, pageCompression=1)
    canvas.setTitle(f"{name}: assembly")
    canvas.setAuthor("dsfab")
    regular, bold, _ = fonts(name)
    paper = Paper(canvas, (regular, bold))
    pages = book_pages(plan, design)
    for number, (title, draw) in enumerate(pages, 1):
        draw(paper)
        _header_and_footer(paper, name, title, f"{number} / {len(pages)}")
        canvas.showPage()
    canvas.save()
    return file.getvalue()


def book_pages(plan: WorkshopPlan, design: Design) -> list[BookPage]:
    """Return titles and drawings of all pages."""
    flat_pages = [*cut_list_pages(plan), *nest_pages(plan)]
    last_page = ("What was not checked", partial(_unchecked_page, plan=plan))
    if plan.graph is None:
        return [*flat_pages, last_page]
    load = design.load if design.has("statics") else None
    up = up_axis(plan.graph.sheet.surface.V, design.surface, load)
    faces, figures, notes = drawn_faces(plan, PAPER), _key_figures(plan, design), list(plan.notes)
    pages: list[BookPage] = [("Assembly", partial(draw_cover, faces=faces, up=up, figures=figures, notes=notes))]
    pages += joint_pages(plan) if plan.bars else [] if plan.planks else model_pages(plan)
    pages += _view_pages(faces_by_member(faces, plan) if plan.bars else faces, up)
    if plan.planks or plan.layering:
        pages += refolded_pages(plan, faces, up)
    pages += [*family_pages(plan), *(bar_pages(plan) if plan.bars else []), *flat_pages]
    if plan.route == "panels":
        return [*pages, last_page]
    steps, rule = _steps(plan, up)
    return [*pages, *node_pages(plan), *step_pages(steps, faces, up, rule), last_page]


def _steps(plan: WorkshopPlan, up: Floats) -> tuple[tuple[AssemblyStep, ...], str]:
    if plan.planks:
        return plank_steps(plan, up), plank_rule(plan)
    if plan.bars:
        return bar_steps(plan, up), BAR_RULE
    assert plan.graph is not None
    assert plan.layering is not None
    return assembly_steps(plan.graph, plan.layering, up), LAYER_RULE


def _view_pages(faces: list[MemberFaces], up: Floats) -> list[BookPage]:
    views = (
        ("Members, from above", Axonometry.from_angles(up, -90.0, 90.0)),
        ("Members, from the front", Axonometry.from_angles(up)),
        ("Members, from behind", Axonometry.from_angles(up, 122.0)),
    )
    return [(title, partial(draw_named_view, faces=faces, view=view)) for title, view in views]


def _key_figures(plan: WorkshopPlan, design: Design) -> list[tuple[str, str]]:
    graph, preset = plan.graph, design.preset
    assert graph is not None
    size = np.ptp(graph.sheet.surface.V, axis=0)
    area = sum(part.area for part in plan.parts if not part.thickness)
    bolts = {hole.bolt for part in plan.parts for hole in part.holes}
    longest = max(plan.parts, key=lambda part: part.size[0])
    if plan.model:
        return model_figures(plan)
    if plan.bars:
        return bar_figures(plan, design)
    if plan.planks:
        layers = [("Depth of planks", length(plan.planks.stock.depth)), ("Thickness", length(plan.thickness))]
        joints = ("Nodes with slots", str(len(plan.planks.planks.crossings.crossings)))
    else:
        layers = [("Thickness of a layer", length(plan.thickness))]
        layers += [("Layers where two members cross", str(preset.workshop.layers))]
        joints = (
            "Nodes and splices that are joined with bolts",
            f"{len(bolts)}, bolts of {length(preset.workshop.bolt)}",
        )
    members, total_length = {part.member for part in plan.parts}, sum(member.length for member in graph.members)
    statics = preset.statics
    return [
        ("Size over all", " x ".join(f"{x:.2f}" for x in size) + " m"),
        ("Members", f"{len(members)}, together {total_length:,.0f} m"),
        ("Parts", f"{len(plan.parts)}, {len(plan.equal_parts)} different"),
        ("Longest part", f"{longest.id}, {MM_PER_M * longest.size[0]:,.0f} mm"),
        *sheet_figures(plan),
        *layers,
        joints,
        ("Mass of all parts", f"{area * plan.thickness * statics.density:,.0f} kg"),
        ("Material", statics.material or f"{statics.density:g} kg/m³, {statics.young / 1e9:g} GPa"),
    ]


PLANKS_UNCHECKED = (
    "whether slotted planks, splices and glue are strong enough: dsfab checked one continuous sheet, not upright "
    "planks",
    "whether the unfinished structure stands at each stage, and which props and scaffolding it needs",
    "inner corners of slots: a round cutter leaves its radius there; cut the corners square by hand, or over-cut them",
    "the stress in twisted planks, and how far they spring back",
    "effects of moisture, grain and knots; required distances of bolts from edges and ends (see the material's "
    "standard)",
    "the bearings, which hold the structure at its supports",
)
"""Risks of upright planks that dsfab does not check, for the last page of the assembly book."""


def _unchecked_points(plan: WorkshopPlan) -> tuple[str, ...]:
    if plan.model:
        return MODEL_UNCHECKED
    return BARS_UNCHECKED if plan.bars else PLANKS_UNCHECKED if plan.planks else LAYERS_UNCHECKED


def _unchecked_page(paper: Paper, plan: WorkshopPlan) -> None:
    x, y = PAGE.x, PAGE.y + PAGE.high - 8
    blocks = (("Not checked by dsfab:", _unchecked_points(plan)), ("Notes on this plan:", plan.notes))
    for head, notes in blocks:
        paper.text((x, y), head, 11, bold=True)
        y -= 7
        for note in notes:
            for k, line in enumerate(paper.wrapped_lines(note, 240, 10)):
                if k == 0:
                    paper.text((x, y), "·", 10)
                paper.text((x + 5, y), line, 10)
                y -= 5
            y -= 1.5
        y -= 6


def _header_and_footer(paper: Paper, name: str, title: str, number: str) -> None:
    top, right = PAPER_HEIGHT - 16, PAPER_WIDTH - MARGIN
    paper.text((MARGIN, top), name, 15, bold=True)
    paper.text((MARGIN + paper.width(name, 15, bold=True) + 6, top), title, 15, QUIET)
    paper.polylines([np.array([[MARGIN, top - 4], [right, top - 4]])], INK, 0.8)
    paper.polylines([np.array([[MARGIN, 10.5], [right, 10.5]])], HAIR, 0.5)
    paper.text((MARGIN, 6.5), f"dsfab {__version__} · seen from the side to which normals point · A3", 7.5, QUIET)
    paper.text((right, 6.5), number, 7.5, QUIET, "right")
