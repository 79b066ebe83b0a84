"""The beam model of a structure: its members as beams between nodes, solved and judged against the sheet.

joints     where members are joined     ends    what their ends run into
hubs       the middles of discs         beams   straight pieces between nodes
carried    loads and supports, on nodes     build   all of it together: `Design.frame`
model      `Frame`                      solve   displacements, reactions, forces        agreement   with the sheet
forces     what members bear, from the section forces of the sheet    sections   how planes across them cut its faces
"""

from dsfab.members.frame.build import frame_of
from dsfab.members.frame.forces import COMPONENTS, STATIONS, MemberForces, forces_along, member_forces
from dsfab.members.frame.model import (
    BeamMaterial,
    Frame,
    FrameAgreement,
    FrameAnswer,
    agreement,
    solve_frame,
    torsion_constant,
)

__all__ = [
    "COMPONENTS",
    "STATIONS",
    "BeamMaterial",
    "Frame",
    "FrameAgreement",
    "FrameAnswer",
    "MemberForces",
    "agreement",
    "forces_along",
    "frame_of",
    "member_forces",
    "solve_frame",
    "torsion_constant",
]
