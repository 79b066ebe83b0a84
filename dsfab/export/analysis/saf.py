"""Structural Analysis Format (SAF) 2.2.0: the beam model as a workbook."""

import importlib.util
import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.core.materials import MATERIALS
from dsfab.core.units import MM_PER_M
from dsfab.export.part import Part
from dsfab.export.readback import NUMBERS_READ_BACK, ReadBack, require_equal

if TYPE_CHECKING:
    from dsfab.members.frame import BeamMaterial, Frame

VERSION = "2.2.0"
Cell = str | int | float
KILO, MEGA = 1e3, 1e6
FINE, COARSE = 0.1, 1.0  # rounding steps (mm) of widths below and above 100 mm, so that similar beams share a section
SMALL = {0: 1e-6, 3: 1e-2}
"""Smallest forces (key 0) and moments (key 3) in the workbook, as fractions of the largest value in the load case."""
TYPES = {
    "S": "Steel",
    "GL": "Timber",
    "CLT": "Timber",
    "plywood": "Timber",
    "aluminium": "Aluminium",
    "concrete": "Concrete",
}
"""Type of a material, by the beginning of the material's name; all further materials have the type `Other`."""
ACTIONS = {
    "permanent": ("Permanent", "Standard"),
    "snow": ("Variable", "Snow"),
    "wind": ("Variable", "Wind"),
    "variable": ("Variable", "Standard"),
}
"""Action type and load type in SAF, by kind of action."""
GROUPS = {"snow": "Snow", "wind": "Wind", "variable": "Domestic"}  # load type of a load group in SAF, by kind of action
DIRECTIONS = ("ux", "uy", "uz", "fix", "fiy", "fiz")
STIFFNESS = (
    *("Stiffness X [MN/m]", "Stiffness Y [MN/m]", "Stiffness Z [MN/m]"),
    *("Stiffness Fix [MNm/rad]", "Stiffness Fiy [MNm/rad]", "Stiffness Fiz [MNm/rad]"),
)


@dataclass(frozen=True)
class SafSheet:
    """A sheet of the workbook: column names in `head`, then rows."""

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell | None, ...], ...]

    @classmethod
    def from_rows(cls, name: str, rows: list[dict[str, Cell | None]]) -> "SafSheet":
        """Return a sheet that has a column for each key of `rows`."""
        head = tuple(dict.fromkeys(key for row in rows for key in row))
        return cls(name, head, tuple(tuple(row.get(key) for key in head) for row in rows))


def saf_sheets(name: str, frame: "Frame", description: str = "") -> list[SafSheet]:
    """Return the sheets of the workbook for a beam model."""
    sections = [_dimensions(t, w) for t, w in zip(frame.thickness, frame.width, strict=True)]
    numbers = {size: f"CS{k}" for k, size in enumerate(dict.fromkeys(sections), 1)}
    sheets = [
        SafSheet("Project", (), (("Name", name), ("Description", description))),
        SafSheet("Model", (), _model(name)),
        SafSheet.from_rows("StructuralMaterial", [_material(frame.material)]),
        SafSheet.from_rows(
            "StructuralCrossSection", [_section(frame.material, size, id_) for size, id_ in numbers.items()]
        ),
        SafSheet.from_rows("StructuralPointConnection", list(_nodes(frame))),
        SafSheet.from_rows("StructuralCurveMember", list(_members(frame, [numbers[size] for size in sections]))),
        SafSheet.from_rows("StructuralPointSupport", list(_supports(frame))),
        SafSheet.from_rows("StructuralLoadGroup", _groups(frame.actions)),
        SafSheet.from_rows("StructuralLoadCase", [_case(case, kind) for case, kind in frame.actions.items()]),
        SafSheet.from_rows(
            "StructuralLoadCombination", [_sum(*combination) for combination in frame.combinations.items()]
        ),
        SafSheet.from_rows("StructuralPointAction", list(_actions(frame, 0))),
        SafSheet.from_rows("StructuralPointMoment", list(_actions(frame, 3))),
    ]
    return [sheet for sheet in sheets if sheet.rows]


def _model(name: str) -> tuple[tuple[str, str], ...]:
    return (
        ("Name", name),
        ("Description", "beams along the members of a cut sheet, by dsfab; the nodal loads include the weight"),
        ("Discipline", "Load-bearing structure"),
        ("Source type", "Structural analysis model"),
        ("Source application", "dsfab"),
        ("SAF Version", VERSION),
        ("Global coordinate system", "Z vertical"),
        ("LCS of cross-section", "ZYX"),
        ("System of units", "Metric"),
        ("National code", "EC-Standard-EN"),
    )


