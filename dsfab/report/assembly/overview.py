"""The first pages of the book: cover, views with names, and flat parts bent back into space."""

from collections.abc import Callable

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.units import MM_PER_M
from dsfab.render import Nameplate, place_names
from dsfab.report.assembly.axonometry import DRAWN_PIECES, Axonometry, MemberFaces, painted_faces
from dsfab.report.assembly.paper import HAIR, INK, PAGE, QUIET, RED, DrawingTransform, Paper, PaperBox
from dsfab.surface import simplified_line
from dsfab.workshop import RefoldedStrip, WorkshopPlan, refolded_plan

GRID_PER_MM = 8.0  # Grid cells per millimetre of paper; `place_names` moves names on this grid.


def draw_cover(
    paper: Paper, faces: list[MemberFaces], up: Floats, figures: list[tuple[str, str]], notes: list[str]
) -> None:
    """Draw the structure; beside the drawing write its key figures, and the notes below them. up : (3,) unit vector."""
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
    """Draw members into a box of the page; `colours` by member replaces the colours of these members.
    extent : (k, 2) points that the box must show, metres; None shows all members."""
    faces_in_order = painted_faces(faces, view, colours)
    extent = faces_in_order.corners.reshape(-1, 2) if extent is None else extent
    fitted = DrawingTransform.fit_to_box(extent.min(axis=0), extent.max(axis=0), box)
    paper.faces(faces_in_order, fitted)
    return fitted


def draw_named_view(paper: Paper, faces: list[MemberFaces], view: Axonometry) -> None:
    """Draw all members with their names on one page."""
    box = PaperBox(PAGE.x + 6, PAGE.y + 8, PAGE.wide - 12, PAGE.high - 14)
    fitted = draw_structure(paper, faces, view, box, {})
    letter = 2.5 * min(
        1.0, float(np.sqrt(120 / len(faces)))
    )  # height in millimetres; over 120 members need smaller letters
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
    """Return a page of flat parts bent back into space; nothing for a plan without strips. up : (3,) unit vector."""
    parts_in_space = refolded_plan(plan)
    if not parts_in_space.strips:
        return []
    colours = {strip.id: strip.colour for strip in faces}
    piece = piece_length(faces)
    parts = [
        MemberFaces(strip.id, colours[strip.member], strip_quads(strip, piece, plan.planks is not None))
        for strip in parts_in_space.strips
    ]
    caption = f"{len(parts)} flat parts, bent back by their lengths on the drawings, each in its place."
    if len(parts_in_space.deviations):
        joint_words = "slots of two planks at nodes" if plan.planks else "holes at nodes"
        gap_words = "beside each other" if plan.planks else "off the line of their bolt"
        gap = MM_PER_M * parts_in_space.deviations.max()
        caption += f" {len(parts_in_space.deviations)} {joint_words} are up to {gap:.2g} mm {gap_words}."
    plates = len(plan.parts) - len(parts)
    caption += f" {plates} {'plate is' if plates == 1 else 'plates are'} not bent back." if plates else ""
    return [("Parts bent back into space", _refolded_page(faces, parts, up, caption))]


def piece_length(faces: list[MemberFaces]) -> float:
    """Return the length of the straight pieces in the drawing of a curved part, metres."""
    corners = np.concatenate([face.quads.reshape(-1, 3) for face in faces])
    return float(np.linalg.norm(np.ptp(corners, axis=0))) / DRAWN_PIECES


def strip_quads(strip: RefoldedStrip, piece: float, slotted: bool = False) -> Floats:
    """Return a strip as quads (q, 4, 3): about `piece` metres long, or from corner to corner for a slotted strip."""
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
