"""`Picker`: any of the ways to say where something is, told apart by `pick`; and the space and the edges it means."""

from typing import Annotated

import numpy as np
from pydantic import Field

from dsfab.arrays import Bools
from dsfab.surface.extent import Extent
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import spanned_edges
from dsfab.surface.outlines import Brush, ClosedCurves, PlanPolygon
from dsfab.surface.pickers import TOUCH, All, Ball, Boundary, Box, Facing, Nearest, Side, Vertices, VerticesLeft

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


def edges_of(at: Picker, surface: Surface) -> Bools:
    """(e,) the edges that a picker means, besides the vertices at their ends; raises SurfaceError as the picker does.

    What means the boundary means free edges alone: one within the sheet may join two of its vertices. What means a part
    of space, or normals, means the edges with both ends in it, an outline, which may be hollow, those with their middle
    in it as well; vertices that are named mean what they span (`spanned_edges`).
    """
    picked, edges = at.vertices(surface), surface.edges
    if isinstance(at, VerticesLeft):
        return at.edges(surface)
    if isinstance(at, Vertices | Nearest):
        return spanned_edges(surface.F, edges, picked)
    both: Bools = np.asarray(picked[edges.ends].all(axis=1))
    if isinstance(at, Boundary) or getattr(at, "boundary", False):
        return both & edges.boundary
    if isinstance(at, PlanPolygon | ClosedCurves | Brush):
        middle = surface.V[edges.ends[both]].mean(axis=1)
        both[both] = at.extent(surface).depth(middle) >= -TOUCH * surface.size
    return both
