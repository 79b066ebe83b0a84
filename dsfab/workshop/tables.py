"""Parts, sheets, nodes and bars of a plan as rows, in millimetres and square metres: for CSV and `cutlist.xlsx`."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from dsfab.units import MM_PER_M
from dsfab.workshop.bars import BarPlan
from dsfab.workshop.drawings import file_stem
from dsfab.workshop.nesting import NestedSheet
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.prices import stock_cost

Cell = str | int | float
NEVER = datetime(1980, 1, 1)
"""The date in every workbook: the same plan gives the same bytes."""
WIDEST = 40
"""Letters that a column of a workbook is wide, at most."""


@dataclass(frozen=True)
class PlanTable:
    """Rows under a head, by a name."""

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def part_table(plan: WorkshopPlan) -> PlanTable:
    """A row for each part that differs from all others: how often it is cut, and as which parts."""
    costs = part_costs(plan)
    head = (
        *("part", "count", "same_as_it", "member", "length_mm", "width_mm", "thickness_mm", "area_m2", "holes"),
        *("layer_mm", "strain", "sheets", "file", *(("cost",) if costs else ())),
    )
    rows = []
    for group in plan.same:
        part, names = plan.parts[group[0]], [plan.parts[k].id for k in group]
        a, b = (MM_PER_M * part.size).round(1).tolist()
        sheets = sorted({plan.sheet_of[one] for one in names})
        rows.append(
            (part.id, len(names), " ".join(x.replace(" ", "_") for x in names[1:]), part.member, a, b)
            + (round(MM_PER_M * plan.thickness_of(part), 3), round(part.area, 4), len(part.holes))
            + (round(MM_PER_M * part.layer, 3), f"{part.strain:.2e}", " ".join(map(str, sheets)))
            + (f"{file_stem(part.id)}.dxf",)
            + ((round(sum(costs[one] for one in names), 2),) if costs else ())
        )
    return PlanTable("parts", head, tuple(rows))


def part_costs(plan: WorkshopPlan) -> dict[str, float]:
    """What each part, by its name, costs: its share, by area, of its sheet's price; empty where there are no prices."""
    if not any(sheet.price for sheet in plan.sheets):
        return {}
    whole = [sum(one.part.area for one in sheet.parts) for sheet in plan.sheets]
    shares = [sheet.price / area for sheet, area in zip(plan.sheets, whole, strict=True)]
    return {
        one.part.id: share * one.part.area
        for sheet, share in zip(plan.sheets, shares, strict=True)
        for one in sheet.parts
    }


def stock_table(plan: WorkshopPlan) -> PlanTable:
    """A row for each size and thickness of the sheets: how many there are, how much of them becomes parts, and their
    price, where they have one."""
    kinds: dict[tuple[float, ...], list[NestedSheet]] = {}
    for sheet in plan.sheets:
        thickness = plan.thickness_of(sheet.parts[0].part)
        kinds.setdefault((*sheet.size, thickness, sheet.price), []).append(sheet)
    rows = []
    for (a, b, thickness, price), sheets in sorted(kinds.items()):
        mm = [round(MM_PER_M * x, 3) for x in (a, b, thickness)]
        used = sum(sheet.used for sheet in sheets) / len(sheets)
        rows.append((*mm, len(sheets), round(used, 3), *((price, round(price * len(sheets), 2)) if price else ())))
    head = ("length_mm", "width_mm", "thickness_mm", "sheets", "used")
    return PlanTable("stock", (*head, *(("price", "cost") if stock_cost(plan.sheets) else ())), tuple(rows))


def nest_table(plan: WorkshopPlan) -> PlanTable:
    """A row for each part on its sheet: where the lower left corner of its box is, and how far it is turned."""
    head = ("sheet", "sheet_length_mm", "sheet_width_mm", "sheet_used", "part", "x_mm", "y_mm", "turned_deg")
    rows = []
    for k, sheet in enumerate(plan.sheets, 1):
        for one in sheet.parts:
            x, y = (MM_PER_M * one.placed.outline.min(axis=0)).round(1).tolist()
            a, b = (round(MM_PER_M * size, 1) for size in sheet.size)
            rows.append((k, a, b, round(sheet.used, 3), one.part.id, x, y, round(float(np.degrees(one.turn)), 1)))
    return PlanTable("nests", head, tuple(rows))


