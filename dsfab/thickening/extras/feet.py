"""Feet: blocks that a solid stands on."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from dsfab.errors import SolidError
from dsfab.surface import Picker
from dsfab.surface.pickers import STRICT, Real
from dsfab.thickening.extras.base import Base
from dsfab.thickening.extras.bodies import box, positive, united_bodies

if TYPE_CHECKING:
    import manifold3d


@dataclass(frozen=True)
class Feet:
    """`kind = "feet"`: a block under each part of the sheet that reaches the picked vertices, united with it.

    at : what stands on feet.    height : metres below the lowest picked vertex of a part.    margin : metres around it.
    sink : metres above that vertex: blocks must meet the sheet.    Blocks stand along z.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    at: Picker
    height: Real
    margin: Real
    sink: Real
    kind: Literal["feet"] = "feet"

    def applied(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """The solid with its feet; raises SolidError where none of the picked vertices is on the sheet."""
        positive(self, "height", "margin", "sink")
        blocks = []
        for points in base.parts(self.at.vertices(base.surface)):
            low, high = points.min(axis=0) - self.margin, points.max(axis=0) + self.margin
            low[2], high[2] = points[:, 2].min() - self.height, points[:, 2].min() + self.sink
            blocks.append(box(low, high))
        if not blocks:
            raise SolidError("thickening.extra 'feet': none of the picked vertices is on the sheet; set pattern.keep")
        standing = united_bodies([solid, *blocks])
        if len(standing.decompose()) > len(solid.decompose()):
            raise SolidError("thickening.extra 'feet': a foot does not meet the solid; raise sink or margin")
        return standing
