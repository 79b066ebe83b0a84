"""The command `dsfab check`: check an exported file."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.check_nonlinear import LINEAR_FILE_CHECK, Nonlinear, check_nonlinear
from dsfab.app.options import MaxTriangles, Quiet, Set, Source, Switch, built_folder
from dsfab.app.terminal import Reporter, print_lines, print_result
from dsfab.core.messages import length, mass

if TYPE_CHECKING:
    from dsfab.core.arrays import Floats
    from dsfab.design.design import Design
    from dsfab.preset.model import Preset
    from dsfab.study.file_check import Clearance, FileCheck, FileContents, Finding

QUESTIONS = {
    "solid": "is it a solid",
    "unit": "is the unit right",
    "cut": "can CAD programs cut the solid",
    "wall": "is every wall thick enough",
    "gap": "is every gap wide enough",
    "design": "is it the design",
    "compliance": "is the stiffness as designed",
}


@Parameter(name="*")
@dataclass(frozen=True)
class Expected:
    """Options for the design that the checked file should contain."""

    preset: Annotated[
        str | None, Parameter(help="Expected design: a preset, or a built folder [preset.toml beside the file].")
    ] = None
    set_: Set = ()

    def preset_name(self, file: Path) -> str | None:
        """Return the preset of the command line. The default is preset.toml in the file's folder, else None."""
        neighbour = file.parent / "preset.toml"
        return self.preset if self.preset is not None else str(neighbour) if neighbour.is_file() else None

    def read_preset(self, name: str) -> "Preset":
        """Read a preset. name : shipped preset, path of a preset file, or folder of a build."""
        folder = built_folder(name)
        return Source(self.set_).read_preset(str(folder / "preset.toml") if folder else name)


@Parameter(name="*")
@dataclass(frozen=True)
class Reading:
    """Options for reading a file."""

    unit: Annotated[str | None, Parameter(help="Unit of an STL file's numbers: mm, cm, m, in, ft [mm].")] = None
    max_triangles: MaxTriangles = None
    density: Annotated[float, Parameter(help="Density for the mass, kg/m3 [the density in the preset].")] = 0.0

    def contents(self, file: Path, deflection: float) -> "FileContents":
        """Read the solid from a file. deflection : largest distance (m) between curved faces and their triangles."""
        from dsfab.study.file_check import read_shipped
        from dsfab.surface import DEFAULT_TRIANGLES

        return read_shipped(file, self.unit, self.max_triangles or DEFAULT_TRIANGLES, deflection)


def check(
    file: Path,
    /,
    *,
    expected: Expected = Expected(),
    reading: Reading = Reading(),
    nonlinear: Nonlinear = LINEAR_FILE_CHECK,
    solid: Annotated[bool, Parameter(help="With a preset: also compare compliance by a solid model.")] = True,
    json_: Annotated[bool, Switch(name="--json", help="Print JSON instead of text.")] = False,
    quiet: Quiet = False,
) -> int:
    """Read an exported solid with independent readers; check that it is valid, and that it matches the design.

    The exit code is 1 if a check fails.

    Parameters
    ----------
    file
        STL, 3MF or STEP; with --nonlinear a preset, or a folder that `dsfab build` wrote."""
    if nonlinear.nonlinear:
        return check_nonlinear(str(file), Source(expected.set_), nonlinear, json_, quiet)
    from dsfab.study.file_check import check_contents

    name = expected.preset_name(file)
    with Reporter(quiet or json_) as reporter:
        contents, design = _read_file(file, expected.read_preset(name) if name is not None else None, reading, reporter)
        checked = check_contents(contents, design, reading.unit is not None, reading.density, solid, reporter)
    if json_:
        print_result(json.dumps(check_facts(checked, name), indent=2))
    elif not quiet:
        print_lines(check_lines(checked, name))
    return 0 if checked.has_passed else 1


