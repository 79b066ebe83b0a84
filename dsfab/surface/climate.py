"""Snow and wind: pressures that depend on how a face is turned."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from pydantic import ConfigDict

from dsfab.arrays import Bools, Floats
from dsfab.errors import SurfaceError
from dsfab.surface.cover import one_sided_pieces, require_two_sides
from dsfab.surface.mesh import Surface
from dsfab.surface.names import Name
from dsfab.surface.picker import Picker
from dsfab.surface.pickers import STRICT, All, CaseName, Real, Vector, unit_vector

EDGE_ON = 1e-12
"""Faces whose normal has a smaller part along a direction are parallel to it."""


@dataclass(frozen=True)
class Snow:
    """A load in pascals per *plan* area, which falls along `direction` (any length): s A |n . d| d on each face.

    At angles where snow slides off, make it smaller or pick less: s is what lies on the ground plan, shape factor and
    all [EN 1991-1-3, 5.2]. Open sheets carry it whichever way their normals point, so pick the upper part of one that
    overhangs; on closed surfaces only the faces that look against `direction` carry.

    covered : whether something covers the openings of the structure and carries it to the ribs; else it lies on these
              alone.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    pressure: Real
    direction: Vector = (0.0, 0.0, -1.0)
    at: Picker = field(default_factory=All)
    kind: Literal["snow"] = "snow"
    case: CaseName = "load"
    name: Name = ""
    covered: bool = True

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """(m, 3) Pa on each face; times the areas it sums to `pressure` times the plan area of the faces."""
        _require_pressure("snow", self.pressure)
        d = unit_vector(self.direction, "a load of kind 'snow'")
        towards = -(outward_normals(surface) @ d)
        two_sided = ~one_sided_pieces(surface.F, surface.edges)
        lying = np.where(two_sided & surface.is_closed, towards, np.abs(towards))
        plan = np.where(picked_faces(surface, self.at, "snow"), lying, 0.0)
        if plan.max() <= EDGE_ON:
            raise SurfaceError("a load of kind 'snow' falls past every picked face; pick faces that it can lie on")
        return np.asarray(self.pressure * np.maximum(plan, 0.0)[:, None] * d)

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons."""
        return to_corners(surface, self.traction(surface) * surface.areas[:, None])


@dataclass(frozen=True)
class Wind:
    """Wind of velocity pressure q, Pa, that blows towards `direction`: a pressure -c q n on each face, with

        c = windward (-n . d)   where the outside meets the wind (pressed in),
        c = -leeward (n . d)    where it is turned away (sucked out).

    The outside is where the normals point; on closed surfaces it is outside whichever way they point. The defaults give
    the walls across the wind their coefficients +0.8 and -0.5 [EN 1991-1-4:2005, table 7.1, zones D and E, h/d = 1]
    and fade with the cosine to the sides. This is a first estimate for choosing a pattern: suction along roofs and side
    walls, and the inside of open halls, are not in it; give those as a `pressure` on picked faces.

    covered : as of snow; an open lattice has other coefficients too, for what blows through it [EN 1991-1-4, 7.11].
    """

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

    def traction(self, surface: Surface, weight: float = 0.0) -> Floats:
        """(m, 3) Pa on each face."""
        _require_pressure("wind", self.pressure)
        picked = picked_faces(surface, self.at, "wind")
        require_two_sides(surface, picked, "a load of kind 'wind'")
        n = outward_normals(surface)
        along = n @ unit_vector(self.direction, "a load of kind 'wind'")
        c = self.windward * np.maximum(-along, 0.0) - self.leeward * np.maximum(along, 0.0)
        c[~picked | (np.abs(along) <= EDGE_ON)] = 0.0
        if not c.any():
            raise SurfaceError(
                "a load of kind 'wind' blows past every picked face or has no coefficients; turn it or pick more faces"
            )
        return np.asarray(-self.pressure * c[:, None] * n)

    def on(self, surface: Surface, weight: float) -> Floats:
        """(n, 3) newtons."""
        return to_corners(surface, self.traction(surface) * surface.areas[:, None])


def outward_normals(surface: Surface) -> Floats:
    """(m, 3) the faces' normals, turned round when they point into a closed surface."""
    return -surface.normals if surface.is_closed and surface.volume < 0 else surface.normals


def picked_faces(surface: Surface, at: Picker, kind: str) -> Bools:
    """(m,) the faces whose corners are all picked; raises SurfaceError when there are none."""
    faces = surface.faces_of(at.vertices(surface))
    if not faces.any():
        raise SurfaceError(
            f"a load of kind '{kind}' is on no face: no triangle has all three corners picked; pick a wider region"
        )
    return faces


def to_corners(surface: Surface, on_face: Floats) -> Floats:
    """(n, 3) a third of each face's force (m, 3) at each of its corners."""
    corners = np.repeat(on_face / 3, 3, axis=0)
    at = surface.F.ravel()
    return np.stack([np.bincount(at, corners[:, i], minlength=surface.n) for i in range(3)], axis=1)


def _require_pressure(kind: str, pressure: float) -> None:
    if not pressure > 0:
        raise SurfaceError(f"a load of kind '{kind}' needs a positive pressure in pascals, not {pressure:g}")