def node_table(plan: WorkshopPlan) -> PlanTable:
    """A row for each node that has a bolt: its members and where they meet; empty for a flat sheet."""
    head = ("node", "kind", "member_a", "member_b", "along_a_mm", "along_b_mm", "angle_deg", "x_mm", "y_mm", "z_mm")
    nodes = [node for node in plan.graph.nodes if node.kind != "grazing"] if plan.graph else []
    rows = []
    for node in nodes:
        along = [round(MM_PER_M * s, 1) for s in node.at]
        place = (MM_PER_M * node.point).round(1).tolist()
        rows.append((node.id, node.kind, *node.members, *along, round(node.angle, 2), *place))
    return PlanTable("nodes", head, tuple(rows))


def bar_table(plan: WorkshopPlan) -> PlanTable:
    """A row for each bar of a plan, as `bar_rows` has it; empty where there is none."""
    if plan.bars is None:
        return PlanTable("bars", BAR_HEAD, ())
    files = {plan.parts[k].id: file_stem(plan.parts[some[0]].id) for some in plan.same for k in some}
    return bar_rows(plan.bars, files)


BAR_HEAD = (
    *("bar", "from", "to", "nodes_apart_mm", "length_mm", "width_mm", "from_along_deg", "from_dip_deg"),
    *("to_along_deg", "to_dip_deg", "twist_deg", "bow_mm", "file"),
)


def bar_rows(plan: BarPlan, files: Mapping[str, str]) -> PlanTable:
    """Each bar: from which node to which, and its angles; `files` has the stems of drawings that are not its own.

    along : degrees from the first bar of the node, counter-clockwise as seen from outside.    dip : degrees below the
    plate of the node, by which its arm is folded.    twist : degrees that the bar turns by from its first node to its
    second one, right-handed.    bow : millimetres that the member's axis is from the bar.
    """
    nodes, rows = plan.found.lattice.nodes, []
    sizes = {part.id: part.size for part in plan.parts}
    for bar in plan.found.bars:
        name, (one, two) = bar.bay.id, (nodes[end.node] for end in bar.ends)
        mm = MM_PER_M * np.array([float(np.linalg.norm(two.point - one.point)), *sizes[name]])
        turned = np.degrees([*(x for end in bar.ends for x in (end.azimuth, end.dip)), bar.twist]).round(4) + 0.0
        row = name, one.id, two.id, *mm.round(1).tolist(), *turned.tolist()
        rows.append((*row, round(MM_PER_M * bar.sagitta, 1), f"{files.get(name, file_stem(name))}.dxf"))
    return PlanTable("bars", BAR_HEAD, tuple(rows))


def cut_list(plan: WorkshopPlan) -> str:
    """The parts as CSV."""
    return table_csv(part_table(plan))


def table_csv(table: PlanTable) -> str:
    """A table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(table.head)
    writer.writerows(table.rows)
    return text.getvalue()


def cut_list_workbook(plan: WorkshopPlan) -> bytes:
    """Parts, nests, stock, nodes and bars as an Excel workbook, a sheet for each that has rows."""
    import xlsxwriter

    file = io.BytesIO()
    with xlsxwriter.Workbook(file, {"in_memory": True}) as book:
        book.set_properties({"created": NEVER})
        strong = book.add_format({"bold": True, "bottom": 1})
        for table in (f(plan) for f in (part_table, nest_table, stock_table, node_table, bar_table)):
            if not table.rows:
                continue
            sheet = book.add_worksheet(table.name)
            sheet.write_row(0, 0, table.head, strong)
            for k, row in enumerate(table.rows, 1):
                sheet.write_row(k, 0, [_number(cell) for cell in row])
            sheet.freeze_panes(1, 1)
            sheet.autofilter(0, 0, len(table.rows), len(table.head) - 1)
            for k, width in enumerate(_widths(table)):
                sheet.set_column(k, k, width)
    return file.getvalue()


def _number(cell: Cell) -> Cell:
    """Numbers that are written in words of their own are numbers in a workbook; names of parts are none."""
    return float(cell) if isinstance(cell, str) and "e-" in cell and cell[0].isdigit() else cell


def _widths(table: PlanTable) -> Sequence[int]:
    columns = zip(table.head, *table.rows, strict=True)
    return [min(max(len(str(cell)) for cell in column) + 3, WIDEST) for column in columns]
