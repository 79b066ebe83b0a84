"""Forces of members as a workbook, `NAME.member_forces.xlsx`: what is what, the largest of each, a sheet for each.

Metres, newtons and newton metres, as heads say.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.bars import SAID, prepare
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.saf import NEVER, ready, workbook_cells

__all__ = ["check", "encode", "prepare", "ready"]

READ = 1e-9
"""Numbers read back may be off by this share of the largest of their member."""
WIDTH = 31
"""Characters of a sheet's name, at most."""
NOT_IN_NAMES = str.maketrans(dict.fromkeys("[]:*?/\\'", "_"))
OF_ALL = ("least", "greatest")
"""Rows that are of no case."""


def encode(part: Part) -> Iterator[bytes]:
    """The workbook; the same part gives the same bytes."""
    import xlsxwriter

    file, records = io.BytesIO(), part.details.records
    with xlsxwriter.Workbook(file, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}) as book:
        book.set_properties({"created": NEVER})
        strong, plain = book.add_format({"bold": True, "bottom": 1}), book.add_format({"num_format": "0.000"})
        about = book.add_worksheet("about")
        about.set_column(0, 0, 110)
        for k, line in enumerate((f"{part.name}: {SAID[0]}", *SAID[1:])):
            about.write(k, 0, line)
        tables = [("largest", ["member", "number", "value", "case", "bay", "along [m]"], list(_largest(records)))]
        tables += [
            (name, ["case", "bay", "along [m]", *records["columns"]], list(_rows(bar)))
            for name, bar in zip(sheet_names(records["bars"]), records["bars"].values(), strict=True)
        ]
        for name, head, rows in tables:
            sheet = book.add_worksheet(name)
            sheet.freeze_panes(1, 0)
            sheet.set_column(0, len(head) - 1, 13)
            sheet.write_row(0, 0, head, strong)
            for k, row in enumerate(rows, 1):
                sheet.write_row(k, 0, row, plain)
    yield file.getvalue()


def check(part: Part, path: Path) -> ReadBack:
    """Read back by the standard library's readers of archives and XML, number by number."""
    found, bars = workbook_cells(path), part.details.records["bars"]
    if len(found) != len(bars) + 2:
        raise differs(part, "sheets", len(bars) + 2, len(found))
    count = 0
    for name, bar in zip(sheet_names(bars), bars.values(), strict=True):
        numbers = np.array([row[3:] for row in found[name][1:]], dtype=np.float64)
        given = np.concatenate(list(bar["forces"].values()))
        if numbers.shape != given.shape or not (np.abs(numbers - given) <= READ * np.abs(given).max()).all():
            raise ExportError(f"the forces of {name} of {part.name!r} read back different; write member_forces.csv")
        count += len(given)
    return ReadBack(count, "rows")


def sheet_names(bars: Any) -> list[str]:
    """Names of members as sheets may have them: 31 characters, none of []:*?/\\', each once, in capitals or not."""
    seen, names = {"about", "largest"}, []
    for member in bars:
        word = str(member).translate(NOT_IN_NAMES)[:WIDTH]
        count = 1
        while word.lower() in seen:
            count += 1
            tail = f" ({count})"
            word = str(member).translate(NOT_IN_NAMES)[: WIDTH - len(tail)] + tail
        seen.add(word.lower())
        names.append(word)
    return names


def _rows(bar: Any) -> Iterator[list[Any]]:
    for case, table in bar["forces"].items():
        for bay, s, row in zip(bar["bay"], bar["s"].tolist(), table.tolist(), strict=True):
            yield [case, bay, s, *row]


def _largest(records: Any) -> Iterator[list[Any]]:
    """Of each member and each number, the value that is farthest from nothing, and where."""
    for member, bar in records["bars"].items():
        cases = [case for case in bar["forces"] if case not in OF_ALL or len(bar["forces"]) == 1]
        tables = np.stack([bar["forces"][case] for case in cases])
        for column, name in enumerate(records["columns"]):
            case, k = np.unravel_index(int(np.abs(tables[:, :, column]).argmax()), tables.shape[:2])
            yield [member, name, float(tables[case, k, column]), cases[int(case)], bar["bay"][k], float(bar["s"][k])]
