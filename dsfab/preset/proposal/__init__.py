"""Propose a preset for the user's own surface, with a reason for each decision.

shape      coarse copy: edges, corners, sides, hollows        readings   ways in which the surface may be supported
judgement  scores of readings; unit, vertical axis, supports  reading    reads the mesh and repairs small faults
loads      loads by kind of surface, or by the user's choice  sizes      spacing, thickness, edge length, widths
marks      marks on layers of the user's file                 text       text of the preset with comments
decisions  the whole proposal"""

from dsfab.preset.proposal.decisions import OWN, Proposal, preset_for, propose
from dsfab.preset.proposal.loads import MeshWishes
from dsfab.preset.proposal.reading import Decision, origin_near, preset_name, size_doubt, sizes_in_other_units

__all__ = [
    "OWN", "Decision", "MeshWishes", "Proposal", "origin_near", "preset_for", "preset_name", "propose",
    "size_doubt", "sizes_in_other_units",
]  # fmt: skip
