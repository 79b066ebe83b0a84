"""Data for checks of members: bays (parts between nodes), rectangular sections, utilisation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, Ints, lock_floats, read_only_copy
from dsfab.members import MemberGraph
from dsfab.members.frame import STATIONS, MemberForces, torsion_constant


@dataclass(frozen=True, eq=False)
class MemberBays:
    """The b bays (parts between nodes) of all members, each with five stations; lengths in metres.
    member    : (b,) name of the member.    name : (b,) names of the bay's two nodes, "N012 N013".
    s         : (b, 5) arc length along the axis.    width : (b, 5) of the section.    thickness : of all sections.
    length    : (b,) distance between the nodes along the axis.    curvature : (b, 5) normal curvature of the axis, 1/m.
    forces    : by load case, (b, 5, 6): N, Vy, Vz in N; Mt, My, Mz in Nm.

          z, normal      width along y, thickness along z:
          |  y           My bends the member out of the surface (W = width thickness^2 / 6),
        o-+-/----o       Mz bends it within the surface (W = thickness width^2 / 6)"""

    member: tuple[str, ...]
    name: tuple[str, ...]
    s: Floats
    width: Floats
    thickness: float
    length: Floats
    curvature: Floats
    forces: Mapping[str, Floats]

    def __post_init__(self) -> None:
        b = len(self.member)
        lock_floats(self, s=(b, None), width=(b, None), curvature=(b, None), length=(b,))
        forces = {case: read_only_copy(rows, np.float64, (*self.s.shape, 6)) for case, rows in self.forces.items()}
        object.__setattr__(self, "forces", MappingProxyType(forces))

    @classmethod
    def from_forces(cls, graph: MemberGraph, forces: Mapping[str, MemberForces], thickness: float) -> "MemberBays":
        rows = [_member_bays(graph, member_forces) for member_forces in forces.values()]
        names = list(dict.fromkeys(case for member_forces in forces.values() for case in member_forces.forces))
        if not rows:
            none = np.zeros((0, STATIONS))
            return cls((), (), none, none, thickness, np.zeros(0), none, {})
        member = tuple(name for row in rows for name in row[0])
        bay = tuple(name for row in rows for name in row[1])
        length, s, width, curvature = (np.concatenate([row[2][k] for row in rows]) for k in range(4))
        by_case = {
            case: np.concatenate(
                [member_forces.forces[case].reshape(-1, STATIONS, 6) for member_forces in forces.values()]
            )
            for case in names
        }
        return cls(member, bay, s, width, thickness, length, curvature, by_case)

    def with_cases(self, cases: list[str]) -> "MemberBays":
        """Return the bays with the forces of the given load cases only."""
        return replace(self, forces={case: self.forces[case] for case in cases})


def _member_bays(
    graph: MemberGraph, forces: MemberForces
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[Floats, Floats, Floats, Floats]]:
    axis, nodes = graph.by_id[forces.member].curve, graph.nodes_along[forces.member]
    lengths = graph.bays(forces.member).tolist()
    length_by_name = {f"{nodes[k].id} {nodes[(k + 1) % len(nodes)].id}": length for k, length in enumerate(lengths)}
    names = forces.bay[::STATIONS]
    s = forces.s.reshape(-1, STATIONS)
    kn = np.interp(s % axis.length if axis.closed else s, axis.s, axis.kn)
    numbers = np.array([length_by_name[name] for name in names]), s, forces.width.reshape(-1, STATIONS), kn
    return (forces.member,) * len(names), names, numbers


class CodeCheck(NamedTuple):
    """Name of a check, with its clause and formula."""

    name: str
    clause: str

    def __str__(self) -> str:
        return f"{self.name}, {self.clause}"


CheckRatios = dict[CodeCheck, Floats]
"""By check, the forces / resistances: (b, 5) at the stations of b bays, or (b, 1) for whole bays."""


@dataclass(frozen=True, eq=False)
class Utilisation:
    """Utilisation (force / resistance) of b bays (parts of members between nodes) in c checks; 1 is the limit.
    standard  : name of the standard, or the reason for its absence.
    values    : by load case or combination, the largest value (b, c) along each bay.
    station   : by case, the station (b, c) of the largest value, 0 to 4; 0 for a value of the whole bay.
    assumed   : sentences about assumptions.    unchecked : topics without a check.
    combined  : True if cases are combinations with partial factors."""

    bays: MemberBays
    checks: tuple[CodeCheck, ...]
    standard: str
    values: Mapping[str, Floats]
    station: Mapping[str, Ints]
    assumed: tuple[str, ...]
    unchecked: tuple[str, ...]
    combined: bool = True

    def __post_init__(self) -> None:
        shape = (len(self.bays.member), len(self.checks))
        for name, kind in (("values", np.float64), ("station", np.int64)):
            rows = {case: read_only_copy(array, kind, shape) for case, array in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(rows))

    @cached_property
    def cases(self) -> tuple[str, ...]:
        return tuple(self.values)

    @cached_property
    def _all(self) -> Floats:
        return np.stack([self.values[case] for case in self.cases], axis=1)

    @cached_property
    def worst(self) -> Floats:
        """Largest utilisation (b, c) of each bay in each check, over all cases."""
        return np.asarray(self._all.max(axis=1))

    @cached_property
    def largest(self) -> Floats:
        """Largest utilisation (b,) of each bay, over all checks and cases."""
        return np.asarray(self.worst.max(axis=1))

    def governing(self, bay: int) -> tuple[CodeCheck, str, int]:
        """Return the check, case and station (0 to 4) with the largest utilisation of a bay."""
        k, c = np.unravel_index(int(self._all[bay].argmax()), self._all[bay].shape)
        case = self.cases[int(k)]
        return self.checks[int(c)], case, int(self.station[case][bay, int(c)])

    @cached_property
    def order(self) -> Ints:
        """Numbers (b,) of the bays, in the order of falling utilisation."""
        return np.argsort(-self.largest, kind="stable")

    @cached_property
    def by_member(self) -> dict[str, float]:
        """Largest utilisation of each member, by name."""
        by_name: dict[str, float] = {}
        for name, value in zip(self.bays.member, self.largest.tolist(), strict=True):
            by_name[name] = max(by_name.get(name, 0.0), value)
        return by_name

    def worst_bays(self, count: int) -> list[int]:
        """Return the number of the most utilised bay of each of the `count` most utilised members, the worst first."""
        seen: dict[str, int] = {}
        for bay in self.order.tolist():
            seen.setdefault(self.bays.member[bay], bay)
        return list(seen.values())[:count]

    @property
    def summary(self) -> str:
        """Text about the largest utilisation."""
        bay = int(self.order[0])
        check, case, _ = self.governing(bay)
        over = [name for name, value in self.by_member.items() if value > 1]
        under = f" under {case}" if len(self.cases) > 1 else ""
        count = f"{len(over)} of {len(self.by_member)} members are over 100 %" if over else "no member is over 100 %"
        return f"largest utilisation: {self.bays.member[bay]}, {self.largest[bay]:.0%} ({check}){under}; {count}"


@dataclass(frozen=True, eq=False)
class Rectangle:
    """Rectangular sections (b, k), k sections in each of b bays. Width along y, thickness along z, metres."""

    width: Floats
    thickness: Floats

    @cached_property
    def area(self) -> Floats:
        """Areas (b, k), m2."""
        return np.asarray(self.width * self.thickness)

    @cached_property
    def Wy(self) -> Floats:  # noqa: N802 - its name in the field
        """Elastic section modulus for My (b, k), m3."""
        return np.asarray(self.width * self.thickness**2 / 6)

    @cached_property
    def Wz(self) -> Floats:  # noqa: N802
        """Elastic section modulus for Mz (b, k), m3."""
        return np.asarray(self.thickness * self.width**2 / 6)

    @cached_property
    def iy(self) -> Floats:
        """Radii of gyration out of the surface (b, k), metres."""
        return np.asarray(self.thickness / np.sqrt(12))

    @cached_property
    def iz(self) -> Floats:
        """Radii of gyration within the surface (b, k), metres."""
        return np.asarray(self.width / np.sqrt(12))

    @cached_property
    def lying(self) -> Floats:
        """(b, k): 1 for sections that are at least as wide as thick, else 0."""
        return np.asarray((self.width >= self.thickness).astype(np.float64))

    @cached_property
    def weak(self) -> Floats:
        """Second moments of area (b, k) about the weak axis, m4."""
        a, t = np.maximum(self.width, self.thickness), np.minimum(self.width, self.thickness)
        return np.asarray(a * t**3 / 12)

    @cached_property
    def It(self) -> Floats:  # noqa: N802
        """St. Venant's torsion constants (b, k), m4."""
        return torsion_constant(self.width, self.thickness)

    @cached_property
    def Wt(self) -> Floats:  # noqa: N802
        """Torque divided by the largest shear stress (b, k), m3 [Roark, table 10.1, case 4]."""
        a = np.maximum(self.width, self.thickness) / 2
        r = np.minimum(self.width, self.thickness) / 2 / a
        return np.asarray(8 * a**3 * r**2 / (3 * (1 + 0.6095 * r + 0.8865 * r**2 - 1.8023 * r**3 + 0.91 * r**4)))

    def slimmest(self) -> "Rectangle":
        """Return the smallest width and thickness (b, 1) of each bay, without the sections at the bay's ends."""
        inner = slice(1, -1) if self.width.shape[1] > 2 else slice(None)
        narrow = (side[:, inner].min(axis=1, keepdims=True) for side in (self.width, self.thickness))
        return Rectangle(*narrow)

    def torsional(self, length: Floats, young: float, shear: float) -> Floats:
        """Return the critical moment (b, k), Nm, for lateral torsional buckling [Timoshenko, Gere 1961, 6.1].
        length : lengths of the bays, metres.    young, shear : Young's modulus and shear modulus, Pa."""
        return np.asarray(np.pi / length * np.sqrt(young * self.weak * shear * self.It))


