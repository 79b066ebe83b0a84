"""`LoadCase` and its loads: self-weight, forces, pressures, line loads, cladding, snow and wind."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from annotated_types import Ge
from pydantic import ConfigDict, Field

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.outlines import Picker
from dsfab.surface.loads.pickers import STRICT, All, CaseName, Real, Vector, unit_vector
from dsfab.surface.loads.roof_shapes import (
    INNER_ZONE,
    ROOF_RISE,
    CanopyCoefficients,
    RoofProfile,
    drifted_on_arch,
    flat_roof_pressure,
    half_cleared,
    snow_shape_factor,
    vault_pressure,
)
from dsfab.surface.loads.supports import Name, Support
from dsfab.surface.mesh import Surface, signed_volumes
from dsfab.surface.orientation import one_sided_pieces, require_two_sides

EDGE_ON = 1e-12  # A face with the normal n is parallel to a unit direction d if |n . d| is at most this.


@dataclass(frozen=True)
class Snow:
    """A snow load, or another load per *plan* area: a force s A |n . d| d on a face of area A and unit normal n.
    s is `pressure` (Pa) with its shape factor, and d the unit vector of `direction` [EN 1991-1-3, 5.2]. An open sheet
    carries snow on all picked faces, also under overhangs; a closed surface only on upper faces.
    shape   : "mu1", "half" or "drifted" to multiply `pressure` (s_k on the ground) by `snow_shape_factor`,
              `half_cleared` or `drifted_on_arch`; "" if `pressure` includes the factor.
    drift   : horizontal direction in which the wind carries the snow, for "half" and "drifted".
    kind    : "snow"; or "imposed" for people and services [EN 1991-1-1, 6.3].
    covered : true if a covering closes the openings, so that members also carry the snow on the covering."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    direction: Vector = (0.0, 0.0, -1.0)
    at: Picker = field(default_factory=All)
    kind: Literal["snow", "imposed"] = "snow"
    case: CaseName = "load"
    name: Name = ""
    covered: bool = True
    shape: Literal["", "mu1", "half", "drifted"] = ""
    drift: Vector = (1.0, 0.0, 0.0)

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """Return the traction (m, 3) of the snow, Pa: force per area of each face. `weight` is not used."""
        _require_pressure(self.kind, self.pressure)
        if self.shape and self.kind != "snow":
            raise SurfaceError(f"a load of kind '{self.kind}' has no shape; remove the key, or use kind 'snow'")
        if self.drift != Snow.drift and self.shape not in ("half", "drifted"):
            raise SurfaceError("a load of kind 'snow' uses drift only with shape 'half' or 'drifted'; remove drift")
        d, normals = unit_vector(self.direction, f"a load of kind '{self.kind}'"), outward_normals(surface)
        towards = -(normals @ d)
        two_sided = ~one_sided_pieces(surface.F, surface.edges)
        lying = np.where(two_sided & surface.is_closed, towards, np.abs(towards))
        picked = picked_faces(surface, self.at, self.kind)
        plan = np.where(picked, lying, 0.0)
        if self.shape:
            slope = np.degrees(np.arccos(np.clip(np.abs(towards), 0.0, 1.0)))
            plan = plan * self._shape_factor(surface, picked, normals, slope)
        if plan.max() <= EDGE_ON:
            raise SurfaceError(
                f"a load of kind '{self.kind}' misses every picked face; pick faces that are not vertical"
                + (" or steeper than 60 degrees" if self.shape else "")
            )
        return np.asarray(self.pressure * np.maximum(plan, 0.0)[:, None] * d)

    def _shape_factor(self, surface: Surface, picked: Bools, normals: Floats, slope: Floats) -> Floats:
        if self.shape == "mu1":
            return snow_shape_factor(slope)
        require_two_sides(surface, picked, f"a load of kind 'snow' with shape '{self.shape}'")
        factor = half_cleared if self.shape == "half" else drifted_on_arch
        profiles = RoofProfile.of_roofs(surface, picked, normals, self.drift, self.kind)
        return np.asarray(np.sum([factor(profile, slope) for profile in profiles], axis=0))

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3) of the snow at the vertices, newtons; `weight` is not used."""
        return forces_at_corners(surface, self.traction(surface) * surface.areas[:, None])


WindShape = Literal[
    "", "vault", "vault up", "flat down", "flat up", "canopy down", "canopy up", "canopy down half", "canopy up half"
]


@dataclass(frozen=True)
class Wind:
    """Wind of velocity pressure q, Pa, along the unit vector d of `direction`: a pressure -c q n on each face, with

        c = windward (-n . d)   if the outside faces the wind (pressure),
        c = -leeward (n . d)    if the outside faces away (suction).

    Normals n point to the outside, see `outward_normals`. By default, walls across the wind have the coefficients +0.8
    and -0.5 [EN 1991-1-4:2005, table 7.1, zones D and E, h/d = 1].

    This first estimate lacks suction along roofs and side walls, and pressure in open halls; add `pressure` loads.
    For roofs use a shape; then `windward` and `leeward` are for the other faces, such as walls:

    shape   : "vault" for a curved roof on walls or on the ground, see `vault_pressure`, and "vault up" for its second
              value; "flat down" or "flat up" for a flat roof on walls, see `flat_roof_pressure`; "canopy down" or
              "canopy up" for an open roof: its largest or smallest force coefficient on all faces, and with " half" on
              the half towards the wind, see `CanopyCoefficients`.
    eaves   : for vaults and flat roofs, height of the eaves above the ground, metres.
    covered : see `Snow`; an open lattice also has different coefficients [EN 1991-1-4, 7.11]."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    direction: Vector
    windward: Real = 0.8
    leeward: Real = 0.5
    at: Picker = field(default_factory=All)
    kind: Literal["wind"] = "wind"
    case: CaseName = "load"
    name: Name = ""
    covered: bool = True
    shape: WindShape = ""
    eaves: Annotated[Real, Ge(0)] = 0.0

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """Return the traction (m, 3) on each face, Pa."""
        _require_pressure("wind", self.pressure)
        self._require_agreeing_keys()
        picked = picked_faces(surface, self.at, "wind")
        require_two_sides(surface, picked, "a load of kind 'wind'")
        n = outward_normals(surface)
        along = n @ unit_vector(self.direction, "a load of kind 'wind'")
        c = np.where(picked, self._on_roofs(surface, picked, n, along) if self.shape else self._on_faces(along), 0.0)
        if not c.any():
            raise SurfaceError(
                "a load of kind 'wind' is parallel to every picked face or has no coefficients; change its direction, "
                "or pick more faces"
            )
        return np.asarray(-self.pressure * c[:, None] * n)

    def _require_agreeing_keys(self) -> None:
        if self.eaves and not self.shape.startswith(("vault", "flat")):
            kind = f"with shape '{self.shape}'" if self.shape else "without a shape"
            raise SurfaceError(f"a load of kind 'wind' {kind} does not use eaves; remove the key")

    def _on_faces(self, along: Floats) -> Floats:
        """Return the coefficients (m,) of walls. along : (m,) n . d of each face."""
        c = self.windward * np.maximum(-along, 0.0) - self.leeward * np.maximum(along, 0.0)
        return np.where(np.abs(along) <= EDGE_ON, 0.0, c)

    def _on_roofs(self, surface: Surface, picked: Bools, normals: Floats, along: Floats) -> Floats:
        c = self._on_faces(along)
        for profile in RoofProfile.of_roofs(surface, picked, normals, self.direction, "wind"):
            if self.shape.startswith("vault"):
                on_roof = vault_pressure(profile, self.eaves, suction=self.shape == "vault up")
            elif self.shape in INNER_ZONE:
                on_roof = flat_roof_pressure(profile, self.eaves, INNER_ZONE[self.shape])
            else:
                canopy = CanopyCoefficients.of_roof(RoofProfile.all_around(surface, profile.roof, normals))
                on_half = self.shape.endswith("half")
                down, up = canopy.half if on_half else canopy.full
                loaded = profile.front | (not on_half)
                on_roof = np.where(loaded, down if self.shape.startswith("canopy down") else up, 0.0)
            c[profile.roof] = on_roof[profile.roof]
        return c

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3), newtons."""
        return forces_at_corners(surface, self.traction(surface) * surface.areas[:, None])


def outward_normals(surface: Surface) -> Floats:
    """Return the normals (m, 3) of the faces to the outside: out of closed pieces, and to the upper side of roofs.
    Other open pieces, such as walls, keep the normals of the surface."""
    rise, is_closed, piece = _pieces_in_space(surface)
    volume = signed_volumes(surface.V, surface.F, piece, len(rise))
    inward = (volume.sum() if surface.is_closed else volume) < 0  # voids have negative volumes
    turned = np.where(is_closed, inward, rise < -ROOF_RISE)
    return np.where(turned[piece][:, None], -surface.normals, surface.normals)


def faces_without_upper_side(surface: Surface) -> Bools:
    """Mark the faces (m,) of open pieces with a mean slope of 60 degrees or more, such as walls."""
    rise, is_closed, piece = _pieces_in_space(surface)
    return np.asarray((~is_closed & (np.abs(rise) <= ROOF_RISE))[piece])


def _pieces_in_space(surface: Surface) -> tuple[Floats, Bools, Ints]:
    """Return the mean vertical part of each piece's normals, a mask of closed pieces, and the piece of each face."""
    count, piece = surface.pieces
    rise = np.bincount(piece, surface.normals[:, 2] * surface.areas) / np.bincount(piece, surface.areas)
    is_open = np.bincount(piece, surface.edges.boundary[surface.edges.of].any(axis=1), count) > 0
    return rise, ~is_open, piece