def _read_file(
    file: Path, preset: "Preset | None", reading: Reading, reporter: Reporter
) -> "tuple[FileContents, Design | None]":
    from dsfab.design import run
    from dsfab.export import work_while_waiting
    from dsfab.study.file_check import deflection_for

    reporter("read", f"reading {file.name}")
    if preset is None:
        return reading.contents(file, 0.0), None
    designs: list[Design] = []
    with work_while_waiting(lambda: designs.append(run(preset, reporter))):
        contents = reading.contents(file, deflection_for(preset))
    return contents, designs[0]


def check_facts(checked: "FileCheck", preset: str | None = None) -> dict[str, Any]:
    """Return the results of a file check for JSON, in SI units; None for unknown values."""
    soundness, clearances = checked.soundness, checked.clearances
    return {
        "file": str(checked.path),
        "preset": preset,
        "reader": checked.found.reader,
        "unit": {"name": checked.found.unit, "declared": checked.found.declared},
        "triangles": len(checked.found.F),
        "watertight": soundness.watertight,
        "faults": [{"kind": f.kind, "count": f.count, "at_m": list(f.place)} for f in soundness.faults],
        "crossings_tested": soundness.tested,
        "touching_points": soundness.pinches,
        "collapsed_triangles": checked.found.collapsed,
        "pieces": soundness.pieces,
        "volume_m3": soundness.volume if soundness.watertight else None,
        "area_m2": soundness.area,
        "mass_kg": checked.mass,
        "box_m": soundness.box.tolist(),
        "thinnest_wall": _clearance_facts(clearances.wall) if clearances else None,
        "smallest_gap": _clearance_facts(clearances.gap) if clearances else None,
        "distance": _distance_facts(checked),
        "compliance": _compliance_facts(checked),
        "findings": {f.name: {"verdict": f.verdict, "reason": _reason(f, checked)} for f in checked.findings},
        "passed": checked.has_passed,
    }


def _distance_facts(checked: "FileCheck") -> dict[str, Any] | None:
    if (distance := checked.distance) is None:
        return None
    return {
        "skin_max_m": distance.skin,
        "skin_mean_m": distance.skin_mean,
        "skin_at_m": distance.skin_place.tolist(),
        "file_to_design_m": distance.to_design,
        "file_to_design_at_m": distance.to_place.tolist(),
        "allowed_m": distance.allowed,
        "design_to_file_m": distance.from_design,
        "design_to_file_at_m": distance.from_place.tolist(),
        "size_ratio": distance.scale,
    }


def _compliance_facts(checked: "FileCheck") -> dict[str, Any] | None:
    if (carrying := checked.carrying) is None:
        return None
    return {
        "shell_J": carrying.shell,
        "solid_J": carrying.solid,
        "ratio": carrying.ratio,
        "shell_elements": carrying.elements,
        "tetrahedra": carrying.tetrahedra,
        "unknowns": carrying.unknowns,
        "edge_m": carrying.edge,
    }


def _clearance_facts(clearance: "Clearance | None") -> dict[str, Any] | None:
    return None if clearance is None else {"m": clearance.size, "at_m": clearance.place.tolist()}


def check_lines(checked: "FileCheck", preset: str | None = None) -> Iterator[str]:
    """Yield the results of a file check as lines of text."""
    rows = [(QUESTIONS[f.name], f.verdict, _reason(f, checked)) for f in checked.findings]
    width = max(len(question) for question, _, _ in rows)
    yield f"{checked.path}, read by {checked.found.reader}" + (f", against {preset}" if preset else "")
    for question, verdict, reason in rows:
        yield f"  {question:<{width}}  {verdict:<7}  {reason}".rstrip()
    for fault in checked.soundness.faults:
        yield f"fault: {fault.message}, first at {_place_words(fault.place)}"
    numbers = [(label, value) for label, value in _number_rows(checked) if value]
    width = max(len(label) for label, _ in numbers)
    for label, value in numbers:
        yield f"  {label:<{width}}  {value}"


