"""The page that shows the flat parts bent back into space beside the design."""

from collections.abc import Callable

import numpy as np

from dsfab.arrays import Floats
from dsfab.report.assembly.axonometry import PIECES, Axonometry, MemberFaces
from dsfab.report.assembly.overview import structure
from dsfab.report.assembly.paper import PAGE, QUIET, Paper, PaperBox
from dsfab.surface import simplified_line
from dsfab.units import MM_PER_M
from dsfab.workshop import RefoldedStrip, WorkshopPlan, refolded

DRAWN = 1e-3
"""Metres that edges of planks may be off on the drawing."""
WORDS = 24.0
"""Millimetres below the pictures, at least."""


def refolded_pages(
    plan: WorkshopPlan, faces: list[MemberFaces], up: Floats
) -> list[tuple[str, Callable[[Paper], None]]]:
    """The page; none where no strip is cut, or of a model."""
    found = refolded(plan)
    if not found.strips:
        return []
    colours = {one.id: one.colour for one in faces}
    piece = piece_length(faces)
    parts = [
        MemberFaces(one.id, colours[one.member], strip_quads(one, piece, plan.planks is not None))
        for one in found.strips
    ]
    said = f"{len(parts)} flat parts, bent back by their lengths on the drawings, each in its place."
    if len(found.off):
        what = "slots of two planks at nodes" if plan.planks else "holes at nodes"
        beside = "beside each other" if plan.planks else "off the line of their bolt"
        said += f" {len(found.off)} {what} are up to {MM_PER_M * found.off.max():.2g} mm {beside}."
    plates = len(plan.parts) - len(parts)
    said += f" {plates} {'plate is' if plates == 1 else 'plates are'} not bent back." if plates else ""
    return [("Parts bent back into space", _page(faces, parts, up, said))]


def piece_length(faces: list[MemberFaces]) -> float:
    """Metres of the pieces in which parts are drawn."""
    return float(np.linalg.norm(np.ptp(np.concatenate([one.quads.reshape(-1, 3) for one in faces]), axis=0))) / PIECES


def strip_quads(strip: RefoldedStrip, piece: float, slotted: bool = False) -> Floats:
    """(q, 4, 3) a strip in pieces of about so many metres; of one with slots at every corner of these."""
    middle = strip.edges.mean(axis=1)
    long = float(np.linalg.norm(np.diff(middle, axis=0), axis=1).sum())
    count = max(int(np.ceil(long / piece)), 1)
    if slotted:
        rows = simplified_line(strip.edges.reshape(-1, 6), DRAWN).reshape(-1, 2, 3)
    else:
        rows = strip.edges[np.unique(np.linspace(0, len(strip.edges) - 1, count + 1).round().astype(int))]
    right, left = rows[:, 0], rows[:, 1]
    return np.stack([right[:-1], right[1:], left[1:], left[:-1]], axis=1)


def _page(faces: list[MemberFaces], parts: list[MemberFaces], up: Floats, said: str) -> Callable[[Paper], None]:
    view = Axonometry.of(up)
    extent = np.concatenate([view.flat(one.quads).reshape(-1, 2) for one in (*faces, *parts)])

    def draw(paper: Paper) -> None:
        room = PaperBox(PAGE.x, PAGE.y + WORDS, PAGE.wide, PAGE.high - WORDS)
        captions = ("Members, as they are designed", said)
        for some, cell, words in zip((faces, parts), room.cells(2, 1, 10.0), captions, strict=True):
            fitted = structure(paper, some, view, cell, {}, extent)
            below = float(fitted.of(extent)[:, 1].min()) - 10
            for row, line in enumerate(paper.wrapped(words, cell.wide, 10)):
                paper.text((cell.x, below - 4.8 * row), line, 10, QUIET)

    return draw