def picked_faces(surface: Surface, picker: Picker, kind: str) -> Bools:
    """Mark the faces (m,) whose three corners are picked; raises SurfaceError if there is no such face."""
    faces = surface.faces_of(picker.vertices(surface))
    if not faces.any():
        raise SurfaceError(
            f"a load of kind '{kind}' is on no face: no triangle has all three corners picked; pick a wider region"
        )
    return faces


def forces_at_corners(surface: Surface, on_face: Floats) -> Floats:
    """Return the forces (n, 3) at the vertices: each corner takes a third of its face's force (m, 3)."""
    corners = np.repeat(on_face / 3, 3, axis=0)
    corner = surface.F.ravel()
    return np.stack([np.bincount(corner, corners[:, i], minlength=surface.n) for i in range(3)], axis=1)


def _require_pressure(kind: str, pressure: float) -> None:
    if not pressure > 0:
        raise SurfaceError(f"a load of kind '{kind}' needs a positive pressure in pascals, not {pressure:g}")


SPREAD_PARTS = ("weight", "bare", "covered")  # Load parts that act on faces.


@dataclass(frozen=True, eq=False)
class LoadParts:
    """Loads of a load case by origin: forces at the vertices of a surface, and tractions on its faces.
    point   : (n, 3) loads of kind force and line, newtons.
    weight  : (m, 3) weight of the sheet itself, in proportion to its material, Pa.
    bare    : (m, 3) loads that act on material alone, such as snow on an open lattice, Pa.
    covered : (m, 3) loads that also act on openings with a covering, such as glass, Pa."""

    point: Floats
    weight: Floats
    bare: Floats
    covered: Floats

    def __post_init__(self) -> None:
        lock(self, "point", np.float64, (None, 3))
        lock(self, "weight", np.float64, (None, 3))
        for name in SPREAD_PARTS[1:]:
            lock(self, name, np.float64, (len(self.weight), 3))

    @classmethod
    def total(cls, parts: Mapping[str, Self], factors: Mapping[str, float]) -> Self:
        """Return the sum of the parts of several cases, each multiplied by its factor."""
        weight = {name: factors.get(name, 0.0) for name in parts}
        names = ("point", *SPREAD_PARTS)
        return cls(*(np.sum([f * getattr(parts[k], part) for k, f in weight.items()], axis=0) for part in names))

    @property
    def traction(self) -> Floats:
        """Traction (m, 3) of all loads on faces, Pa."""
        return np.asarray(self.weight + self.bare + self.covered)

    def forces(self, surface: Surface) -> Floats:
        """Return the forces (n, 3), newtons: `point`, and a third of each face's force at each of its corners."""
        traction = self.traction
        return (
            self.point + forces_at_corners(surface, traction * surface.areas[:, None]) if traction.any() else self.point
        )

    def on_share(self, weight: float | Floats = 1.0, bare: float | Floats = 1.0) -> Self:
        """Return the loads with `weight` and `bare` multiplied by factors: one number, or one for each face (m,)."""
        shares = (np.asarray(share, dtype=np.float64).reshape(-1, 1) for share in (weight, bare))
        scaled = {part: getattr(self, part) * share for part, share in zip(SPREAD_PARTS, shares, strict=False)}
        return replace(self, **scaled)


