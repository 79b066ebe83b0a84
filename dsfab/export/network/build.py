"""The file of a part by members, and what OCCT says of it: read again, compared with the mesh, cut by half-spaces."""

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.budget import BudgetError, within
from dsfab.export.network import use_check
from dsfab.export.network.draft import MemberDraft, member_draft, member_plan
from dsfab.export.part import Part
from dsfab.export.program import ProgramError, last_line
from dsfab.export.smooth.acceptance import GAP
from dsfab.export.smooth.limits import Limits
from dsfab.export.smooth.occt_check import OcctFinding, findings, occt
from dsfab.export.smooth.plan import SmoothPlan
from dsfab.limits import CHANGED_VOLUME, DEFLECTION

SECONDS, SECONDS_PER_FACE = 120.0, 0.3
"""Of the processor, for each of both programs, many times what was measured."""

CUTS = len(use_check.PLANES)
PLAIN, BOX = 1e-3, 1e-2
"""Shares that the volume by the plain rule may be off, and the box at each side."""


@dataclass(frozen=True, eq=False)
class MemberFile:
    """The text of a file with `solids`, and what was found: faces, trimmed ones among them; gap, largest distances of
    the solid from the mesh and back, millimetres; volume, mm3, and by what share the plain rule is off."""

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float
    there: float
    back: float
    volume: float
    fillets: tuple[int, int]
    limits: Limits

    @property
    def told(self) -> str:
        """How the file was made."""
        some = f", {self.trimmed} of its {self.faces} faces trimmed" if self.trimmed else ""
        return (
            f"four-sided patches on shared curves{some}; at most {self.there:.2g} mm off the mesh and the mesh "
            f"{self.back:.2g} mm off it (allowed are {self.limits.distance:.2g} mm and the mesh's own chord error, "
            f"usually under {self.limits.usual:.2g} mm); {CUTS} of {CUTS} half-space cuts valid, "
            f"{self.fillets[0]} of {self.fillets[1]} fillets made"
        )


class NotByMembersError(ExportError):
    """Why a solid is not written by members."""


_MADE: WeakKeyDictionary[Part, MemberFile] = WeakKeyDictionary()


def member_file(part: Part) -> MemberFile:
    """The file of a part, made once; raises NotByMembersError with the reason where it cannot be made, or is not taken,
    and BudgetError where it is too large."""
    if part not in _MADE:
        try:
            _MADE[part] = _accepted(part)
        except BudgetError:
            raise
        except ExportError as error:
            raise NotByMembersError(str(error)) from error
    return _MADE[part]


def _accepted(part: Part) -> MemberFile:
    plan = member_plan(part)
    draft = member_draft(part, plan)
    within(part, draft.faces, len(draft.text))
    seconds = SECONDS + SECONDS_PER_FACE * draft.faces
    with occt() as program:
        found = findings(program, draft.text, DEFLECTION * plan.limits.distance, seconds)
    there, back = _asked_as_a_solid(part, plan, draft, found)
    said = _use(draft.text, seconds)
    volume = sum(one.volume for one in found)
    _asked_in_use(part, plan, said)
    gap, fillets = max(draft.gap, *(one.gap for one in found)), (said["fillets"], said["sharp"])
    return MemberFile(
        draft.text, draft.solids, draft.faces, draft.trimmed, gap, there, back, volume, fillets, plan.limits
    )


def _require(*tests: tuple[bool, str]) -> None:
    """Raise ExportError with the first complaint whose test failed."""
    for good, complaint in tests:
        if not good:
            raise ExportError(complaint)


def _asked_as_a_solid(
    part: Part, plan: SmoothPlan, draft: MemberDraft, found: list[OcctFinding]
) -> tuple[float, float]:
    """The largest distances from the mesh and back; raises ExportError where the solids are not those of the part."""
    t, gap, faces = plan.limits.thickness, max((one.gap for one in found), default=0.0), sum(one.faces for one in found)
    _require(
        (len(found) == draft.solids, "OCCT did not read the solids by members within the time limit"),
        (all(one.valid and one.closed for one in found), "OCCT finds the solid by members invalid"),
        (faces == draft.faces, f"OCCT reads {faces} faces by members instead of {draft.faces}"),
        (all(one.tessellates for one in found), "OCCT makes no triangles of a face by members"),
        (gap <= GAP * t, f"a gap by members of {gap:.3g} mm is wider than {GAP * t:.3g} mm"),
    )
    gate = plan.gate
    volume, wanted = sum(one.volume for one in found), float(gate.volumes.sum())
    rounder = float((gate.rounder * gate.volumes).sum()) / wanted
    there, back = gate.distances(found, part.F)
    far = max(there, back, key=lambda way: way.worst - way.allowed)
    _require(
        (far.worst <= far.allowed, f"by members it is {far.worst:.2g} mm off the mesh, more than {far.allowed:.2g} mm"),
        (
            abs(volume - wanted) <= (CHANGED_VOLUME + rounder) * wanted,
            f"its volume by members is off by {volume / wanted - 1:.1%}",
        ),
    )
    return there.most, back.most


def _use(text: str, seconds: float) -> dict[str, Any]:
    """What `use_check` says of a file."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "a.step"
        path.write_text(text, encoding="ascii")
        try:
            said: dict[str, Any] = json.loads(last_line(use_check.__file__, str(path), seconds=seconds))
        except (subprocess.TimeoutExpired, ProgramError) as error:
            raise ExportError("OCCT did not cut the solid by members within the time limit") from error
    return said


def _asked_in_use(part: Part, plan: SmoothPlan, said: dict[str, Any]) -> None:
    """Raise ExportError where a CAD program would fail with the file, or be told something else than it is."""
    size = np.ptp(part.box, axis=0)
    room = BOX * float(np.linalg.norm(size)) + plan.limits.distance + plan.limits.usual
    off = float(np.abs(np.array(said["box"]).reshape(2, 3) - part.box).max())
    plain = said["plain"] / said["volume"] - 1
    _require(
        (said["valid"], "OCCT finds the solid by members invalid once it is read again"),
        (said["sound"] == CUTS, f"half-space cut {said['sound'] + 1} of {CUTS} of the solid by members is not valid"),
        (said["boxed"], "what a box cuts out of the solid by members is not valid"),
        (said["closed"], "a section of the solid by members has open ends"),
        (said["again"], "the solid by members is not the same once OCCT has written and read it"),
        (abs(plain) <= PLAIN, f"the plain rule finds the volume by members {plain:.2%} off"),
        (off <= room, f"the box of the solid by members is {off:.3g} mm off"),
    )
