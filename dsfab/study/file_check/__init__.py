"""Check of an exported file by readers that are independent of the export."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.core.limits import Status
from dsfab.core.messages import length
from dsfab.design.design import Design
from dsfab.export import Fault, Soundness, StepTriangles, curved_soundness, cut_fault, soundness, work_while_waiting
from dsfab.study.fabrication import Check, fabrication
from dsfab.study.file_check.file_geometry import (
    SUFFIXES,
    Clearance,
    Clearances,
    Distance,
    FileContents,
    clearances,
    deflection_for,
    distance,
    read_shipped,
)
from dsfab.study.file_check.solid_compliance import SolidCompliance, compared_compliance, missing_packages
from dsfab.surface import DEFAULT_TRIANGLES

__all__ = [
    "SUFFIXES", "Clearance", "Clearances", "Distance", "Fault", "FileCheck", "FileContents", "Finding",
    "SolidCompliance", "Soundness", "check_contents", "check_file", "deflection_for", "read_shipped", "soundness",
]  # fmt: skip

Progress = Callable[[str, str], None]
TOO_THIN, TOO_THICK = 1e-4, 10.0  # if the thinnest wall (m) lies outside of this range, the unit is wrong
AGREES, DIFFERS = 0.05, 0.15  # differences of compliance: solid and shell agree below 5 %, and differ above 15 %


@dataclass(frozen=True)
class Finding:
    """The verdict of one check of a file. name : `solid`, `unit`, `cut`, `wall`, `gap`, `design` or `compliance`.
    reason : a sentence that explains the verdict, or ''."""

    name: str
    verdict: Status
    reason: str = ""


@dataclass(frozen=True, eq=False)
class FileCheck:
    """Result of the check of a file.
    clearances : thinnest wall and smallest gap, or None.    density : kg/m3, 0 if unknown.
    distance   : distance between the file's solid and the design, or None.
    carrying   : compliances of the file's solid and the design, or None."""

    path: Path
    found: FileContents
    soundness: Soundness
    clearances: Clearances | None
    distance: Distance | None
    carrying: SolidCompliance | None
    density: float
    findings: tuple[Finding, ...]

    @property
    def mass(self) -> float | None:
        """Mass (kg); None if unknown."""
        return self.density * self.soundness.volume if self.density and self.soundness.watertight else None

    @property
    def has_passed(self) -> bool:
        return not any(finding.verdict == "fail" for finding in self.findings)


def check_file(
    path: str | Path,
    design: Design | None = None,
    unit: str | None = None,
    density: float = 0.0,
    solid: bool = True,
    progress: Progress | None = None,
    max_triangles: int = DEFAULT_TRIANGLES,
) -> FileCheck:
    """Read a file and check the solid in the file.
    design : the design to compare the solid with, or None.
    unit   : unit of an STL file's numbers, default millimetres.     density : kg/m3; 0 for the design's density.
    solid  : True to compute the compliance of the solid; this needs the packages of dsfab[solid].
    Raises SurfaceError or ExportError for a file that cannot be read."""
    if progress:
        progress("read", f"reading {Path(path).name}")
    contents = read_shipped(path, unit, max_triangles, deflection_for(design.preset) if design else 0.0)
    return check_contents(contents, design, unit is not None, density, solid, progress)


def check_contents(
    contents: FileContents,
    design: Design | None = None,
    unit_given: bool = False,
    density: float = 0.0,
    solid: bool = True,
    progress: Progress | None = None,
) -> FileCheck:
    """Check the solid in a file that was already read.
    contents : contents of the file. With a design, read the file with the deflection `deflection_for(preset)`.
    unit_given : True if the user named the unit of the file's numbers.    density, solid : as in `check_file`."""
    tell = progress or (lambda stage, doing: None)
    tell("judge", f"looking for holes and crossings in {len(contents.F):,} triangles")
    sound = file_soundness(contents, tell)
    cut, walls_and_gaps, design_distance = _cut_and_measured(contents, sound, design, tell)
    findings = [
        Finding("solid", "pass" if sound.sound else "fail"),
        _unit_finding(contents, walls_and_gaps, design_distance, unit_given),
    ]
    usable = all(finding.verdict == "pass" for finding in findings)
    findings += cut
    carries = None
    if design is not None and design_distance is not None:
        matches_design = design_distance.beyond <= 0
        findings += _limit_findings(walls_and_gaps, design, matches_design)
        findings.append(Finding("design", "pass" if matches_design else "fail"))
        carries, why = _solid_compliance(contents, design, solid, usable, tell)
        findings.append(_compliance_finding(carries, why))
    density = density or (design.preset.statics.density if design else 0.0)
    return FileCheck(contents.path, contents, sound, walls_and_gaps, design_distance, carries, density, tuple(findings))