@dataclass(frozen=True)
class Force:
    """A total force in newtons, spread over the picked vertices by their areas; a point force on a single vertex."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    at: Picker
    force: Vector
    kind: Literal["force"] = "force"
    case: CaseName = "load"
    name: Name = ""

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3) at the vertices, newtons; the sum is `force`."""
        if not any(self.force):
            raise SurfaceError("a load of kind 'force' is zero; give force = [fx, fy, fz] in newtons")
        share = np.where(self.at.vertices(surface), surface.vertex_areas, 0.0)
        if not share.any():
            raise SurfaceError("a load of kind 'force' is on vertices without faces; pick vertices of the surface")
        return np.asarray((share / share.sum())[:, None] * np.array(self.force))


@dataclass(frozen=True)
class Pressure:
    """A pressure in pascals on the faces whose corners are all picked; a positive pressure acts against their normals.
    covered : true if a covering carries the pressure over openings to the members (see `Snow`)."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    at: Picker = field(default_factory=All)
    kind: Literal["pressure"] = "pressure"
    case: CaseName = "load"
    name: Name = ""
    covered: bool = True

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """Return the traction (m, 3) on each face, Pa."""
        return (-self.pressure * surface.faces_of(self.at.vertices(surface)))[:, None] * surface.normals

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3) at the vertices, newtons; the sum is -`pressure` times the faces' vector area."""
        if self.pressure == 0:
            raise SurfaceError("a load of kind 'pressure' is zero; give pressure in pascals")
        faces = picked_faces(surface, self.at, "pressure")
        require_two_sides(surface, faces, "a load of kind 'pressure'")
        return forces_at_corners(surface, (-self.pressure * faces * surface.areas)[:, None] * surface.normals)


