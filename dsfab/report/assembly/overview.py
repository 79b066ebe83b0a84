"""Pages of the assembly book that show the structure."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.messages import count_phrase
from dsfab.core.units import MM_PER_M
from dsfab.members import Member, MemberGraph
from dsfab.render import Nameplate, place_names
from dsfab.report.assembly.axonometry import DRAWN_PIECES, Axonometry, MemberFaces, painted_faces
from dsfab.report.assembly.paper import HAIR, INK, PAGE, QUIET, RED, DrawingTransform, Paper, PaperBox
from dsfab.surface import simplified_line
from dsfab.workshop import Layering, RefoldedStrip, WorkshopPlan, is_strip, layer_numbers, refolded_plan

GRID_PER_MM = 8.0  # Grid cells per millimetre of paper; `place_names` moves names on this grid.


def draw_cover(
    paper: Paper, faces: list[MemberFaces], up: Floats, figures: list[tuple[str, str]], notes: list[str]
) -> None:
    """Draw the cover page: structure, key figures, notes. up : (3,) unit vector. figures : names and values."""
    wide = 128.0
    drawing = PaperBox(PAGE.x, PAGE.y, PAGE.wide - wide - 10, PAGE.high)
    draw_structure(paper, faces, Axonometry.from_angles(up), drawing, {})
    x, y = PAGE.x + PAGE.wide - wide, PAGE.y + PAGE.high - 6
    for name, value in figures:
        paper.text((x, y), name, 8.5, QUIET)
        paper.text((x + wide, y), value, 8.5, side="right", bold=True)
        paper.polylines([np.array([[x, y - 2], [x + wide, y - 2]])], HAIR, 0.4)
        y -= 6.4
    y -= 6
    for note in notes:
        bad = note.startswith("NOT ")
        for k, line in enumerate(paper.wrapped_lines(note, wide - 5, 8)):
            if k == 0:
                paper.text((x, y), "!" if bad else "·", 8, RED if bad else INK, bold=True)
            paper.text((x + 5, y), line, 8, RED if bad else INK)
            y -= 3.8
        y -= 1.6


def draw_structure(
    paper: Paper,
    faces: list[MemberFaces],
    view: Axonometry,
    box: PaperBox,
    colours: dict[str, tuple[float, float, float]],
    extent: Floats | None = None,
) -> DrawingTransform:
    """Draw members into a box of the page; return the map from metres of the view to millimetres of paper.
    colours : colours of some members, by name.    extent : (k, 2) points that the box must show, m, or None."""
    faces_in_order = painted_faces(faces, view, colours)
    extent = faces_in_order.corners.reshape(-1, 2) if extent is None else extent
    fitted = DrawingTransform.fit_to_box(extent.min(axis=0), extent.max(axis=0), box)
    paper.faces(faces_in_order, fitted)
    return fitted


def draw_named_view(paper: Paper, faces: list[MemberFaces], view: Axonometry) -> None:
    """Draw all members with their names on one page."""
    box = PaperBox(PAGE.x + 6, PAGE.y + 8, PAGE.wide - 12, PAGE.high - 14)
    fitted = draw_structure(paper, faces, view, box, {})
    letter = 2.5 * min(1.0, float(np.sqrt(120 / len(faces))))  # millimetres; smaller for over 120 members
    plates = [Nameplate(face.id, (0, 0, 0), *_name_places(face, view, fitted)) for face in faces]
    size = (int(GRID_PER_MM * (PAGE.wide + 2 * PAGE.x)), int(GRID_PER_MM * (PAGE.high + PAGE.y + 10)))
    names = place_names(plates, size, GRID_PER_MM * letter)
    points = 1.38 * letter * 72 / 25.4
    for name in names:
        if not np.array_equal(name.middle, name.anchor):
            paper.polylines([np.stack([name.anchor, name.middle]) / GRID_PER_MM], INK, 0.3)
    for name in names:
        x, y = (name.middle / GRID_PER_MM).tolist()
        half = paper.width(name.plate.text, points) / 2 + 0.4
        low, high = y - 0.62 * letter, y + 0.62 * letter
        paper.polygon(np.array([[x - half, low], [x + half, low], [x + half, high], [x - half, high]]), (1, 1, 1))
        paper.text((x, y - 0.48 * letter), name.plate.text, points, side="middle")
    if abs(view.upwards[2]) < 1e-9:
        paper.scale_bar((PAGE.x, PAGE.y), fitted.scale)


def _name_places(face: MemberFaces, view: Axonometry, fitted: DrawingTransform) -> tuple[Floats, Bools]:
    middles = face.quads.mean(axis=1)
    order = np.abs(np.arange(len(middles)) - len(middles) / 2).argsort(kind="stable")
    places = fitted.to_paper(view.projected(middles[order[:: max(len(order) // 15, 1)]]))
    return GRID_PER_MM * places, np.ones(len(places), dtype=bool)


def refolded_pages(
    plan: WorkshopPlan, faces: list[MemberFaces], up: Floats
) -> list[tuple[str, Callable[[Paper], None]]]:
    """Return title and drawing function of a page with flat parts bent into their final shape; [] without bent parts.
    up : (3,) unit vector, upwards."""
    parts_in_space = refolded_plan(plan)
    if not parts_in_space.strips:
        return []
    colours = {strip.id: strip.colour for strip in faces}
    piece = piece_length(faces)
    parts = [
        MemberFaces(strip.id, colours[strip.member], strip_quads(strip, piece, plan.planks is not None))
        for strip in parts_in_space.strips
    ]
    caption = (
        f"The picture shows {len(parts)} flat parts, bent into their final shape with the lengths from the drawings."
    )
    if len(parts_in_space.deviations):
        number, gap = len(parts_in_space.deviations), MM_PER_M * parts_in_space.deviations.max()
        away = f"are up to {gap:.2g} mm away from"
        holes = f" {number} holes at nodes {away} the axis of the bolt."
        slots = f" At {count_phrase(number, 'node')}, the slots of two planks {away} each other."
        caption += slots if plan.planks else holes
    plates = len(plan.parts) - len(parts)
    caption += f" {plates} {'plate is' if plates == 1 else 'plates are'} not bent back." if plates else ""
    return [("Flat parts bent into their final shape", _refolded_page(faces, parts, up, caption))]


def piece_length(faces: list[MemberFaces]) -> float:
    """Return the length (m) of the straight pieces that approximate a curved part in a drawing."""
    corners = np.concatenate([face.quads.reshape(-1, 3) for face in faces])
    return float(np.linalg.norm(np.ptp(corners, axis=0))) / DRAWN_PIECES


def strip_quads(strip: RefoldedStrip, piece: float, slotted: bool = False) -> Floats:
    """Return a bent strip as quadrilaterals (q, 4, 3), about `piece` m long. slotted : True to divide at corners."""
    if slotted:
        rows = simplified_line(strip.edges.reshape(-1, 6), 1e-3).reshape(-1, 2, 3)
    else:
        length = float(np.linalg.norm(np.diff(strip.edges.mean(axis=1), axis=0), axis=1).sum())
        count = max(int(np.ceil(length / piece)), 1)
        rows = strip.edges[np.unique(np.linspace(0, len(strip.edges) - 1, count + 1).round().astype(int))]
    right_edge, left_edge = rows[:, 0], rows[:, 1]
    return np.stack([right_edge[:-1], right_edge[1:], left_edge[1:], left_edge[:-1]], axis=1)


def _refolded_page(
    faces: list[MemberFaces], parts: list[MemberFaces], up: Floats, caption: str
) -> Callable[[Paper], None]:
    view = Axonometry.from_angles(up)
    extent = np.concatenate([view.projected(face.quads).reshape(-1, 2) for face in (*faces, *parts)])

    def draw(paper: Paper) -> None:
        foot = 24.0  # the captions need 24 millimetres
        room = PaperBox(PAGE.x, PAGE.y + foot, PAGE.wide, PAGE.high - foot)
        captions = ("Members, as they are designed", caption)
        for shown_faces, cell, words in zip((faces, parts), room.cells(2, 1, 10.0), captions, strict=True):
            fitted = draw_structure(paper, shown_faces, view, cell, {}, extent)
            below = float(fitted.to_paper(extent)[:, 1].min()) - 10
            for row, line in enumerate(paper.wrapped_lines(words, cell.wide, 10)):
                paper.text((cell.x, below - 4.8 * row), line, 10, QUIET)

    return draw


STEP_PICTURES = 12  # Approximate number of steps, each with a picture.

LAYER_RULE = (
    "Assemble each layer before the layer above it: at every node, bolt the upper member onto the lower member. "
    "Within a layer, assemble members in the order of the heights of their lowest points; order members of equal "
    "height by name. If no bolt holds a member yet, prop the member until the next layer is bolted on."
)
"""Rule for the order of `assembly_steps`, printed for the builders."""


@dataclass(frozen=True)
class AssemblyStep:
    """A step of assembly. members : names of members to add. layer : number of layers above these members."""

    layer: int
    members: tuple[str, ...]


def assembly_steps(graph: MemberGraph, layering: Layering, up: Floats) -> tuple[AssemblyStep, ...]:
    """Return the steps of assembly of members in layers. up : (3,) unit vector.
    A member appears once in each of its layers."""
    return _ordered_steps(graph, up, partial(layer_numbers, layering))


PLANK_RULE = (
    "First place and prop the planks whose slots are open above: {first}. Then put on the other planks: {then}, each "
    "piece along the mean normal of its slots. Within a family, place members in the order of the heights of their "
    "lowest points; order members of equal height by name. Close a splice when both pieces are in place."
)
"""Rule for the order of `plank_steps`, printed for the builders."""
FAMILY_WORDS = {"major": "family A", "minor": "family B", "rim": "edges", "keep": "planks around supports and loads"}


def plank_rule(plan: WorkshopPlan) -> str:
    """Return `PLANK_RULE` with the names of the plan's families of members inserted."""
    assert plan.graph is not None
    assert plan.planks is not None
    families = {member.family for member in plan.graph.members if is_strip(member)}
    first_family, *next_families = [FAMILY_WORDS[family] for family in plan.planks.planks.order if family in families]
    return PLANK_RULE.format(first=first_family, then=", then ".join(next_families))


