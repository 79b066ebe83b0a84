"""Propose a preset for the user's own surface, with a line for each decision.

reading   the mesh in metres with z up, small faults mended        feet    supports
sizes     spacing, thickness, edges, widths                        marks   drawings on layers of the file
text      the commented preset                                     decisions   the whole proposal
"""

from dsfab.preset.proposal.decisions import OWN, Proposal, preset_for, propose
from dsfab.preset.proposal.reading import Decision, preset_name, size_doubt, sizes_in_other_units

__all__ = ["OWN", "Decision", "Proposal", "preset_for", "preset_name", "propose", "size_doubt", "sizes_in_other_units"]