@dataclass(frozen=True)
class SelfWeight:
    """The weight of the uncut sheet, and later of the cut sheet, towards `direction` (any length)."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    direction: Vector = (0.0, 0.0, -1.0)
    kind: Literal["self_weight"] = "self_weight"
    case: CaseName = "load"
    name: Name = ""

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3) at the vertices, newtons. weight : weight of the sheet, N/m2."""
        if not weight > 0:
            raise SurfaceError(
                f"a load of kind 'self_weight' needs a sheet with weight, not {weight:g} N/m2; give the "
                "material a density and a thickness"
            )
        return weight * surface.vertex_areas[:, None] * unit_vector(self.direction, "a load of kind 'self_weight'")

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """Return the traction (m, 3) on each face of a sheet of `weight` newtons per square metre, Pa."""
        return np.broadcast_to(weight * unit_vector(self.direction, "a load of kind 'self_weight'"), (surface.m, 3))


@dataclass(frozen=True)
class Cladding:
    """The weight of a covering (glass, membrane, boards): a permanent load in newtons per square metre of the surface.
    The weight acts along `direction` (any length) on faces whose corners are all picked, and also on openings."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    direction: Vector = (0.0, 0.0, -1.0)
    at: Picker = field(default_factory=All)
    kind: Literal["cladding"] = "cladding"
    case: CaseName = "load"
    name: Name = ""

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """Return the traction (m, 3) of the covering on each face, Pa; `weight` is not used."""
        if not self.pressure > 0:
            raise SurfaceError(
                f"a load of kind 'cladding' needs a positive pressure in pascals, not {self.pressure:g}; give "
                "thickness x density x 9.81, such as 250 for 10 mm of glass"
            )
        along = self.pressure * unit_vector(self.direction, "a load of kind 'cladding'")
        return picked_faces(surface, self.at, "cladding")[:, None] * along

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3) at the vertices, newtons; the sum is `pressure` times the area of the faces."""
        return forces_at_corners(surface, self.traction(surface) * surface.areas[:, None])


