"""What architects add to a solid: feet, holes, trimming, splitting for a print bed; `[[thickening.extra]]` in a preset.

All of it is boolean work of manifold3d; its result passes the same tests as every solid (see `judge`).
"""

from dsfab.thickening.extras.base import Base
from dsfab.thickening.extras.cutting import Holes, Trim
from dsfab.thickening.extras.feet import Feet
from dsfab.thickening.extras.make import Extra, with_extras
from dsfab.thickening.extras.splitting import Split

__all__ = ["Base", "Extra", "Feet", "Holes", "Split", "Trim", "with_extras"]
