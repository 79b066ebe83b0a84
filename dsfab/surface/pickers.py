"""Pickers: which vertices of a surface a support or a load is at.

Each is a table in a preset, told apart by its `pick`: `at = { pick = "side", axis = "z", end = "min" }`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from annotated_types import Ge, Gt, Le, MinLen
from pydantic import AllowInfNan, ConfigDict, StringConstraints

from dsfab.arrays import Bools, Floats, first
from dsfab.errors import SurfaceError
from dsfab.surface.cover import require_two_sides
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import on_boundary

Real = Annotated[float, AllowInfNan(False)]
Vector = tuple[Real, Real, Real]
CaseName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]

TOUCH = 1e-6
"""Share of the surface's size by which a picker reaches further than it says: coordinates are rounded."""

LONGEST = 160
"""Characters of a value that are shown in a message: polygons go on and on."""

STRICT: ConfigDict = {"extra": "forbid"}
"""pydantic: refuse keys that a table does not have."""


class _HasPick(Protocol):
    @property
    def pick(self) -> str: ...


@dataclass(frozen=True)
class All:
    """Every vertex."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pick: Literal["all"] = "all"

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices."""
        return np.ones(surface.n, dtype=bool)


@dataclass(frozen=True)
class Box:
    """The vertices in the box with two opposite corners, metres, its walls included.

    relative : whether the corners are shares of the surface's own box, 0 to 1 along each axis.
    boundary : whether vertices of free edges alone are picked.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    min: Vector
    max: Vector
    relative: bool = False
    boundary: bool = False
    pick: Literal["box"] = "box"

    def corners(self, surface: Surface) -> Floats:
        """(2, 3) the corners, metres."""
        return _placed([self.min, self.max], surface, self.relative)

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices; raises SurfaceError when there are none or min is beyond max."""
        low, high = self.corners(surface)
        if (low > high).any():
            raise SurfaceError(f"{picker_words(self)} has min beyond max; swap them")
        away = np.linalg.norm(surface.V - np.clip(surface.V, low, high), axis=1)
        if self.boundary:
            away[~on_boundary(surface.edges, surface.n)] = np.inf
        return within_reach(self, surface, away, 0.0)


@dataclass(frozen=True)
class Ball:
    """The vertices within `radius` of `center`, metres.

    relative : whether the centre is in shares of the surface's box, 0 to 1 along each axis, and the radius one of its
               diagonal.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    center: Vector
    radius: Annotated[Real, Gt(0)]
    relative: bool = False
    pick: Literal["ball"] = "ball"

    def metres(self, surface: Surface) -> tuple[Floats, float]:
        """The centre (3,) and the radius, metres."""
        scale = surface.size if self.relative else 1.0
        return _placed([self.center], surface, self.relative)[0], self.radius * scale

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices; raises SurfaceError when there are none."""
        center, radius = self.metres(surface)
        return within_reach(self, surface, np.linalg.norm(surface.V - center, axis=1), radius)


@dataclass(frozen=True)
class Side:
    """The vertices within `depth` metres of the surface's lowest or highest x, y or z; at depth 0 those on it.

    relative : whether the depth is a share of the surface's extent along the axis.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    axis: Literal["x", "y", "z"]
    end: Literal["min", "max"]
    depth: Annotated[Real, Ge(0)] = 0.0
    relative: bool = False
    pick: Literal["side"] = "side"

    def reach(self, surface: Surface) -> float:
        """The depth, metres."""
        return self.depth * (float(np.ptp(surface.V[:, "xyz".index(self.axis)])) if self.relative else 1.0)

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices: at least one always."""
        x = surface.V[:, "xyz".index(self.axis)]
        away = x - x.min() if self.end == "min" else x.max() - x
        return within_reach(self, surface, away, self.reach(surface))


@dataclass(frozen=True)
class Nearest:
    """The vertex nearest to each point, metres.

    relative : whether points are in shares of the surface's box, 0 to 1 along each axis.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    points: Annotated[tuple[Vector, ...], MinLen(1)]
    relative: bool = False
    pick: Literal["nearest"] = "nearest"

    def places(self, surface: Surface) -> Floats:
        """(k, 3) the points, metres."""
        return _placed(self.points, surface, self.relative)

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices, the first of those equally near; raises SurfaceError when no point is given."""
        picked = np.zeros(surface.n, dtype=bool)
        for point in self.places(surface):
            picked[np.linalg.norm(surface.V - point, axis=1).argmin()] = True
        return _some(self, surface, picked, "")


