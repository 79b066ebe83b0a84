"""The command `dsfab check`: reads the workshop's file again and judges it."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.check_nonlinear import AS_A_FILE, Nonlinear, check_nonlinear
from dsfab.app.options import MaxTriangles, Quiet, Set, Source, built_folder
from dsfab.app.terminal import Reporter, out
from dsfab.core.messages import length, mass

if TYPE_CHECKING:
    from dsfab.core.arrays import Floats
    from dsfab.design.design import Design
    from dsfab.preset.model import Preset
    from dsfab.study.file_check import Clearance, FileCheck, FileContents, Finding

QUESTIONS = {
    "solid": "is it a solid",
    "unit": "is the unit right",
    "cut": "can CAD programs cut it",
    "wall": "is no wall too thin",
    "gap": "is no gap too small",
    "design": "is it the design",
    "compliance": "does it carry like the design",
}


@Parameter(name="*")
@dataclass(frozen=True)
class Expected:
    """The design that a file should hold."""

    preset: Annotated[
        str | None, Parameter(help="The expected design: a preset, or a built folder [preset.toml beside the file].")
    ] = None
    set_: Set = ()

    def name(self, file: Path) -> str | None:
        """Return the preset of the command line, or that beside the file, if any."""
        beside = file.parent / "preset.toml"
        return self.preset if self.preset is not None else str(beside) if beside.is_file() else None

    def of(self, name: str) -> "Preset":
        """Return the preset, or that of the built folder, of this name."""
        folder = built_folder(name)
        return Source(self.set_).read(str(folder / "preset.toml") if folder else name)


@Parameter(name="*")
@dataclass(frozen=True)
class Reading:
    """Options for reading a file."""

    unit: Annotated[str | None, Parameter(help="Unit of an STL file's numbers: mm, cm, m, in, ft [mm].")] = None
    max_triangles: MaxTriangles = None
    density: Annotated[float, Parameter(help="kg/m3, for the mass [the preset's].")] = 0.0

    @property
    def most(self) -> int:
        """Triangles that the file may have."""
        from dsfab.surface import DEFAULT_TRIANGLES

        return self.max_triangles or DEFAULT_TRIANGLES

    def contents(self, file: Path, deflection: float) -> "FileContents":
        """Read a file; `deflection` is the tolerance of triangles on curved faces of STEP, metres."""
        from dsfab.study.file_check import read_shipped

        return read_shipped(file, self.unit, self.most, deflection)


def check(
    file: Path,
    /,
    *,
    expected: Expected = Expected(),
    reading: Reading = Reading(),
    nonlinear: Nonlinear = AS_A_FILE,
    solid: Annotated[bool, Parameter(help="With a preset: also compare compliance by a solid model.")] = True,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON instead of text.")] = False,
    quiet: Quiet = False,
) -> int:
    """Read an exported solid again, with readers that did not write it: is it sound, and is it the design?

    The exit code is 1 when something fails.

    Parameters
    ----------
    file
        STL, 3MF or STEP; with --nonlinear a preset, or a folder that `dsfab build` wrote.
    """
    if nonlinear.nonlinear:
        return check_nonlinear(str(file), Source(expected.set_), nonlinear, json_, quiet)
    from dsfab.study.file_check import check_contents

    name = expected.name(file)
    with Reporter(quiet or json_) as reporter:
        found, design = _read(file, expected.of(name) if name is not None else None, reading, reporter)
        checked = check_contents(found, design, reading.unit is not None, reading.density, solid, reporter)
    if json_:
        out(json.dumps(facts(checked, name), indent=2))
    elif not quiet:
        for line in lines(checked, name):
            out(line)
    return 0 if checked.passed else 1


def _read(
    file: Path, preset: "Preset | None", reading: Reading, reporter: Reporter
) -> "tuple[FileContents, Design | None]":
    from dsfab.design import run
    from dsfab.export import meanwhile
    from dsfab.study.file_check import deflection_for

    reporter("read", f"reading {file.name}")
    if preset is None:
        return reading.contents(file, 0.0), None
    made: list[Design] = []
    with meanwhile(lambda: made.append(run(preset, reporter))):
        found = reading.contents(file, deflection_for(preset))
    return found, made[0]


def facts(checked: "FileCheck", preset: str | None = None) -> dict[str, Any]:
    """Return the results as plain data, SI units; null for quantities that could not be measured."""
    sound, near = checked.soundness, checked.clearances
    return {
        "file": str(checked.path),
        "preset": preset,
        "reader": checked.found.reader,
        "unit": {"name": checked.found.unit, "declared": checked.found.declared},
        "triangles": len(checked.found.F),
        "watertight": sound.watertight,
        "faults": [{"kind": f.kind, "count": f.count, "at_m": list(f.place)} for f in sound.faults],
        "crossings_tested": sound.tested,
        "touching_points": sound.pinches,
        "collapsed_triangles": checked.found.collapsed,
        "pieces": sound.pieces,
        "volume_m3": sound.volume if sound.watertight else None,
        "area_m2": sound.area,
        "mass_kg": checked.mass,
        "box_m": sound.box.tolist(),
        "thinnest_wall": _clearance(near.wall) if near else None,
        "smallest_gap": _clearance(near.gap) if near else None,
        "distance": _distance(checked),
        "compliance": _compliance(checked),
        "findings": {f.name: {"verdict": f.verdict, "reason": _reason(f, checked)} for f in checked.findings},
        "passed": checked.passed,
    }


def _distance(checked: "FileCheck") -> dict[str, Any] | None:
    if (apart := checked.distance) is None:
        return None
    return {
        "skin_max_m": apart.skin,
        "skin_mean_m": apart.skin_mean,
        "skin_at_m": apart.skin_place.tolist(),
        "file_to_design_m": apart.to_design,
        "file_to_design_at_m": apart.to_place.tolist(),
        "allowed_m": apart.allowed,
        "design_to_file_m": apart.from_design,
        "design_to_file_at_m": apart.from_place.tolist(),
        "size_ratio": apart.scale,
    }


def _compliance(checked: "FileCheck") -> dict[str, Any] | None:
    if (carries := checked.carrying) is None:
        return None
    return {
        "shell_J": carries.shell,
        "solid_J": carries.solid,
        "ratio": carries.ratio,
        "shell_elements": carries.elements,
        "tetrahedra": carries.tetrahedra,
        "unknowns": carries.unknowns,
        "edge_m": carries.edge,
    }


def _clearance(found: "Clearance | None") -> dict[str, Any] | None:
    return None if found is None else {"m": found.size, "at_m": found.place.tolist()}


def lines(checked: "FileCheck", preset: str | None = None) -> Iterator[str]:
    """Yield the results as text: the verdicts first, then the numbers."""
    rows = [(QUESTIONS[f.name], f.verdict, _reason(f, checked)) for f in checked.findings]
    width = max(len(question) for question, _, _ in rows)
    yield f"{checked.path}, read by {checked.found.reader}" + (f", against {preset}" if preset else "")
    for question, verdict, reason in rows:
        yield f"  {question:<{width}}  {verdict:<7}  {reason}".rstrip()
    for fault in checked.soundness.faults:
        yield f"fault: {fault.told}, first at {_at(fault.place)}"
    numbers = [(label, value) for label, value in _numbers(checked) if value]
    width = max(len(label) for label, _ in numbers)
    for label, value in numbers:
        yield f"  {label:<{width}}  {value}"


def _numbers(checked: "FileCheck") -> Iterator[tuple[str, str]]:
    found, sound, near, apart = checked.found, checked.soundness, checked.clearances, checked.distance
    low, high = sound.box
    yield "unit", f"{found.unit}, " + ("named by the file" if found.declared else "by convention: STL names none")
    yield "size", " x ".join(length(side) for side in (high - low).tolist())
    yield "triangles", f"{len(found.F):,}" + (f", {found.collapsed} more collapsed" if found.collapsed else "")
    yield "pieces", f"{sound.pieces}" + (f", touching in {sound.pinches} points" if sound.pinches else "")
    yield "volume", f"{sound.volume:.6g} m3" if sound.watertight else ""
    yield "mass", f"{mass(checked.mass)} at {checked.density:g} kg/m3" if checked.mass is not None else ""
    if near is not None:
        yield "thinnest wall", _where(near.wall)
        yield "smallest gap", _where(near.gap)
    if apart is not None:
        yield "skins, off t/2", f"{_small(apart.skin_mean)} on average, {_small(apart.skin)} at most"
        yield "file to design", f"{_small(apart.to_design)} at most, at {_at(apart.to_place.tolist())}"
        yield "design to file", f"{_small(apart.from_design)} at most, at {_at(apart.from_place.tolist())}"
    if (carries := checked.carrying) is not None:
        yield "compliance as a solid", f"{carries.solid:.4g} J, {carries.tetrahedra:,} ten-node tetrahedra"
        yield "compliance as a shell", f"{carries.shell:.4g} J, {carries.elements} on the cut sheet"


def _small(metres: float) -> str:
    return length(metres) if metres >= 1e-6 else "under 0.001 mm"


def _where(found: "Clearance | None") -> str:
    return "none" if found is None else f"{length(found.size)} at {_at(found.place.tolist())}"


def _at(place: "tuple[float, float, float] | list[float] | Floats") -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ") m"


def _reason(finding: "Finding", checked: "FileCheck") -> str:
    """Reason of a verdict in a short sentence; empty if the numbers below show it."""
    if finding.verdict == "unknown":
        return finding.reason + ("; not run" if finding.name == "compliance" and checked.carrying is None else "")
    if finding.name == "unit" and finding.verdict == "fail":
        return _unit_reason(checked)
    if finding.name == "compliance" and checked.carrying is not None:
        off = checked.carrying.ratio - 1
        return f"as a solid it is {abs(off):.1%} {'softer' if off > 0 else 'stiffer'} than as a shell"
    if finding.name == "design" and finding.verdict == "fail" and checked.distance is not None:
        away, allowed = checked.distance.beyond + checked.distance.allowed, checked.distance.allowed
        return f"its surface is {length(away)} off the design's where {length(allowed)} are allowed"
    return finding.reason


def _unit_reason(checked: "FileCheck") -> str:
    read = checked.found.unit
    if checked.distance is not None:
        apart = checked.distance
        return (
            f"read in {read} it is {apart.scale:.4g} times the design's size: its numbers look like "
            f"{apart.meant_unit}; scale the file, or give --unit if its receiver will know"
        )
    wall = checked.clearances.wall if checked.clearances else None
    size = length(wall.size) if wall else "nothing"
    thin = wall is not None and wall.size < 1
    other = "metres" if thin else "micrometres"
    return f"read in {read} its thinnest wall is {size}: its numbers look like {other}; scale the file or give --unit"
