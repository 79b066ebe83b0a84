"""Propose a preset for the user's own surface, with one line of explanation for each decision.

reading   reads the mesh in metres, turns z up, mends small faults     feet        supports
sizes     spacing, thickness, edges, widths                            marks       marks on layers of the user's file
text      text of the preset with comments                             decisions   the whole proposal"""

from dsfab.preset.proposal.decisions import OWN, Proposal, preset_for, propose
from dsfab.preset.proposal.reading import Decision, preset_name, size_doubt, sizes_in_other_units

__all__ = ["OWN", "Decision", "Proposal", "preset_for", "preset_name", "propose", "size_doubt", "sizes_in_other_units"]
