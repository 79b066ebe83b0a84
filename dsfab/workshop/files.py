"""Files of the workshop: drawings of parts and sheets, and cut lists."""

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import MappingProxyType

import numpy as np

from dsfab.core.units import MM_PER_M
from dsfab.export import (
    FlatCircle,
    FlatDrawing,
    FlatLine,
    atomic_folder,
    check_flat_dxf,
    flat_dxf,
    flat_svg,
    write_chunks,
)
from dsfab.workshop.bars import BarPlan
from dsfab.workshop.nesting import NestedSheet
from dsfab.workshop.parts import FlatPart, strokes
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.stock import stock_cost

TITLE, SMALL_TITLE = 0.06, 0.06  # largest height of a sheet's title: in metres, and as a fraction of the sheet's width


def part_drawing(part: FlatPart) -> FlatDrawing:
    """Return the drawing of a part. The middle line is on the layer AXIS."""
    axis = [FlatLine("AXIS", part.axis)] if len(part.axis) else []
    return FlatDrawing(part.id, (*part_lines(part), *axis), part_circles(part))


def file_stem(part: str) -> str:
    """Return a file name without suffix for a part's name."""
    return part.replace(" ", "_").replace("/", "_")


def drawing_files(plan: WorkshopPlan) -> dict[str, list[str]]:
    """Return the names of the drawing files of each member's parts, by member name."""
    drawings: dict[str, list[str]] = {}
    for group in plan.equal_parts:
        for k in group:
            drawings.setdefault(plan.parts[k].member, []).append(f"{file_stem(plan.parts[group[0]].id)}.dxf")
    return {member: list(dict.fromkeys(sorted(files))) for member, files in drawings.items()}


def part_lines(part: FlatPart) -> Iterator[FlatLine]:
    """Yield the outline, openings, engraved lines and folds of a part."""
    outline, *slots = part.contours
    yield FlatLine("CUT", outline, closed=True)
    yield from (FlatLine("SLOTS", slot, closed=True) for slot in slots)
    yield from (FlatLine("ENGRAVE", mark) for mark in part.marks)
    yield from (FlatLine("FOLD", fold.line) for fold in part.folds)


def part_circles(part: FlatPart) -> tuple[FlatCircle, ...]:
    """Return the holes of a part as circles of a drawing."""
    return tuple(FlatCircle("HOLES", (float(h.at[0]), float(h.at[1])), h.diameter) for h in part.holes)


