"""Pages of the order of assembly: a rule, and a picture for each step."""

from collections.abc import Callable

import numpy as np

from dsfab.arrays import Floats
from dsfab.report.assembly.axonometry import Axonometry, MemberFaces
from dsfab.report.assembly.overview import structure
from dsfab.report.assembly.paper import PAGE, QUIET, Paper, PaperBox
from dsfab.report.assembly.sequence import AssemblyStep

ACROSS, DOWN = 3, 2
"""Steps on a page."""
STANDING = (0.82, 0.81, 0.79)
"""The colour of what stands already."""
LINES = 3
"""Of names below a picture."""


def step_pages(
    steps: tuple[AssemblyStep, ...], faces: list[MemberFaces], up: Floats, rule: str
) -> list[tuple[str, Callable[[Paper], None]]]:
    """Pages of pictures: what is new is in its colour, what stands is grey; above them by which rule."""
    per_page = ACROSS * DOWN
    return [
        (
            f"Assembly: steps {k + 1} to {min(k + per_page, len(steps))} of {len(steps)}",
            _page(steps, k, faces, (up, rule)),
        )
        for k in range(0, len(steps), per_page)
    ]


def _page(
    steps: tuple[AssemblyStep, ...], first: int, faces: list[MemberFaces], how: tuple[Floats, str]
) -> Callable[[Paper], None]:
    up, rule = how
    view = Axonometry.of(up)
    extent = np.concatenate([view.flat(one.quads).reshape(-1, 2) for one in faces])

    def draw(paper: Paper) -> None:
        top = PAGE.y + PAGE.high
        for k, line in enumerate(paper.wrapped(rule, PAGE.wide, 8)):
            paper.text((PAGE.x, top - 3 - 3.8 * k), line, 8, QUIET)
        room = PaperBox(PAGE.x, PAGE.y, PAGE.wide, PAGE.high - 13)
        some = range(first, min(first + ACROSS * DOWN, len(steps)))
        for k, cell in zip(some, room.cells(ACROSS, DOWN, 8.0), strict=False):
            _step(paper, steps, k, faces, cell, (view, extent))

    return draw


def _step(
    paper: Paper,
    steps: tuple[AssemblyStep, ...],
    k: int,
    faces: list[MemberFaces],
    cell: PaperBox,
    seen: tuple[Axonometry, Floats],
) -> None:
    view, extent = seen
    new = set(steps[k].members)
    before = {name for step in steps[:k] for name in step.members} - new
    there = [one for one in faces if one.id in new or one.id in before]
    below = 5.0 + 3.4 * LINES
    picture = PaperBox(cell.x, cell.y + below, cell.wide, cell.high - below)
    structure(paper, there, view, picture, dict.fromkeys(before, STANDING), extent)
    paper.text((cell.x, cell.y + below - 3), f"{k + 1}", 12, bold=True)
    lines = paper.wrapped(", ".join(steps[k].members), cell.wide - 10, 8)
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"... to {steps[k].members[-1]}"]
    for row, line in enumerate(lines):
        paper.text((cell.x + 8, cell.y + below - 3 - 3.4 * row), line, 8)
