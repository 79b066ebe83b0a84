"""Pages of flat parts: cut list, nested sheets, nodes, and the members of each family."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal

import numpy as np

from dsfab.core.messages import count_phrase
from dsfab.core.units import MM_PER_M
from dsfab.members import Member
from dsfab.report.assembly.paper import HAIR, INK, PAGE, QUIET, RED, DrawingTransform, Paper, PaperBox, usual_scale
from dsfab.workshop import FlatPart, NestedSheet, WorkshopPlan, money, node_table, stock_cost, stock_words

ACROSS, DOWN = 4, 13  # Columns and rows of parts on a page.
ROWS, COLUMNS = 62, 3  # Rows and columns of nodes on a page.
LEGIBLE, LEGIBLE_MODEL = 40.0, 400.0  # smallest scales (mm per m) with legible names, of structures and models
PartsPage = tuple[str, Callable[[Paper], None]]


def sheet_figures(plan: WorkshopPlan, name: str = "Sheets") -> list[tuple[str, str]]:
    """Return pairs of title and text about the sheets of stock: number, size, used fraction of the area, and price."""
    cost = stock_cost(plan.sheets)
    priced = [("Price of the sheets", money(cost))] if cost else []
    return [(name, f"{stock_words(plan.sheets)}, {plan.used_share:.0%} used"), *priced]


def cut_list_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return pages with a drawing of each different part."""
    pages = []
    per_page = ACROSS * DOWN
    for k in range(0, len(plan.equal_parts), per_page):
        groups = plan.equal_parts[k : k + per_page]
        first_id, last_id = plan.parts[groups[0][0]].id, plan.parts[groups[-1][0]].id
        pages.append((f"Cut list, {_part_count(plan)}: {first_id} to {last_id}", _cut_list_page(plan, groups)))
    return pages


def _part_count(plan: WorkshopPlan) -> str:
    mm = sorted({MM_PER_M * plan.part_thickness(part) for part in plan.parts}, reverse=True)
    return f"{len(plan.parts)} parts, {' and '.join(f'{x:g}' for x in mm)} mm thick, in {len(plan.equal_parts)} shapes"


def _cut_list_page(plan: WorkshopPlan, groups: Sequence[tuple[int, ...]]) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        for cell, group in zip(PAGE.cells(ACROSS, DOWN, 3.0), groups, strict=False):
            part = plan.parts[group[0]]
            a, b = (MM_PER_M * part.size).tolist()
            sheets = ", ".join(map(str, sorted({plan.sheet_numbers[plan.parts[k].id] for k in group})))
            top = cell.y + cell.high - 3.4
            paper.text((cell.x, top), f"{len(group)} x {part.id}", 8, bold=True)
            paper.text((cell.x + cell.wide, top), f"{a:,.0f} x {b:,.0f}", 7.5, side="right")
            thick = f" · {MM_PER_M * plan.part_thickness(part):g} mm" if plan.bars else ""
            holes = f"{len(part.holes)} hole{'' if len(part.holes) == 1 else 's'}" if part.holes else ""
            words = f"{holes}{thick} · sheet {sheets}".removeprefix(" · ")
            paper.text((cell.x, cell.y + 0.6), words if len(words) <= 64 else words[:61] + "...", 6, QUIET)
            room = PaperBox(cell.x, cell.y + 3.4, cell.wide, cell.high - 8.4)
            half = part.size / 2
            middle = (part.outline.min(axis=0) + part.outline.max(axis=0)) / 2
            _outline(paper, part, DrawingTransform.fit_to_box(middle - half, middle + half, room))
            paper.polylines([np.array([[cell.x, cell.y - 1.2], [cell.x + cell.wide, cell.y - 1.2]])], HAIR, 0.3)

    return draw


def _outline(paper: Paper, part: FlatPart, fitted: DrawingTransform) -> None:
    paper.polylines([fitted.to_paper(part.outline), *(fitted.to_paper(s) for s in part.slots)], INK, 0.4, closed=True)
    if part.folds:
        paper.polylines([fitted.to_paper(fold.line) for fold in part.folds], RED, 0.3)
    if part.holes:
        places = fitted.to_paper(np.array([hole.at for hole in part.holes]))
        paper.circles(places, max(part.holes[0].diameter * fitted.scale, 0.3), INK)


