"""CSV files and workbooks in SI units: section forces of a sheet, forces and utilisation of members."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.export.analysis.saf import FIXED_DATE, workbook_cells
from dsfab.export.part import Part
from dsfab.export.readback import NUMBERS_READ_BACK, ReadBack, require_equal
from dsfab.export.writing import rows
from dsfab.statics import CONVENTION, SectionForces

if TYPE_CHECKING:
    from dsfab.members.eurocode import Utilisation
    from dsfab.members.frame import MemberForces

COLUMNS = ("N [N]", "Vy [N]", "Vz [N]", "Mt [N m]", "My [N m]", "Mz [N m]")

UNITS = "units: metres and newtons; n and q: newtons per metre of section; m: newton metres per metre of section"
Q_LESS = "shear q converges one order slower than moment m; on ribs 3 or 4 faces wide, q is up to a fifth too small"
SHEET_FORMAT = "%.8g"
READ = 1e-6  # largest error of numbers read back / largest number of the column


def prepare_fields(part: Part) -> Part:
    """Return the part with its section forces as values in the faces, for a VTU file."""
    details = part.details
    values = {name: column for name, column in _faces(part).items() if not name.startswith(("centre", "area"))}
    for case, forces in details.section_forces.items():
        values |= {f"{case} {name}": column for name, column in _columns(forces).items() if "degrees" not in name}
    facts = (UNITS, *CONVENTION, "one value per face; " + Q_LESS)
    return replace(part, details=replace(part.details, values=values, facts=facts))


def encode_sheet(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a CSV file of section forces. A row has a face, numbered from 1, and a load case."""
    yield "".join(f"# {x}\r\n" for x in (UNITS, *CONVENTION, "one row for each face and load case; " + Q_LESS)).encode()
    faces = _scalars(_faces(part))
    yield _line(["case", "face", *faces, *_names(part)]).encode()
    for case, forces in part.details.section_forces.items():
        numbers = [*faces.values(), *_scalars(_columns(forces)).values()]
        before = _line([case])[:-2].replace("%", "%%")
        template = ",".join((before, "%d", *[SHEET_FORMAT] * len(numbers))) + "\r\n"
        for text in rows(template, np.arange(1, len(part.F) + 1), *numbers):
            yield text.encode()