@dataclass(frozen=True)
class Boundary:
    """The vertices of all free edges, or of one boundary loop: 0 is the longest in metres, 1 the next."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    loop: Literal["all"] | Annotated[int, Ge(0)] = "all"
    pick: Literal["boundary"] = "boundary"

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices; raises SurfaceError when the surface has no such loop."""
        loops = surface.loops
        if not loops:
            raise SurfaceError(f"{picker_words(self)} picks no vertex: the surface is closed; use another picker")
        if self.loop != "all" and not 0 <= self.loop < len(loops):
            raise SurfaceError(
                f"{picker_words(self)} picks no vertex: the surface has {len(loops)} boundary loops, so use loop = "
                f"0 to {len(loops) - 1} or 'all'"
            )
        picked = np.zeros(surface.n, dtype=bool)
        for loop in loops if self.loop == "all" else [loops[self.loop]]:
            picked[loop] = True
        return picked


@dataclass(frozen=True)
class Facing:
    """The vertices whose normal is within `angle` degrees of `direction`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    direction: Vector
    angle: Annotated[Real, Ge(0), Le(180)] = 30.0
    pick: Literal["facing"] = "facing"

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices; raises SurfaceError when there are none."""
        require_two_sides(surface, np.ones(surface.m, dtype=bool), picker_words(self))
        d, N = unit_vector(self.direction, picker_words(self)), surface.vertex_normals
        degrees = np.degrees(np.arctan2(np.linalg.norm(np.cross(N, d), axis=1), N @ d))
        degrees[~N.any(axis=1)] = np.inf
        picked = degrees <= self.angle + np.degrees(TOUCH)
        return _some(self, surface, picked, f"; the nearest normal is {degrees.min():.3g} degrees away")


@dataclass(frozen=True)
class Vertices:
    """Vertices by their indices, counted from 0."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    indices: Annotated[tuple[Annotated[int, Ge(0)], ...], MinLen(1)]
    pick: Literal["vertices"] = "vertices"

    def vertices(self, surface: Surface) -> Bools:
        """(n,) the picked vertices; raises SurfaceError for an index that the surface does not have."""
        indices = np.array(self.indices, dtype=np.int64)
        bad = indices[(indices < 0) | (indices >= surface.n)]
        if len(bad):
            raise SurfaceError(
                f"pick = 'vertices' names {len(bad)} vertices (first: {first(bad)}) outside 0..{surface.n - 1}, the "
                "vertices of the surface"
            )
        picked = np.zeros(surface.n, dtype=bool)
        picked[indices] = True
        return _some(self, surface, picked, "")


@dataclass(frozen=True)
class VerticesLeft(Vertices):
    """What voids have left of what another picker means: vertices, and the edges between them by their `ends`, the
    smaller first."""

    ends: tuple[tuple[int, int], ...] = ()

    def edges(self, surface: Surface) -> Bools:
        """(e,) the edges."""
        table = surface.edges.ends
        ends = np.array(self.ends, dtype=np.int64).reshape(-1, 2)
        return np.isin(table[:, 0] * surface.n + table[:, 1], ends[:, 0] * surface.n + ends[:, 1])


def unit_vector(direction: Vector, whose: str) -> Floats:
    """(3,) the direction at length 1; raises SurfaceError for the zero vector."""
    d = np.array(direction, dtype=np.float64)
    length = np.linalg.norm(d)
    if not np.isfinite(length) or length == 0:
        raise SurfaceError(f"{whose} needs a direction that is not zero, such as (0, 0, -1)")
    return d / length


def _placed(points: Sequence[Vector], surface: Surface, relative: bool) -> Floats:
    """(k, 3) points in metres, of those that are or of shares of the surface's box."""
    P = np.array(points, dtype=np.float64).reshape(-1, 3)
    low, high = surface.V.min(axis=0), surface.V.max(axis=0)
    return low + P * (high - low) if relative else P


def within_reach(picker: _HasPick, surface: Surface, away: Floats, reach: float) -> Bools:
    """(n,) the vertices that are `away` (n,) at most `reach`, both in metres; raises SurfaceError when there are
    none."""
    picked = away <= reach + TOUCH * surface.size
    return _some(picker, surface, picked, f"; the nearest vertex is {away.min() - reach:.4g} m outside")


def _some(picker: _HasPick, surface: Surface, picked: Bools, why: str) -> Bools:
    if picked.any():
        return picked
    low, high = (", ".join(f"{x:.4g}" for x in f(surface.V, axis=0)) for f in (np.min, np.max))
    raise SurfaceError(f"{picker_words(picker)} picks no vertex{why} (the surface's box is ({low}) to ({high}) m)")


def picker_words(picker: _HasPick) -> str:
    """The picker as its table says it, without what was left out; of long lists the beginning."""
    given = ((f.name, getattr(picker, f.name)) for f in fields(picker))  # type: ignore[arg-type]
    values = ", ".join(
        f"{name} = {_short(value)}"
        for name, value in given
        if name != "pick" and value is not None and value is not False
    )
    return f"pick = {picker.pick!r}" + (f" with {values}" if values else "")


def _short(value: object) -> str:
    """A value as Python writes it; a path as text."""
    text = repr(str(value) if isinstance(value, Path) else value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
