"""Files of a design, and reading of a design from its folder.

files     one file of a design, and smooth STEP
archive   lines and fields of a design, and the file `design.npz`, from which dsfab reads the design later"""

from dsfab.design.output.archive import design_lines
from dsfab.design.output.files import body_details, curved_design, to_build123d, write

__all__ = ["body_details", "curved_design", "design_lines", "to_build123d", "write"]