def check_sheet(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare the numbers with the part."""
    faces, names, cases = _scalars(_faces(part)), _names(part), part.details.section_forces
    head = len(CONVENTION) + 3
    width = 2 + len(faces) + len(names)
    numbers = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=head, quotechar='"', usecols=range(1, width), ndmin=2
    )
    require_equal(part, "rows", len(part.F) * len(cases), len(numbers))
    blocks = numbers.reshape(len(cases), len(part.F), width - 1)
    for block, (case, forces) in zip(blocks, cases.items(), strict=True):
        expected = np.stack([*faces.values(), *_scalars(_columns(forces)).values()], axis=1)
        if not (np.abs(block[:, 1:] - expected) <= READ * np.abs(expected).max(axis=0)).all():
            raise ExportError(
                f"the section forces of {part.name!r} under {case} differ when the file is read back; write .forces.vtu"
            )
    return ReadBack(len(numbers), "rows")


def _names(part: Part) -> list[str]:
    return list(_scalars(_columns(next(iter(part.details.section_forces.values())))))


def _faces(part: Part) -> dict[str, Floats]:
    sheet, first_case = part.details.sheet, next(iter(part.details.section_forces.values()))
    assert sheet is not None
    return {
        "centre [m]": sheet.centroids,
        "area [m2]": sheet.areas,
        "local x [1]": first_case.frame[:, 0],
        "local y [1]": first_case.frame[:, 1],
        "normal [1]": sheet.normals,
    }


def _columns(forces: SectionForces) -> dict[str, Floats]:
    columns: dict[str, Floats] = {}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        for index, axes in enumerate(("x", "y", "xy")):
            columns[f"{name}_{axes} [{unit}]"] = getattr(forces, name)[:, index]
    columns |= {f"q_{axis} [N/m]": np.asarray(forces.q[:, index]) for index, axis in enumerate("xy")}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        values, angle, direction = forces.principal(name)
        columns |= {f"{name}_{index} [{unit}]": np.asarray(values[:, index - 1]) for index in (1, 2)}
        columns[f"{name}_1 from local x [degrees]"] = angle
        columns[f"{name}_1 direction [1]"] = direction
    return columns


def _scalars(columns: Mapping[str, Floats]) -> dict[str, Floats]:
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
    "forces of members at their sections, summed from n, m and q of the cut sheet",
    "units: metres, newtons, newton metres",
    "x along the member, from the first node of its bay (the part between two nodes); z: normal of the surface; y = z "
    "cross x, to the left",
    "signs on a section with outward normal x: positive N is tension; positive My stretches the side at positive z",
    "positive Mz stretches the right side (negative y); Mt turns about x; Vy and Vz act along y and z",
    "rows 'least' and 'greatest': smallest and largest value of each column over all cases and combinations",
    "bays end where joints begin; Vz is the least accurate force, and is computed from the change of moments where "
    "both values differ",
)


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a CSV file of member forces, with a row for each member, station and load case."""
    text = io.StringIO()
    text.writelines(f"# {line}\r\n" for line in MEMBER_NOTES)
    writer = csv.writer(text)
    writer.writerow(["case", "member", "bay", "along [m]", *COLUMNS])
    for member, along in _forces(part).items():
        for case, bay, *numbers in _rows(along):
            writer.writerow([case, member, bay, *map(_number, numbers)])
    yield text.getvalue().encode()


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare the numbers with the part."""
    numbers = np.loadtxt(
        path, delimiter=",", comments=None, skiprows=len(MEMBER_NOTES) + 1, quotechar='"', usecols=range(4, 10), ndmin=2
    )
    expected = np.concatenate([rows for along in _forces(part).values() for rows in _tables(along).values()])
    require_equal(part, "rows", len(expected), len(numbers))
    if not (np.abs(numbers - expected) <= READ * np.abs(expected).max(axis=0)).all():
        raise ExportError(
            f"the forces of members of {part.name!r} differ when the file is read back; write forces.csv instead"
        )
    return ReadBack(len(numbers), "rows")


NOT_IN_NAMES = str.maketrans(dict.fromkeys("[]:*?/\\'", "_"))


def encode_workbook(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a workbook of member forces, with a worksheet for each member."""
    import xlsxwriter

    file, members = io.BytesIO(), _forces(part)
    with xlsxwriter.Workbook(file, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}) as book:
        book.set_properties({"created": FIXED_DATE})
        strong, number_format = book.add_format({"bold": True, "bottom": 1}), book.add_format({"num_format": "0.000"})
        about = book.add_worksheet("about")
        about.set_column(0, 0, 110)
        for k, line in enumerate((f"{part.name}: {MEMBER_NOTES[0]}", *MEMBER_NOTES[1:])):
            about.write(k, 0, line)
        tables = [("largest", ["member", "number", "value", "case", "bay", "along [m]"], list(_largest(members)))]
        tables += [
            (name, ["case", "bay", "along [m]", *COLUMNS], list(_rows(along)))
            for name, along in zip(sheet_names(members), members.values(), strict=True)
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
    """Read the file back and compare the numbers with the part."""
    cells, members = workbook_cells(path), _forces(part)
    require_equal(part, "sheets", len(members) + 2, len(cells))
    count = 0
    for name, along in zip(sheet_names(members), members.values(), strict=True):
        numbers = np.array([row[3:] for row in cells[name][1:]], dtype=np.float64)
        expected = np.concatenate(list(_tables(along).values()))
        if (
            numbers.shape != expected.shape
            or not (np.abs(numbers - expected) <= NUMBERS_READ_BACK * np.abs(expected).max()).all()
        ):
            raise ExportError(
                f"the forces of {name} of {part.name!r} differ when the file is read back; write member_forces.csv"
            )
        count += len(expected)
    return ReadBack(count, "rows")


def sheet_names(members: Iterable[str]) -> list[str]:
    r"""Return different names for the members' worksheets, with at most 31 letters and without []:*?/\\'."""
    seen, names, width = {"about", "largest"}, [], 31
    for member in members:
        word = member.translate(NOT_IN_NAMES)[:width]
        count = 1
        while word.lower() in seen:
            count += 1
            tail = f" ({count})"
            word = member.translate(NOT_IN_NAMES)[: width - len(tail)] + tail
        seen.add(word.lower())
        names.append(word)
    return names


def _forces(part: Part) -> Mapping[str, "MemberForces"]:
    return part.details.member_forces or {}


def _tables(along: "MemberForces") -> dict[str, Floats]:
    least, greatest = np.moveaxis(along.envelope, -1, 0)
    return {**along.forces, **({"least": least, "greatest": greatest} if len(along.forces) > 1 else {})}


def _rows(along: "MemberForces") -> Iterator[list[Any]]:
    for case, table in _tables(along).items():
        for bay, s, row in zip(along.bay, along.s.tolist(), table.tolist(), strict=True):
            yield [case, bay, s, *row]


def _largest(members: Mapping[str, "MemberForces"]) -> Iterator[list[Any]]:
    for member, along in members.items():
        cases, tables = list(along.forces), np.stack(list(along.forces.values()))
        for column, name in enumerate(COLUMNS):
            case, k = np.unravel_index(int(np.abs(tables[:, :, column]).argmax()), tables.shape[:2])
            yield [member, name, float(tables[case, k, column]), cases[int(case)], along.bay[k], float(along.s[k])]


UTILISATION_NOTES = (
    "utilisation: force divided by resistance, for each bay of the members, the largest value first; the limit is 1",
    "units: metres, newtons, newton metres; forces as in member_forces.csv, for the section of largest utilisation",
)
HEAD = ("member", "bay", "utilisation", "check", "clause", "case", "along [m]", "width [m]", "thickness [m]", "bay [m]")


def encode_utilisation(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a CSV file of utilisations, with a row for each bay (part between nodes) of a member."""
    utilisation = _utilisation(part)
    text, bays = io.StringIO(), utilisation.bays
    text.writelines(f"# {line}\r\n" for line in _lines(utilisation))
    writer = csv.writer(text)
    writer.writerow([*HEAD, *COLUMNS, *map(str, utilisation.checks)])
    for bay in utilisation.order.tolist():
        check, case, station = utilisation.governing(bay)
        words = bays.member[bay], bays.name[bay], _number(utilisation.largest[bay]), check.name, check.clause, case
        sizes = bays.s[bay, station], bays.width[bay, station], bays.thickness, bays.length[bay]
        writer.writerow([*words, *map(_number, (*sizes, *_checked_numbers(utilisation, bay)[1:]))])
    yield text.getvalue().encode()


def _utilisation(part: Part) -> "Utilisation":
    assert part.details.utilisation is not None
    return part.details.utilisation


def _checked_numbers(utilisation: "Utilisation", bay: int) -> list[float]:
    _, case, station = utilisation.governing(bay)
    forces = utilisation.bays.forces[case][bay, station]
    return [utilisation.largest[bay], *forces.tolist(), *utilisation.worst[bay].tolist()]


def _lines(utilisation: "Utilisation") -> Iterator[str]:
    yield from UTILISATION_NOTES
    yield f"checked by: {utilisation.standard}"
    yield from utilisation.assumed
    yield from (f"not checked: {line}" for line in utilisation.unchecked)


def _number(value: float) -> str:
    return f"{value:.8g}"


def check_utilisation(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare the numbers with the part."""
    utilisation = _utilisation(part)
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
    expected = np.array([_checked_numbers(utilisation, bay) for bay in utilisation.order.tolist()])
    require_equal(part, "rows", len(expected), len(rows))
    read = np.array([[float(row[HEAD.index("utilisation")]), *map(float, row[len(HEAD) :])] for row in rows])
    if not (np.abs(read - expected) <= READ * np.maximum(np.abs(expected).max(axis=0), 1e-30)).all():
        raise ExportError(
            f"the table of {part.name!r} differs when the file is read back; write member_forces.csv instead"
        )
    return ReadBack(len(rows), "rows")


def sentence(part: Part) -> str:
    """Return a sentence about the member with the largest utilisation."""
    return _utilisation(part).summary
