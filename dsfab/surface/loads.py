"""`LoadCase`: what holds the surface and what presses on it, and the loads it is built from."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field

from dsfab.arrays import Bools, Floats, lock
from dsfab.errors import SurfaceError
from dsfab.surface.climate import Snow, Wind, picked_faces, to_corners
from dsfab.surface.cover import require_two_sides
from dsfab.surface.load_parts import AREAS, LoadParts
from dsfab.surface.mesh import Surface
from dsfab.surface.names import Name
from dsfab.surface.picker import Picker
from dsfab.surface.pickers import STRICT, All, CaseName, Real, Vector, unit_vector
from dsfab.surface.supports import Support


@dataclass(frozen=True)
class Force:
    """A force in newtons, the whole of it, spread over the picked vertices in proportion to their areas.

    On a single vertex it is a point force.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    at: Picker
    force: Vector
    kind: Literal["force"] = "force"
    case: CaseName = "load"
    name: Name = ""

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons; they sum to `force`."""
        if not any(self.force):
            raise SurfaceError("a load of kind 'force' is zero; give force = [fx, fy, fz] in newtons")
        share = np.where(self.at.vertices(surface), surface.vertex_areas, 0.0)
        if not share.any():
            raise SurfaceError("a load of kind 'force' is on vertices without faces; pick vertices of the surface")
        return np.asarray((share / share.sum())[:, None] * np.array(self.force))


@dataclass(frozen=True)
class Pressure:
    """A pressure in pascals on the faces whose corners are all picked; positive presses against their normals.

    A constant pressure gives each corner a third of its face's force: the consistent load of linear triangles.

    covered : whether something covers the openings of the structure and carries it to the ribs (see `Snow`).
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    at: Picker = field(default_factory=All)
    kind: Literal["pressure"] = "pressure"
    case: CaseName = "load"
    name: Name = ""
    covered: bool = True

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """(m, 3) Pa on each face."""
        return (-self.pressure * surface.faces_of(self.at.vertices(surface)))[:, None] * surface.normals

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons; they sum to -pressure times the vector area of the faces."""
        if self.pressure == 0:
            raise SurfaceError("a load of kind 'pressure' is zero; give pressure in pascals")
        faces = picked_faces(surface, self.at, "pressure")
        require_two_sides(surface, faces, "a load of kind 'pressure'")
        on_face = (-self.pressure * faces * surface.areas)[:, None] * surface.normals
        return to_corners(surface, on_face)


@dataclass(frozen=True)
class SelfWeight:
    """The weight of the sheet, towards `direction` (any length): of the whole of it while it is uncut and directions
    are sought, and of what is left of it once it is cut."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    direction: Vector = (0.0, 0.0, -1.0)
    kind: Literal["self_weight"] = "self_weight"
    case: CaseName = "load"
    name: Name = ""

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons for a sheet of `weight` newtons per square metre; they sum to weight times area."""
        if not weight > 0:
            raise SurfaceError(
                f"a load of kind 'self_weight' needs a sheet that weighs something (it is {weight:g} N/m2); give the "
                "material a density and a thickness"
            )
        return weight * surface.vertex_areas[:, None] * unit_vector(self.direction, "a load of kind 'self_weight'")

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """(m, 3) Pa on each face of a sheet of `weight` newtons per square metre."""
        along = weight * unit_vector(self.direction, "a load of kind 'self_weight'")
        return np.broadcast_to(along, (surface.m, 3))


@dataclass(frozen=True)
class Cladding:
    """The weight of what covers the surface, glass, a membrane or boards: a permanent load in pascals of the surface's
    own area, on openings too, which it carries to the ribs; towards `direction` (any length).

    It lies on the faces whose corners are all picked.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    direction: Vector = (0.0, 0.0, -1.0)
    at: Picker = field(default_factory=All)
    kind: Literal["cladding"] = "cladding"
    case: CaseName = "load"
    name: Name = ""

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """(m, 3) Pa on each face."""
        if not self.pressure > 0:
            raise SurfaceError(
                f"a load of kind 'cladding' needs a positive pressure in pascals, not {self.pressure:g}; its weight "
                "is its thickness times its density times 9.81: 10 mm of glass are 250 Pa"
            )
        along = self.pressure * unit_vector(self.direction, "a load of kind 'cladding'")
        return picked_faces(surface, self.at, "cladding")[:, None] * along

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons; they sum to pressure times the area of the faces."""
        return to_corners(surface, self.traction(surface) * surface.areas[:, None])


@dataclass(frozen=True)
class Line:
    """A load in newtons per metre along edges: each edge gives half of its share to both of its ends.

    edges : `boundary`, the free edges whose ends are both picked; `all`, every edge whose ends are both picked, for a
            path through the sheet (pick a line of vertices, not a region).
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    at: Picker
    per_metre: Vector
    edges: Literal["boundary", "all"] = "boundary"
    kind: Literal["line"] = "line"
    case: CaseName = "load"
    name: Name = ""

    def on_edges(self, surface: Surface) -> Floats:
        """(e, 3) newtons per metre; times the lengths it sums to `per_metre` times the length of the line."""
        if not any(self.per_metre):
            raise SurfaceError("a load of kind 'line' is zero; give per_metre = [fx, fy, fz] in newtons per metre")
        line: Bools = np.asarray(self.at.vertices(surface)[surface.edges.ends].all(axis=1))
        if self.edges == "boundary":
            line &= surface.edges.boundary
        if not line.any():
            which = "free edge" if self.edges == "boundary" else "edge"
            raise SurfaceError(
                f"a load of kind 'line' is on no {which}: none has both ends picked; pick two neighbours at least"
                + (", or set edges = 'all' for edges within the sheet" if self.edges == "boundary" else "")
            )
        return np.asarray(line[:, None] * np.array(self.per_metre))

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons."""
        ends = surface.edges.ends
        length = np.linalg.norm(surface.V[ends[:, 1]] - surface.V[ends[:, 0]], axis=1)
        force = np.zeros((surface.n, 3))
        np.add.at(force, ends.ravel(), np.repeat(self.on_edges(surface) * length[:, None] / 2, 2, axis=0))
        return force


Load = Annotated[Force | Pressure | SelfWeight | Cladding | Line | Snow | Wind, Field(discriminator="kind")]


def load_parts(surface: Surface, loads: Sequence[Load], weight: float = 0.0) -> LoadParts:
    """Loads by what they act on.

    weight : of the sheet, newtons per square metre, as for `LoadCase.build`. Raises SurfaceError as that does.
    """
    spread: dict[str, Floats] = {on: np.zeros((surface.m, 3)) for on in AREAS}
    point = np.zeros((surface.n, 3))
    for load in loads:
        if isinstance(load, Force | Line):
            point += load.on(surface, weight)
        else:
            covered = isinstance(load, Cladding) or (not isinstance(load, SelfWeight) and load.covered)
            on = "weight" if isinstance(load, SelfWeight) else "covered" if covered else "bare"
            spread[on] = spread[on] + load.traction(surface, weight)
    return LoadParts(point, **spread)


@dataclass(frozen=True, eq=False)
class LoadCase:
    """Supports and loads on the vertices of one surface.

    fixed  : (n, 3) True where a vertex may not move along x, y, z.
    force  : (n, 3) force on each vertex, newtons.
    loaded : (n,) True at the vertices under a concentrated load (a force or a line; not what is spread over faces),
             which the pattern may protect with `keep`.
    spring : (n, 3) stiffness of elastic supports along x, y, z, newtons per metre; none when left out.
    clamped: (e,) edges that may not turn about themselves; empty, as when left out, for none.
    fixed_edges : (e, 3) True where an edge may not move between its ends either; empty, as when left out, where the
             held vertices alone say so (`spanned_edges`).
    parts  : what the forces are made of, by what it acts on; None where all of it acts on the vertices themselves.
    """

    fixed: Bools
    force: Floats
    loaded: Bools
    spring: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    clamped: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    fixed_edges: Bools = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))
    parts: LoadParts | None = None

    def __post_init__(self) -> None:
        lock(self, "fixed", np.bool_, (None, 3))
        lock(self, "force", np.float64, (len(self.fixed), 3))
        lock(self, "loaded", np.bool_, (len(self.fixed),))
        if not len(self.spring):
            object.__setattr__(self, "spring", np.zeros((len(self.fixed), 3)))
        lock(self, "spring", np.float64, (len(self.fixed), 3))
        lock(self, "clamped", np.bool_, (None,))
        lock(self, "fixed_edges", np.bool_, (None, 3))

    @classmethod
    def build(cls, surface: Surface, supports: Sequence[Support], loads: Sequence[Load], weight: float = 0.0) -> Self:
        """The load case of all supports and loads together.

        weight : of the sheet, newtons per square metre (density x thickness x gravity), for self-weight.

        Raises SurfaceError without a support or a load, for pickers that pick nothing, for loads that are zero, and
        when every load is on directions that are held.
        """
        if not supports:
            raise SurfaceError("the surface has no support; add a [[surface.support]] that holds some vertices")
        if not loads:
            raise SurfaceError("the surface has no load; add a [[surface.load]]: a force, a pressure or self_weight")
        fixed = np.logical_or.reduce([support.fixed(surface) for support in supports])
        force = np.sum([load.on(surface, weight) for load in loads], axis=0)
        if not np.isfinite(force).all():
            raise SurfaceError("a load is not a finite number; give newtons or pascals as plain numbers")
        if not force[~fixed].any():
            raise SurfaceError(
                "every load is on held vertices or cancels out, so nothing is left for the surface to carry; load "
                "vertices that are free to move"
            )
        loaded = np.zeros(surface.n, dtype=bool)
        for load in loads:
            if isinstance(load, Force):
                loaded |= load.at.vertices(surface)
            elif isinstance(load, Line):
                loaded[surface.edges.ends[load.on_edges(surface).any(axis=1)]] = True
        spring = np.sum([support.springs(surface) for support in supports], axis=0)
        clamped = np.logical_or.reduce([support.clamped(surface) for support in supports])
        # a free edge from one support to the next is held as its ends are, by elements with a middle too
        between = fixed[surface.edges.ends].all(axis=1) & surface.edges.boundary[:, None]
        between = np.logical_or.reduce([between, *(support.fixed_edges(surface) for support in supports)])
        return cls(fixed, force, loaded, spring, clamped, between, load_parts(surface, loads, weight))

    @property
    def held(self) -> Bools:
        """(n,) vertices with any support, springs among them."""
        return np.asarray((self.fixed | (self.spring > 0)).any(axis=1))

    @property
    def point(self) -> Floats:
        """(n, 3) newtons that act on the vertices themselves, of forces and lines."""
        return self.force if self.parts is None else self.parts.point

    def loading(self, force: Floats, loaded: Bools | None = None) -> Self:
        """The same supports under other forces (n, 3), newtons, on the vertices."""
        return replace(self, force=force, loaded=self.loaded if loaded is None else loaded, parts=None)

    def with_parts(self, surface: Surface, parts: LoadParts) -> Self:
        """The same supports under other loads."""
        return replace(self, force=parts.forces(surface), parts=parts)

    def under(self, surface: Surface, loads: Sequence[Load], weight: float) -> Self:
        """The same supports under these loads; `weight` of the sheet, newtons per square metre."""
        return self.with_parts(surface, load_parts(surface, loads, weight))

    def of_thickness(self, surface: Surface, share: float) -> Self:
        """The same on a sheet that is `share` times as thick: it weighs as much less."""
        if self.parts is None or share == 1:
            return self
        return self.with_parts(surface, self.parts.on_share(weight=share))

    def on_share(self, surface: Surface, share: Floats) -> Self:
        """The same where shares (m,) of the faces are there, which carry themselves and what acts on them alone."""
        if self.parts is None:
            return self
        return self.with_parts(surface, self.parts.on_share(share, share))
