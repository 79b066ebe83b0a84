"""From a sheet to a solid: `offsets` on the uncut surface, `thicken` on what the pattern kept of it."""

from dsfab.thickening.apart import Layer, apart
from dsfab.thickening.extras import Base, Extra, Feet, Holes, Split, Trim, with_extras
from dsfab.thickening.notes import Repairs
from dsfab.thickening.offset import Offsets, Side, offsets
from dsfab.thickening.solid import Solid, thicken

__all__ = [
    "Base",
    "Extra",
    "Feet",
    "Holes",
    "Layer",
    "Offsets",
    "Repairs",
    "Side",
    "Solid",
    "Split",
    "Trim",
    "apart",
    "offsets",
    "thicken",
    "with_extras",
]
