"""`OffsetLayer`: what is to be proven about."""

from dataclasses import dataclass

from dsfab.arrays import Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.thickening.offset import SHIFT, Side


@dataclass(frozen=True, eq=False)
class OffsetLayer:
    """A thickened surface before anything is removed.

    uncut  : an edge-manifold surface, faces consistently oriented, with half-thickness vectors D (n, 3), metres.
    cells  : the same surface cut, all of it, with vectors `carried` (n', 3), and the face (m',) each cell lies in.
    side   : as in `thicken`.
    """

    uncut: Surface
    D: Floats
    cells: Surface
    carried: Floats
    parent: Ints
    side: Side = "mid"

    @property
    def shift(self) -> int:
        """By how many D the middle lies off the surface."""
        return SHIFT[self.side]
