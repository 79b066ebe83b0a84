"""Pickers (selections of vertices) by an outline: polygon, curves of a drawing, brush stroke; and the type `Picker`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Gt, MinLen
from pydantic import ConfigDict, Field

from dsfab.core.arrays import Bools, Floats, lengths, polygon_perimeter
from dsfab.core.errors import SurfaceError
from dsfab.surface.files.drawings import closed_curves
from dsfab.surface.loads.pickers import (
    PICKER_TOLERANCE,
    STRICT,
    All,
    Ball,
    Boundary,
    Box,
    Extent,
    Facing,
    Nearest,
    Real,
    Side,
    Vector,
    Vertices,
    VerticesLeft,
    picker_words,
    pierced_faces,
    within_reach,
)
from dsfab.surface.mesh import Surface, nearest_places
from dsfab.surface.topology import spanned_edges


def depth_in(loops: Sequence[Floats], P: Floats) -> Floats:
    """Return the distance (p,) of points P (p, 2) from the sides of polygons `loops`, each (k, 2); negative outside.
    A polygon inside a polygon bounds a hole."""
    start = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    space = np.zeros((2 * len(start), 3))
    space[:, :2] = np.concatenate([start, end])
    sides = np.arange(2 * len(start)).reshape(2, -1).T
    points = np.zeros((len(P), 3))
    points[:, :2] = P
    away = nearest_places(points, space, sides).distance
    return np.asarray(np.where(_inside(start, end, P), away, -away))


def _inside(start: Floats, end: Floats, P: Floats) -> Bools:
    odd, block = np.zeros(len(P), dtype=bool), max(4_000_000 // len(start), 1)  # blocks save memory
    rise = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    for k in range(0, len(P), block):
        x, y = P[k : k + block].T[:, :, None]
        spans = (start[:, 1] <= y) != (end[:, 1] <= y)
        crossing_x = start[:, 0] + (y - start[:, 1]) / rise * (end[:, 0] - start[:, 0])
        odd[k : k + block] = (spans & (crossing_x > x)).sum(axis=1) % 2 == 1
    return odd


def without_repeats(P: Floats) -> Floats:
    """Return the corners (k, d) of a closed polygon without consecutive duplicates."""
    return np.asarray(P[(np.roll(P, 1, axis=0) != P).any(axis=1)])


def enclosed_area(P: Floats) -> float:
    """Return the positive area of a polygon (k, 2), in its unit squared."""
    (x, y), (u, v) = P.T, np.roll(P, -1, axis=0).T
    return float(abs(x @ v - u @ y) / 2)


def bend_corners(P: Floats) -> Bools:
    """Return a mask (k,) of the corners of a polygon (k, 2) at which the outline bends by 15 degrees or more."""
    came, goes = P - np.roll(P, 1, axis=0), np.roll(P, -1, axis=0) - P
    cross = came[:, 0] * goes[:, 1] - came[:, 1] * goes[:, 0]
    angle = np.abs(np.arctan2(cross, np.einsum("ki,ki->k", came, goes)))
    return np.asarray(angle >= np.radians(15.0))


def self_crossing(P: Floats) -> tuple[int, int, Floats] | None:
    """Return the numbers of two sides of a polygon P (k, 2) that cross or touch, and their common point (2,).
    Neighbouring sides do not count. Return None if no sides cross."""
    k, Q = len(P), np.roll(P, -1, axis=0)
    for i in range(k - 2):
        j = np.arange(i + 2, k - (i == 0))
        a, b, c, d = P[i], Q[i], P[j], Q[j]
        turn_c, turn_d = _turns(a, b, c), _turns(a, b, d)
        turn_a, turn_b = _turns(c, d, a), _turns(c, d, b)
        across = (turn_c * turn_d <= 0) & (turn_a * turn_b <= 0)
        on_line = (turn_c == 0) & (turn_d == 0)
        ahead, span = (c - a) @ (b - a), (d - a) @ (b - a)
        across &= ~on_line | ((np.maximum(ahead, span) >= 0) & (np.minimum(ahead, span) <= (b - a) @ (b - a)))
        if across.any():
            n = int(across.argmax())
            share = turn_a[n] / (turn_a[n] - turn_b[n]) if turn_a[n] != turn_b[n] else 0.0
            return i, int(j[n]), a + share * (b - a)
    return None


def _turns(a: Floats, b: Floats, c: Floats) -> Floats:
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


LEVEL = float(np.cos(np.radians(1)))  # Cosine of the largest slope of a curve that is projected from above.
ONE_PLANE = 1e-3  # Largest distance of curves from their common plane, divided by their size.


class OutlineError(SurfaceError, ValueError):
    """Error for an invalid outline; also a ValueError, so that pydantic adds the preset's key to the message."""