def _material(material: "BeamMaterial") -> dict[str, Cell | None]:
    name, listed = material.name or "material of the preset", MATERIALS.get(material.name)
    kind = next((kind for begin, kind in TYPES.items() if material.name.startswith(begin)), "Other")
    return {
        "Name": name,
        "Type": kind,
        "Quality": name,
        "Unit mass [kg/m3]": material.density,
        "E modulus [MPa]": material.young / MEGA,
        "G modulus [MPa]": material.shear / MEGA,
        "Poisson Coefficient": material.poisson,
        "Thermal expansion [1/K]": listed.expansion if listed else None,
    }


def _dimensions(thickness: float, width: float) -> tuple[float, float]:
    w = MM_PER_M * width
    step = COARSE if w >= 100 * COARSE else FINE
    return round(MM_PER_M * thickness, 3), round(max(round(w / step), 1) * step, 1)


def _section(material: "BeamMaterial", size: tuple[float, float], name: str) -> dict[str, Cell | None]:
    H, B = (x / MM_PER_M for x in size)
    a, t = max(H, B), min(H, B)
    return {
        "Name": name,
        "Material": material.name or "material of the preset",
        "Cross-section type": "Parametric",
        "Shape": "Rectangle",
        "Parameters [mm]": f"{size[0]:g}; {size[1]:g}",
        "A [m2]": H * B,
        "Iy [m4]": B * H**3 / 12,
        "Iz [m4]": H * B**3 / 12,
        "It [m4]": a * t**3 * (1 / 3 - 0.21 * t / a * (1 - (t / a) ** 4 / 12)),
    }


def _nodes(frame: "Frame") -> Iterator[dict[str, Cell | None]]:
    for name, point in zip(frame.nodes, frame.points.tolist(), strict=True):
        yield {"Name": name} | {f"Coordinate {axis} [m]": x for axis, x in zip("XYZ", point, strict=True)}


def _members(frame: "Frame", sections: list[str]) -> Iterator[dict[str, Cell | None]]:
    count: dict[str, int] = {}
    for k, (i, j) in enumerate(frame.ends.tolist()):
        member = frame.beam_members[k] or "link"
        count[member] = count.get(member, 0) + 1
        begin, end = frame.nodes[i], frame.nodes[j]
        aside = round(MM_PER_M * float(frame.eccentricity[k]), 3)
        yield {
            "Name": f"{member}.{count[member]}",
            "Type": "General",
            "Cross section": sections[k],
            "Nodes": f"{begin}; {end}",
            "Segments": "Line",
            "Begin node": begin,
            "End node": end,
            "Length [m]": float(frame.length[k]),
            "Geometrical shape": "Line",
            "LCS": "z by vector",
            "LCS Rotation [deg]": 0.0,
            **{f"Coordinate {axis} [m]": x for axis, x in zip("XYZ", frame.axes[k, 2].tolist(), strict=True)},
            "System line": "Centre",
            **{f"Structural {axis} Eccentricity of {node} Node [mm]": x for axis, node, x in _aside(aside)},
            **{f"Analysis {axis} Eccentricity of {node} Node [mm]": x for axis, node, x in _aside(0.0)},
            "Layer": member,
            "Behaviour in analysis": "Standard",
        }


def _aside(y: float) -> Iterator[tuple[str, str, float]]:
    for node in ("Beg", "End"):
        yield from (("Y", node, y), ("Z", node, 0.0))


def _supports(frame: "Frame") -> Iterator[dict[str, Cell | None]]:
    fixed, spring = frame.fixed, frame.spring
    for number, k in enumerate(np.flatnonzero((fixed | (spring > 0)).any(axis=1)).tolist(), 1):
        all_fixed, hinged = fixed[k].all(), fixed[k, :3].all() and not fixed[k, 3:].any()
        row: dict[str, Cell | None] = {
            "Name": f"Sn{number}",
            "Type": "Fixed" if all_fixed else "Hinged" if hinged else "Custom",
            "Boundary condition": "In node",
            "Node": frame.nodes[k],
        }
        for axis, word in enumerate(DIRECTIONS):
            row[word] = "Rigid" if fixed[k, axis] else "Flexible" if spring[k, axis] > 0 else "Free"
        for axis, word in enumerate(STIFFNESS):
            row[word] = float(spring[k, axis]) / MEGA if spring[k, axis] > 0 and not fixed[k, axis] else None
        yield row


def _groups(actions: Mapping[str, str]) -> list[dict[str, Cell | None]]:
    return [
        {
            "Name": f"LG {kind}",
            "Load group type": ACTIONS[kind][0],
            "Relation": "Exclusive" if kind in ("snow", "wind") else "Standard",
            "Load type": GROUPS.get(kind),
        }
        for kind in dict.fromkeys(actions.values())
    ]


