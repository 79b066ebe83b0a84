"""From a sheet to a solid: `offsets` on the uncut surface, `thicken` on what the pattern kept of it."""

from dsfab.thickening.extras import Base, Extra, Feet, Holes, Ring, SplitBodies, Trim, with_extras
from dsfab.thickening.notes import Repairs
from dsfab.thickening.offset import SHIFT, Offsets, Side, offsets
from dsfab.thickening.parts import parts
from dsfab.thickening.separation_proof import OffsetLayer, apart
from dsfab.thickening.skin import closed_skin
from dsfab.thickening.solid import Solid, thicken

__all__ = [
    "SHIFT",
    "Base",
    "Extra",
    "Feet",
    "Holes",
    "OffsetLayer",
    "Offsets",
    "Repairs",
    "Ring",
    "Side",
    "Solid",
    "SplitBodies",
    "Trim",
    "apart",
    "closed_skin",
    "offsets",
    "parts",
    "thicken",
    "with_extras",
]
