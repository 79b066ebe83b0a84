"""Holes, and what is cut off by a plane or a box."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from dsfab.errors import SolidError
from dsfab.surface.pickers import STRICT, Real, Vector
from dsfab.thickening.extras.base import Base
from dsfab.thickening.extras.bodies import box, drill, positive, unit

if TYPE_CHECKING:
    import manifold3d


@dataclass(frozen=True)
class Holes:
    """`kind = "holes"`: round holes through the solid.

    at : points on the middle of the sheet, metres.    diameter : metres.    axis : direction of the drill.
    depth : metres, half of it on each side of the point; holes go no further, so that what lies behind stays whole.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    at: tuple[Vector, ...]
    diameter: Real
    depth: Real
    axis: Vector = (0.0, 0.0, 1.0)
    kind: Literal["holes"] = "holes"

    def applied(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """The solid with the holes; raises SolidError for one that meets no material."""
        positive(self, "diameter", "depth")
        for number, point in enumerate(self.at, 1):
            drilled = solid - drill(np.array(point), np.array(self.axis), self.diameter, self.depth)
            if drilled.volume() > solid.volume() * (1 - 1e-12):
                raise SolidError(
                    f"thickening.extra 'holes': point {number} of {len(self.at)} meets no material; the nearest is at "
                    f"{base.nearest(np.array(point))} m"
                )
            solid = drilled
        return solid


@dataclass(frozen=True)
class Trim:
    """`kind = "trim"`: cut off what lies beyond a plane, or outside of a box, or both.

    point, normal : of the plane; what lies where the normal points to is cut off.    low, high : corners of the box.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    point: Vector | None = None
    normal: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    kind: Literal["trim"] = "trim"

    def applied(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """What is left of the solid on one side of the plane and inside the box; raises SolidError."""
        plane, corners = (self.point, self.normal), (self.low, self.high)
        if (None in plane and any(plane)) or (None in corners and any(corners)) or not (any(plane) or any(corners)):
            raise SolidError("thickening.extra 'trim' needs point and normal of a plane, or low and high of a box")
        if self.point is not None and self.normal is not None:
            normal = unit(self.normal, "thickening.extra 'trim': normal")
            solid = solid.trim_by_plane((-normal).tolist(), float(-normal @ np.array(self.point)))
        if self.low is not None and self.high is not None:
            if not (np.array(self.low) < np.array(self.high)).all():
                raise SolidError("thickening.extra 'trim': low must be below high along x, y and z")
            solid = solid ^ box(np.array(self.low), np.array(self.high))
        return solid