def moment_factor(moment: Floats) -> Floats:
    """Return the equivalent uniform moment factor C_m (b, 1) for moments (b, 5) of bays [EN 1993-1-1, table B.3]."""
    ends = moment[:, [0, -1]]
    first_is_larger = np.abs(ends[:, 0]) >= np.abs(ends[:, 1])
    large, small = np.where(first_is_larger, ends[:, 0], ends[:, 1]), np.where(first_is_larger, ends[:, 1], ends[:, 0])
    middle = moment[:, moment.shape[1] // 2]
    tiny = np.finfo(float).tiny
    psi = np.divide(small, large, out=np.zeros_like(large), where=np.abs(large) > tiny)
    span = np.abs(middle) > np.abs(large)
    alpha_s = np.divide(middle, large, out=np.ones_like(large), where=~span & (np.abs(large) > tiny))
    alpha_h = np.divide(large, middle, out=np.zeros_like(large), where=span)
    hogging = np.where(psi < 0, 0.1 * (1 - psi), 0.1) - 0.8 * alpha_s
    by_ends = np.maximum(np.where(alpha_s >= 0, 0.2 + 0.8 * alpha_s, hogging), 0.4)
    by_span = 0.95 + 0.05 * alpha_h * np.where((alpha_h < 0) & (psi < 0), 1 + 2 * psi, 1.0)
    return np.asarray(np.where(span, by_span, by_ends)[:, None])


STRESS = CodeCheck("stress over strength", "not from a standard: stress sqrt(s^2 + 3 t^2) with s = N/A + My/Wy + Mz/Wz")


def plain_checks(bays: MemberBays, forces: Floats, strength: float, bent: Floats) -> CheckRatios:
    """Return the largest von Mises stress at each station / `strength` (Pa).
    forces : (b, 5, 6) as in `MemberBays.forces`.    bent : (b, 5) stress from bending members into shape, Pa."""
    section = Rectangle(bays.width, np.full_like(bays.width, bays.thickness))
    N, Vy, Vz, Mt, My, Mz = np.abs(np.moveaxis(forces, -1, 0))
    axial = N / section.area + My / section.Wy + Mz / section.Wz + bent
    shear = 1.5 * np.hypot(Vy, Vz) / section.area + Mt / section.Wt
    return {STRESS: np.asarray(np.sqrt(axial**2 + 3 * shear**2) / strength)}