def nest_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return pages that show all sheets with the name of each part."""
    wide = max(sheet.size[0] for sheet in plan.sheets)
    high = max(sheet.size[1] for sheet in plan.sheets)
    legible = LEGIBLE_MODEL if plan.model else LEGIBLE
    grids = ((a, d) for a in (1, 2, 3) for d in (1, 2, 3, 4))
    scales = {(a, d): min((PAGE.wide / a - 6) / wide, (PAGE.high / d - 12) / high) for a, d in grids}
    across, down = max(scales, key=lambda n: (scales[n] > legible, min(n[0] * n[1], 6), scales[n]))
    scale, scale_name = usual_scale(scales[across, down])
    pages = []
    for k in range(0, len(plan.sheets), across * down):
        sheets, cells = plan.sheets[k : k + across * down], PAGE.cells(across, down, 5.0)
        title = f"Sheets {k + 1} to {k + len(sheets)} of {len(plan.sheets)}, {scale_name}"
        pages.append((title, _nest_page(sheets, k, cells, scale)))
    return pages


def _nest_page(
    sheets: Sequence[NestedSheet], sheets_before: int, cells: list[PaperBox], scale: float
) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        for k, (sheet, cell) in enumerate(zip(sheets, cells, strict=False), sheets_before + 1):
            size = np.array(sheet.size)
            fitted = DrawingTransform(scale, np.array([cell.x, cell.y + cell.high - 6 - scale * size[1]]))
            frame = fitted.to_paper(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size)
            a, b = (MM_PER_M * size).tolist()
            thick = sheet.parts[0].part.thickness
            size_words = f"{a:,.0f} x {b:,.0f} mm" + (f" x {MM_PER_M * thick:g} mm" if thick else "")
            words = f"Sheet {k}   {size_words}   {sheet.used_share:.0%} used"
            paper.text(frame[3] + [0, 2], words, 8, bold=True)
            for placement in sheet.parts:
                _outline(paper, placement.placed_part, fitted)
            paper.polylines([frame], QUIET, 0.6, closed=True)
            for placement in sheet.parts:
                _part_name(paper, placement.placed_part, fitted)
        paper.scale_bar((PAGE.x, PAGE.y - 4), scale)

    return draw


def _part_name(paper: Paper, part: FlatPart, fitted: DrawingTransform) -> None:
    middle = (part.outline.min(axis=0) + part.outline.max(axis=0)) / 2
    x, y = fitted.to_paper(part.axis[len(part.axis) // 2] if len(part.axis) else middle).tolist()
    long, high = paper.width(part.id, 5.5) / 2 + 0.3, 1.0
    upright = part.size[1] > part.size[0]
    half = np.array([high, long] if upright else [long, high])
    paper.polygon(np.array([x, y]) + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), (1, 1, 1))
    if upright:
        paper.upright_text((x, y - long + 0.3), part.id, 5.5)
    else:
        paper.text((x, y - 0.7), part.id, 5.5, side="middle")


def node_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return pages with a table of all nodes with bolts."""
    heads, places = ("node", "members", "angle", "x", "y", "z"), (0.0, 16.0, 72.0, 90.0, 107.0, 122.0)
    note = "Coordinates in millimetres, on the middle surface; angles between the members at the node."
    meets = "on" if plan.layering else "with"
    rows = [_node_row(row, meets) for row in node_table(plan).rows]
    return table_pages("Nodes", rows, (ROWS, COLUMNS), heads, places, note)


def _node_row(row: Sequence[str | int | float], meets: str) -> list[str]:
    name, kind, lower, upper, _, _, angle, *place = row
    words = f"{lower} {meets} {upper}" if kind == "crossing" else f"{lower}, {upper} ({kind})"
    return [str(name), words, "" if angle != angle else f"{angle:.1f}°", *(f"{value:,.0f}" for value in place)]


def table_pages(
    title: str,
    rows: Sequence[Sequence[str]],
    size: tuple[int, int],
    heads: Sequence[str],
    places: Sequence[float],
    note: str,
) -> list[PartsPage]:
    """Return the pages of a table in blocks side by side. size : rows per block, and blocks per page.
    heads : titles of the columns.    places : distances of the columns from the left edge of a block, mm."""
    down, columns = size

    def draw(paper: Paper, page_rows: Sequence[Sequence[str]]) -> None:
        step = PAGE.high / (down + 1)
        for k in range(0, len(page_rows), down):
            x, top = PAGE.x + k // down * PAGE.wide / columns, PAGE.y + PAGE.high - step
            for place, head in zip(places, heads, strict=True):
                paper.text((x + place, top), head, 6.5, QUIET, "left" if place < 50 else "right")
            paper.polylines([np.array([[x, top - 1], [x + places[-1], top - 1]])], INK, 0.5)
            for number, row in enumerate(page_rows[k : k + down], 1):
                for place, words in zip(places, row, strict=True):
                    side: Literal["left", "right"] = "left" if place < 50 else "right"
                    paper.text((x + place, top - number * step), words, 6.5, side=side, bold=place == 0)
        for k, line in enumerate(paper.wrapped_lines(note, PAGE.wide, 7)):
            paper.text((PAGE.x, PAGE.y - 4 - 2.8 * k), line, 7, QUIET)

    parts = [rows[k : k + down * columns] for k in range(0, len(rows), down * columns)]
    return [(f"{title} {part[0][0]} to {part[-1][0]}", partial(draw, page_rows=part)) for part in parts]


