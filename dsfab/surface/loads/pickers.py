"""Pickers of vertices for supports and loads, by side, box, ball, boundary and more; `Extent`, a part of space."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations, product
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from annotated_types import Ge, Gt, Le, MinLen
from pydantic import AllowInfNan, ConfigDict, StringConstraints

from dsfab.core.arrays import Bools, Floats, Ints, cross, first_few, lock
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import count_phrase
from dsfab.surface.mesh import Surface
from dsfab.surface.orientation import require_two_sides
from dsfab.surface.topology import on_boundary


@dataclass(frozen=True, eq=False)
class Extent:
    """A part of space, such as a box, that selects vertices or a region of the surface.
    depth   : function that returns the distance (k,) of points (k, 3) from the part's border, metres; negative outside.
    creases : (c, 2, 3) ends of the segments where two walls of the part meet, metres.
    width   : about half the width of the part at narrow places, metres. Mesh edges near the border are shorter."""

    depth: Callable[[Floats], Floats]
    creases: Floats
    width: float

    def __post_init__(self) -> None:
        lock(self, "creases", np.float64, (None, 2, 3))

    @classmethod
    def union(cls, extents: "list[Extent]") -> "Extent":
        """Return the union of extents."""
        if len(extents) == 1:
            return extents[0]
        creases = np.concatenate([extent.creases for extent in extents])
        width = min(extent.width for extent in extents)
        return cls(lambda P: np.max([extent.depth(P) for extent in extents], axis=0), creases, width)

    @classmethod
    def ball(cls, center: Floats, radius: float) -> "Extent":
        """Return the ball around a point (3,), metres."""
        return cls(lambda P: radius - np.linalg.norm(P - center, axis=1), np.empty((0, 2, 3)), radius)

    @classmethod
    def box(cls, low: Floats, high: Floats) -> "Extent":
        """Return the box between two opposite corners (3,), metres."""
        corners = np.array(list(product(*np.stack([low, high], axis=1))))
        edges = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b).bit_count() == 1]
        middle, half = (low + high) / 2, (high - low) / 2

        def depth(P: Floats) -> Floats:
            outside = np.abs(P - middle) - half
            return np.asarray(-np.linalg.norm(np.maximum(outside, 0), axis=1) - np.minimum(outside.max(axis=1), 0))

        return cls(depth, corners[np.array(edges)], float(np.sort(half)[1]))

    @classmethod
    def below(cls, direction: Floats, height: float, width: float) -> "Extent":
        """Return the space where the coordinate along a unit vector (3,) is below `height`, metres.
        width : largest edge length for meshes near the border, metres."""
        return cls(lambda P: height - P @ direction, np.empty((0, 2, 3)), width)


def pierced_faces(surface: Surface, a: Floats, b: Floats) -> tuple[Ints, Floats]:
    """Return the faces (k,) that the segment from a to b (3,) meets, in order, and their positions (k,) on the segment:
    0 at a, 1 at b. Faces parallel to the segment do not count [Moeller and Trumbore 1997]."""
    P, Q, R = (surface.V[surface.F[:, k]] for k in range(3))
    ray, u, v = np.broadcast_to(b - a, P.shape), Q - P, R - P
    normal, to = cross(ray, v), a - P
    volume = np.einsum("mi,mi->m", u, normal)
    inside = -1e-9  # tolerance for rounding errors of barycentric coordinates
    least = 1e-12 * np.linalg.norm(b - a) * np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    safe = np.where(np.abs(volume) > least, volume, np.inf)
    u_share, side = np.einsum("mi,mi->m", to, normal) / safe, cross(to, u)
    v_share, t = np.einsum("mi,mi->m", ray, side) / safe, np.einsum("mi,mi->m", v, side) / safe
    in_face = (u_share >= inside) & (v_share >= inside) & (u_share + v_share <= 1 - inside)
    faces = np.flatnonzero(np.isfinite(safe) & in_face & (t >= 0) & (t <= 1))
    order = np.argsort(t[faces], kind="stable")
    return faces[order], t[faces[order]]


Real = Annotated[float, AllowInfNan(False)]
Vector = tuple[Real, Real, Real]
CaseName = Annotated[str, StringConstraints(pattern=r"^[^\W_]([\w .-]*[\w.-])?$")]
PICKER_TOLERANCE = 1e-6  # Tolerance of a picker for rounded coordinates, divided by the surface's size.
STRICT: ConfigDict = {"extra": "forbid"}  # Make pydantic refuse unknown keys.


class _HasPick(Protocol):
    @property
    def pick(self) -> str: ...


@dataclass(frozen=True)
class All:
    """Picker of all vertices of the surface."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pick: Literal["all"] = "all"

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices."""
        return np.ones(surface.n, dtype=bool)


@dataclass(frozen=True)
class Box:
    """Picker of the vertices in or on a box between the opposite corners `min` and `max`, metres.
    relative : true if the corners are fractions of the surface's own box, 0 to 1 along each axis.
    boundary : true to pick only vertices of free edges."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    min: Vector
    max: Vector
    relative: bool = False
    boundary: bool = False
    pick: Literal["box"] = "box"

    def corners(self, surface: Surface) -> Floats:
        """Return two opposite corners of the box (2, 3), metres."""
        return _in_metres([self.min, self.max], surface, self.relative)

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError for an empty box, or for min beyond max."""
        low, high = self.corners(surface)
        if (low > high).any():
            raise SurfaceError(f"{picker_words(self)} has min beyond max; swap them")
        away = np.linalg.norm(surface.V - np.clip(surface.V, low, high), axis=1)
        if self.boundary:
            away[~on_boundary(surface.edges, surface.n)] = np.inf
        return within_reach(self, surface, away, 0.0)


@dataclass(frozen=True)
class Ball:
    """Picker of the vertices within `radius` of `center`, metres.
    relative : true if `center` is in fractions of the surface's box, 0 to 1 along each axis, and `radius` is a
               fraction of the box's diagonal."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    center: Vector
    radius: Annotated[Real, Gt(0)]
    relative: bool = False
    pick: Literal["ball"] = "ball"

    def metres(self, surface: Surface) -> tuple[Floats, float]:
        """Return the ball's centre (3,) and radius, metres."""
        scale = surface.size if self.relative else 1.0
        return _in_metres([self.center], surface, self.relative)[0], self.radius * scale

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError if no vertex is picked."""
        center, radius = self.metres(surface)
        return within_reach(self, surface, np.linalg.norm(surface.V - center, axis=1), radius)


@dataclass(frozen=True)
class Side:
    """Picker of the vertices within `depth` metres of the surface's smallest or largest coordinate along `axis`.
    relative : true if the depth is a fraction of the surface's extent along the axis."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    axis: Literal["x", "y", "z"]
    end: Literal["min", "max"]
    depth: Annotated[Real, Ge(0)] = 0.0
    relative: bool = False
    pick: Literal["side"] = "side"

    def reach(self, surface: Surface) -> float:
        """Return the width of the picked strip, measured along the axis, metres."""
        return self.depth * (float(np.ptp(surface.V[:, "xyz".index(self.axis)])) if self.relative else 1.0)

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices."""
        x = surface.V[:, "xyz".index(self.axis)]
        away = x - x.min() if self.end == "min" else x.max() - x
        return within_reach(self, surface, away, self.reach(surface))


@dataclass(frozen=True)
class Nearest:
    """Picker of the vertex nearest to each point of `points`, metres.
    relative : true if the points are fractions of the surface's box, 0 to 1 along each axis."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    points: Annotated[tuple[Vector, ...], MinLen(1)]
    relative: bool = False
    pick: Literal["nearest"] = "nearest"

    def places(self, surface: Surface) -> Floats:
        """Return the points (k, 3), metres."""
        return _in_metres(self.points, surface, self.relative)

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the vertices that are nearest to the points. Raises SurfaceError without points."""
        picked = np.zeros(surface.n, dtype=bool)
        for point in self.places(surface):
            picked[np.linalg.norm(surface.V - point, axis=1).argmin()] = True
        return _require_picked(self, surface, picked, "")


@dataclass(frozen=True)
class Boundary:
    """Picker of the vertices of all free edges, of one boundary loop, or of a part of a loop.
    loop   : "all", or the number of a loop: 0 is the longest loop in metres.
    points : points near the boundary, metres, instead of `loop`. One point picks the nearest loop. Three points pick
             a part of the nearest loop: start, a point between, end."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    loop: Literal["all"] | Annotated[int, Ge(0)] = "all"
    points: tuple[Vector, ...] = ()
    pick: Literal["boundary"] = "boundary"

    def __post_init__(self) -> None:
        if len(self.points) not in (0, 1, 3) or (self.points and self.loop != "all"):
            raise ValueError(
                "pick = 'boundary' needs a loop, or points: one point for a whole loop, three points for a part of a "
                "loop (start, middle, end)"
            )

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError for a closed surface or an unknown loop."""
        loops = surface.loops
        if not loops:
            raise SurfaceError(f"{picker_words(self)} picks no vertex: the surface is closed; use another picker")
        if self.loop != "all" and not 0 <= self.loop < len(loops):
            raise SurfaceError(
                f"{picker_words(self)} picks no vertex: the surface has {len(loops)} boundary loops, so use loop = "
                f"0 to {len(loops) - 1} or 'all'"
            )
        picked = np.zeros(surface.n, dtype=bool)
        for loop in self._named_loop(surface) if self.points else loops if self.loop == "all" else [loops[self.loop]]:
            picked[loop] = True
        return picked

    def _named_loop(self, surface: Surface) -> list[Ints]:
        """Return the boundary loop nearest to the first point; with three points, only the part between the first
        and the third point that contains the second point."""
        away = [np.linalg.norm(surface.V[loop] - self.points[0], axis=1).min() for loop in surface.loops]
        loop = surface.loops[int(np.argmin(away))]
        if len(self.points) == 1:
            return [loop]
        P = surface.V[loop]
        start, past, end = (int(np.linalg.norm(P - point, axis=1).argmin()) for point in self.points)
        if (past - start) % len(loop) > (end - start) % len(loop):
            start, end = end, start
        return [np.roll(loop, -start)[: (end - start) % len(loop) + 1]]


@dataclass(frozen=True)
class Facing:
    """Picker of the vertices with normals within `angle` degrees of `direction`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    direction: Vector
    angle: Annotated[Real, Ge(0), Le(180)] = 30.0
    pick: Literal["facing"] = "facing"

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError if no vertex is picked."""
        require_two_sides(surface, np.ones(surface.m, dtype=bool), picker_words(self))
        d, N = unit_vector(self.direction, picker_words(self)), surface.vertex_normals
        degrees = np.degrees(np.arctan2(np.linalg.norm(np.cross(N, d), axis=1), N @ d))
        degrees[~N.any(axis=1)] = np.inf
        picked = degrees <= self.angle + np.degrees(PICKER_TOLERANCE)
        return _require_picked(self, surface, picked, f"; the nearest normal is {degrees.min():.3g} degrees away")


@dataclass(frozen=True)
class Vertices:
    """Picker of the vertices with the given indices, counted from 0."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    indices: Annotated[tuple[Annotated[int, Ge(0)], ...], MinLen(1)]
    pick: Literal["vertices"] = "vertices"

    def vertices(self, surface: Surface) -> Bools:
        """Return a mask (n,) of the picked vertices; raises SurfaceError for an index that the surface lacks."""
        indices = np.array(self.indices, dtype=np.int64)
        bad = indices[(indices < 0) | (indices >= surface.n)]
        if len(bad):
            raise SurfaceError(
                f"pick = 'vertices' names {count_phrase(len(bad), 'vertex')} (first: {first_few(bad)}) that the "
                f"surface lacks; use 0 to {surface.n - 1}"
            )
        picked = np.zeros(surface.n, dtype=bool)
        picked[indices] = True
        return _require_picked(self, surface, picked, "")


