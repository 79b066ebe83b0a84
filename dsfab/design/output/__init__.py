"""What of a design goes into which file, and a built design read back from its folder.

files     one file of a design            lines, fields, curved   what drawings, ParaView and smooth STEP take of it
archive   `design.npz`: a design kept     archive_even            and its evenly spaced stripes
member_records, member_shapes  its members and nodes, for files: what is known of them; as bodies
beam_records, bar_records      its beam model, and what members bear
"""

from dsfab.design.output.fields import design_lines
from dsfab.design.output.files import body_details, curved_design, to_build123d, write

__all__ = ["body_details", "curved_design", "design_lines", "to_build123d", "write"]
