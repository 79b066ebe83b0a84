"""A preset for a surface of the user's own: what a sensible architect would decide, each decision told.

reading.py   the mesh in metres, z up, small faults mended        vertical.py   which axis points to the sky
feet.py      where it stands                                      sizes.py      spacing, thickness, edges, widths
marks.py     what is drawn beside it on layers                    propose.py   all of it as a commented preset
"""

from dsfab.preset.proposal.decisions import OWN, Proposal, preset_for, propose
from dsfab.preset.proposal.reading import Decision, preset_name, size_doubt, sizes_in_other_units

__all__ = ["OWN", "Decision", "Proposal", "preset_for", "preset_name", "propose", "size_doubt", "sizes_in_other_units"]