@dataclass(frozen=True)
class VerticesLeft(Vertices):
    """Picked vertices that remain after voids are cut out.
    ends : (k, 2) vertices of each edge between picked vertices, smaller index first."""

    ends: tuple[tuple[int, int], ...] = ()

    def edges(self, surface: Surface) -> Bools:
        """Return a mask (e,) of the edges of the surface that are listed in `ends`."""
        table = surface.edges.ends
        ends = np.array(self.ends, dtype=np.int64).reshape(-1, 2)
        return np.isin(table[:, 0] * surface.n + table[:, 1], ends[:, 0] * surface.n + ends[:, 1])


def unit_vector(direction: Vector, whose: str) -> Floats:
    """Return a direction (3,) with length 1. Raises SurfaceError for a zero vector. whose : text for the message."""
    d = np.array(direction, dtype=np.float64)
    length = np.linalg.norm(d)
    if not np.isfinite(length) or length == 0:
        raise SurfaceError(f"{whose} needs a direction that is not zero, such as (0, 0, -1)")
    return d / length


def _in_metres(points: Sequence[Vector], surface: Surface, relative: bool) -> Floats:
    P = np.array(points, dtype=np.float64).reshape(-1, 3)
    low, high = surface.V.min(axis=0), surface.V.max(axis=0)
    return low + P * (high - low) if relative else P


