"""Where the axes of members are joined: at their nodes, at ends within each other, and where members graze."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.members import Member, MemberGraph

BEYOND = 1.0
"""What goes on beyond a member's last node is part of the joint if it is shorter than this share of the other's
width."""
SAME = 0.25
"""Axes that are nearer to each other than this share of the narrower width are joined in one node, others by a link."""
REACH = 2.0
"""An end is joined to an axis that is at most so many widths away."""
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
    """The joints of a graph; members without an axis join nothing by themselves."""
    joints = AxisJoints(graph)
    joints.on = {member.id: [] for member in joints.lined}
    for node in graph.nodes:
        members = [graph.by_id[name] for name in node.members]
        if any(member.axis is None for member in members):
            continue
        if node.kind == "grazing":
            joints.grazed.update(_linked(joints, members, node.at, node.id))
            continue
        number = joints.node(node.point, node.id)
        for member, s in zip(members, node.at, strict=True):
            joints.on[member.id].append((s, number))
    _join_ends(joints)
    return joints


def _linked(joints: AxisJoints, members: list[Member], at: tuple[float, float], name: str) -> tuple[int, int]:
    """Join two members at arc lengths of their axes: in one node, if they are near enough, else by a link. Returns the
    nodes of both."""
    one, other = (joints.place(member, s, name) for member, s in zip(members, at, strict=True))
    if one != other:
        joints.links.append((one, other, min(member.mean_width for member in members)))
    return one, other


def _join_ends(joints: AxisJoints) -> None:
    """Cut off what goes on beyond the last nodes, and join the ends that have none to the axis that is nearest."""
    samples = [(member, *_samples(member)) for member in joints.lined]
    trees = {member.id: (cKDTree(P), s) for member, s, P in samples}
    open_ended = [member for member in joints.lined if member.axis and not member.axis.closed]
    for member in open_ended:
        for s, what in zip((0.0, member.length), member.ends, strict=True):
            if what in joints.graph.by_id:
                _join_end(joints, member, s, trees)
    for member in open_ended:
        span = [0.0, member.length]
        for side, what in enumerate(member.ends):
            near = _nearest(joints, member, span[side])
            beyond = near and abs(near[0] - span[side]) < BEYOND * joints.other_width(member, near[1])
            if near and beyond and what not in ("edge", "free"):
                span[side] = near[0]
        joints.ends[member.id] = span[0], span[1]


def _nearest(joints: AxisJoints, member: Member, s: float) -> tuple[float, int] | None:
    """The arc length and the number of the node of a member that is nearest to an arc length."""
    return min(joints.on[member.id], key=lambda one: abs(one[0] - s), default=None)


def _join_end(joints: AxisJoints, member: Member, s: float, trees: Mapping[str, tuple[cKDTree, Floats]]) -> None:
    """Join the end of a member that has no node to the nearest axis of another."""
    assert member.axis is not None
    near = _nearest(joints, member, s)
    if near and abs(near[0] - s) < SAME * member.mean_width:
        return
    point = member.axis.at(np.array([s]))[0][0]
    found = []
    for name, (tree, at) in trees.items():
        if name != member.id:
            distance, k = tree.query(point)
            found.append((float(distance), name, float(at[k])))
    distance, name, at_other = min(found, default=(np.inf, "", 0.0))
    other = joints.graph.by_id.get(name)
    if other is None or distance > REACH * max(member.mean_width, other.mean_width):
        return
    _linked(joints, [member, other], (s, at_other), f"{member.id} end")


def _samples(member: Member) -> tuple[Floats, Floats]:
    """(k,) arc lengths and (k, 3) points along a member, a quarter of its width apart."""
    assert member.axis is not None
    count = int(np.clip(4 * member.length / max(member.mean_width, 1e-9), 8, 400))
    s = np.linspace(0, member.length, count + 1)
    return s, member.axis.at(s)[0]


def _apart(member: Member, one: float, other: float) -> float:
    """Metres between arc lengths of a member."""
    gap = abs(one - other)
    assert member.axis is not None
    return min(gap, member.length - gap) if member.axis.closed else gap
