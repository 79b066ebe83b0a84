"""`Frame`: a structure as straight beams between nodes, with their sections, supports and loads."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock, locked

Combinations = Mapping[str, Mapping[str, float]]
"""Factors of cases by the names of combinations."""

SHEAR = 5 / 6
"""Share of a rectangle that shear acts on [Timoshenko 1921]."""


def torsion_constant(width: Floats, thickness: Floats) -> Floats:
    """St. Venant's torsion constant of rectangles, m4, to half a per cent [Roark, table 10.1, case 4].

    width, thickness : (b,) metres, either of them the longer one.
    """
    a, t = np.maximum(width, thickness), np.minimum(width, thickness)
    slim = t / a
    return np.asarray(a * t**3 * (1 / 3 - 0.21 * slim * (1 - slim**4 / 12)))


@dataclass(frozen=True, eq=False)
class BeamMaterial:
    """young : Pa.    poisson : 1.    density : kg/m3.    name : as the preset has it, or ''."""

    young: float
    poisson: float
    density: float
    name: str = ""

    @property
    def shear(self) -> float:
        """Shear modulus, Pa."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True, eq=False)
class Frame:
    """Straight beams of rectangular section between nodes. SI units; rows of six are translations, then rotations,
    about the axes of the surface.

             z (normal of the surface)
             |  y (in the surface)        width along y, thickness along z
        o====+==/=====o --> x             Mz bends the beam in the surface, My with it
             | /

    points    : (n, 3) metres.    nodes : (n,) their names: those of the members' nodes, or of a member and a number.
    ends      : (b, 2) the nodes that each beam goes from and to.
    normal    : (b, 3) unit vectors, local z of each beam.
    width     : (b,) metres, along local y.    thickness : (b,) metres, along local z.
    member    : (b,) the member that each beam is a piece of, a number in `members`; -1 for a link, which joins what the
                sheet joins away from the axes: held edges, middles of discs, members that only graze each other.
    members   : their names.
    fixed     : (n, 6) True where a node may not move or turn.    spring : (n, 6) N/m and Nm.
    loads     : by case, (n, 6) newtons and newton metres on the nodes, of tributary areas.
    combinations : by name, the factor of each case.    actions : by case, permanent, snow, wind or variable; empty
                where that is not known.
    eccentricity : (b,) metres by which the middle of the material lies to the left of the beam, along local y. Beams
                are in the middle of the sheet: none along local z.
    stout     : (b,) the width of the member over the length of the bay that the beam is a piece of, 1 where it grazes
                another one at an end of the bay: there both are one wider piece. 0 for links.
    """

    points: Floats
    nodes: tuple[str, ...]
    ends: Ints
    normal: Floats
    width: Floats
    thickness: Floats
    member: Ints
    members: tuple[str, ...]
    fixed: Bools
    spring: Floats
    loads: Mapping[str, Floats]
    material: BeamMaterial
    combinations: Combinations = field(default_factory=dict)
    eccentricity: Floats = field(default_factory=lambda: np.zeros(0))
    stout: Floats = field(default_factory=lambda: np.zeros(0))
    actions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, b = len(self.points), len(self.ends)
        for name in ("eccentricity", "stout"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.zeros(b))
        lock(self, "points", np.float64, (n, 3))
        lock(self, "ends", np.int64, (b, 2))
        lock(self, "member", np.int64, (b,))
        lock(self, "normal", np.float64, (b, 3))
        for name in ("width", "thickness", "eccentricity", "stout"):
            lock(self, name, np.float64, (b,))
        lock(self, "fixed", np.bool_, (n, 6))
        lock(self, "spring", np.float64, (n, 6))
        loads = {name: locked(values, np.float64, (n, 6)) for name, values in self.loads.items()}
        object.__setattr__(self, "loads", MappingProxyType(loads))

    @cached_property
    def length(self) -> Floats:
        """(b,) metres."""
        return np.asarray(np.linalg.norm(self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]], axis=1))

    @cached_property
    def axes(self) -> Floats:
        """(b, 3, 3) local x, y and z of each beam, unit vectors in rows."""
        x = (self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]]) / self.length[:, None]
        y = np.cross(self.normal, x)
        y /= np.linalg.norm(y, axis=1)[:, None]
        return np.stack([x, y, np.cross(x, y)], axis=1)

    @cached_property
    def area(self) -> Floats:
        """(b,) of the sections, m2."""
        return self.width * self.thickness

    @cached_property
    def shear_area(self) -> Floats:
        """(b,) what shear acts on of each section, either way, m2."""
        return SHEAR * self.area

    @cached_property
    def inertia(self) -> Floats:
        """(b, 3) torsion constant, second moments about local y and about local z, m4."""
        w, t = self.width, self.thickness
        return np.stack([torsion_constant(w, t), w * t**3 / 12, t * w**3 / 12], axis=1)

    @cached_property
    def all_loads(self) -> dict[str, Floats]:
        """(n, 6) of each case, then of each combination."""
        sums = {
            name: np.sum([factor * self.loads[case] for case, factor in factors.items()], axis=0)
            for name, factors in self.combinations.items()
        }
        return {**self.loads, **sums}
