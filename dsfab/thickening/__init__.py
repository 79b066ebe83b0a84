"""Thickening of a cut sheet: `offsets` computes offset vectors of the uncut surface, `thicken` makes the solid."""

from dsfab.thickening.extras import Extra, with_extras
from dsfab.thickening.extras.bodies import Base
from dsfab.thickening.extras.cutting import SplitBodies
from dsfab.thickening.offset_vectors import SHIFT, Side, offsets
from dsfab.thickening.separation_proof import OffsetLayer, proven_cells
from dsfab.thickening.skin import closed_skin
from dsfab.thickening.solid import Repairs, Solid, parts, thicken

__all__ = [
    "SHIFT", "Base", "Extra", "OffsetLayer", "Repairs", "Side", "Solid", "SplitBodies", "closed_skin", "offsets",
    "parts", "proven_cells", "thicken", "with_extras",
]  # fmt: skip
