"""From a sheet to a solid: `offsets` on the uncut surface, `thicken` on what the pattern kept of it."""

from dsfab.thickening.notes import Repairs
from dsfab.thickening.offset import Offsets, Side, offsets
from dsfab.thickening.solid import Solid, thicken

__all__ = ["Offsets", "Repairs", "Side", "Solid", "offsets", "thicken"]