@dataclass(frozen=True)
class Line:
    """A load in newtons per metre along edges: each edge gives half of its load to each of its ends.
    edges : `boundary`, free edges with both ends picked; or `all`, every edge with both ends picked. For a path
            through the sheet use `all`, and pick a line of vertices, not a region."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    at: Picker
    per_metre: Vector
    edges: Literal["boundary", "all"] = "boundary"
    kind: Literal["line"] = "line"
    case: CaseName = "load"
    name: Name = ""

    def on_edges(self, surface: Surface) -> Floats:
        """Return the load (e, 3), N/m. Its integral along the edges is `per_metre` times the line's length."""
        if not any(self.per_metre):
            raise SurfaceError("a load of kind 'line' is zero; give per_metre = [fx, fy, fz] in newtons per metre")
        line: Bools = np.asarray(self.at.vertices(surface)[surface.edges.ends].all(axis=1))
        if self.edges == "boundary":
            line &= surface.edges.boundary
        if not line.any():
            which = "free edge" if self.edges == "boundary" else "edge"
            raise SurfaceError(
                f"a load of kind 'line' is on no {which}; pick both ends of at least one {which}: two neighbours"
                + (", or set edges = 'all' for edges within the sheet" if self.edges == "boundary" else "")
            )
        return np.asarray(line[:, None] * np.array(self.per_metre))

    def forces(self, surface: Surface, weight: float) -> Floats:
        """Return the forces (n, 3), newtons."""
        ends = surface.edges.ends
        length = np.linalg.norm(surface.V[ends[:, 1]] - surface.V[ends[:, 0]], axis=1)
        force = np.zeros((surface.n, 3))
        np.add.at(force, ends.ravel(), np.repeat(self.on_edges(surface) * length[:, None] / 2, 2, axis=0))
        return force


Load = Annotated[Force | Pressure | SelfWeight | Cladding | Line | Snow | Wind, Field(discriminator="kind")]


def load_parts(surface: Surface, loads: Sequence[Load], weight: float = 0.0) -> LoadParts:
    """Return the loads as `LoadParts`: forces at vertices, and the loads `weight`, `bare` and `covered` on faces.
    weight : weight of the sheet, N/m2. Raises SurfaceError as `LoadCase.build` does."""
    spread: dict[str, Floats] = {part: np.zeros((surface.m, 3)) for part in SPREAD_PARTS}
    point = np.zeros((surface.n, 3))
    for load in loads:
        if isinstance(load, Force | Line):
            point += load.forces(surface, weight)
        else:
            covered = isinstance(load, Cladding) or (not isinstance(load, SelfWeight) and load.covered)
            part = "weight" if isinstance(load, SelfWeight) else "covered" if covered else "bare"
            spread[part] = spread[part] + load.traction(surface, weight)
    return LoadParts(point, **spread)


