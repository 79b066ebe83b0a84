"""The file of a part by members, and what OCCT says of it: read again, compared with the mesh, cut by half-spaces."""

import subprocess
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.core.derived import derived
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME, DEFLECTION
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.by_members.draft import ManyFacesError, MemberDraft, member_draft, member_plan
from dsfab.export.cad.step.file_size import BudgetError, within
from dsfab.export.cad.step.shared.skins import Limits
from dsfab.export.cad.step.smooth.acceptance import GAP, Away, Gate, SmoothPlan
from dsfab.export.cad.step.soundness import MOST_FACES, box_fault, drawn_fault, said_of_use, sampled_use, step_triangles
from dsfab.export.cad.step.worker import use_check
from dsfab.export.cad.step.worker.reports import OcctFinding, StepMesh, occt, whole_findings
from dsfab.export.part import Part
from dsfab.export.subprocesses import ProgramError

SECONDS, SECONDS_PER_FACE = 120.0, 0.3
"""Processor time for each of both programs, many times the measured time."""

CUTS = len(use_check.PLANES)


@dataclass(frozen=True, eq=False)
class MemberFile:
    """Checked file of a part by members.

    solids, faces, trimmed : numbers.    gap : widest, mm.    there, back : distances from the mesh and back, mm.
    volume : mm3.    used : result of OCCT's trial cuts, as text.
    """

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float
    there: float
    back: float
    volume: float
    used: str
    limits: Limits

    @property
    def told(self) -> str:
        """Description of the file for messages."""
        some = f", {self.trimmed} of its {self.faces} faces trimmed" if self.trimmed else ""
        return (
            f"four-sided patches on shared curves{some}; at most {self.there:.2g} mm off the mesh and the mesh "
            f"{self.back:.2g} mm off it ({self.limits.told}); {self.used}"
        )


class NotByMembersError(ExportError):
    """Reason against members. if_asked : True if a request by name helps."""

    def __init__(self, reason: str, if_asked: bool = False) -> None:
        super().__init__(reason)
        self.if_asked = if_asked


class _RoughError(ExportError):
    """The file is too far off the mesh, or OCCT finds it invalid or no solid; a finer file may pass."""


@derived
def member_file(part: Part) -> MemberFile:
    """Return the file of a part, which holds it; raises NotByMembersError with the reason, and BudgetError if it is too
    large."""
    try:
        return _accepted(part)
    except BudgetError:
        raise
    except ExportError as error:
        raise NotByMembersError(str(error), isinstance(error, ManyFacesError)) from error


def _accepted(part: Part) -> MemberFile:
    """Return the first file that passes: if the usual one is rough, one whose faces keep nearer to the mesh."""
    plan = member_plan(part)
    try:
        return _tried(part, plan, False)
    except _RoughError:
        return _tried(part, plan, True)