def file_soundness(contents: FileContents, tell: Progress) -> Soundness:
    """Find holes and crossing triangles in a file's surface. tell : function that reports the progress."""
    finer = "making finer triangles on curved faces, because some triangles cross"
    triangles = StepTriangles(contents.V, contents.F, contents.face, contents.collapsed)
    return curved_soundness(triangles, contents.deflection, contents.shape, lambda: tell("judge", finer))


def _cut_and_measured(
    contents: FileContents, sound: Soundness, design: Design | None, tell: Progress
) -> tuple[list[Finding], Clearances | None, Distance | None]:
    walls_and_gaps, distances = list[Clearances](), list[Distance]()

    def measure() -> None:
        if sound.watertight:
            tell("measure", "measuring walls and gaps")
            walls_and_gaps.append(clearances(contents.V, contents.F))
        if design is not None:
            tell("compare", "measuring the distance of the solid from the design")
            distances.append(distance(contents, design))

    cut = []
    with work_while_waiting(measure):
        if contents.shape and sound.sound:
            tell("judge", "cutting the solid in half as a test")
            cut.append(_cut_finding(contents))
    return cut, next(iter(walls_and_gaps), None), next(iter(distances), None)


def _unit_finding(
    contents: FileContents, walls_and_gaps: Clearances | None, apart: Distance | None, unit_given: bool
) -> Finding:
    if apart is not None:
        return Finding("unit", "fail" if apart.meant_unit else "pass")
    if walls_and_gaps is None or walls_and_gaps.wall is None or contents.declared or unit_given:
        return Finding("unit", "pass" if contents.declared or unit_given else "unknown", "an STL file names no unit")
    return Finding("unit", "fail" if not TOO_THIN <= walls_and_gaps.wall.size <= TOO_THICK else "pass")


def _cut_finding(contents: FileContents) -> Finding:
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "shape.bin"  # the binary file loads faster than STEP
        path.write_bytes(contents.shape)
        fault, _ = cut_fault(path, contents.path.read_bytes().count(b"ADVANCED_FACE("))
    why = f"{fault}: for a solid that CAD programs can cut, write step = 'members' or 'faceted'"
    return Finding("cut", "unknown", why) if fault else Finding("cut", "pass")


def _limit_findings(walls_and_gaps: Clearances | None, design: Design, matches_design: bool) -> list[Finding]:
    options, findings = design.preset.fabrication, []
    built = {check.name: check for check in fabrication(design).checks} if matches_design else {}
    for name, limit in (("wall", options.min_wall), ("gap", options.min_gap)):
        if not limit:
            continue
        if check := built.get(f"min_{name}"):
            findings.append(Finding(name, check.verdict, _built_measure(check)))
            continue
        clearance = getattr(walls_and_gaps, name) if walls_and_gaps else None
        if walls_and_gaps is None:
            findings.append(Finding(name, "unknown", "the surface in the file is not closed"))
        else:
            findings.append(Finding(name, "fail" if clearance is not None and clearance.size < limit else "pass"))
    return findings


def _built_measure(check: Check) -> str:
    if not check.value:
        return "none in the design"
    place = ", ".join(f"{x:.4g}" for x in check.place)
    return (
        f"the design's smallest value is {length(check.value[0])} at ({place}) m; the limit is {length(check.limit[0])}"
    )


def _solid_compliance(
    contents: FileContents, design: Design, is_requested: bool, usable: bool, tell: Progress
) -> tuple[SolidCompliance | None, str]:
    if not is_requested:
        return None, "not asked for"
    if not usable:
        return None, "the file does not contain a valid solid in the right unit"
    if absent := missing_packages():
        return None, absent
    tell("carry", "filling the solid with tetrahedra and solving this model")
    try:
        return compared_compliance(contents, design), ""
    except DsfabError as error:
        return None, str(error)


def _compliance_finding(carries: SolidCompliance | None, why: str) -> Finding:
    if carries is None:
        return Finding("compliance", "unknown", why)
    difference = abs(carries.ratio - 1)
    if difference <= AGREES:
        return Finding("compliance", "pass")
    if difference > DIFFERS:
        return Finding("compliance", "fail")
    return Finding(
        "compliance",
        "unknown",
        f"the compliances of the file and of the design differ by {difference:.0%}; compare them on a finer mesh",
    )