@dataclass(frozen=True, eq=False)
class LoadCase:
    """Supports and loads on the vertices of one surface.
    fixed       : (n, 3) True if a vertex may not move along x, y, z.
    force       : (n, 3) force on each vertex, newtons.
    loaded      : (n,) True at the vertices under a load of kind force or line.
    spring      : (n, 3) stiffness of elastic supports along x, y, z, newtons per metre; by default none.
    clamped     : (e,) edges that may not rotate about themselves; by default none, (0,).
    fixed_edges : (e, 3) True if points inside an edge may not move along x, y, z; (0, 3) if not specified.
    parts       : the loads by origin; None if all forces act on the vertices themselves."""

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
        """Return the load case with all supports and loads. weight : weight of the sheet, N/m2, for self-weight.
        Raises SurfaceError
        - without a support or a load, and for pickers without vertices;
        - for loads that are zero, and for loads that act only in fixed directions."""
        if not supports:
            raise SurfaceError("the surface has no support; add a [[surface.support]] that holds some vertices")
        if not loads:
            raise SurfaceError("the surface has no load; add a [[surface.load]]: a force, a pressure or self_weight")
        fixed = np.logical_or.reduce([support.fixed_directions(surface) for support in supports])
        force = np.sum([load.forces(surface, weight) for load in loads], axis=0)
        if not np.isfinite(force).all():
            raise SurfaceError("a load is not a finite number; give newtons or pascals as plain numbers")
        if not force[~fixed].any():
            raise SurfaceError(
                "all loads act on fixed vertices or cancel each other, so the surface carries nothing; put loads on "
                "vertices that are free to move"
            )
        loaded = np.zeros(surface.n, dtype=bool)
        for load in loads:
            if isinstance(load, Force):
                loaded |= load.at.vertices(surface)
            elif isinstance(load, Line):
                loaded[surface.edges.ends[load.on_edges(surface).any(axis=1)]] = True
        spring = np.sum([support.springs(surface) for support in supports], axis=0)
        clamped = np.logical_or.reduce([support.clamped_edges(surface) for support in supports])
        # if both ends of a border edge are fixed, fix its middle, where elements may have a node
        between = fixed[surface.edges.ends].all(axis=1) & surface.edges.boundary[:, None]
        between = np.logical_or.reduce([between, *(support.fixed_edges(surface) for support in supports)])
        return cls(fixed, force, loaded, spring, clamped, between, load_parts(surface, loads, weight))

    @property
    def supported(self) -> Bools:
        """Vertices (n,) with any support, springs included."""
        return np.asarray((self.fixed | (self.spring > 0)).any(axis=1))

    @property
    def point(self) -> Floats:
        """Forces (n, 3) of the loads of kind force and line, which act on the vertices themselves, newtons."""
        return self.force if self.parts is None else self.parts.point

    def with_forces(self, force: Floats, loaded: Bools | None = None) -> Self:
        """Return the same supports with forces (n, 3), newtons, on the vertices. loaded : None keeps the old mask."""
        return replace(self, force=force, loaded=self.loaded if loaded is None else loaded, parts=None)

    def with_parts(self, surface: Surface, parts: LoadParts) -> Self:
        """Return the same supports with the loads `parts` in place of the old loads."""
        return replace(self, force=parts.forces(surface), parts=parts)

    def with_loads(self, surface: Surface, loads: Sequence[Load], weight: float) -> Self:
        """Return the same supports with other loads; `weight` of the sheet, newtons per square metre."""
        return self.with_parts(surface, load_parts(surface, loads, weight))

    def of_thickness(self, surface: Surface, share: float) -> Self:
        """Return the load case of a sheet with `share` times the thickness; its self-weight changes, too."""
        if self.parts is None or share == 1:
            return self
        return self.with_parts(surface, self.parts.on_share(weight=share))

    def on_share(self, surface: Surface, share: Floats) -> Self:
        """Return the load case of a sheet that keeps a fraction (m,) of each face; loads `weight` and `bare` shrink."""
        if self.parts is None:
            return self
        return self.with_parts(surface, self.parts.on_share(share, share))
