"""`member_forces`: what each member bears along its axis, summed up from the section forces of the sheet.

On a line across the member, of length l, with m and q of its face and n, which varies along it, v the unit vector
across the line in the face, z the normal of the face and r the arm from the axis:

    F = sum l (n v - (q . v) z) + edges,        M = sum l (r x (n v - (q . v) z) + (m v) x z) + edges.

Where the line ends on a free edge, a force m_vs z acts there besides (Kirchhoff 1850), s along the line and outward, m
at that point: in pure torsion it is half of the torque.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from dsfab.arrays import Floats, group_sums, lock, locked
from dsfab.frame.joints import fitting
from dsfab.frame.sections import PLANES, Sections, sections
from dsfab.members import Member, MemberGraph, Node
from dsfab.statics import SectionForces

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where the forces of a bay are told: shares of its clear length, between the joints at its ends."""
STATIONS = len(SHARES)
"""Of each bay."""
COMPONENTS = ("N", "Vy", "Vz", "Mt", "My", "Mz")
"""x along the axis, z along the normal of the surface, y to the left; on a section that x points out of."""


@dataclass(frozen=True, eq=False)
class MemberForces:
    """What a member bears at stations of its axis.

    member : its name.    s : (k,) metres along its axis.    bay : (k,) from which node to which, "N012 N013".
    width  : (k,) metres, of the section that was summed up.
    forces : by case and combination, (k, 6) N, Vy, Vz in newtons and Mt, My, Mz in newton metres, see `COMPONENTS`.
             N is positive for tension. My stretches the side that the normal points to, if positive; Mz the right
             side; Mt turns about the axis.
    """

    member: str
    s: Floats
    bay: tuple[str, ...]
    width: Floats
    forces: Mapping[str, Floats]

    def __post_init__(self) -> None:
        for name in ("s", "width"):
            lock(self, name, np.float64, (len(self.bay),))
        forces = {name: locked(rows, np.float64, (len(self.s), 6)) for name, rows in self.forces.items()}
        object.__setattr__(self, "forces", MappingProxyType(forces))

    @property
    def envelope(self) -> Floats:
        """(k, 6, 2) the least and the greatest of all cases and combinations."""
        every = np.stack(list(self.forces.values()))
        return np.stack([every.min(axis=0), every.max(axis=0)], axis=-1)


def member_forces(graph: MemberGraph, forces: Mapping[str, SectionForces]) -> dict[str, MemberForces]:
    """By the names of members that have an axis and a bay, what they bear, of section forces of the design's sheet."""
    found = {}
    for member in graph.members:
        s, bays = _stations(graph, member)
        if len(s):
            found[member.id] = forces_along(graph, member, s, bays, forces)
    return found


def forces_along(
    graph: MemberGraph, member: Member, s: Floats, bays: tuple[str, ...], forces: Mapping[str, SectionForces]
) -> MemberForces:
    """What a member bears at arc lengths (k,) of its axis, metres, in bays (k,)."""
    assert member.axis is not None
    surface, axis = graph.sheet.surface, member.axis
    cut = sections(surface, member.cells, axis, s)
    _, T, N = axis.at(s % axis.length if axis.closed else s)
    axes = np.stack([T, np.cross(N, T), N], axis=1)
    return MemberForces(
        member.id,
        s,
        bays,
        group_sums(cut.station, cut.length[:, None], len(s))[:, 0],
        {name: _summed(cut, axes, one, graph, surface.normals) for name, one in forces.items()},
    )


def _summed(cut: Sections, axes: Floats, given: SectionForces, graph: MemberGraph, normals: Floats) -> Floats:
    """(k, 6) the components of F and M along local axes (k, 3, 3)."""
    source, z = graph.source[cut.face], normals[cut.face]
    frame = given.frame[source]
    v = np.einsum("cai,ci->ca", frame, cut.across)
    n = np.einsum("cek,cka->cea", cut.weight, given.corners[source])
    ends = [np.einsum("ca,cai->ci", _times(n[:, k], v), frame) for k in (0, 1)]
    m = np.einsum("ca,cai->ci", _times(given.m[source], v), frame)
    p = np.stack(ends, axis=1) - (np.einsum("ca,ca->c", given.q[source], v)[:, None] * z)[:, None]
    F = group_sums(cut.station, cut.length[:, None] * p.mean(axis=1), len(axes))
    moment = np.cross(cut.arm, (2 * p + p[:, ::-1]) / 6).sum(axis=1) + np.cross(m, z)  # of what varies linearly
    M = group_sums(cut.station, cut.length[:, None] * moment, len(axes))
    f = _edge_forces(cut, given, graph, normals)
    F = F + group_sums(cut.end_station, f, len(axes))
    M = M + group_sums(cut.end_station, np.cross(cut.end_arm, f), len(axes))
    return np.concatenate([np.einsum("kai,ki->ka", axes, F), np.einsum("kai,ki->ka", axes, M)], axis=1)


def _edge_forces(cut: Sections, given: SectionForces, graph: MemberGraph, normals: Floats) -> Floats:
    """(e, 3) newtons at ends of lines on free edges, the mean over the planes of a station."""
    source = graph.source[cut.end_face]
    frame = given.frame[source]
    v, s = (np.einsum("cai,ci->ca", frame, x) for x in (cut.end_across, cut.end_out))
    m = np.einsum("ck,cka->ca", cut.end_weight, given.corner_moments[source])
    twist = np.einsum("ca,ca->c", s, _times(m, v))
    return np.asarray(twist[:, None] * normals[cut.end_face] / PLANES)


def _times(tensor: Floats, v: Floats) -> Floats:
    """(c, 2) of symmetric tensors x, y, xy (c, 3) and vectors (c, 2)."""
    x, y, xy = tensor.T
    return np.stack([x * v[:, 0] + xy * v[:, 1], xy * v[:, 0] + y * v[:, 1]], axis=1)


def _stations(graph: MemberGraph, member: Member) -> tuple[Floats, tuple[str, ...]]:
    """Arc lengths along a member where its forces are told, and the bays that they are in."""
    nodes = graph.along[member.id]
    if member.axis is None or len(nodes) < 2:
        return np.zeros(0), ()
    bays = graph.bays(member.id)
    s, names = [], list[str]()
    for k, length in enumerate(bays.tolist()):
        one, other = nodes[k], nodes[(k + 1) % len(nodes)]
        begin = one.at[one.members.index(member.id)]
        half = np.array([_half(graph, member, node) for node in (one, other)]) + graph.sheet.surface.mean_edge / 2
        half = fitting(half, length)
        if length > member.mean_width:
            s.append(begin + half[0] + np.array(SHARES) * (length - half.sum()))
            names += [f"{one.id} {other.id}"] * len(SHARES)
    return np.concatenate(s) if s else np.zeros(0), tuple(names)


def _half(graph: MemberGraph, member: Member, node: Node) -> float:
    """Half of the width of the other member at a node, along this one; metres."""
    other = graph.by_id[node.members[1 - node.members.index(member.id)]]
    slant = np.sin(np.radians(node.angle)) if node.angle == node.angle else 1.0
    return float(other.mean_width / 2 / max(slant, 0.3))
