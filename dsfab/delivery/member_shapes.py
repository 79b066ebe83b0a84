"""The members of a design as bodies: each as thick as the sheet, with all that lies below others too."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.export import MemberShape
from dsfab.members import Member
from dsfab.pipeline import Design
from dsfab.surface import Surface
from dsfab.thickening import SHIFT, closed_skin, offsets

PLATES = ("disc", "plate", "fill")
"""Kinds of members that are not long and narrow."""


def member_shapes(design: Design) -> tuple[MemberShape, ...]:
    """In the order of the names, metres. Where two members cross both are there, so that all bodies together have more
    volume than the solid; `own_area` of `member_records` says what each is counted with."""
    sheet, ask = design.members.sheet, design.preset.thickening
    offset = offsets(design.surface, design.preset.statics.thickness, ask.side)
    D = sheet.carry_corners(offset.at_corners(design.surface.F), design.surface.F)
    return tuple(_shape(sheet.surface, D, member, SHIFT[ask.side]) for member in design.members.members)


def _shape(surface: Surface, D: Floats, member: Member, shift: int) -> MemberShape:
    used, F = np.unique(surface.F[member.cells], return_inverse=True)
    piece = Surface(surface.V[used], F.reshape(-1, 3))
    V, faces = closed_skin(piece, D[used], shift)
    axis = member.axis.P if member.axis else np.zeros((0, 3))
    edges = tuple(piece.V[np.append(loop, loop[0])] for loop in piece.loops)
    return MemberShape(member.id, member.family or member.kind, V, faces, axis, edges, member.kind in PLATES)