def plank_steps(plan: WorkshopPlan, up: Floats) -> tuple[AssemblyStep, ...]:
    """Return the steps of assembly of planks. up : (3,) unit vector, upwards."""
    assert plan.graph is not None
    assert plan.planks is not None
    built, order = {part.member for part in plan.parts}, plan.planks.planks.order

    def numbers(member: Member) -> tuple[int, ...]:
        if member.id not in built:
            return ()
        return (len(order) - 1 - order.index(member.family) if is_strip(member) else -1,)

    return _ordered_steps(plan.graph, up, numbers)


def _ordered_steps(
    graph: MemberGraph, up: Floats, numbers: Callable[[Member], tuple[int, ...]]
) -> tuple[AssemblyStep, ...]:
    surface = graph.sheet.surface
    z = surface.V @ up
    heights = {member.id: float(z[surface.F[member.cells]].min()) for member in graph.members}
    span = max(max(heights.values()) - min(heights.values()), 1e-9)
    level = 0.02  # if height difference / height of structure is below this, members are sorted by name
    entries = [
        (number, round(heights[member.id] / span / level), k, member.id)
        for k, member in enumerate(graph.members)
        for number in numbers(member)
    ]
    entries.sort(key=lambda entry: (-entry[0], *entry[1:]))
    per_step = max(int(np.ceil(len(entries) / STEP_PICTURES)), 1)
    steps = []
    for number, group in groupby(entries, key=lambda entry: entry[0]):
        names = [name for *_, name in group]
        steps += [AssemblyStep(number, tuple(names[k : k + per_step])) for k in range(0, len(names), per_step)]
    return tuple(steps)


