"""The sheets of a workbook in Structural Analysis Format 2.2.0: names and columns as published at saf.guide.

Metric units, as its table says: metres, millimetres for sections, MPa, kN, kNm, MN/m. Programs need not keep the order
of sheets and columns, only their names.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.units import MM_PER_M

VERSION = "2.2.0"
Cell = str | int | float
KILO, MEGA = 1e3, 1e6
FINE, COARSE = 0.1, 1.0
"""Widths are rounded to so many millimetres, coarse from 100 mm on: else each beam would have a section of its own."""
SMALL = {0: 1e-6, 3: 1e-2}
"""Forces (0) under this share of the largest one of their case are left out, they are rounding errors, and moments (3),
of loads beside their beam: of tower and snow_vault displacements change by under .07 %, and half of the rows go."""
TYPES = {"S": "Steel", "GL": "Timber", "CLT": "Timber", "plywood": "Timber", "aluminium": "Aluminium"}
TYPES |= {"concrete": "Concrete"}
"""Types of materials by how their names begin; all others are `Other`."""
ACTIONS = {
    "permanent": ("Permanent", "Standard"),
    "snow": ("Variable", "Snow"),
    "wind": ("Variable", "Wind"),
    "variable": ("Variable", "Standard"),
}
"""Action type and load type of a case."""
GROUPS = {"snow": "Snow", "wind": "Wind", "variable": "Domestic"}
"""Load types of groups that vary."""
DIRECTIONS = ("ux", "uy", "uz", "fix", "fiy", "fiz")
STIFFNESS = (
    *("Stiffness X [MN/m]", "Stiffness Y [MN/m]", "Stiffness Z [MN/m]"),
    *("Stiffness Fix [MNm/rad]", "Stiffness Fiy [MNm/rad]", "Stiffness Fiz [MNm/rad]"),
)


@dataclass(frozen=True)
class SafSheet:
    """A sheet: rows below a head. `Project` and `Model` have no head, and a name and a value in each row."""

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell | None, ...], ...]

    @classmethod
    def of(cls, name: str, rows: list[dict[str, Cell | None]]) -> "SafSheet":
        """With a column for each key of any row, in the order in which they come."""
        head = tuple(dict.fromkeys(key for row in rows for key in row))
        return cls(name, head, tuple(tuple(row.get(key) for key in head) for row in rows))


def saf_sheets(name: str, records: Mapping[str, Any]) -> list[SafSheet]:
    """All sheets of a beam model, see `dsfab.delivery.beam_records`; sheets without rows are left out."""
    frame = records["frame"]
    sections = [_dimensions(t, w) for t, w in zip(frame["thickness"], frame["width"], strict=True)]
    numbers = {size: f"CS{k}" for k, size in enumerate(dict.fromkeys(sections), 1)}
    every = [
        SafSheet("Project", (), (("Name", name), ("Description", records["description"]))),
        SafSheet("Model", (), _model(name)),
        SafSheet.of("StructuralMaterial", [_material(records["material"])]),
        SafSheet.of("StructuralCrossSection", [_section(records, size, id_) for size, id_ in numbers.items()]),
        SafSheet.of("StructuralPointConnection", list(_nodes(frame))),
        SafSheet.of("StructuralCurveMember", list(_members(frame, [numbers[size] for size in sections]))),
        SafSheet.of("StructuralPointSupport", list(_supports(frame))),
        SafSheet.of("StructuralLoadGroup", _groups(records["actions"])),
        SafSheet.of("StructuralLoadCase", [_case(case, kind) for case, kind in records["actions"].items()]),
        SafSheet.of("StructuralLoadCombination", [_sum(*one) for one in frame["combinations"].items()]),
        SafSheet.of("StructuralPointAction", list(_actions(frame, 0))),
        SafSheet.of("StructuralPointMoment", list(_actions(frame, 3))),
    ]
    return [sheet for sheet in every if sheet.rows]


def _model(name: str) -> tuple[tuple[str, str], ...]:
    return (
        ("Name", name),
        ("Description", "beams along the members of a cut sheet, by dsfab; weight is among the nodal loads"),
        ("Discipline", "Load-bearing structure"),
        ("Source type", "Structural analysis model"),
        ("Source application", "dsfab"),
        ("SAF Version", VERSION),
        ("Global coordinate system", "Z vertical"),
        ("LCS of cross-section", "ZYX"),
        ("System of units", "Metric"),
        ("National code", "EC-Standard-EN"),
    )


def _material(given: Mapping[str, Any]) -> dict[str, Cell | None]:
    name = given["name"] or "material of the preset"
    kind = next((kind for begin, kind in TYPES.items() if given["name"].startswith(begin)), "Other")
    return {
        "Name": name,
        "Type": kind,
        "Quality": name,
        "Unit mass [kg/m3]": given["density"],
        "E modulus [MPa]": given["young"] / MEGA,
        "G modulus [MPa]": given["shear"] / MEGA,
        "Poisson Coefficient": given["poisson"],
        "Thermal expansion [1/K]": given["expansion"],
    }


def _dimensions(thickness: float, width: float) -> tuple[float, float]:
    """Height and width of a section, millimetres."""
    w = MM_PER_M * width
    step = COARSE if w >= 100 * COARSE else FINE
    return round(MM_PER_M * thickness, 3), round(max(round(w / step), 1) * step, 1)


def _section(records: Mapping[str, Any], size: tuple[float, float], name: str) -> dict[str, Cell | None]:
    """A rectangle, as high as the sheet is thick: H along local z, B along local y."""
    H, B = (x / MM_PER_M for x in size)
    a, t = max(H, B), min(H, B)
    torsion = a * t**3 * (1 / 3 - 0.21 * t / a * (1 - (t / a) ** 4 / 12))
    return {
        "Name": name,
        "Material": records["material"]["name"] or "material of the preset",
        "Cross-section type": "Parametric",
        "Shape": "Rectangle",
        "Parameters [mm]": f"{size[0]:g}; {size[1]:g}",
        "A [m2]": H * B,
        "Iy [m4]": B * H**3 / 12,
        "Iz [m4]": H * B**3 / 12,
        "It [m4]": torsion,
    }


def _nodes(frame: Mapping[str, Any]) -> Iterator[dict[str, Cell | None]]:
    for name, point in zip(frame["nodes"], frame["points"].tolist(), strict=True):
        yield {"Name": name} | {f"Coordinate {axis} [m]": x for axis, x in zip("XYZ", point, strict=True)}


def _members(frame: Mapping[str, Any], sections: list[str]) -> Iterator[dict[str, Cell | None]]:
    count: dict[str, int] = {}
    for k, (i, j) in enumerate(frame["ends"].tolist()):
        member = frame["member"][k] or "link"
        count[member] = count.get(member, 0) + 1
        begin, end = frame["nodes"][i], frame["nodes"][j]
        aside = round(MM_PER_M * float(frame["eccentricity"][k]), 3)
        yield {
            "Name": f"{member}.{count[member]}",
            "Type": "General",
            "Cross section": sections[k],
            "Nodes": f"{begin}; {end}",
            "Segments": "Line",
            "Begin node": begin,
            "End node": end,
            "Length [m]": float(frame["length"][k]),
            "Geometrical shape": "Line",
            "LCS": "z by vector",
            "LCS Rotation [deg]": 0.0,
            **{f"Coordinate {axis} [m]": x for axis, x in zip("XYZ", frame["z"][k].tolist(), strict=True)},
            "System line": "Centre",
            **{f"Structural {axis} Eccentricity of {node} Node [mm]": x for axis, node, x in _aside(aside)},
            **{f"Analysis {axis} Eccentricity of {node} Node [mm]": x for axis, node, x in _aside(0.0)},
            "Layer": member,
            "Behaviour in analysis": "Standard",
        }


def _aside(y: float) -> Iterator[tuple[str, str, float]]:
    for node in ("Beg", "End"):
        yield from (("Y", node, y), ("Z", node, 0.0))


def _supports(frame: Mapping[str, Any]) -> Iterator[dict[str, Cell | None]]:
    fixed, spring = frame["fixed"], frame["spring"]
    for number, k in enumerate(np.flatnonzero((fixed | (spring > 0)).any(axis=1)).tolist(), 1):
        whole, hinged = fixed[k].all(), fixed[k, :3].all() and not fixed[k, 3:].any()
        row: dict[str, Cell | None] = {
            "Name": f"Sn{number}",
            "Type": "Fixed" if whole else "Hinged" if hinged else "Custom",
            "Boundary condition": "In node",
            "Node": frame["nodes"][k],
        }
        for axis, word in enumerate(DIRECTIONS):
            row[word] = "Rigid" if fixed[k, axis] else "Flexible" if spring[k, axis] > 0 else "Free"
        for axis, word in enumerate(STIFFNESS):
            row[word] = float(spring[k, axis]) / MEGA if spring[k, axis] > 0 and not fixed[k, axis] else None
        yield row


def _groups(actions: Mapping[str, str]) -> list[dict[str, Cell | None]]:
    """A group for each kind of action; of cases of snow, and of wind, one acts at a time, as in EN 1990 here."""
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
    weight = "; what the structure weighs is among them" if kind == "permanent" else ""
    return {
        "Name": name,
        "Description": f"loads on nodes, of tributary areas{weight}",
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


def _actions(frame: Mapping[str, Any], first: int) -> Iterator[dict[str, Cell | None]]:
    """Forces (first 0) or moments (3) on nodes, a row for each direction."""
    letter, unit, words = ("F", "Value [kN]", "XYZ") if first == 0 else ("M", "Value [kNm]", ("Mx", "My", "Mz"))
    number = 0
    for case, rows in frame["loads"].items():
        values: Floats = rows[:, first : first + 3] / KILO
        for k, axis in np.argwhere(np.abs(values) > SMALL[first] * np.abs(values).max()).tolist():
            number += 1
            yield {
                "Name": f"{letter}{number}",
                "Type": "Standard",
                "Direction": words[axis],
                "Force action": "In node",
                "Reference node": frame["nodes"][k],
                unit: float(values[k, axis]),
                "Load case": case,
                "Coordinate system": "Global",
            }
