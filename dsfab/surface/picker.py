"""`Picker`: any of the ways to say where something is, told apart by `pick`; and the part of space that it means."""

from typing import Annotated

import numpy as np
from pydantic import Field

from dsfab.surface.extent import Extent
from dsfab.surface.mesh import Surface
from dsfab.surface.outlines import Brush, ClosedCurves, PlanPolygon
from dsfab.surface.pickers import All, Ball, Boundary, Box, Facing, Nearest, Side, Vertices

Picker = Annotated[
    All | Box | Ball | Side | Nearest | Boundary | Facing | Vertices | PlanPolygon | ClosedCurves | Brush,
    Field(discriminator="pick"),
]


def has_outline(at: Picker) -> bool:
    """Whether a picker means a part of space, so that what it picks ends along a line."""
    return isinstance(at, PlanPolygon | ClosedCurves | Brush | Ball | Box | Side) and not getattr(at, "boundary", False)


def extent_of(at: Picker, surface: Surface) -> Extent | None:
    """The part of space that a picker means; None for those that mean vertices or faces.

    Raises SurfaceError as `ClosedCurves.extent` does.
    """
    if isinstance(at, PlanPolygon | ClosedCurves | Brush):
        return at.extent(surface)
    if isinstance(at, Ball):
        return Extent.ball(*at.metres(surface))
    if isinstance(at, Box) and not at.boundary:
        return Extent.box(*at.corners(surface))
    if isinstance(at, Side):
        axis = np.eye(3)["xyz".index(at.axis)] * (1 if at.end == "min" else -1)
        return Extent.below(axis, float((surface.V @ axis).min()) + at.reach(surface), at.reach(surface))
    return None