ACROSS, DOWN = 3, 2  # Columns and rows of pictures on a page, with one picture for each step.
STANDING_COLOUR = (0.82, 0.81, 0.79)  # Colour of members that earlier steps have assembled.


def step_pages(
    steps: tuple[AssemblyStep, ...], faces: list[MemberFaces], up: Floats, rule: str
) -> list[tuple[str, Callable[[Paper], None]]]:
    """Return title and drawing function of each page. A page has a picture of each of its assembly steps.
    up : (3,) unit vector, upwards.    rule : text on the pages."""
    pages, per_page = [], ACROSS * DOWN
    for k in range(0, len(steps), per_page):
        title = f"Assembly: steps {k + 1} to {min(k + per_page, len(steps))} of {len(steps)}"
        pages.append((title, _steps_page(steps, k, faces, (up, rule))))
    return pages


def _steps_page(
    steps: tuple[AssemblyStep, ...], first_step: int, faces: list[MemberFaces], view_and_rule: tuple[Floats, str]
) -> Callable[[Paper], None]:
    up, rule = view_and_rule
    view = Axonometry.from_angles(up)
    extent = np.concatenate([view.projected(face.quads).reshape(-1, 2) for face in faces])

    def draw(paper: Paper) -> None:
        top = PAGE.y + PAGE.high
        for k, line in enumerate(paper.wrapped_lines(rule, PAGE.wide, 8)):
            paper.text((PAGE.x, top - 3 - 3.8 * k), line, 8, QUIET)
        room = PaperBox(PAGE.x, PAGE.y, PAGE.wide, PAGE.high - 13)
        step_numbers = range(first_step, min(first_step + ACROSS * DOWN, len(steps)))
        for k, cell in zip(step_numbers, room.cells(ACROSS, DOWN, 8.0), strict=False):
            _draw_step(paper, steps, k, faces, cell, (view, extent))

    return draw


def _draw_step(
    paper: Paper,
    steps: tuple[AssemblyStep, ...],
    k: int,
    faces: list[MemberFaces],
    cell: PaperBox,
    view_and_extent: tuple[Axonometry, Floats],
) -> None:
    (view, extent), count = view_and_extent, 3  # text lines below a picture
    added = set(steps[k].members)
    standing = {name for step in steps[:k] for name in step.members} - added
    visible = [face for face in faces if face.id in added or face.id in standing]
    foot = 5.0 + 3.4 * count
    picture = PaperBox(cell.x, cell.y + foot, cell.wide, cell.high - foot)
    draw_structure(paper, visible, view, picture, dict.fromkeys(standing, STANDING_COLOUR), extent)
    paper.text((cell.x, cell.y + foot - 3), f"{k + 1}", 12, bold=True)
    lines = paper.wrapped_lines(", ".join(steps[k].members), cell.wide - 10, 8)
    if len(lines) > count:
        lines = [*lines[: count - 1], f"... to {steps[k].members[-1]}"]
    for row, line in enumerate(lines):
        paper.text((cell.x + 8, cell.y + foot - 3 - 3.4 * row), line, 8)