def _number_rows(checked: "FileCheck") -> Iterator[tuple[str, str]]:
    contents, soundness, clearances, distance = checked.found, checked.soundness, checked.clearances, checked.distance
    low, high = soundness.box
    yield (
        "unit",
        f"{contents.unit}, "
        + ("named by the file" if contents.declared else "this unit is assumed, because STL files have no units"),
    )
    yield "size", " x ".join(length(side) for side in (high - low).tolist())
    yield "triangles", f"{len(contents.F):,}" + (f", {contents.collapsed} more collapsed" if contents.collapsed else "")
    yield "pieces", f"{soundness.pieces}" + (f", touching in {soundness.pinches} points" if soundness.pinches else "")
    yield "volume", f"{soundness.volume:.6g} m3" if soundness.watertight else ""
    yield "mass", f"{mass(checked.mass)} at {checked.density:g} kg/m3" if checked.mass is not None else ""
    if clearances is not None:
        yield "thinnest wall", _clearance_words(clearances.wall)
        yield "smallest gap", _clearance_words(clearances.gap)
    if distance is not None:
        mean, largest = _distance_words(distance.skin_mean), _distance_words(distance.skin)
        yield "skins, off t/2", f"{mean} on average, {largest} at most"
        to_place, from_place = _place_words(distance.to_place.tolist()), _place_words(distance.from_place.tolist())
        yield "file to design", f"{_distance_words(distance.to_design)} at most, at {to_place}"
        yield "design to file", f"{_distance_words(distance.from_design)} at most, at {from_place}"
    if (carrying := checked.carrying) is not None:
        yield "compliance as a solid", f"{carrying.solid:.4g} J, {carrying.tetrahedra:,} ten-node tetrahedra"
        yield "compliance as a shell", f"{carrying.shell:.4g} J, {carrying.elements} on the cut sheet"


def _distance_words(metres: float) -> str:
    return length(metres) if metres >= 1e-6 else "under 0.001 mm"


def _clearance_words(clearance: "Clearance | None") -> str:
    return "none" if clearance is None else f"{length(clearance.size)} at {_place_words(clearance.place.tolist())}"


def _place_words(place: "tuple[float, float, float] | list[float] | Floats") -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ") m"


def _reason(finding: "Finding", checked: "FileCheck") -> str:
    if finding.verdict == "unknown":
        return finding.reason + ("; not run" if finding.name == "compliance" and checked.carrying is None else "")
    if finding.name == "unit" and finding.verdict == "fail":
        return _unit_reason(checked)
    if finding.name == "compliance" and checked.carrying is not None:
        softening = checked.carrying.ratio - 1
        return (
            f"the solid is {abs(softening):.1%} {'softer' if softening > 0 else 'stiffer'} than the shell of the design"
        )
    if finding.name == "design" and finding.verdict == "fail" and checked.distance is not None:
        distance, allowed = checked.distance.beyond + checked.distance.allowed, checked.distance.allowed
        return f"the file's solid is up to {length(distance)} from the design's surface; the limit is {length(allowed)}"
    return finding.reason


def _unit_reason(checked: "FileCheck") -> str:
    read = checked.found.unit
    if (distance := checked.distance) is not None:
        return (
            f"read in {read}, the file is {distance.scale:.4g} times as large as the design, so its unit is probably "
            f"{distance.meant_unit}; scale the file, or give --unit if the recipient knows the unit"
        )
    wall = checked.clearances.wall if checked.clearances else None
    likely_unit = "metres" if wall is not None and wall.size < 1 else "micrometres"
    words = (
        f"the thinnest wall of the solid is {length(wall.size) if wall else 'nothing'}, so the unit is probably "
        f"{likely_unit}"
    )
    return f"if the lengths of the solid are in {read}, {words}; scale the file or give --unit"
