"""The beam model of a structure: its members as beams between nodes, solved and judged against the sheet.

joints     where members are joined     hubs    the middles of discs     beams   straight pieces between nodes
carried    loads and supports, on nodes     build   all of it together: `Design.frame`
model      `Frame`                      solve   displacements, reactions, forces        agreement   with the sheet
"""

from dsfab.frame.agreement import FrameAgreement, agreement
from dsfab.frame.build import frame_of
from dsfab.frame.model import BeamMaterial, Frame
from dsfab.frame.solve import FrameAnswer, solve_frame

__all__ = ["BeamMaterial", "Frame", "FrameAgreement", "FrameAnswer", "agreement", "frame_of", "solve_frame"]