def within_reach(picker: _HasPick, surface: Surface, away: Floats, reach: float) -> Bools:
    """Return a mask (n,) of the vertices with distances `away` (n,) of at most `reach`, metres.
    Raises SurfaceError with the name of the picker if no vertex is marked."""
    picked = away <= reach + PICKER_TOLERANCE * surface.size
    return _require_picked(picker, surface, picked, f"; the nearest vertex is {away.min() - reach:.4g} m out of reach")


def _require_picked(picker: _HasPick, surface: Surface, picked: Bools, why: str) -> Bools:
    if picked.any():
        return picked
    low, high = (", ".join(f"{x:.4g}" for x in f(surface.V, axis=0)) for f in (np.min, np.max))
    raise SurfaceError(f"{picker_words(picker)} picks no vertex{why} (the surface's box is ({low}) to ({high}) m)")


def picker_words(picker: _HasPick) -> str:
    """Return a picker as a text for messages, without defaults and with long values shortened."""
    items = ((f.name, getattr(picker, f.name)) for f in fields(picker))  # type: ignore[arg-type]
    values = ", ".join(
        f"{name} = {_short(value)}"
        for name, value in items
        if name != "pick" and value is not None and value is not False and value != ()
    )
    return f"pick = {picker.pick!r}" + (f" with {values}" if values else "")


def _short(value: object) -> str:
    text = repr(str(value) if isinstance(value, Path) else value)
    return text if len(text) <= 160 else f"{text[:160]}..."  # polygons may have thousands of corners
