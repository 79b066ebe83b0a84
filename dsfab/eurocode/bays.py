"""`MemberBays`: members from node to node, with their sections and what they bear."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from dsfab.arrays import Floats, lock, locked
from dsfab.frame import STATIONS, MemberForces
from dsfab.members import MemberGraph


@dataclass(frozen=True, eq=False)
class MemberBays:
    """b bays of members, each with five stations; lengths in metres.

    member, name : (b,) of the member, and "N012 N013" of its nodes.
    s         : (b, 5) along the axis of the member.    width : (b, 5) of the section.    thickness : of all.
    length    : (b,) from node to node, along the axis.
    curvature : (b, 5) of the axis with the surface, 1/m.
    forces    : by case and combination, (b, 5, 6) N, Vy, Vz, N; Mt, My, Mz, Nm, see `dsfab.frame.MemberForces`.

          z, normal      width along y, thickness along z:
          |  y           My bends the member with the surface (W = width thickness^2 / 6),
        o-+-/----o       Mz within it (W = thickness width^2 / 6)
    """

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
        for name in ("s", "width", "curvature"):
            lock(self, name, np.float64, (b, None))
        lock(self, "length", np.float64, (b,))
        forces = {case: locked(rows, np.float64, (*self.s.shape, 6)) for case, rows in self.forces.items()}
        object.__setattr__(self, "forces", MappingProxyType(forces))

    @classmethod
    def of(cls, graph: MemberGraph, forces: Mapping[str, MemberForces], thickness: float) -> "MemberBays":
        """The bays of members whose forces are known; thickness in metres."""
        rows = [_member_bays(graph, one) for one in forces.values()]
        names = list(dict.fromkeys(case for one in forces.values() for case in one.forces))
        if not rows:
            none = np.zeros((0, STATIONS))
            return cls((), (), none, none, thickness, np.zeros(0), none, {})
        member = tuple(name for row in rows for name in row[0])
        bay = tuple(name for row in rows for name in row[1])
        length, s, width, curvature = (np.concatenate([row[2][k] for row in rows]) for k in range(4))
        by_case = {
            case: np.concatenate([one.forces[case].reshape(-1, STATIONS, 6) for one in forces.values()])
            for case in names
        }
        return cls(member, bay, s, width, thickness, length, curvature, by_case)

    def some(self, cases: list[str]) -> "MemberBays":
        """The same with the forces of some cases only."""
        return replace(self, forces={case: self.forces[case] for case in cases})


def _member_bays(
    graph: MemberGraph, one: MemberForces
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[Floats, Floats, Floats, Floats]]:
    """Of one member: its name and those of its b bays; their lengths (b,), and s, width and curvature (b, 5) each."""
    axis, nodes = graph.by_id[one.member].axis, graph.along[one.member]
    assert axis is not None
    lengths = graph.bays(one.member).tolist()
    known = {f"{nodes[k].id} {nodes[(k + 1) % len(nodes)].id}": length for k, length in enumerate(lengths)}
    names = one.bay[::STATIONS]
    s = one.s.reshape(-1, STATIONS)
    kn = np.interp(s % axis.length if axis.closed else s, axis.s, axis.kn)
    numbers = np.array([known[name] for name in names]), s, one.width.reshape(-1, STATIONS), kn
    return (one.member,) * len(names), names, numbers