def _case(name: str, kind: str) -> dict[str, Cell | None]:
    action, load = ACTIONS[kind]
    weight = ", including the weight of the structure" if kind == "permanent" else ""
    return {
        "Name": name,
        "Description": f"loads on nodes, from tributary areas{weight}",
        "Action type": action,
        "Load group": f"LG {kind}",
        "Load type": load,
        "Duration": "Medium" if action == "Variable" else None,
    }


def _sum(name: str, factors: Mapping[str, float]) -> dict[str, Cell | None]:
    row: dict[str, Cell | None] = {"Name": name, "Category": "Not defined", "Type": "Linear"}
    for k, (case, factor) in enumerate(factors.items(), 1):
        row |= {f"Load factor {k}": factor, f"Multiplier {k}": 1.0, f"Load case name {k}": case}
    return row


def _actions(frame: "Frame", first_column: int) -> Iterator[dict[str, Cell | None]]:
    letter, unit, words = ("F", "Value [kN]", "XYZ") if first_column == 0 else ("M", "Value [kNm]", ("Mx", "My", "Mz"))
    number = 0
    for case, rows in frame.loads.items():
        values: Floats = rows[:, first_column : first_column + 3] / KILO
        for k, axis in np.argwhere(np.abs(values) > SMALL[first_column] * np.abs(values).max()).tolist():
            number += 1
            yield {
                "Name": f"{letter}{number}",
                "Type": "Standard",
                "Direction": words[axis],
                "Force action": "In node",
                "Reference node": frame.nodes[k],
                unit: float(values[k, axis]),
                "Load case": case,
                "Coordinate system": "Global",
            }


SUFFIX = ".saf.xlsx"
FIXED_DATE = datetime(1980, 1, 1)  # date of every workbook, fixed so that equal designs give equal bytes
MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"


def require_xlsxwriter() -> None:
    """Raise ExportError if XlsxWriter is not installed."""
    if importlib.util.find_spec("xlsxwriter") is None:
        raise ExportError(".xlsx files need the library XlsxWriter; install it with: pip install XlsxWriter")


def agreement_text(part: Part) -> str:
    """Return the sentences that compare the beam model of a part with the shell model."""
    return "\n".join(part.details.facts)


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the SAF workbook with a part's beam model."""
    import xlsxwriter

    file = io.BytesIO()
    with xlsxwriter.Workbook(file, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}) as book:
        book.set_properties({"created": FIXED_DATE})
        strong = book.add_format({"bold": True, "bottom": 1})
        for table in saf_sheets(part.name, part.details.beam_model, part.details.description):
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
    """Read the workbook back, and compare rows and nodes with the part. Raises ExportError for a difference."""
    cells, sheets = workbook_cells(path), saf_sheets(part.name, part.details.beam_model)
    for sheet in sheets:
        rows = cells.get(sheet.name, [])
        require_equal(part, f"rows of {sheet.name}", len(sheet.rows) + (1 if sheet.head else 0), len(rows))
        if sheet.head and tuple(rows[0]) != sheet.head:
            raise ExportError(
                f"the sheet {sheet.name} of {part.name!r} has other column names when read back; write the file again"
            )
    points = _coordinates(cells["StructuralPointConnection"][1:])
    expected = _coordinates([list(row) for row in _sheet(sheets, "StructuralPointConnection").rows])
    if not (np.abs(points - expected) <= NUMBERS_READ_BACK * np.abs(expected).max()).all():
        raise ExportError(
            f"the nodes of {part.name!r} have other coordinates when the file is read back; write members.json instead"
        )
    return ReadBack(len(_sheet(sheets, "StructuralCurveMember").rows), "beams")


def _sheet(sheets: Sequence[SafSheet], name: str) -> SafSheet:
    return next(sheet for sheet in sheets if sheet.name == name)


def _coordinates(rows: Sequence[Sequence[Cell | None]]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return np.array([row[1:4] for row in rows], dtype=np.float64)


def workbook_cells(path: Path) -> dict[str, list[list[Cell | None]]]:
    """Return the cells of each sheet of a workbook, by sheet name and in rows; empty cells are None."""
    with zipfile.ZipFile(path) as archive:
        shared = [
            "".join(text.text or "" for text in item.iter(f"{MAIN}t"))
            for item in ElementTree.fromstring(archive.read("xl/sharedStrings.xml"))
        ]
        names = [
            element.attrib["name"]
            for element in ElementTree.fromstring(archive.read("xl/workbook.xml")).iter(f"{MAIN}sheet")
        ]
        cells = {}
        for number, name in enumerate(names, 1):
            root = ElementTree.fromstring(archive.read(f"xl/worksheets/sheet{number}.xml"))
            cells[name] = [_row(row, shared) for row in root.iter(f"{MAIN}row")]
    return cells


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
