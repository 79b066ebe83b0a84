"""STEP file with step = 'members', checked by OCCT."""

import subprocess
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.core.derived import derived
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME, DEFLECTION
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.by_members.draft import ManyFacesError, MemberDraft, member_draft
from dsfab.export.cad.step.file_size import BudgetError, require_budget
from dsfab.export.cad.step.shared.plan import MeshDistances, PieceJudge, SolidPlan
from dsfab.export.cad.step.shared.skins import GAP_SHARE, SmoothLimits
from dsfab.export.cad.step.soundness import (
    MOST_FACES,
    box_fault,
    sampled_use,
    step_triangles,
    triangle_fault,
    use_report,
)
from dsfab.export.cad.step.worker import reports
from dsfab.export.cad.step.worker.reports import OcctFinding, StepMesh, occt
from dsfab.export.cad.step.worker.use import PLANES
from dsfab.export.part import Part
from dsfab.export.subprocesses import ProgramError

SECONDS, SECONDS_PER_FACE = 120.0, 0.3
"""Limit of processor time for each OCCT program: a constant (s), plus seconds per face. Most programs need far less."""

CUT_COUNT = len(PLANES)


@dataclass(frozen=True, eq=False)
class MemberFile:
    """Checked STEP file with step = 'members'. trimmed : number of trimmed faces.    used : sentence on trial cuts.
    gap         : widest gap between a face and its edges, mm.    volume : volume of the solid, mm3.
    there, back : largest distance of the solid from the mesh, and of the mesh from the solid, mm."""

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float
    there: float
    back: float
    volume: float
    used: str
    limits: SmoothLimits

    @property
    def summary(self) -> str:
        """Sentence on faces and accuracy of the file, for messages."""
        trimmed_text = f", {self.trimmed} of its {self.faces} faces trimmed" if self.trimmed else ""
        return (
            f"four-sided patches on shared curves{trimmed_text}; distance at most {self.there:.2g} mm from the solid "
            f"to the mesh and {self.back:.2g} mm from the mesh to the solid ({self.limits.summary}); {self.used}"
        )


class NotByMembersError(ExportError):
    """Error with the reason why step = 'members' failed."""

    def __init__(self, reason: str, if_asked: bool = False) -> None:
        super().__init__(reason)
        self.if_asked = if_asked


class RoughError(ExportError):
    """Error for a file with step = 'members' that is not exact enough or not valid."""


@derived
def member_file(part: Part) -> MemberFile:
    """Return the checked STEP file of a part with step = 'members'.
    Raises NotByMembersError with the reason, and BudgetError if the file is too large."""
    try:
        plan = SolidPlan(part)
        try:
            return _tried(part, plan, False)
        except RoughError:
            return _tried(part, plan, True)
    except BudgetError:
        raise
    except ExportError as error:
        raise NotByMembersError(str(error), isinstance(error, ManyFacesError)) from error


def _tried(part: Part, plan: SolidPlan, fine: bool) -> MemberFile:
    with occt() as program:  # another process loads OCCT while dsfab drafts the file
        draft = member_draft(part, plan, fine)
        require_budget(part, draft.faces, len(draft.text))
        seconds, deflection = SECONDS + SECONDS_PER_FACE * draft.faces, DEFLECTION * plan.limits.distance
        triangles = list[TriangleReport]()

        def judge(mesh: StepMesh) -> None:
            triangles.append(TriangleReport.from_mesh(mesh, plan.gate))

        findings = reports.findings(program, draft.text, deflection, seconds, judge)
    forth, back, shape = require_solid(part, plan, draft, findings, triangles)
    used = _cut_once(part, plan, draft, shape) if part.hurry else _use_sentence(draft, seconds)
    volume, gap = sum(finding.volume for finding in findings), max(draft.gap, *(finding.gap for finding in findings))
    return MemberFile(draft.text, draft.solids, draft.faces, draft.trimmed, gap, forth, back, volume, used, plan.limits)


@dataclass(frozen=True, eq=False)
class TriangleReport:
    """Report on the triangles that OCCT makes from a STEP solid. fault : reason why they bound no solid, or "".
    there, back : distances of these triangles from the mesh, and of the mesh from the triangles."""

    there: MeshDistances
    back: MeshDistances
    fault: str
    shape: bytes

    @classmethod
    def from_mesh(cls, mesh: StepMesh, gate: PieceJudge) -> "TriangleReport":
        """Return the report on OCCT's triangles `mesh`. gate : measures distances from the mesh of the part."""
        triangles = step_triangles(mesh)
        forth, back = gate.distances(MM_PER_M * triangles.V, triangles.F)
        try:
            fault = triangle_fault(triangles, mesh.deflection / MM_PER_M, mesh.shape)
        except ExportError as error:
            fault = str(error)
        return cls(forth, back, fault, mesh.shape)


