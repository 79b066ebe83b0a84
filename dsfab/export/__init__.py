"""From a solid to a file: millimetres, the unit written into it, read back by another reader before it has its name."""

from dsfab.export.formats import FORMATS, STEP_FACES, write
from dsfab.export.part import Details

__all__ = ["FORMATS", "STEP_FACES", "Details", "write"]