@dataclass(frozen=True)
class PlanPolygon:
    """Picker of the space above and below a polygon: `{ pick = "plan", polygon = [[0, 0], [2, 0], [2, 1]] }`.
    polygon : corners, x and y, metres.    low, high : limits on z, metres; by default none.
    Raises OutlineError for a polygon that has no area or crosses itself, and for heights in the wrong order."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    polygon: tuple[tuple[Real, Real], ...]
    low: Real | None = None
    high: Real | None = None
    pick: Literal["plan"] = "plan"

    def __post_init__(self) -> None:
        check_polygon(np.array(self.polygon, dtype=np.float64).reshape(-1, 2), "polygon")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise OutlineError(f"low = {self.low:g} is not below high = {self.high:g}; swap them")

    def extent(self, surface: Surface) -> Extent:
        """Return the prism above and below the polygon, cut off at the heights `low` and `high` if they are set."""
        P, z = without_repeats(np.array(self.polygon)), surface.V[:, 2]
        low = -np.inf if self.low is None else self.low
        high = np.inf if self.high is None else self.high

        def depth(X: Floats) -> Floats:
            return np.minimum(depth_in([P], X[:, :2]), np.minimum(X[:, 2] - low, high - X[:, 2]))

        room = surface.size
        floor, roof = max(low, z.min() - room), min(high, z.max() + room)
        levels = [level for level in (self.low, self.high) if level is not None]
        uprights = [((*p, floor), (*p, roof)) for p in P[bend_corners(P)]]
        sides = list(zip(P, np.roll(P, -1, axis=0), strict=True))
        around = [((*p, level), (*q, level)) for level in levels for p, q in sides]
        return Extent(depth, np.array([*uprights, *around]).reshape(-1, 2, 3), _width(P))

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError if no vertex is picked."""
        return within_reach(self, surface, -self.extent(surface).depth(surface.V), 0.0)


@dataclass(frozen=True)
class ClosedCurves:
    """Picker of the space inside closed curves of a drawing: `{ pick = "curve", file = "door.dxf", layer = "door" }`.
    dsfab projects horizontal curves along z, and other curves along the normal of their plane, like a door in a facade.
    file   : drawing, DXF or 3DM; relative paths start at the preset's folder, in Python at the current folder.
    layer  : layer of the curves; by default all layers.    unit : unit of the file's numbers; by default its own unit.
    curves : points of polygons, used in place of a file, metres.
    depth  : largest distance from the curves' plane, metres. By default, horizontal curves have no limit, and
             other curves select only the nearest part of the surface.
    Raises OutlineError unless exactly one of `file` and `curves` is set."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    file: Path | None = None
    layer: str | None = None
    unit: str | None = None
    curves: tuple[tuple[Vector, ...], ...] | None = None
    depth: Annotated[Real, Gt(0)] | None = None
    pick: Literal["curve"] = "curve"

    def __post_init__(self) -> None:
        if (self.file is None) == (not self.curves):
            raise OutlineError('give either file = "door.dxf" or curves = [[[x, y, z], ...], ...]')
        if self.file is None and (self.layer or self.unit):
            raise OutlineError("layer and unit need a file; curves without a file are in metres")

    def loops(self) -> tuple[Floats, ...]:
        """Return the points (k, 3) of each curve, metres. For a file, raises SurfaceError as `closed_curves` does."""
        if self.file is not None:
            return closed_curves(self.file, self.layer, self.unit)
        return tuple(np.array(curve, dtype=np.float64) for curve in self.curves or ())

    def extent(self, surface: Surface) -> Extent:
        """Return the prisms on both sides of the curves, normal to each curve's plane.
        Raises SurfaceError for curves that cross themselves or have no area."""
        planes: list[_Plane] = []
        for number, loop in enumerate(self.loops()):
            loop = without_repeats(loop)
            new_plane = _Plane.from_curve(loop, picker_words(self), number)
            plane_index = next((k for k, plane in enumerate(planes) if plane.holds(loop)), None)
            if plane_index is None:
                planes.append(new_plane)
            else:
                plane = planes[plane_index]
                planes[plane_index] = replace(plane, loops=(*plane.loops, loop))
        return Extent.union([plane.extent(surface, self.depth) for plane in planes])

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError without vertices, and for invalid outlines."""
        return within_reach(self, surface, -self.extent(surface).depth(surface.V), 0.0)


