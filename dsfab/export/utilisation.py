"""Members against the Eurocodes: a table, `NAME.member_utilisation.csv`, the worst bay first."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs

SAID = (
    "what members bear over what they can bear, bay by bay, the worst first; 1 is full",
    "units: metres, newtons, newton metres; forces as in member_forces.csv, where that check decides",
)
HEAD = ("member", "bay", "utilisation", "check", "clause", "case", "along [m]", "width [m]", "thickness [m]", "bay [m]")
DIGITS = 8
READ = 1e-6
"""Numbers read back may be off by this share of the largest of their column."""
NUMBERS = 2
"""The first column of numbers."""


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without members that were checked."""
    if "utilisation" not in part.details.records:
        raise ExportError(f"{part.name!r} has no members to check; only a design knows them: use design.write(...)")
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Lines that begin with #, a line of names, then a row for each bay of a member."""
    found = part.details.records["utilisation"]
    text = io.StringIO()
    text.writelines(f"# {line}\r\n" for line in _lines(found))
    writer = csv.writer(text)
    writer.writerow([*HEAD, *part.details.records["columns"], *found["checks"]])
    for row in found["rows"]:
        words = row["member"], row["bay"], _number(row["utilisation"]), row["check"], row["clause"], row["case"]
        sizes = row["along"], row["width"], found["thickness"], row["length"]
        writer.writerow([*words, *map(_number, (*sizes, *row["forces"], *row["each"]))])
    yield text.getvalue().encode()


def _lines(found: Any) -> Iterator[str]:
    yield from SAID
    yield f"checked by: {found['standard']}"
    yield from found["assumed"]
    yield from (f"not checked: {line}" for line in found["unchecked"])


def _number(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def check(part: Part, path: Path) -> ReadBack:
    """Read back number by number."""
    found = part.details.records["utilisation"]
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
    given = np.array([[row["utilisation"], *row["forces"], *row["each"]] for row in found["rows"]])
    if len(rows) != len(given):
        raise differs(part, "rows", len(given), len(rows))
    read = np.array([[float(row[NUMBERS]), *map(float, row[len(HEAD) :])] for row in rows])
    if not (np.abs(read - given) <= READ * np.maximum(np.abs(given).max(axis=0), 1e-30)).all():
        raise ExportError(f"the table of {part.name!r} reads back different; write member_forces.csv instead")
    return ReadBack(len(rows), "rows")


def sentence(part: Part, refused: Sequence[ExportError]) -> str:
    """Which member bears most."""
    return "; ".join(part.details.records["utilisation"]["told"])
