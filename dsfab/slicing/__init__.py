"""Stage 5, slicing: from stripes to a sheet that is cut along their edges."""

from dsfab.slicing.cut import cut, material_area
from dsfab.slicing.pinch import Pinched, resolve_pinches
from dsfab.slicing.sheet import Sheet

__all__ = ["Pinched", "Sheet", "cut", "material_area", "resolve_pinches"]