@dataclass(frozen=True)
class Brush:
    """Picker of the space within `radius` (metres) of a polyline through `points`, like the stroke of a brush.
    A new stroke begins where two consecutive points are more than two radii apart."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    points: Annotated[tuple[Vector, ...], MinLen(1)]
    radius: Annotated[Real, Gt(0)]
    pick: Literal["brush"] = "brush"

    def extent(self, surface: Surface) -> Extent:
        """Return the balls around points, and tubes around the segments that join consecutive points of a stroke."""
        points, radius = np.array(self.points, dtype=np.float64), self.radius
        step, dots = lengths(np.diff(points, axis=0)), np.arange(len(points))
        ways = np.stack([dots[:-1], dots[1:]], axis=1)[(step > 0) & (step <= 2 * radius)]

        def depth(P: Floats) -> Floats:
            distance = nearest_places(P, points, dots[:, None]).distance
            return radius - (np.minimum(distance, nearest_places(P, points, ways).distance) if len(ways) else distance)

        return Extent(depth, np.empty((0, 2, 3)), radius)

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError if no vertex is picked."""
        return within_reach(self, surface, -self.extent(surface).depth(surface.V), 0.0)


def check_polygon(P: Floats, name: str) -> None:
    """Raise OutlineError if a polygon P (k, 2), metres, has no area or crosses itself. name : text for the message."""
    P = without_repeats(P)
    if len(P) < 3:
        raise OutlineError(f"{name} has {len(P)} different corners; give three or more")
    if crossing := self_crossing(P):
        i, j, (x, y) = crossing
        raise OutlineError(
            f"{name} crosses or touches itself: side {i} and side {j} (counted from 0) meet at ({x:.4g}, {y:.4g}); "
            "list its corners in their order around the polygon"
        )
    if not enclosed_area(P) > 0:
        raise OutlineError(f"{name} has no area, because its corners are on a line; move a corner")


