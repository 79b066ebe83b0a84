"""Section forces of a cut sheet: a table, `NAME.forces.csv`, and fields for ParaView, `NAME.forces.vtu`. SI units.

Both hold metres, newtons and newton metres, as names of columns say, and the convention of axes and signs.
"""

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.text import rows

UNITS = "units: metres, newtons, newton metres; n and q per metre of section, m per metre of section"
Q_LESS = "q is one order less accurate than m, and too small by up to a fifth on ribs 3 or 4 faces wide"
DIGITS = "%.8g"
READ = 1e-6
"""Numbers read back may be off by this share of their column's largest."""


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without section forces."""
    if not part.details.records.get("cases"):
        raise ExportError(f"{part.name!r} has no section forces; only a design knows them: use design.write(...)")
    return part


def prepare_fields(part: Part) -> Part:
    """The part with what a VTU file holds: fields of each face, the case before the name of each of its own."""
    records = prepare(part).details.records
    values = {name: column for name, column in records["faces"].items() if not name.startswith(("centre", "area"))}
    for case, columns in records["cases"].items():
        values |= {f"{case} {name}": column for name, column in columns.items() if "degrees" not in name}
    facts = (UNITS, *records["convention"], "one value per face; " + Q_LESS)
    return replace(part, details=replace(part.details, values=values, facts=facts))


def encode(part: Part) -> Iterator[bytes]:
    """Lines that begin with #, a line of names, then a row per face and case; faces count from 1."""
    records = part.details.records
    said = (UNITS, *records["convention"], "one row per face and case; " + Q_LESS)
    yield "".join(f"# {line}\r\n" for line in said).encode()
    faces = _scalars(records["faces"])
    head = ["case", "face", *faces, *_names(records)]
    yield _line(head).encode()
    for case, columns in records["cases"].items():
        numbers = [*faces.values(), *_scalars(columns).values()]
        before = _line([case])[:-2].replace("%", "%%")
        template = ",".join((before, "%d", *[DIGITS] * len(numbers))) + "\r\n"
        for text in rows(template, np.arange(1, len(part.F) + 1), *numbers):
            yield text.encode()


def check(part: Part, path: Path) -> ReadBack:
    """Read back number by number, by numpy."""
    records = part.details.records
    faces, names = _scalars(records["faces"]), _names(records)
    head = len(records["convention"]) + 3
    width = 2 + len(faces) + len(names)
    found = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=head, quotechar='"', usecols=range(1, width), ndmin=2
    )
    wanted = len(part.F) * len(records["cases"])
    if len(found) != wanted:
        raise differs(part, "rows", wanted, len(found))
    blocks = found.reshape(len(records["cases"]), len(part.F), width - 1)
    for block, (case, columns) in zip(blocks, records["cases"].items(), strict=True):
        given = np.stack([*faces.values(), *_scalars(columns).values()], axis=1)
        if not (np.abs(block[:, 1:] - given) <= READ * np.abs(given).max(axis=0)).all():
            raise ExportError(
                f"the section forces of {part.name!r} under {case} read back different; write .forces.vtu"
            )
    return ReadBack(len(found), "rows")


def _names(records: Mapping[str, Mapping[str, Mapping[str, Floats]]]) -> list[str]:
    return list(_scalars(next(iter(records["cases"].values()))))


def _scalars(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Columns of one number each: `local x [1]` of three becomes `local x.x [1]`, `local x.y [1]`, `local x.z [1]`."""
    found: dict[str, Floats] = {}
    for name, values in columns.items():
        if values.ndim == 1:
            found[name] = values
            continue
        word, unit = name.split(" [")
        found |= {f"{word}.{axis} [{unit}": np.asarray(values[:, index]) for index, axis in enumerate("xyz")}
    return found


def _line(words: list[str]) -> str:
    text = io.StringIO()
    csv.writer(text).writerow(words)
    return text.getvalue()
