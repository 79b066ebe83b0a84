"""The beam model of a structure: its members as beams between nodes.

joints   nodes where members meet or end, and at the centres of discs
beams    members divided into straight beams; loads and supports at the nodes of the beams
build    construction of the whole model
model    `Frame`, the solution of a frame, comparison with the shell model (sheet)
forces   section forces of members, summed from the shell model"""

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