@dataclass(frozen=True, eq=False)
class _Plane:
    """A plane that contains closed curves. origin : (3,) point of the plane.    loops : curves, (k, 3) each.
    axes : (3, 3) unit vectors; the last vector is the normal."""

    origin: Floats
    axes: Floats
    loops: tuple[Floats, ...]

    @classmethod
    def from_curve(cls, loop: Floats, whose: str, number: int) -> "_Plane":
        if len(loop) < 3:
            raise SurfaceError(f"{whose}: curve {number} has {len(loop)} different points; give three or more")
        origin = loop.mean(axis=0)
        axes = np.linalg.svd(loop - origin, full_matrices=False)[2]
        if abs(axes[2, 2]) > LEVEL:
            axes = np.eye(3)
        flat = cls(origin, axes, (loop,))
        try:
            check_polygon(flat.projected(loop), f"curve {number}, seen along its normal,")
        except OutlineError as error:
            raise SurfaceError(f"{whose}: {error}") from None
        return flat

    def projected(self, P: Floats) -> Floats:
        return np.asarray((P - self.origin) @ self.axes[:2].T)

    def distances(self, P: Floats) -> Floats:
        return np.asarray((P - self.origin) @ self.axes[2])

    @cached_property
    def level(self) -> bool:
        return bool(abs(self.axes[2, 2]) > LEVEL)

    def holds(self, loop: Floats) -> bool:
        size = float(np.linalg.norm(np.ptp(np.concatenate([*self.loops, loop]), axis=0)))
        return bool(np.abs(self.distances(loop)).max() < ONE_PLANE * size)

    def extent(self, surface: Surface, depth: float | None) -> Extent:
        """Return the prism over the curves, normal to the plane. depth : height of the prism on each side of
        the plane, metres; None: unlimited for horizontal curves, else only through the surface's nearest part."""
        loops, normal = [self.projected(loop) for loop in self.loops], self.axes[2]
        low, high = (-depth, depth) if depth else (-np.inf, np.inf)
        if depth is None and not self.level:
            low, high = self._nearest_part(surface)

        def prism_depth(P: Floats) -> Floats:
            distance = self.distances(P)
            return np.minimum(depth_in(loops, self.projected(P)), np.minimum(distance - low, high - distance))

        reach = np.abs(self.distances(surface.V)).max() + surface.size
        ends = np.array([max(low, -reach), min(high, reach)])[:, None] * normal
        corners = np.concatenate([loop[bend_corners(flat)] for loop, flat in zip(self.loops, loops, strict=True)])
        foot = corners - self.distances(corners)[:, None] * normal
        return Extent(prism_depth, foot[:, None] + ends, min(_width(flat) for flat in loops))

    def _nearest_part(self, surface: Surface) -> tuple[float, float]:
        """Return the lower and the upper height (m) of a prism that contains only the surface's nearest part.
        Heights are measured from the plane. A height is infinite if no other part of the surface lies on its side."""
        reach, normal = np.abs(self.distances(surface.V)).max() + surface.size, self.axes[2]
        nearest_hits, behind = list[float](), list[float]()
        for p in self._sight_points():
            foot = p - self.distances(p[None]) * normal
            _, t = pierced_faces(surface, foot - reach * normal, foot + reach * normal)
            if not len(t):
                continue
            hits = (2 * t - 1) * reach
            k = int(np.abs(hits).argmin())
            nearest_hits.append(float(hits[k]))
            behind += [float(hit) for hit in hits if abs(hit - hits[k]) > ONE_PLANE * surface.size]
        if not nearest_hits:
            return -np.inf, np.inf
        lowest, highest = min(nearest_hits), max(nearest_hits)
        below, above = [hit for hit in behind if hit < lowest], [hit for hit in behind if hit > highest]
        low = (max(below) + lowest) / 2 if below else -np.inf
        return low, (min(above) + highest) / 2 if above else np.inf

    def _sight_points(self) -> Floats:
        points = list[Floats]()
        for loop in self.loops:
            sample = loop[:: max(2 * len(self.loops) * len(loop) // 48, 1)]
            points += [sample, (sample + loop.mean(axis=0)) / 2]
        return np.concatenate(points)


def _width(P: Floats) -> float:
    return 2 * enclosed_area(P) / polygon_perimeter(P)


def self_contained(picker: Any) -> Any:
    """Return the picker with the points of its curves in place of the file. Other pickers stay unchanged.
    Raises SurfaceError as `closed_curves` does."""
    if not isinstance(picker, ClosedCurves) or picker.file is None:
        return picker
    curves = tuple(tuple((float(x), float(y), float(z)) for x, y, z in loop) for loop in picker.loops())
    return ClosedCurves(curves=curves, depth=picker.depth)


Picker = Annotated[
    All | Box | Ball | Side | Nearest | Boundary | Facing | Vertices | PlanPolygon | ClosedCurves | Brush,
    Field(discriminator="pick"),
]


def has_outline(picker: Picker) -> bool:
    """Return True if a picker selects all vertices in a part of space. Regions by these pickers have smooth edges."""
    return isinstance(picker, PlanPolygon | ClosedCurves | Brush | Ball | Box | Side) and not getattr(
        picker, "boundary", False
    )


def extent_of(picker: Picker, surface: Surface) -> Extent | None:
    """Return the part of space in which a picker selects all vertices; None for a picker without a part of space.
    Raises SurfaceError as `ClosedCurves.extent` does."""
    if isinstance(picker, PlanPolygon | ClosedCurves | Brush):
        return picker.extent(surface)
    if isinstance(picker, Ball):
        return Extent.ball(*picker.metres(surface))
    if isinstance(picker, Box) and not picker.boundary:
        return Extent.box(*picker.corners(surface))
    if isinstance(picker, Side):
        axis = np.eye(3)["xyz".index(picker.axis)] * (1 if picker.end == "min" else -1)
        return Extent.below(axis, float((surface.V @ axis).min()) + picker.reach(surface), picker.reach(surface))
    return None


def edges_of(picker: Picker, surface: Surface) -> Bools:
    """Return a mask (e,) of the edges between picked vertices. A picker of the boundary selects only free edges.
    For a picker by outline, an edge's middle must also lie inside. Raises SurfaceError as the picker does."""
    picked, edges = picker.vertices(surface), surface.edges
    if isinstance(picker, VerticesLeft):
        return picker.edges(surface)
    if isinstance(picker, Vertices | Nearest):
        return spanned_edges(surface.F, edges, picked)
    is_picked: Bools = np.asarray(picked[edges.ends].all(axis=1))
    if isinstance(picker, Boundary) or getattr(picker, "boundary", False):
        return is_picked & edges.boundary
    if isinstance(picker, PlanPolygon | ClosedCurves | Brush):
        middle = surface.V[edges.ends[is_picked]].mean(axis=1)
        is_picked[is_picked] = picker.extent(surface).depth(middle) >= -PICKER_TOLERANCE * surface.size
    return is_picked