def _require(passed: bool, complaint: str, error: type[ExportError] = ExportError) -> None:
    if not passed:
        raise error(complaint)


def require_solid(
    part: Part, plan: SolidPlan, draft: MemberDraft, findings: list[OcctFinding], triangles: list[TriangleReport]
) -> tuple[float, float, bytes]:
    """Check the findings of OCCT on a STEP file. Raises ExportError for a fault.
    Return the largest distance (mm) of the solid from the mesh, then of the mesh from the solid, and OCCT's shape."""
    wide_box = 2e-2  # allowed error of OCCT's bounding box / its diagonal; the error is 1.1 % for a saddle of 5 m
    gap, widest = max((finding.gap for finding in findings), default=0.0), GAP_SHARE * plan.limits.thickness
    faces = sum(finding.faces for finding in findings)
    _require(len(findings) == draft.solids, "OCCT did not read the curved solid along members within the time limit")
    sound = all(finding.valid and finding.closed for finding in findings)
    _require(sound, "OCCT finds the curved solid along members invalid", RoughError)
    _require(
        faces == draft.faces,
        f"OCCT reads {faces} faces in the curved solid along members, instead of {draft.faces} faces",
    )
    _require(
        gap <= widest,
        f"the curved solid along members has a gap of {gap:.3g} mm, wider than the allowed {widest:.3g} mm",
    )
    low, high = np.array([finding.box for finding in findings]).reshape(-1, 2, 3).transpose(1, 0, 2)
    box = box_fault(part, [*low.min(axis=0).tolist(), *high.max(axis=0).tolist()], plan.limits, wide_box)
    _require(not box, f"by members, {box}")
    _require(bool(triangles), "OCCT cannot divide a face of the curved solid along members into triangles", RoughError)
    gate, forth, back = plan.gate, triangles[0].there, triangles[0].back
    volume, mesh_volume = sum(finding.volume for finding in findings), float(gate.volumes.sum())
    rounder = float((gate.excess_volumes * gate.volumes).sum()) / mesh_volume
    worst_way = max(forth, back, key=lambda distances: distances.worst - distances.allowed)
    complaint = (
        f"the solid of curved patches along members is {worst_way.worst:.2g} mm from the mesh, more than the allowed "
        f"{worst_way.allowed:.2g} mm"
    )
    _require(worst_way.worst <= worst_way.allowed, complaint, RoughError)
    is_kept = abs(volume - mesh_volume) <= (CHANGED_VOLUME + rounder) * mesh_volume
    _require(
        is_kept,
        f"the volume of the curved solid along members differs by {volume / mesh_volume - 1:.1%} from that of the mesh",
    )
    _require(not triangles[0].fault, triangles[0].fault, RoughError)
    return forth.most, back.most, triangles[0].shape


def _cut_once(part: Part, plan: SolidPlan, draft: MemberDraft, shape: bytes) -> str:
    use = sampled_use(part, shape, draft.faces, plan.limits, ".bin")
    if use.fault:
        raise ExportError(f"by members, {use.fault}")
    return (
        "a half-space cut valid"
        if use.tried
        else f"dsfab made no trial cut, because the solid has over {MOST_FACES} faces"
    )


def _use_sentence(draft: MemberDraft, seconds: float) -> str:
    try:
        report = use_report(draft.text, seconds=seconds)
    except (subprocess.TimeoutExpired, ProgramError) as error:
        raise ExportError("OCCT did not cut the curved solid along members within the time limit") from error
    require_use(report)
    return f"OCCT made {CUT_COUNT} of {CUT_COUNT} half-space cuts and {report['fillets']} of {report['sharp']} fillets"


def require_use(report: dict[str, Any]) -> None:
    """Raise ExportError if OCCT failed in a trial with the solid, such as a cut. report : results of trials."""
    plain_limit = 1e-3  # largest relative error of the volume if OCCT does not refine its integration
    plain_error = report["plain"] / report["volume"] - 1
    _require(report["valid"], "OCCT finds the curved solid along members invalid after writing and reading the solid")
    last_cut = _cut_fault(f"half-space cut {report['sound'] + 1} of {CUT_COUNT}", report["missed"][-1])
    _require(report["sound"] == CUT_COUNT, last_cut)
    _require(report["boxed"], _cut_fault("a cut with a box", report["box_missed"]))
    _require(report["closed"], "a plane section of the curved solid along members has open ends")
    _require(report["again"], "the curved solid along members changes when OCCT writes and reads the solid")
    _require(
        abs(plain_error) <= plain_limit,
        f"OCCT's rough volume of the curved solid along members is wrong by {plain_error:.2%}",
    )


def _cut_fault(cut: str, missed: float) -> str:
    if missed == 1:
        return f"{cut} of the curved solid along members is not valid"
    return f"after {cut}, the parts together lack {missed:.1e} of the volume of the curved solid along members"
