"""Forces of members: a table, `NAME.member_forces.csv`. Metres, newtons and newton metres, as names of columns say."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs

SAID = (
    "what members bear at their sections, summed up from n, m and q of the cut sheet",
    "units: metres, newtons, newton metres",
    "x along the member, from the first node of its bay on; z: normal of the surface; y = z cross x, to the left",
    "on a section that x points out of: N positive is tension; My positive stretches the side of the normal",
    "Mz positive stretches the right side; Mt turns about x; Vy and Vz act along y and z",
    "least and greatest: of all cases and combinations, each number by itself",
    "bays end where joints begin; Vz is the weak one: up to a fifth of it is missing in ribs of 3 or 4 faces",
)
DIGITS = 8
READ = 1e-6
"""Numbers read back may be off by this share of the largest of their column."""


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without forces of members."""
    if "bars" not in part.details.records:
        raise ExportError(f"{part.name!r} has no forces of members; only a design knows them: use design.write(...)")
    if not part.details.records["bars"]:
        raise ExportError(f"{part.name!r} has no member with a bay between two nodes; write forces.csv, of every face")
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Lines that begin with #, a line of names, then a row per member, station and case."""
    text = io.StringIO()
    text.writelines(f"# {line}\r\n" for line in SAID)
    writer = csv.writer(text)
    writer.writerow(["case", "member", "bay", "along [m]", *part.details.records["columns"]])
    for member, bar in part.details.records["bars"].items():
        for case, rows in bar["forces"].items():
            for bay, s, row in zip(bar["bay"], bar["s"], rows, strict=True):
                writer.writerow([case, member, bay, *(f"{x:.{DIGITS}g}" for x in (s, *row))])
    yield text.getvalue().encode()


def check(part: Part, path: Path) -> ReadBack:
    """Read back number by number, by numpy."""
    found = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=len(SAID) + 1, quotechar='"', usecols=range(4, 10), ndmin=2
    )
    bars = part.details.records["bars"].values()
    given = np.concatenate([rows for bar in bars for rows in bar["forces"].values()])
    if len(found) != len(given):
        raise differs(part, "rows", len(given), len(found))
    if not (np.abs(found - given) <= READ * np.abs(given).max(axis=0)).all():
        raise ExportError(f"the forces of members of {part.name!r} read back different; write forces.csv instead")
    return ReadBack(len(found), "rows")