def nest_drawing(plan: WorkshopPlan, name: str) -> FlatDrawing:
    """Return the drawing of all sheets of a plan in rows."""
    lines, circles = list[FlatLine](), list[FlatCircle]()
    pitch = 1.15  # step from one sheet to the next, in sizes of the largest sheet
    wide = max(sheet.size[0] for sheet in plan.sheets) * pitch
    high = max(sheet.size[1] for sheet in plan.sheets) * pitch
    across = max(1, round(np.sqrt(len(plan.sheets) * high / wide)))
    for k, sheet in enumerate(plan.sheets):
        origin = np.array([k % across * wide, -(k // across) * high])
        frame = origin + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * sheet.size
        lines.append(FlatLine("STOCK", frame, closed=True))
        title = f"SHEET {k + 1}" if len(plan.sheets) > 1 else "SHEET"
        title += f"   {MM_PER_M * plan.part_thickness(sheet.parts[0].part):g} MM" if plan.bars else ""
        tall = min(TITLE, SMALL_TITLE * sheet.size[1])
        lines += [FlatLine("STOCK", mark + frame[3] + [0.0, tall / 2]) for mark in strokes(title, tall)]
        for nested in sheet.parts:
            _ = nested.part.contours  # compute contours once; moved copies reuse the contours
            part = nested.placed_part.moved_by(0.0, origin)
            lines += part_lines(part)
            circles += part_circles(part)
    return FlatDrawing(name, tuple(lines), tuple(circles))


def sheet_drawing(sheet: NestedSheet, title: str) -> FlatDrawing:
    """Return the drawing of a sheet for a laser."""
    frame = FlatLine("STOCK", np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * sheet.size, closed=True)
    parts = [nested.placed_part for nested in sheet.parts]
    lines = [line for part in parts for line in part_lines(part)]
    return FlatDrawing(title, (frame, *lines), tuple(circle for part in parts for circle in part_circles(part)))


Cell = str | int | float
FIXED_DATE = datetime(1980, 1, 1)  # date in every workbook, so that equal plans have equal bytes


@dataclass(frozen=True)
class PlanTable:
    """Table with a name, column names (`head`) and rows."""

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def part_table(plan: WorkshopPlan) -> PlanTable:
    """Return the table of parts: a row for each group of equal parts."""
    costs = part_costs(plan)
    head = (
        *("part", "count", "same_as_it", "member", "length_mm", "width_mm", "thickness_mm", "area_m2", "holes"),
        *("layer_mm", "strain", "sheets", "file", *(("cost",) if costs else ())),
    )
    rows = []
    for group in plan.equal_parts:
        part, names = plan.parts[group[0]], [plan.parts[k].id for k in group]
        a, b = (MM_PER_M * part.size).round(1).tolist()
        sheets = sorted({plan.sheet_numbers[name] for name in names})
        rows.append(
            (part.id, len(names), " ".join(x.replace(" ", "_") for x in names[1:]), part.member, a, b)
            + (round(MM_PER_M * plan.part_thickness(part), 3), round(part.area, 4), len(part.holes))
            + (round(MM_PER_M * part.layer, 3), f"{part.strain:.2e}", " ".join(map(str, sheets)))
            + (f"{file_stem(part.id)}.dxf",)
            + ((round(sum(costs[name] for name in names), 2),) if costs else ())
        )
    return PlanTable("parts", head, tuple(rows))


def part_costs(plan: WorkshopPlan) -> dict[str, float]:
    """Return the cost of each part by name; empty without prices."""
    if not any(s.price for s in plan.sheets):
        return {}
    areas = [sum(x.part.area for x in s.parts) for s in plan.sheets]
    shares = [s.price / area for s, area in zip(plan.sheets, areas, strict=True)]
    return {x.part.id: share * x.part.area for s, share in zip(plan.sheets, shares, strict=True) for x in s.parts}


def stock_table(plan: WorkshopPlan) -> PlanTable:
    """Return the table of the stock: a row for each sheet size, thickness and price."""
    kinds: dict[tuple[float, ...], list[NestedSheet]] = {}
    for sheet in plan.sheets:
        thickness = plan.part_thickness(sheet.parts[0].part)
        kinds.setdefault((*sheet.size, thickness, sheet.price), []).append(sheet)
    rows = []
    for (a, b, thickness, price), sheets in sorted(kinds.items()):
        mm = [round(MM_PER_M * x, 3) for x in (a, b, thickness)]
        used = sum(sheet.used_share for sheet in sheets) / len(sheets)
        rows.append((*mm, len(sheets), round(used, 3), *((price, round(price * len(sheets), 2)) if price else ())))
    head = ("length_mm", "width_mm", "thickness_mm", "sheets", "used")
    return PlanTable("stock", (*head, *(("price", "cost") if stock_cost(plan.sheets) else ())), tuple(rows))


def nest_table(plan: WorkshopPlan) -> PlanTable:
    """Return the table of positions: a row for each part, with its sheet, lower left corner and rotation."""
    head = ("sheet", "sheet_length_mm", "sheet_width_mm", "sheet_used", "part", "x_mm", "y_mm", "turned_deg")
    rows = []
    for k, s in enumerate(plan.sheets, 1):
        for item in s.parts:
            x, y = (MM_PER_M * item.placed_part.outline.min(axis=0)).round(1).tolist()
            a, b = (round(MM_PER_M * size, 1) for size in s.size)
            rows.append((k, a, b, round(s.used_share, 3), item.part.id, x, y, round(float(np.degrees(item.turn)), 1)))
    return PlanTable("nests", head, tuple(rows))


def node_table(plan: WorkshopPlan) -> PlanTable:
    """Return the table of nodes with a bolt; empty for a flat sheet."""
    head = ("node", "kind", "member_a", "member_b", "along_a_mm", "along_b_mm", "angle_deg", "x_mm", "y_mm", "z_mm")
    nodes = [node for node in plan.graph.nodes if node.kind != "grazing"] if plan.graph else []
    rows = []
    for node in nodes:
        along = [round(MM_PER_M * s, 1) for s in node.at]
        place = (MM_PER_M * node.point).round(1).tolist()
        rows.append((node.id, node.kind, *node.members, *along, round(node.angle, 2), *place))
    return PlanTable("nodes", head, tuple(rows))


def bar_table(plan: WorkshopPlan) -> PlanTable:
    """Return the table of a plan's bars; empty without bars."""
    if plan.bars is None:
        return PlanTable("bars", BAR_HEAD, ())
    files = {plan.parts[k].id: file_stem(plan.parts[group[0]].id) for group in plan.equal_parts for k in group}
    return bar_rows(plan.bars, files)


BAR_HEAD = (
    *("bar", "from", "to", "nodes_apart_mm", "length_mm", "width_mm", "from_along_deg", "from_dip_deg"),
    *("to_along_deg", "to_dip_deg", "twist_deg", "bow_mm", "file"),
)


def bar_rows(plan: BarPlan, files: Mapping[str, str]) -> PlanTable:
    """Return the table of bars, with nodes, sizes and angles. files : name of the drawing by bar.
    along : degrees from the node's first bar to this bar, counter-clockwise as seen from outside.
    dip   : degrees below the node plate.    bow : largest distance of the member's axis from the bar (mm).
    twist : degrees from the normal at the first node to the normal at the second node, right-handed about the bar."""
    nodes, rows = plan.bar_lattice.lattice.nodes, []
    sizes = {part.id: part.size for part in plan.parts}
    for bar in plan.bar_lattice.bars:
        name, (begin_node, end_node) = bar.bay.id, (nodes[end.node] for end in bar.ends)
        mm = MM_PER_M * np.array([float(np.linalg.norm(end_node.point - begin_node.point)), *sizes[name]])
        turned = np.degrees([*(x for end in bar.ends for x in (end.azimuth, end.dip)), bar.twist]).round(4) + 0.0
        row = name, begin_node.id, end_node.id, *mm.round(1).tolist(), *turned.tolist()
        rows.append((*row, round(MM_PER_M * bar.sagitta, 1), f"{files.get(name, file_stem(name))}.dxf"))
    return PlanTable("bars", BAR_HEAD, tuple(rows))


def cut_list(plan: WorkshopPlan) -> str:
    """Return the table of parts as CSV text."""
    return table_csv(part_table(plan))


def table_csv(table: PlanTable) -> str:
    """Return a table as CSV text."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(table.head)
    writer.writerows(table.rows)
    return text.getvalue()


def cut_list_workbook(plan: WorkshopPlan) -> bytes:
    """Return all tables of a plan as an Excel workbook."""
    import xlsxwriter

    file = io.BytesIO()
    with xlsxwriter.Workbook(file, {"in_memory": True}) as book:
        book.set_properties({"created": FIXED_DATE})
        strong = book.add_format({"bold": True, "bottom": 1})
        for table in (f(plan) for f in (part_table, nest_table, stock_table, node_table, bar_table)):
            if not table.rows:
                continue
            sheet = book.add_worksheet(table.name)
            sheet.write_row(0, 0, table.head, strong)
            for k, row in enumerate(table.rows, 1):
                sheet.write_row(k, 0, [_as_number(cell) for cell in row])
            sheet.freeze_panes(1, 1)
            sheet.autofilter(0, 0, len(table.rows), len(table.head) - 1)
            for k, column in enumerate(zip(table.head, *table.rows, strict=True)):
                sheet.set_column(k, k, min(max(len(str(cell)) for cell in column) + 3, 40))
    return file.getvalue()


def _as_number(cell: Cell) -> Cell:
    return float(cell) if isinstance(cell, str) and "e-" in cell and cell[0].isdigit() else cell


NEST, CUTLIST, WORKBOOK, BARS, SHEET = "nest", "cutlist.csv", "cutlist.xlsx", "bars.csv", "sheet_"


def write_workshop(
    plan: WorkshopPlan, folder: Path, name: str, documents: Mapping[str, bytes] = MappingProxyType({})
) -> Path:
    """Write all files of a plan into a folder; write nothing if a file fails.    documents : further files by name.
    Files of an earlier plan are removed. Raises ExportError if the folder is not writable."""
    with atomic_folder(folder, _outdated_files) as partial:
        nest = nest_drawing(plan, name)
        write_chunks(partial / f"{NEST}.dxf", [flat_dxf(nest)])
        check_flat_dxf(nest, partial / f"{NEST}.dxf")
        write_chunks(partial / f"{NEST}.svg", [flat_svg(nest)])
        if plan.model:
            _write_sheets(plan, partial, name)
        for group in plan.equal_parts:
            part = plan.parts[group[0]]
            drawing = part_drawing(part)
            write_chunks(partial / f"{file_stem(part.id)}.dxf", [flat_dxf(drawing)])
            write_chunks(partial / f"{file_stem(part.id)}.svg", [flat_svg(drawing)])
        write_chunks(partial / CUTLIST, [cut_list(plan).encode()])
        write_chunks(partial / WORKBOOK, [cut_list_workbook(plan)])
        if plan.bars:
            write_chunks(partial / BARS, [table_csv(bar_table(plan)).encode()])
        for document, content in documents.items():
            write_chunks(partial / document, [content])
    return folder


def _write_sheets(plan: WorkshopPlan, folder: Path, name: str) -> None:
    for k, sheet in enumerate(plan.sheets, 1):
        drawing = sheet_drawing(sheet, f"{name}, sheet {k} of {len(plan.sheets)}")
        path = folder / f"{SHEET}{k}.dxf"
        write_chunks(path, [flat_dxf(drawing)])
        check_flat_dxf(drawing, path)
        write_chunks(path.with_suffix(".svg"), [flat_svg(drawing, 1e-4)])


def _outdated_files(target: Path, partial: Path) -> set[str]:
    try:
        with open(target / CUTLIST, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        named = {row["file"] for row in rows}
        named |= {f"{SHEET}{number}.dxf" for row in rows for number in row["sheets"].split()}
    except (OSError, ValueError, KeyError, AttributeError):
        return set()
    names = {name for name in named if name == Path(name).name} if None not in named else set()
    pictures = {Path(name).with_suffix(".svg").name for name in names}
    return (names | pictures | _old_bar_list(target)) - {path.name for path in partial.iterdir()}


def _old_bar_list(target: Path) -> set[str]:
    try:
        with open(target / BARS, encoding="utf-8") as file:
            return {BARS} if file.readline().startswith("bar,from,to,") else set()
    except (OSError, ValueError):
        return set()
