"""Section forces of a sheet, and forces and Eurocode utilisation of members, as CSV and workbook; SI units."""

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.export.analysis.saf import FIXED_DATE, workbook_cells
from dsfab.export.part import Part
from dsfab.export.readback import NUMBERS_READ_BACK, ReadBack, count_error
from dsfab.export.writing import rows

UNITS = "units: metres, newtons, newton metres; n and q per metre of section, m per metre of section"
Q_LESS = "q is one order less accurate than m, and too small by up to a fifth on ribs 3 or 4 faces wide"
SHEET_FORMAT = "%.8g"
READ = 1e-6
"""Numbers read back may be off by this share of their column's largest."""


def prepare_sheet(part: Part) -> Part:
    """Return the part itself; raises ExportError if it has no section forces."""
    if not part.details.records.get("cases"):
        raise ExportError(f"{part.name!r} has no section forces; only a design knows them: use design.write(...)")
    return part


def prepare_fields(part: Part) -> Part:
    """Return the part with the fields of a VTU file, one value per face; each name begins with its case."""
    records = prepare_sheet(part).details.records
    values = {name: column for name, column in records["faces"].items() if not name.startswith(("centre", "area"))}
    for case, columns in records["cases"].items():
        values |= {f"{case} {name}": column for name, column in columns.items() if "degrees" not in name}
    facts = (UNITS, *records["convention"], "one value per face; " + Q_LESS)
    return replace(part, details=replace(part.details, values=values, facts=facts))


def encode_sheet(part: Part) -> Iterator[bytes]:
    """Yield lines that begin with #, a line of names, then a row per face and case; faces count from 1."""
    records = part.details.records
    notes = (UNITS, *records["convention"], "one row per face and case; " + Q_LESS)
    yield "".join(f"# {line}\r\n" for line in notes).encode()
    faces = _scalars(records["faces"])
    head = ["case", "face", *faces, *_names(records)]
    yield _line(head).encode()
    for case, columns in records["cases"].items():
        numbers = [*faces.values(), *_scalars(columns).values()]
        before = _line([case])[:-2].replace("%", "%%")
        template = ",".join((before, "%d", *[SHEET_FORMAT] * len(numbers))) + "\r\n"
        for text in rows(template, np.arange(1, len(part.F) + 1), *numbers):
            yield text.encode()


def check_sheet(part: Part, path: Path) -> ReadBack:
    """Read the numbers back with numpy."""
    records = part.details.records
    faces, names = _scalars(records["faces"]), _names(records)
    head = len(records["convention"]) + 3
    width = 2 + len(faces) + len(names)
    numbers = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=head, quotechar='"', usecols=range(1, width), ndmin=2
    )
    row_count = len(part.F) * len(records["cases"])
    if len(numbers) != row_count:
        raise count_error(part, "rows", row_count, len(numbers))
    blocks = numbers.reshape(len(records["cases"]), len(part.F), width - 1)
    for block, (case, columns) in zip(blocks, records["cases"].items(), strict=True):
        expected = np.stack([*faces.values(), *_scalars(columns).values()], axis=1)
        if not (np.abs(block[:, 1:] - expected) <= READ * np.abs(expected).max(axis=0)).all():
            raise ExportError(
                f"the section forces of {part.name!r} under {case} read back different; write .forces.vtu"
            )
    return ReadBack(len(numbers), "rows")


def _names(records: Mapping[str, Mapping[str, Mapping[str, Floats]]]) -> list[str]:
    return list(_scalars(next(iter(records["cases"].values()))))


