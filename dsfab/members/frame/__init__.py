"""The beam model of a structure: its members as beams between nodes.

joints   nodes where members meet and end, and at the centres of discs
beams    straight pieces, loads and supports on nodes
build    the whole model
model    `Frame`, its solution, comparison with the sheet
forces   member forces from the section forces of the sheet"""

from dsfab.members.frame.build import frame_of
from dsfab.members.frame.forces import (
    COMPONENTS,
    STATIONS,
    MemberCuts,
    MemberForces,
    forces_in,
    member_cuts,
    member_forces,
)
from dsfab.members.frame.model import BeamMaterial, Frame, FrameAgreement, agreement, solve_frame, torsion_constant

__all__ = [
    "COMPONENTS", "STATIONS", "BeamMaterial", "Frame", "FrameAgreement", "MemberCuts", "MemberForces", "agreement",
    "forces_in", "frame_of", "member_cuts", "member_forces", "solve_frame", "torsion_constant",
]  # fmt: skip
