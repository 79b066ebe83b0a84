"""Joints between axes of members: at nodes, at member ends, and at the middles of discs around points."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
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


BEYOND = 1.0
"""What goes on beyond a member's last node is part of the joint if it is shorter than this share of the other's
width."""
REACH = 2.0
"""An end is joined to an axis that is at most so many widths away."""

Trees = Mapping[str, tuple[cKDTree, Floats]]
"""By the names of members, points along their axes, and the arc lengths of these."""


def join_ends(joints: AxisJoints) -> None:
    """Cut off what goes on beyond the last nodes, and join the ends that have none to the axis that is nearest, and to
    what else they meet."""
    samples = [(member, *_samples(member)) for member in joints.lined]
    trees = {member.id: (cKDTree(P), s) for member, s, P in samples}
    open_ended = [member for member in joints.lined if member.axis and not member.axis.closed]
    for member in open_ended:
        for s, what in zip((0.0, member.length), member.ends, strict=True):
            if what in joints.graph.by_id:
                _join_end(joints, member, s, trees)
    _join_met(joints, trees)
    for member in open_ended:
        span = [0.0, member.length]
        for side, what in enumerate(member.ends):
            near = _nearest(joints, member, span[side])
            beyond = near and abs(near[0] - span[side]) < BEYOND * joints.other_width(member, near[1])
            if near and beyond and what not in ("edge", "free"):
                span[side] = near[0]
        joints.ends[member.id] = span[0], span[1]


def _join_met(joints: AxisJoints, trees: Trees) -> None:
    """Join ends without a node to the members whose material theirs goes on into: free ones to all of them, others to
    those that end there, too. So the arms of a star, which no node joins, hang together, also where what lies between
    them is a member without an axis: a few faces in the middle.

    What is joined may be as far from an end as the member is wide there. Ends that have a node are left as they are:
    bracing them as well makes the preset `cantilever` 6 % stiffer than its sheet.
    """
    surface = joints.graph.sheet.surface
    middle = surface.V[surface.edges.ends].mean(axis=1)
    borders = [np.unique(surface.edges.of[member.cells]) for member in joints.lined]
    patches = [np.unique(surface.edges.of[one.cells]) for one in joints.graph.members if one.axis is None]
    lined, patched = _owners(borders, len(middle)), _owners(patches, len(middle))
    for member, own in zip(joints.lined, borders, strict=True):
        for s, what, width in _loose_ends(joints, member):
            point = _point(member, s)
            around = np.flatnonzero(np.linalg.norm(middle - point, axis=1) < width)
            between = np.unique(patched[np.intersect1d(own, around)].indices)
            near = np.intersect1d(np.concatenate([own, *(patches[k] for k in between)]), around)
            met = (joints.lined[k] for k in np.unique(lined[near].indices))
            _join_to(joints, (member, s, width), point, [one for one in met if one is not member], what, trees)


def _owners(edges: list[Ints], count: int) -> csr_array:
    """(count, k) of which of k members each edge is, of the edges of each."""
    columns = np.repeat(np.arange(len(edges)), [len(one) for one in edges])
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *edges])
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, len(edges)))


def _join_to(
    joints: AxisJoints, end: tuple[Member, float, float], point: Floats, met: list[Member], what: str, trees: Trees
) -> None:
    """Join an end, of a member at an arc length and a width, to those that it meets, unless a node or a link
    does."""
    member, s, width = end
    for other in met:
        here = {number for at, number in joints.on[member.id] if abs(at - s) < width}
        there = {number for _, number in joints.on[other.id]}
        tree, at = trees[other.id]
        t = float(at[tree.query(point)[1]])
        ends = [one for one, _, _ in _loose_ends(joints, other) if abs(one - t) < width]
        linked_there = any({one, two} & here and {one, two} & there for one, two, _ in joints.links)
        if not (here & there or linked_there) and (ends or what == "free"):
            linked(joints, [member, other], (s, ends[0] if ends else t), f"{member.id} end")


def _nearest(joints: AxisJoints, member: Member, s: float) -> tuple[float, int] | None:
    """The arc length and the number of the node of a member that is nearest to an arc length."""
    return min(joints.on[member.id], key=lambda one: abs(one[0] - s), default=None)


def _join_end(joints: AxisJoints, member: Member, s: float, trees: Trees) -> None:
    """Join the end of a member that has no node to the nearest axis of another."""
    assert member.axis is not None
    near = _nearest(joints, member, s)
    if near and abs(near[0] - s) < SAME * member.mean_width:
        return
    point = _point(member, s)
    found = []
    for name, (tree, at) in trees.items():
        if name != member.id:
            distance, k = tree.query(point)
            found.append((float(distance), name, float(at[k])))
    distance, name, at_other = min(found, default=(np.inf, "", 0.0))
    other = joints.graph.by_id.get(name)
    if other is None or distance > REACH * max(member.mean_width, other.mean_width):
        return
    linked(joints, [member, other], (s, at_other), f"{member.id} end")


def _loose_ends(joints: AxisJoints, member: Member) -> Iterable[tuple[float, str, float]]:
    """Of the ends of a member that no node is at: the arc length, the member that it runs into or "free", and how wide
    it is there, metres."""
    assert member.axis is not None
    if not member.axis.closed:
        for s, what, width in zip((0.0, member.length), member.ends, member.width[[0, -1]].tolist(), strict=True):
            if what == "free" or what in joints.graph.by_id:
                yield s, what, max(width, member.mean_width)


def _point(member: Member, s: float) -> Floats:
    """(3,) on the axis of a member at an arc length."""
    assert member.axis is not None
    return np.asarray(member.axis.at(np.array([s]))[0][0])


def _samples(member: Member) -> tuple[Floats, Floats]:
    """(k,) arc lengths and (k, 3) points along a member, a quarter of its width apart."""
    assert member.axis is not None
    count = int(np.clip(4 * member.length / max(member.mean_width, 1e-9), 8, 400))
    s = np.linspace(0, member.length, count + 1)
    return s, member.axis.at(s)[0]


SPOKES = 3
"""A disc with fewer nodes on its ring has no hub."""


def add_hubs(joints: AxisJoints) -> None:
    """A hub for each disc; its spokes are as wide, together, as the ring is long.

    Under a load on the hub such spokes give .73 times as much as a clamped plate, 1.15 times as much as a plate on a
    simple support: Pa^2/(2 pi E t^3) against .217 and .552 Pa^2/(E t^3), .637 and .159 [Timoshenko, Woinowsky-Krieger
    1959, 19]."""
    for member in joints.lined:
        nodes = sorted({number for _, number in joints.on[member.id]})
        if member.kind == "disc" and member.axis and member.axis.closed and len(nodes) >= SPOKES:
            hub = joints.node(_middle(member), f"{member.id} hub")
            joints.links += [(hub, number, member.length / len(nodes)) for number in nodes]


def _middle(member: Member) -> Floats:
    """(3,) the middle of a closed axis."""
    assert member.axis is not None
    return np.asarray(member.axis.P[:-1].mean(axis=0))