def _scalars(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Split vector columns: `local x [1]` becomes `local x.x [1]`, `local x.y [1]`, `local x.z [1]`."""
    scalars: dict[str, Floats] = {}
    for name, values in columns.items():
        if values.ndim == 1:
            scalars[name] = values
            continue
        word, unit = name.split(" [")
        scalars |= {f"{word}.{axis} [{unit}": np.asarray(values[:, index]) for index, axis in enumerate("xyz")}
    return scalars


def _line(words: list[str]) -> str:
    text = io.StringIO()
    csv.writer(text).writerow(words)
    return text.getvalue()


MEMBER_NOTES = (
    "what members bear at their sections, summed up from n, m and q of the cut sheet",
    "units: metres, newtons, newton metres",
    "x along the member, from the first node of its bay on; z: normal of the surface; y = z cross x, to the left",
    "on a section that x points out of: N positive is tension; My positive stretches the side of the normal",
    "Mz positive stretches the right side; Mt turns about x; Vy and Vz act along y and z",
    "least and greatest: of all cases and combinations, each number by itself",
    "bays end where joints begin; Vz is the weak one: up to a fifth of it is missing in ribs of 3 or 4 faces",
)


def prepare_members(part: Part) -> Part:
    """Return the part itself; raises ExportError if it has no member forces."""
    if "bars" not in part.details.records:
        raise ExportError(f"{part.name!r} has no forces of members; only a design knows them: use design.write(...)")
    if not part.details.records["bars"]:
        raise ExportError(f"{part.name!r} has no member with a bay between two nodes; write forces.csv, of every face")
    return part


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield lines that begin with #, a line of names, then a row per member, station and case."""
    text = io.StringIO()
    text.writelines(f"# {line}\r\n" for line in MEMBER_NOTES)
    writer = csv.writer(text)
    writer.writerow(["case", "member", "bay", "along [m]", *part.details.records["columns"]])
    for member, bar in part.details.records["bars"].items():
        for case, forces in bar["forces"].items():
            for bay, s, row in zip(bar["bay"], bar["s"], forces, strict=True):
                writer.writerow([case, member, bay, *map(_number, (s, *row))])
    yield text.getvalue().encode()


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the numbers back with numpy."""
    numbers = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=len(MEMBER_NOTES) + 1, quotechar='"', usecols=range(4, 10), ndmin=2
    )
    bars = part.details.records["bars"].values()
    expected = np.concatenate([rows for bar in bars for rows in bar["forces"].values()])
    if len(numbers) != len(expected):
        raise count_error(part, "rows", len(expected), len(numbers))
    if not (np.abs(numbers - expected) <= READ * np.abs(expected).max(axis=0)).all():
        raise ExportError(f"the forces of members of {part.name!r} read back different; write forces.csv instead")
    return ReadBack(len(numbers), "rows")


NOT_IN_NAMES = str.maketrans(dict.fromkeys("[]:*?/\\'", "_"))
OF_ALL = ("least", "greatest")
"""Rows that belong to no case."""


def encode_workbook(part: Part) -> Iterator[bytes]:
    """Yield the workbook; equal parts give equal bytes."""
    import xlsxwriter

    file, records = io.BytesIO(), part.details.records
    with xlsxwriter.Workbook(file, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}) as book:
        book.set_properties({"created": FIXED_DATE})
        strong, number_format = book.add_format({"bold": True, "bottom": 1}), book.add_format({"num_format": "0.000"})
        about = book.add_worksheet("about")
        about.set_column(0, 0, 110)
        for k, line in enumerate((f"{part.name}: {MEMBER_NOTES[0]}", *MEMBER_NOTES[1:])):
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
                sheet.write_row(k, 0, row, number_format)
    yield file.getvalue()


def check_workbook(part: Part, path: Path) -> ReadBack:
    """Read the numbers back with the standard library's readers of archives and XML."""
    cells, bars = workbook_cells(path), part.details.records["bars"]
    if len(cells) != len(bars) + 2:
        raise count_error(part, "sheets", len(bars) + 2, len(cells))
    count = 0
    for name, bar in zip(sheet_names(bars), bars.values(), strict=True):
        numbers = np.array([row[3:] for row in cells[name][1:]], dtype=np.float64)
        expected = np.concatenate(list(bar["forces"].values()))
        if (
            numbers.shape != expected.shape
            or not (np.abs(numbers - expected) <= NUMBERS_READ_BACK * np.abs(expected).max()).all()
        ):
            raise ExportError(f"the forces of {name} of {part.name!r} read back different; write member_forces.csv")
        count += len(expected)
    return ReadBack(count, "rows")


def sheet_names(bars: Any) -> list[str]:
    r"""Return names of members as sheet names: at most 31 characters, none of []:*?/\\', each once regardless of
    case.
    """
    seen, names, width = {"about", "largest"}, [], 31
    for member in bars:
        word = str(member).translate(NOT_IN_NAMES)[:width]
        count = 1
        while word.lower() in seen:
            count += 1
            tail = f" ({count})"
            word = str(member).translate(NOT_IN_NAMES)[: width - len(tail)] + tail
        seen.add(word.lower())
        names.append(word)
    return names


def _rows(bar: Any) -> Iterator[list[Any]]:
    for case, table in bar["forces"].items():
        for bay, s, row in zip(bar["bay"], bar["s"].tolist(), table.tolist(), strict=True):
            yield [case, bay, s, *row]


def _largest(records: Any) -> Iterator[list[Any]]:
    """Rows with the value of largest magnitude of each member and each number, and its place."""
    for member, bar in records["bars"].items():
        cases = [case for case in bar["forces"] if case not in OF_ALL or len(bar["forces"]) == 1]
        tables = np.stack([bar["forces"][case] for case in cases])
        for column, name in enumerate(records["columns"]):
            case, k = np.unravel_index(int(np.abs(tables[:, :, column]).argmax()), tables.shape[:2])
            yield [member, name, float(tables[case, k, column]), cases[int(case)], bar["bay"][k], float(bar["s"][k])]


UTILISATION_NOTES = (
    "what members bear over what they can bear, bay by bay, the worst first; 1 is full",
    "units: metres, newtons, newton metres; forces as in member_forces.csv, where that check decides",
)
HEAD = ("member", "bay", "utilisation", "check", "clause", "case", "along [m]", "width [m]", "thickness [m]", "bay [m]")


def prepare_utilisation(part: Part) -> Part:
    """Return the part itself; raises ExportError if no members were checked."""
    if "utilisation" not in part.details.records:
        raise ExportError(f"{part.name!r} has no members to check; only a design knows them: use design.write(...)")
    return part


def encode_utilisation(part: Part) -> Iterator[bytes]:
    """Yield lines that begin with #, a line of names, then a row for each bay of a member."""
    record = part.details.records["utilisation"]
    text = io.StringIO()
    text.writelines(f"# {line}\r\n" for line in _lines(record))
    writer = csv.writer(text)
    writer.writerow([*HEAD, *part.details.records["columns"], *record["checks"]])
    for row in record["rows"]:
        words = row["member"], row["bay"], _number(row["utilisation"]), row["check"], row["clause"], row["case"]
        sizes = row["along"], row["width"], record["thickness"], row["length"]
        writer.writerow([*words, *map(_number, (*sizes, *row["forces"], *row["each"]))])
    yield text.getvalue().encode()


def _lines(record: Any) -> Iterator[str]:
    yield from UTILISATION_NOTES
    yield f"checked by: {record['standard']}"
    yield from record["assumed"]
    yield from (f"not checked: {line}" for line in record["unchecked"])


def _number(value: float) -> str:
    return f"{value:.8g}"


def check_utilisation(part: Part, path: Path) -> ReadBack:
    """Read the numbers back."""
    record = part.details.records["utilisation"]
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
    expected = np.array([[row["utilisation"], *row["forces"], *row["each"]] for row in record["rows"]])
    if len(rows) != len(expected):
        raise count_error(part, "rows", len(expected), len(rows))
    read = np.array([[float(row[HEAD.index("utilisation")]), *map(float, row[len(HEAD) :])] for row in rows])
    if not (np.abs(read - expected) <= READ * np.maximum(np.abs(expected).max(axis=0), 1e-30)).all():
        raise ExportError(f"the table of {part.name!r} reads back different; write member_forces.csv instead")
    return ReadBack(len(rows), "rows")


def sentence(part: Part) -> str:
    """Return a sentence on the member with the largest utilisation."""
    return "; ".join(part.details.records["utilisation"]["told"])
