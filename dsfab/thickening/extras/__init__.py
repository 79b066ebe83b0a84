"""What architects add to a solid, `[[thickening.extra]]` in a preset: feet, ring beams, holes, trimming, splitting.

All of it is boolean work of manifold3d; its result passes the same tests as every solid (see `judge`).
"""

from dsfab.thickening.extras.base import Base
from dsfab.thickening.extras.cutting import Holes, Trim
from dsfab.thickening.extras.feet import Feet
from dsfab.thickening.extras.make import Extra, with_extras
from dsfab.thickening.extras.ring import Ring
from dsfab.thickening.extras.splitting import SplitBodies

__all__ = ["Base", "Extra", "Feet", "Holes", "Ring", "SplitBodies", "Trim", "with_extras"]
