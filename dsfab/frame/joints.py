"""Where the axes of members are joined: at their nodes, and where members graze. What their ends run into: `ends`."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import Member, MemberGraph

SAME = 0.25
"""Axes that are nearer to each other than this share of the narrower width are joined in one node, others by a link."""
CLEAR = 0.2
"""At least this share of a bay is no joint."""


def fitting(halves: Floats, length: float) -> Floats:
    """(2,) how far the joints at both ends of a bay reach into it, metres: less than asked where that is nearly all."""
    return halves * min(1.0, (1 - CLEAR) * length / max(float(halves.sum()), 1e-30))


@dataclass(eq=False)
class AxisJoints:
    """Nodes on the axes of members, as they are found.

    points, names : of the nodes.    on : by member, the arc lengths of nodes along its axis with their numbers.
    links  : pairs of nodes that the sheet joins, and the width of what does, metres.
    ends   : by member, where its beams begin and end, metres along its axis.
    grazed : nodes at which members share material beside their middles.
    """

    graph: MemberGraph
    points: list[Floats] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    on: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    links: list[tuple[int, int, float]] = field(default_factory=list)
    ends: dict[str, tuple[float, float]] = field(default_factory=dict)
    grazed: set[int] = field(default_factory=set)

    @cached_property
    def lined(self) -> list[Member]:
        """The members with an axis."""
        return [member for member in self.graph.members if member.axis is not None]

    def node(self, point: Floats, name: str) -> int:
        """The number of a new node."""
        self.points.append(np.asarray(point, dtype=np.float64))
        self.names.append(name)
        return len(self.names) - 1

    def place(self, member: Member, s: float, name: str) -> int:
        """The node of a member at an arc length: the one that is there already, or a new one."""
        assert member.axis is not None
        near = SAME * member.mean_width
        for at, number in self.on[member.id]:
            if _apart(member, at, s) < near:
                return number
        number = self.node(member.axis.at(np.array([s]))[0][0], name)
        self.on[member.id].append((s, number))
        return number

    def others(self, number: int, member: Member | None = None) -> list[Member]:
        """The members on a node, without one of them."""
        return [one for one in self._at.get(number, []) if one is not member]

    def other_width(self, member: Member, number: int) -> float:
        """Metres, of the widest other member on a node; 0 where there is none."""
        return max((one.mean_width for one in self.others(number, member)), default=0.0)

    def normal_at(self, number: int) -> Floats:
        """(3,) the normal of the surface at a node of some member."""
        for member in self.others(number):
            for s, k in self.on[member.id]:
                if k == number and member.axis is not None:
                    return np.asarray(member.axis.at(np.array([s]))[2][0])
        return np.zeros(3)

    @cached_property
    def _at(self) -> dict[int, list[Member]]:
        """Members by the nodes on them, once all are found."""
        found: dict[int, list[Member]] = {}
        for member in self.lined:
            for number in dict.fromkeys(number for _, number in self.on[member.id]):
                found.setdefault(number, []).append(member)
        return found


def found_joints(graph: MemberGraph) -> AxisJoints:
    """The joints of a graph, but for those of ends; members without an axis join nothing by themselves."""
    joints = AxisJoints(graph)
    joints.on = {member.id: [] for member in joints.lined}
    for node in graph.nodes:
        members = [graph.by_id[name] for name in node.members]
        if any(member.axis is None for member in members):
            continue
        if node.kind == "grazing":
            joints.grazed.update(linked(joints, members, node.at, node.id))
            continue
        number = joints.node(node.point, node.id)
        for member, s in zip(members, node.at, strict=True):
            joints.on[member.id].append((s, number))
    return joints


def linked(joints: AxisJoints, members: list[Member], at: tuple[float, float], name: str) -> tuple[int, int]:
    """Join two members at arc lengths of their axes: in one node, if they are near enough, else by a link as wide as
    the narrower one. Returns the nodes of both."""
    one, other = (joints.place(member, s, name) for member, s in zip(members, at, strict=True))
    if one != other:
        joints.links.append((one, other, min(member.mean_width for member in members)))
    return one, other


def _apart(member: Member, one: float, other: float) -> float:
    """Metres between arc lengths of a member."""
    gap = abs(one - other)
    assert member.axis is not None
    return min(gap, member.length - gap) if member.axis.closed else gap
