"""The file of a part by members, and what OCCT says of it: read again, compared with the mesh, cut by half-spaces."""

import json
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.budget import BudgetError, within
from dsfab.export.network import use_check
from dsfab.export.network.curves import fitted_chains, sampled_chains
from dsfab.export.network.fillets import without_fillets
from dsfab.export.network.graph import ChainNet, net_of
from dsfab.export.network.joining import joined_outlines
from dsfab.export.network.lifting import Lifting
from dsfab.export.network.model import NetModel, net_model
from dsfab.export.network.quads import REACH, quad_net
from dsfab.export.network.straightening import straightened
from dsfab.export.network.text import NetText
from dsfab.export.network.trimmed import TrimmedFace, trimmed_face
from dsfab.export.part import Part
from dsfab.export.plate_text import Entities
from dsfab.export.program import ProgramError, last_line
from dsfab.export.smooth.acceptance import GAP
from dsfab.export.smooth.edges import FLAT
from dsfab.export.smooth.limits import Limits
from dsfab.export.smooth.occt_check import OcctFinding, findings, occt
from dsfab.export.smooth.plan import SmoothPlan
from dsfab.export.smooth.source import StripedSheet
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import header
from dsfab.limits import CHANGED_VOLUME, DEFLECTION
from dsfab.surface import edge_table, pieces
from dsfab.units import MM_PER_M

KIND = "curved solid of four-sided patches by members"
"""What the file says about itself."""

NARROW = 1 / 4000
"""Gap that is wanted between a trimmed face and its edges, as a share of the thickness."""

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


@dataclass(frozen=True, eq=False)
class MemberDraft:
    """What nobody has checked: the text, its solids, faces, trimmed ones among them, and the widest gap, mm."""

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float


def member_draft(part: Part, plan: SmoothPlan) -> MemberDraft:
    """The file of a part before it is checked; raises ExportError where it cannot be made."""
    if plan.curved.striped is None:
        raise ExportError("STEP by members needs the stripes of the sheet, and these are not known")
    lifting = Lifting.of(plan.surface, plan.curved)
    new, shells, faces, trimmed = Entities(), list[int](), list[int](), list[TrimmedFace]()
    count = 0
    for sheet in _sheets(plan.curved.striped()):
        model, surfaces = _solid(sheet, lifting, plan)
        added = NetText(new, model, plan.limits.thickness).faces(surfaces)
        faces += added
        shells += [count] * len(added)
        trimmed += surfaces
        count += 1
    end = closing(np.array(shells), [[i] for i in range(count)], np.array(faces), new.free, part.name)
    text = "".join([header(part.name, KIND, count), *new.text, *end])
    return MemberDraft(text, count, len(faces), 2 * len(trimmed), max((one.gap for one in trimmed), default=0.0))


def _sheets(striped: StripedSheet) -> Iterator[StripedSheet]:
    """The connected pieces of a sheet."""
    count, piece = pieces(striped.F, edge_table(striped.F))
    for i in range(count):
        mine = piece == i
        yield StripedSheet(striped.F[mine], striped.weights, striped.label[mine], striped.loose[mine])


def _solid(sheet: StripedSheet, lifting: Lifting, plan: SmoothPlan) -> tuple[NetModel, list[TrimmedFace]]:
    """The model of a piece, and its faces without four sides."""
    t = plan.limits.thickness
    net = net_of(sheet, plan.surface.V, t / MM_PER_M)
    net = without_fillets(net, lifting)
    net = joined_outlines(net, np.asarray(net.weights @ lifting.skins.points))
    net = straightened(net, lifting, t)
    chains = sampled_chains(net, lifting)
    curves = fitted_chains(chains, dict.fromkeys(chains, FLAT * plan.limits.distance))
    quads = quad_net(net, chains, curves, REACH * t)
    nodes = dict[int, Floats]()
    for k, chain in net.chains.items():
        nodes |= {int(chain.points[0]): chains[k].Q[0], int(chain.points[-1]): chains[k].Q[-1]}
    model = net_model(net, quads, nodes)
    return model, [
        trimmed_face(model, loops, _inside(net, sheet, lifting, region), NARROW * t)
        for region, loops in model.trimmed.items()
    ]


def _inside(net: ChainNet, sheet: StripedSheet, lifting: Lifting, region: int) -> Floats:
    """(k, 6) points of the skins over the middles of a region's cells."""
    F: Ints = sheet.F[net.cell == region]
    a, b, c = (sheet.weights[F[:, i]] for i in range(3))
    return lifting.points(csr_array((a + b + c) * (1 / 3)))


def _accepted(part: Part) -> MemberFile:
    plan = SmoothPlan(part)
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