def _tried(part: Part, plan: SmoothPlan, fine: bool) -> MemberFile:
    with occt() as program:  # the process loads OCCT in parallel
        draft = member_draft(part, plan, fine)
        within(part, draft.faces, len(draft.text))
        seconds, off = SECONDS + SECONDS_PER_FACE * draft.faces, DEFLECTION * plan.limits.distance
        drawn = list[_Drawn]()
        found = whole_findings(program, draft.text, off, seconds, lambda mesh: drawn.append(_Drawn.of(mesh, plan.gate)))
    there, back, shape = _asked_as_a_solid(part, plan, draft, found, drawn)
    used = _cut_once(part, plan, draft, shape) if part.hurry else _used(part, plan, draft, seconds)
    volume, gap = sum(one.volume for one in found), max(draft.gap, *(one.gap for one in found))
    return MemberFile(draft.text, draft.solids, draft.faces, draft.trimmed, gap, there, back, volume, used, plan.limits)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Report on OCCT's triangles.

    there, back : distances from the mesh and back.    fault : reason why they bound no solid, or why that is unknown.
    shape : OCCT's binary shape.
    """

    there: Away
    back: Away
    fault: str
    shape: bytes

    @classmethod
    def of(cls, mesh: StepMesh, gate: Gate) -> "_Drawn":
        """Judge a mesh without refusing it, because OCCT still checks the rest in parallel."""
        drawn = step_triangles(mesh)
        there, back = gate.distances(MM_PER_M * drawn.V, drawn.F)
        try:
            fault = drawn_fault(drawn, mesh.deflection / MM_PER_M, mesh.shape)
        except ExportError as error:
            fault = str(error)
        return cls(there, back, fault, mesh.shape)


def _require(*tests: tuple[bool, str], error: type[ExportError] = ExportError) -> None:
    for good, complaint in tests:
        if not good:
            raise error(complaint)


def _asked_as_a_solid(
    part: Part, plan: SmoothPlan, draft: MemberDraft, found: list[OcctFinding], drawn: list[_Drawn]
) -> tuple[float, float, bytes]:
    """Return the largest distances from the mesh and back, and OCCT's shape; raises ExportError for a wrong or bad
    solid."""
    # Share of the diagonal that OCCT's box may be off. Less than twice the limit of trial cuts, because the
    # alternatives are worse: for a saddle of 5 m, 1.1 % by members and 20 % for the smooth file.
    wide_box = 2e-2
    t, gap, faces = plan.limits.thickness, max((one.gap for one in found), default=0.0), sum(one.faces for one in found)
    _require((len(found) == draft.solids, "OCCT did not read the solids by members within the time limit"))
    sound = all(one.valid and one.closed for one in found)
    _require((sound, "OCCT finds the solid by members invalid"), error=_RoughError)
    _require(
        (faces == draft.faces, f"OCCT reads {faces} faces by members instead of {draft.faces}"),
        (gap <= GAP * t, f"a gap by members of {gap:.3g} mm is wider than {GAP * t:.3g} mm"),
    )
    box = box_fault(part, _box(found), plan.limits, wide_box)
    _require((not box, f"by members {box}"))
    _require((bool(drawn), "OCCT makes no triangles of a face by members"), error=_RoughError)
    gate, (there, back) = plan.gate, (drawn[0].there, drawn[0].back)
    volume, wanted = sum(one.volume for one in found), float(gate.volumes.sum())
    rounder = float((gate.rounder * gate.volumes).sum()) / wanted
    far = max(there, back, key=lambda way: way.worst - way.allowed)
    if far.worst > far.allowed:
        raise _RoughError(f"by members it is {far.worst:.2g} mm off the mesh, more than {far.allowed:.2g} mm")
    _require(
        (
            abs(volume - wanted) <= (CHANGED_VOLUME + rounder) * wanted,
            f"its volume by members is off by {volume / wanted - 1:.1%}",
        ),
    )
    _require((not drawn[0].fault, drawn[0].fault), error=_RoughError)
    return there.most, back.most, drawn[0].shape


def _box(found: list[OcctFinding]) -> list[float]:
    low, high = np.array([one.box for one in found]).reshape(-1, 2, 3).transpose(1, 0, 2)
    return [*low.min(axis=0).tolist(), *high.max(axis=0).tolist()]


def _cut_once(part: Part, plan: SmoothPlan, draft: MemberDraft, shape: bytes) -> str:
    """Describe one trial cut of OCCT's shape; raises ExportError if it failed. Reading the text again would take
    longer."""
    use = sampled_use(part, shape, draft.faces, plan.limits, ".bin")
    if use.fault:
        raise ExportError(f"by members {use.fault}")
    return "a half-space cut valid" if use.tried else f"not cut here, since it has more than {MOST_FACES} faces"


def _used(part: Part, plan: SmoothPlan, draft: MemberDraft, seconds: float) -> str:
    """Describe all trials of `use_check`; raises ExportError if a CAD program would fail with the file or misread
    it."""
    try:
        said = said_of_use(draft.text, seconds=seconds)
    except (subprocess.TimeoutExpired, ProgramError) as error:
        raise ExportError("OCCT did not cut the solid by members within the time limit") from error
    _asked_in_use(part, plan, said)
    return f"{CUTS} of {CUTS} half-space cuts valid, {said['fillets']} of {said['sharp']} fillets made"


def _asked_in_use(part: Part, plan: SmoothPlan, said: dict[str, Any]) -> None:
    plain_limit = 1e-3  # share of the volume that OCCT's plain rule may be off
    plain = said["plain"] / said["volume"] - 1
    _require(
        (said["valid"], "OCCT finds the solid by members invalid once it is read again"),
        (said["sound"] == CUTS, _cut_fault(f"half-space cut {said['sound'] + 1} of {CUTS}", said["missed"][-1])),
        (said["boxed"], _cut_fault("a cut with a box", said["box_missed"])),
        (said["closed"], "a section of the solid by members has open ends"),
        (said["again"], "the solid by members is not the same once OCCT has written and read it"),
        (abs(plain) <= plain_limit, f"the plain rule finds the volume by members {plain:.2%} off"),
    )


def _cut_fault(cut: str, missed: float) -> str:
    """Describe a faulty cut; missed : share of the volume, 1 if a half is invalid."""
    if missed == 1:
        return f"{cut} of the solid by members is not valid"
    return f"the halves of {cut} miss {missed:.1e} of the volume of the solid by members"
