"""Propose a preset for the user's own surface, with one line of explanation for each decision.

shape      a coarse copy: edges, corners, sides, necks, hollows     readings   the ways in which it may be held
judgement  their statics, and the choice of unit, axis, supports    reading    reads the mesh, mends small faults
loads      loads by kind of surface, and the user's wishes          sizes      spacing, thickness, edges, widths
marks      marks on layers of the user's file                       text       text of the preset with comments
decisions  the whole proposal"""

from dsfab.preset.proposal.decisions import OWN, Proposal, preset_for, propose
from dsfab.preset.proposal.loads import MeshWishes
from dsfab.preset.proposal.reading import Decision, preset_name, size_doubt, sizes_in_other_units

__all__ = [
    "OWN", "Decision", "MeshWishes", "Proposal", "preset_for", "preset_name", "propose", "size_doubt",
    "sizes_in_other_units",
]  # fmt: skip
