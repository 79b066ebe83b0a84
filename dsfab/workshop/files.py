"""All that a workshop opens: `nest.dxf`, a DXF and an SVG for each part to cut, and the cut lists, in one folder."""

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from dsfab.export import check_flat_dxf, flat_dxf, flat_svg, whole_or_nothing, write_chunks
from dsfab.workshop.drawings import file_stem, nest_drawing, part_drawing, sheet_drawing
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.tables import bar_table, cut_list, cut_list_workbook, table_csv

NEST, CUTLIST, WORKBOOK, BARS, SHEET = "nest", "cutlist.csv", "cutlist.xlsx", "bars.csv", "sheet_"
LASER = 1e-4
"""Metres; width of lines in the SVG files of sheets."""


def write_workshop(
    plan: WorkshopPlan, folder: Path, name: str, documents: Mapping[str, bytes] = MappingProxyType({})
) -> Path:
    """Write the files of a plan into a folder, all of them or none. Those of an earlier plan that this one does not
    have are removed, as its cut list names them. The same plan gives the same bytes.

    documents : whole files by their names, which go with it.

    Raises ExportError where the folder cannot be written.
    """
    with whole_or_nothing(folder, _outdated) as partial:
        nest = nest_drawing(plan, name)
        write_chunks(partial / f"{NEST}.dxf", [flat_dxf(nest)])
        check_flat_dxf(nest, partial / f"{NEST}.dxf")
        write_chunks(partial / f"{NEST}.svg", [flat_svg(nest)])
        if plan.model:
            _write_sheets(plan, partial, name)
        for group in plan.same:
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
    """A DXF and an SVG of each sheet alone, each on its own way to the laser."""
    for k, sheet in enumerate(plan.sheets, 1):
        drawing = sheet_drawing(sheet, f"{name}, sheet {k} of {len(plan.sheets)}")
        path = folder / f"{SHEET}{k}.dxf"
        write_chunks(path, [flat_dxf(drawing)])
        check_flat_dxf(drawing, path)
        write_chunks(path.with_suffix(".svg"), [flat_svg(drawing, LASER)])


def _outdated(target: Path, partial: Path) -> set[str]:
    """Files that the cut list of an earlier plan names, or that go with it, and that are not written again."""
    try:
        with open(target / CUTLIST, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        named = {row["file"] for row in rows}
        named |= {f"{SHEET}{number}.dxf" for row in rows for number in row["sheets"].split()}
    except (OSError, ValueError, KeyError, AttributeError):
        return set()
    names = {name for name in named if name == Path(name).name} if None not in named else set()
    return (set(_with_svg(names)) | _bar_list(target)) - {path.name for path in partial.iterdir()}


def _bar_list(target: Path) -> set[str]:
    """The list of bars of an earlier plan, if there is one."""
    try:
        with open(target / BARS, encoding="utf-8") as file:
            return {BARS} if file.readline().startswith("bar,from,to,") else set()
    except (OSError, ValueError):
        return set()


def _with_svg(names: set[str]) -> Iterator[str]:
    for name in names:
        yield name
        yield Path(name).with_suffix(".svg").name
