"""CSV: the points of all lines as one table, for spreadsheets, Grasshopper and scripts. Lengths are in millimetres."""

import csv
import io
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_lines, with_lines

HEAD = ("id", "kind", "family", "number", "part", "closed", "length_mm", "point", "x_mm", "y_mm", "z_mm")


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it has no lines."""
    return with_lines(part, ".csv")


def encode(part: Part) -> Iterator[bytes]:
    """A row per point; coordinates to 1e-6 mm. Points count from 1; a closed line ends with its first point."""
    yield (",".join(HEAD) + "\r\n").encode()
    for line in part.details.lines:
        text = io.StringIO()
        label = (line.id, line.kind, line.family, line.number, line.part, int(line.closed), f"{line.length:.6f}")
        csv.writer(text).writerows(
            (*label, i, *(f"{value + 0.0:.6f}" for value in point)) for i, point in enumerate(line.points.tolist(), 1)
        )
        yield text.getvalue().encode()


def check(part: Part, path: Path) -> ReadBack:
    """Read back row by row."""
    with open(path, encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    found = [
        np.array([[float(row[axis]) for axis in HEAD[-3:]] for row in group])
        for _, group in groupby(table, key=lambda row: row["id"])
    ]
    return check_lines(part, found)
