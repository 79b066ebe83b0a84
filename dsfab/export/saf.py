"""Structural Analysis Format, `NAME.saf.xlsx`: the beam model for SCIA, RFEM, SOFiSTiK, ALLPLAN, AxisVM and others."""

import importlib.util
import io
import zipfile
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.saf_tables import Cell, SafSheet, saf_sheets

SUFFIX = ".saf.xlsx"
NEVER = datetime(1980, 1, 1)
"""The date in every workbook: the same design gives the same bytes."""
MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
READ = 1e-9
"""Coordinates read back may be off by this share of the largest one."""


def ready() -> None:
    """Raise ExportError if XlsxWriter is not installed."""
    if importlib.util.find_spec("xlsxwriter") is None:
        raise ExportError(".xlsx files need the library XlsxWriter; install it with: pip install XlsxWriter")


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without a beam model."""
    if not part.details.records.get("frame"):
        raise ExportError(f"{part.name!r} has no beam model; only a design knows it: use design.write(...)")
    return part


def told(part: Part, refused: Sequence[ExportError]) -> str:
    """How far the beams answer as the sheet does, case by case."""
    return "\n".join(part.details.records["told"])


def encode(part: Part) -> Iterator[bytes]:
    """The workbook; the same part gives the same bytes."""
    import xlsxwriter

    file = io.BytesIO()
    with xlsxwriter.Workbook(file, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}) as book:
        book.set_properties({"created": NEVER})
        strong = book.add_format({"bold": True, "bottom": 1})
        for table in saf_sheets(part.name, part.details.records):
            sheet = book.add_worksheet(table.name)
            rows = [table.head, *table.rows] if table.head else table.rows
            for k, row in enumerate(rows):
                for column, cell in enumerate(row):
                    if cell is not None:
                        sheet.write(k, column, cell, strong if table.head and k == 0 else None)
            sheet.freeze_panes(1 if table.head else 0, 1)
            sheet.set_column(0, 30, 18)
    yield file.getvalue()


def check(part: Part, path: Path) -> ReadBack:
    """Read back by the standard library's readers of archives and XML: every sheet with its head and its rows, and the
    nodes where they are."""
    found, wanted = workbook_cells(path), saf_sheets(part.name, part.details.records)
    for sheet in wanted:
        rows = found.get(sheet.name, [])
        count = len(sheet.rows) + (1 if sheet.head else 0)
        if len(rows) != count:
            raise differs(part, f"rows of {sheet.name}", count, len(rows))
        if sheet.head and tuple(rows[0]) != sheet.head:
            raise ExportError(f"the head of {sheet.name} of {part.name!r} reads back different; write it again")
    points = _coordinates(found["StructuralPointConnection"][1:])
    given = _coordinates([list(row) for row in _sheet(wanted, "StructuralPointConnection").rows])
    if not (np.abs(points - given) <= READ * np.abs(given).max()).all():
        raise ExportError(f"the nodes of {part.name!r} read back elsewhere; write members.json instead")
    return ReadBack(len(_sheet(wanted, "StructuralCurveMember").rows), "beams")


def _sheet(sheets: Sequence[SafSheet], name: str) -> SafSheet:
    return next(sheet for sheet in sheets if sheet.name == name)


def _coordinates(rows: Sequence[Sequence[Cell | None]]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return np.array([row[1:4] for row in rows], dtype=np.float64)


def workbook_cells(path: Path) -> dict[str, list[list[Cell | None]]]:
    """By the names of sheets, their rows; cells that are left out are None.

    Of the parts of Office Open XML (ECMA-376) that XlsxWriter writes: numbers and shared strings.
    """
    with zipfile.ZipFile(path) as archive:
        shared = [
            "".join(text.text or "" for text in item.iter(f"{MAIN}t"))
            for item in ElementTree.fromstring(archive.read("xl/sharedStrings.xml"))
        ]
        names = [
            one.attrib["name"] for one in ElementTree.fromstring(archive.read("xl/workbook.xml")).iter(f"{MAIN}sheet")
        ]
        found = {}
        for number, name in enumerate(names, 1):
            root = ElementTree.fromstring(archive.read(f"xl/worksheets/sheet{number}.xml"))
            found[name] = [_row(row, shared) for row in root.iter(f"{MAIN}row")]
    return found


def _row(row: ElementTree.Element, shared: list[str]) -> list[Cell | None]:
    cells: list[Cell | None] = []
    for cell in row.iter(f"{MAIN}c"):
        letters = cell.attrib["r"].rstrip("0123456789")
        column = 0
        for letter in letters:
            column = 26 * column + ord(letter) - ord("A") + 1
        cells += [None] * (column - len(cells))
        value = cell.find(f"{MAIN}v")
        if value is not None and value.text is not None:
            cells[-1] = shared[int(value.text)] if cell.attrib.get("t") == "s" else float(value.text)
    return cells
