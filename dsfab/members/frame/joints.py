"""Joints between axes of members."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.members import Member, MemberGraph

SAME = 0.25
"""Joints on an axis share a node if the distance along the axis is below this fraction of the member's mean width."""


def fitting(halves: Floats, length: float) -> Floats:
    """Return half lengths (2,) of the joints at the ends of a bay, m. The sum is limited to 80 % of the bay.
    halves : (2,) half lengths before the reduction, m.    length : length of the bay, m."""
    clear = 0.2
    return halves * min(1.0, (1 - clear) * length / max(float(halves.sum()), 1e-30))


@dataclass(eq=False)
class AxisJoints:
    """Nodes on the axes of members. points, names : position (3,) and name of each node.
    on     : for each member, pairs (arc length in metres, node number) of the nodes on the axis.
    links  : (node, node, width in metres) for each link, a beam that only joins two nodes.
    ends   : for each member, the arc lengths (m) at which the first beam begins and the last beam ends.
    grazed : numbers of nodes at which members overlap although the middle lines of the members do not meet."""

    graph: MemberGraph
    points: list[Floats] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    on: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    links: list[tuple[int, int, float]] = field(default_factory=list)
    ends: dict[str, tuple[float, float]] = field(default_factory=dict)
    grazed: set[int] = field(default_factory=set)

    @cached_property
    def members_with_axis(self) -> list[Member]:
        return [member for member in self.graph.members if member.axis is not None]

    def node(self, point: Floats, name: str) -> int:
        """Add a node at a point (3,) and return its number."""
        self.points.append(np.asarray(point, dtype=np.float64))
        self.names.append(name)
        return len(self.names) - 1

    def place(self, member: Member, s: float, name: str) -> int:
        """Return the number of the member's node near arc length `s` (m). If there is none, add a node."""
        tolerance = SAME * member.mean_width
        for station, number in self.on[member.id]:
            if _distance(member, station, s) < tolerance:
                return number
        number = self.node(member.curve.frames_at(np.array([s]))[0][0], name)
        self.on[member.id].append((s, number))
        return number

    def other_members(self, number: int, member: Member | None = None) -> list[Member]:
        """Return all members at the node `number` except `member`."""
        return [candidate for candidate in self._members_by_node.get(number, []) if candidate is not member]

    def other_width(self, member: Member, number: int) -> float:
        """Return the width (m) of the widest member at the node `number` except `member`; 0 if `member` is alone."""
        return max((neighbour.mean_width for neighbour in self.other_members(number, member)), default=0.0)

    def normal_at(self, number: int) -> Floats:
        """Return the normal (3,) of the surface at the node `number`; zeros for a node that lies on no axis."""
        for member in self.other_members(number):
            for s, k in self.on[member.id]:
                if k == number and member.axis is not None:
                    return np.asarray(member.axis.frames_at(np.array([s]))[2][0])
        return np.zeros(3)

    @cached_property
    def _members_by_node(self) -> dict[int, list[Member]]:
        by_node: dict[int, list[Member]] = {}
        for member in self.members_with_axis:
            for number in dict.fromkeys(number for _, number in self.on[member.id]):
                by_node.setdefault(number, []).append(member)
        return by_node


def joints_at_nodes(graph: MemberGraph) -> AxisJoints:
    """Return the joints of members at the nodes of a graph."""
    joints = AxisJoints(graph)
    joints.on = {member.id: [] for member in joints.members_with_axis}
    for node in graph.nodes:
        members = [graph.by_id[name] for name in node.members]
        if any(member.axis is None for member in members):
            continue
        if node.kind == "grazing":
            joints.grazed.update(link_members(joints, members, node.at, node.id))
            continue
        number = joints.node(node.point, node.id)
        for member, s in zip(members, node.at, strict=True):
            joints.on[member.id].append((s, number))
    return joints


def link_members(joints: AxisJoints, members: list[Member], lengths: tuple[float, float], name: str) -> tuple[int, int]:
    """Link two members at the arc lengths `lengths` (m). Return the number of the linked node on each member."""
    node_a, node_b = (joints.place(member, s, name) for member, s in zip(members, lengths, strict=True))
    if node_a != node_b:
        joints.links.append((node_a, node_b, min(member.mean_width for member in members)))
    return node_a, node_b


def _distance(member: Member, s: float, t: float) -> float:
    gap = abs(s - t)
    return min(gap, member.length - gap) if member.curve.closed else gap


Trees = Mapping[str, tuple[cKDTree, Floats]]
"""For each member: a search tree of points along the axis, and the arc lengths (m) of these points."""