ROW = 24.0  # Height of each member's row on a page of members, mm.
NAMES = 44.0  # Width of a member's name to the left of the member, mm.
APART = 2.1  # Least distance between the names of two nodes, mm.
SPLICED_NOTE = (
    "Above each line is the name of the crossing member. Below the line is the distance from the member's beginning "
    "along the middle surface, mm. Red lines are splices. For distances on a layer see the drawing of that layer."
)
BARS_NOTE = (
    "Above each line is the name of the crossing member. Below the line is the distance from the member's beginning "
    "along the curved axis, mm. Red: the number of each bar, such as 3 for A07.3. For lengths of bars see the "
    "drawings of the bars."
)
PLANKS_NOTE = (
    "Above each line is the name of the crossing member. Below the line is the distance from the member's beginning "
    "along the axis, mm. Red lines are splices. "
    "A slot open above receives the crossing plank. A plank with a slot open below is put onto the crossing plank."
)
PANELS_NOTE = (
    "Above each line is the name of the crossing member. Below the line is the distance from the member's beginning "
    "in the model, mm. Red lines show where panels begin, at the edge of an uninterrupted member or at a splice."
)
FAMILY_TITLES = {"major": "Family A", "minor": "Family B", "rim": "Edges", "keep": "Around supports and loads"}
PER_PAGE = int(PAGE.high // ROW)


def family_pages(plan: WorkshopPlan) -> list[tuple[str, Callable[[Paper], None]]]:
    """Return titles and drawings of pages with the members of each family."""
    assert plan.graph is not None
    pages = []
    built = {part.member for part in plan.parts}
    for family in dict.fromkeys(member.family for member in plan.graph.members):
        members = [m for m in plan.graph.members if m.family == family and m.id in built]
        longest = max((member.length for member in members), default=0.0)
        for k in range(0, len(members), PER_PAGE):
            page_members = members[k : k + PER_PAGE]
            title = f"{FAMILY_TITLES.get(family, family.title())}: {page_members[0].id} to {page_members[-1].id}"
            pages.append((title, _family_page(plan, page_members, (PAGE.wide - NAMES - 6) / max(longest, 1e-9))))
    return pages


def _family_page(plan: WorkshopPlan, members: list[Member], scale: float) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        for k, member in enumerate(members):
            _member_row(paper, plan, member, PAGE.y + PAGE.high - (k + 1) * ROW, scale)
        note = BARS_NOTE if plan.bars else PLANKS_NOTE if plan.planks else SPLICED_NOTE
        paper.text((PAGE.x, PAGE.y - 4), PANELS_NOTE if plan.route == "panels" else note, 7, QUIET)

    return draw


def _member_row(paper: Paper, plan: WorkshopPlan, member: Member, y: float, scale: float) -> None:
    parts = [part for part in plan.parts if part.member == member.id]
    pieces = [part for part in parts if ".c" not in part.id]
    size = f"{MM_PER_M * member.length:,.0f} x {MM_PER_M * member.mean_width:.0f} mm" if member.axis else "plate"
    paper.text((PAGE.x, y + 13), member.id, 12, bold=True)
    paper.text((PAGE.x, y + 9), size, 7)
    covers = len(parts) - len(pieces)
    words = count_phrase(len(pieces), "bar" if plan.bars else "piece")
    words += f", {count_phrase(covers, 'cover')}" if covers else ""
    paper.text((PAGE.x, y + 5.5), words, 7, QUIET)
    if pieces and plan.layering:
        paper.text((PAGE.x, y + 2), f"layer at {MM_PER_M * pieces[0].layer:+.0f} mm", 7, QUIET)
    paper.polylines([np.array([[PAGE.x, y - 0.5], [PAGE.x + PAGE.wide, y - 0.5]])], HAIR, 0.3)
    if member.axis is None:
        return
    start, mid = PAGE.x + NAMES, y + 11.0
    paper.polylines([np.array([[start, mid], [start + scale * member.length, mid]])], INK, 1.6)
    node_ticks(paper, plan, member, (start, mid), scale)
    for part in pieces:
        if plan.bars and scale * (part.span[1] - part.span[0]) > APART:
            paper.text((start + scale * sum(part.span) / 2, mid + 1.2), part.id.rpartition(".")[2], 5.2, RED, "middle")
        elif 0 < part.span[0] < member.length and not plan.bars:
            x = start + scale * part.span[0]
            paper.polylines([np.array([[x, mid - 2.2], [x, mid + 2.2]])], RED, 1.2)


def node_ticks(paper: Paper, plan: WorkshopPlan, member: Member, origin: tuple[float, float], scale: float) -> None:
    """Draw a tick and the name of each node of a member. origin : paper coordinates (mm) of the member's start."""
    assert plan.graph is not None
    (start, middle), labelled = origin, -np.inf
    for node in plan.graph.nodes_along[member.id]:
        k = node.members.index(member.id)
        x = start + scale * node.at[k]
        paper.polylines([np.array([[x, middle - 1.4], [x, middle + 1.4]])], INK, 0.4)
        if x - labelled >= APART:
            paper.upright_text((x, middle + 2.4), node.members[1 - k], 5.2)
            paper.upright_text((x, middle - 10.2), f"{MM_PER_M * node.at[k]:,.0f}", 5.2, QUIET)
            labelled = x
