"""The published tables of Structural Analysis Format 2.2.0, as far as dsfab writes it, and a checker of workbooks.

From saf.guide: which columns a sheet must have, of what type, which words are allowed, and what names refer to.
"""

from collections.abc import Iterator
from itertools import count, takewhile
from pathlib import Path

import openpyxl

FIXED = ("Rigid", "Free", "Flexible", "Compression only", "Tension only", "Flexible compression only")
FIXED += ("Flexible tension only", "Non linear")
TURNS = ("Free", "Rigid", "Flexible", "Non linear")
TEXT, NUMBER = str, (int, float)

REQUIRED = {
    "StructuralMaterial": {
        "Name": TEXT,
        "Type": ("Concrete", "Steel", "Timber", "Aluminium", "Masonry", "Other"),
        "Quality": TEXT,
    },
    "StructuralCrossSection": {
        "Name": TEXT,
        "Material": TEXT,
        "Cross-section type": ("Parametric", "Manufactured", "Compound", "General"),
        "Shape": ("Rectangle", "Circle", "I Section"),
        "Parameters [mm]": TEXT,
    },
    "StructuralPointConnection": {"Name": TEXT} | {f"Coordinate {axis} [m]": NUMBER for axis in "XYZ"},
    "StructuralCurveMember": {
        "Name": TEXT,
        "Cross section": TEXT,
        "Nodes": TEXT,
        "Segments": ("Line",),
        "LCS": ("y by vector", "z by vector", "y by point", "z by point"),
        "LCS Rotation [deg]": NUMBER,
        **{f"Coordinate {axis} [m]": NUMBER for axis in "XYZ"},
        "System line": ("Centre", "Top", "Bottom", "Left", "Right"),
        **{f"Analysis {axis} Eccentricity of {node} Node [mm]": NUMBER for axis in "YZ" for node in ("Beg", "End")},
        "Behaviour in analysis": ("Standard", "Axial force only", "Compression only", "Tension only"),
    },
    "StructuralPointSupport": {
        "Name": TEXT,
        "Boundary condition": ("In node", "On beam"),
        "Node": TEXT,
        **dict.fromkeys(("ux", "uy", "uz"), FIXED),
        **dict.fromkeys(("fix", "fiy", "fiz"), TURNS),
    },
    "StructuralLoadGroup": {
        "Name": TEXT,
        "Load group type": ("Permanent", "Variable", "Accidental", "Seismic", "Moving", "Tensioning", "Fire"),
        "Relation": ("Exclusive", "Standard", "Together"),
    },
    "StructuralLoadCase": {
        "Name": TEXT,
        "Action type": ("Permanent", "Variable", "Accidental"),
        "Load group": TEXT,
        "Load type": ("Self weight", "Others", "Static", "Wind", "Snow", "Standard"),
    },
    "StructuralLoadCombination": {
        "Name": TEXT,
        "Category": ("ULS (Ultimate Limit State)", "SLS (Serviceability Limit State)", "Not defined"),
        "Load factor 1": NUMBER,
        "Multiplier 1": NUMBER,
        "Load case name 1": TEXT,
    },
    "StructuralPointAction": {
        "Name": TEXT,
        "Direction": ("X", "Y", "Z", "Vector"),
        "Force action": ("On beam", "In node"),
        "Reference node": TEXT,
        "Value [kN]": NUMBER,
        "Load case": TEXT,
        "Coordinate system": ("Global", "Local"),
    },
    "StructuralPointMoment": {
        "Name": TEXT,
        "Direction": ("Mx", "My", "Mz"),
        "Force action": ("On beam", "In node"),
        "Reference node": TEXT,
        "Value [kNm]": NUMBER,
        "Load case": TEXT,
        "Coordinate system": ("Global", "Local"),
    },
}
"""By sheet, the columns that must be there and filled in every row: the type, or the words that are allowed."""

MODEL = {
    "SAF Version": ("2.2.0",),
    "Global coordinate system": ("Z vertical",),
    "LCS of cross-section": ("ZYX",),
    "System of units": ("Metric",),
    "National code": ("EC-Standard-EN",),
}
"""What the sheet of the model must say."""