def join_ends(joints: AxisJoints) -> None:
    """Add links from member ends without a node to nearby members, and set `joints.ends`."""
    samples = [(member, *_samples(member)) for member in joints.members_with_axis]
    trees = {member.id: (cKDTree(P), s) for member, s, P in samples}
    open_ended = [member for member in joints.members_with_axis if member.axis and not member.axis.closed]
    for member in open_ended:
        for s, what in zip((0.0, member.length), member.ends, strict=True):
            if what in joints.graph.by_id:
                _join_end(joints, member, s, trees)
    _join_touching(joints, trees)
    for member in open_ended:
        span = [0.0, member.length]
        for side, what in enumerate(member.ends):
            nearest = _nearest(joints, member, span[side])
            # a short piece beyond the last node belongs to the joint
            beyond = nearest and abs(nearest[0] - span[side]) < joints.other_width(member, nearest[1])
            if nearest and beyond and what not in ("edge", "free"):
                span[side] = nearest[0]
        joints.ends[member.id] = span[0], span[1]


def _join_touching(joints: AxisJoints, trees: Trees) -> None:
    surface = joints.graph.sheet.surface
    middle = surface.V[surface.edges.ends].mean(axis=1)
    borders = [np.unique(surface.edges.of[member.cells]) for member in joints.members_with_axis]
    patches = [np.unique(surface.edges.of[m.cells]) for m in joints.graph.members if m.axis is None]
    with_axis, patched = _owners(borders, len(middle)), _owners(patches, len(middle))
    for member, border in zip(joints.members_with_axis, borders, strict=True):
        for s, what, width in _loose_ends(joints, member):
            point = _point(member, s)
            around = np.flatnonzero(np.linalg.norm(middle - point, axis=1) < width)
            between = np.unique(patched[np.intersect1d(border, around)].indices)
            near_edges = np.intersect1d(np.concatenate([border, *(patches[k] for k in between)]), around)
            neighbours = (joints.members_with_axis[k] for k in np.unique(with_axis[near_edges].indices))
            _join_to(joints, (member, s, width), point, [m for m in neighbours if m is not member], what, trees)


def _owners(edges: list[Ints], count: int) -> csr_array:
    columns = np.repeat(np.arange(len(edges)), [len(group) for group in edges])
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *edges])
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, len(edges)))


def _join_to(
    joints: AxisJoints,
    end: tuple[Member, float, float],
    point: Floats,
    neighbours: list[Member],
    what: str,
    trees: Trees,
) -> None:
    member, s, width = end
    for neighbour in neighbours:
        own_nodes = {number for along, number in joints.on[member.id] if abs(along - s) < width}
        far_nodes = {number for _, number in joints.on[neighbour.id]}
        tree, along = trees[neighbour.id]
        t = float(along[tree.query(point)[1]])
        ends = [place for place, _, _ in _loose_ends(joints, neighbour) if abs(place - t) < width]
        linked = any({a, b} & own_nodes and {a, b} & far_nodes for a, b, _ in joints.links)
        if not (own_nodes & far_nodes or linked) and (ends or what == "free"):
            link_members(joints, [member, neighbour], (s, ends[0] if ends else t), f"{member.id} end")


def _nearest(joints: AxisJoints, member: Member, s: float) -> tuple[float, int] | None:
    return min(joints.on[member.id], key=lambda one: abs(one[0] - s), default=None)


def _join_end(joints: AxisJoints, member: Member, s: float, trees: Trees) -> None:
    nearest = _nearest(joints, member, s)
    if nearest and abs(nearest[0] - s) < SAME * member.mean_width:
        return
    point = _point(member, s)
    candidates = []
    for name, (tree, along) in trees.items():
        if name != member.id:
            distance, k = tree.query(point)
            candidates.append((float(distance), name, float(along[k])))
    distance, name, at_other = min(candidates, default=(np.inf, "", 0.0))
    neighbour = joints.graph.by_id.get(name)
    if neighbour is None or distance > 2.0 * max(member.mean_width, neighbour.mean_width):
        return
    link_members(joints, [member, neighbour], (s, at_other), f"{member.id} end")


def _loose_ends(joints: AxisJoints, member: Member) -> Iterable[tuple[float, str, float]]:
    """Yield the ends of a member that lie at no node and no edge of the sheet: arc length (m), name of the touching
    member or "free", and width (m)."""
    if not member.curve.closed:
        for s, what, width in zip((0.0, member.length), member.ends, member.width[[0, -1]].tolist(), strict=True):
            if what == "free" or what in joints.graph.by_id:
                yield s, what, max(width, member.mean_width)


def _point(member: Member, s: float) -> Floats:
    return np.asarray(member.curve.frames_at(np.array([s]))[0][0])


def _samples(member: Member) -> tuple[Floats, Floats]:
    count = int(np.clip(4 * member.length / max(member.mean_width, 1e-9), 8, 400))
    s = np.linspace(0, member.length, count + 1)
    return s, member.curve.frames_at(s)[0]


def add_hubs(joints: AxisJoints) -> None:
    """Add a central node (hub) to each member of kind "disc" with 3 nodes or more. Links join the hub to all nodes."""
    for member in joints.members_with_axis:
        nodes = sorted({number for _, number in joints.on[member.id]})
        if member.kind == "disc" and member.axis and member.axis.closed and len(nodes) >= 3:
            hub = joints.node(member.axis.P[:-1].mean(axis=0), f"{member.id} hub")
            joints.links += [(hub, number, member.length / len(nodes)) for number in nodes]
