"""Parts as drawings: what is cut, drilled and engraved, each on its own layer."""

from collections.abc import Iterator

import numpy as np

from dsfab.export import FlatCircle, FlatDrawing, FlatLine
from dsfab.units import MM_PER_M
from dsfab.workshop.letters import strokes
from dsfab.workshop.nesting import NestedSheet
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plan import WorkshopPlan

BETWEEN = 1.15
"""From sheet to sheet on the drawing of all, over the longest one."""
TITLE, SMALL_TITLE = 0.06, 0.06
"""Height of the number of a sheet, metres; of small sheets that share of their width."""


def part_drawing(part: FlatPart) -> FlatDrawing:
    """A part alone, with its middle line on a layer of its own, AXIS, which is not to be cut."""
    axis = [FlatLine("AXIS", part.axis)] if len(part.axis) else []
    return FlatDrawing(part.id, (*part_lines(part), *axis), part_circles(part))


def file_stem(part: str) -> str:
    """The name of a part as that of a file."""
    return part.replace(" ", "_").replace("/", "_")


def drawing_files(plan: WorkshopPlan) -> dict[str, list[str]]:
    """The drawings of the parts of each member, by its name."""
    found: dict[str, list[str]] = {}
    for group in plan.same:
        for k in group:
            found.setdefault(plan.parts[k].member, []).append(f"{file_stem(plan.parts[group[0]].id)}.dxf")
    return {member: list(dict.fromkeys(sorted(files))) for member, files in found.items()}


def part_lines(part: FlatPart) -> Iterator[FlatLine]:
    """Outline, openings, engraved lines and folds of a part."""
    outline, *slots = part.contours
    yield FlatLine("CUT", outline, closed=True)
    yield from (FlatLine("SLOTS", slot, closed=True) for slot in slots)
    yield from (FlatLine("ENGRAVE", mark) for mark in part.marks)
    yield from (FlatLine("FOLD", fold.line) for fold in part.folds)


def part_circles(part: FlatPart) -> tuple[FlatCircle, ...]:
    """The holes of a part."""
    return tuple(FlatCircle("HOLES", (float(h.at[0]), float(h.at[1])), h.diameter) for h in part.holes)


def nest_drawing(plan: WorkshopPlan, name: str) -> FlatDrawing:
    """All sheets of a plan, from left to right in rows, each with its number above it."""
    lines, circles = list[FlatLine](), list[FlatCircle]()
    wide = max(sheet.size[0] for sheet in plan.sheets) * BETWEEN
    high = max(sheet.size[1] for sheet in plan.sheets) * BETWEEN
    across = max(1, round(np.sqrt(len(plan.sheets) * high / wide)))
    for k, sheet in enumerate(plan.sheets):
        origin = np.array([k % across * wide, -(k // across) * high])
        frame = origin + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * sheet.size
        lines.append(FlatLine("STOCK", frame, closed=True))
        title = f"SHEET {k + 1}" if len(plan.sheets) > 1 else "SHEET"
        title += f"   {MM_PER_M * plan.thickness_of(sheet.parts[0].part):g} MM" if plan.bars else ""
        tall = min(TITLE, SMALL_TITLE * sheet.size[1])
        lines += [FlatLine("STOCK", mark + frame[3] + [0.0, tall / 2]) for mark in strokes(title, tall)]
        for nested in sheet.parts:
            _ = nested.part.contours  # found before it is moved, once for all drawings
            part = nested.placed.moved(0.0, origin)
            lines += part_lines(part)
            circles += part_circles(part)
    return FlatDrawing(name, tuple(lines), tuple(circles))


def sheet_drawing(sheet: NestedSheet, title: str) -> FlatDrawing:
    """A sheet alone, its lower left corner at the origin: what a laser is given."""
    frame = FlatLine("STOCK", np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * sheet.size, closed=True)
    parts = [nested.placed for nested in sheet.parts]
    lines = [line for part in parts for line in part_lines(part)]
    return FlatDrawing(title, (frame, *lines), tuple(circle for part in parts for circle in part_circles(part)))