REFERS = {
    ("StructuralCrossSection", "Material"): "StructuralMaterial",
    ("StructuralCurveMember", "Cross section"): "StructuralCrossSection",
    ("StructuralCurveMember", "Nodes"): "StructuralPointConnection",
    ("StructuralPointSupport", "Node"): "StructuralPointConnection",
    ("StructuralLoadCase", "Load group"): "StructuralLoadGroup",
    ("StructuralPointAction", "Reference node"): "StructuralPointConnection",
    ("StructuralPointAction", "Load case"): "StructuralLoadCase",
    ("StructuralPointMoment", "Reference node"): "StructuralPointConnection",
    ("StructuralPointMoment", "Load case"): "StructuralLoadCase",
    ("StructuralLoadCombination", "Load case name 1"): "StructuralLoadCase",
}
"""Whose names a column holds."""

IF_FLEXIBLE = dict(
    zip(
        ("ux", "uy", "uz", "fix", "fiy", "fiz"),
        (*(f"Stiffness {axis} [MN/m]" for axis in "XYZ"), *(f"Stiffness Fi{axis} [MNm/rad]" for axis in "xyz")),
        strict=True,
    )
)


def read(path: Path) -> dict[str, list[dict[str, object]]]:
    """By sheet, its rows by their columns, as openpyxl reads them; Project and Model are one row each."""
    book = openpyxl.load_workbook(path, read_only=True)
    found = {}
    for sheet in book.worksheets:
        rows = [list(row) for row in sheet.iter_rows(values_only=True)]
        if sheet.title in ("Project", "Model"):
            found[sheet.title] = [{row[0]: row[1] for row in rows}]
        else:
            found[sheet.title] = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    book.close()
    return found


def faults(book: dict[str, list[dict[str, object]]]) -> list[str]:
    """What a workbook has that the published tables do not allow; empty for a good one."""
    return [*_model(book), *_columns(book), *_names(book), *_conditions(book)]


def _model(book) -> Iterator[str]:
    given = book.get("Model", [{}])[0]
    yield from (f"Model: {key} is {given.get(key)!r}" for key, words in MODEL.items() if given.get(key) not in words)
    optional = ("StructuralLoadCombination", "StructuralPointMoment")
    yield from (f"{sheet} is missing" for sheet in REQUIRED if sheet not in book and sheet not in optional)
    yield from (f"{sheet} is no sheet of SAF" for sheet in book if sheet not in (*REQUIRED, "Project", "Model"))


def _columns(book) -> Iterator[str]:
    for sheet, columns in REQUIRED.items():
        for k, row in enumerate(book.get(sheet, ()), 2):
            for column, allowed in columns.items():
                value = row.get(column)
                typed = allowed in (TEXT, NUMBER)
                if not (isinstance(value, allowed) if typed else value in allowed):
                    yield f"{sheet} row {k}: {column} is {value!r}"


def _names(book) -> Iterator[str]:
    for sheet in REQUIRED:
        names = [row.get("Name") for row in book.get(sheet, ())]
        yield from (
            [f"{sheet}: {len(names) - len(set(names))} names come twice"] if len(set(names)) < len(names) else []
        )
    for (sheet, column), target in REFERS.items():
        known = {row["Name"] for row in book.get(target, ())}
        for row in book.get(sheet, ()):
            words = str(row.get(column)).split("; ")
            yield from (f"{sheet} {row['Name']}: {word!r} is in no {target}" for word in words if word not in known)


def _conditions(book) -> Iterator[str]:
    for row in book.get("StructuralPointSupport", ()):
        for word, stiffness in IF_FLEXIBLE.items():
            if (row[word] == "Flexible") != isinstance(row.get(stiffness), NUMBER):
                yield f"{row['Name']}: {word} is {row[word]} and {stiffness} is {row.get(stiffness)!r}"
    for row in book.get("StructuralLoadCase", ()):
        if (row["Action type"] == "Variable") != (row.get("Duration") in ("Long", "Medium", "Short", "Instantaneous")):
            yield f"{row['Name']}: duration is {row.get('Duration')!r}"
    for row in book.get("StructuralLoadGroup", ()):
        if row["Load group type"] == "Variable" and not row.get("Load type"):
            yield f"{row['Name']}: a group that varies has no load type"


def sums(row: dict[str, object]) -> dict[str, float]:
    """Factors by case of a combination."""
    some = takewhile(lambda k: row.get(f"Load case name {k}") is not None, count(1))
    return {row[f"Load case name {k}"]: row[f"Load factor {k}"] * row[f"Multiplier {k}"] for k in some}
