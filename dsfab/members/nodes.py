"""The nodes of a graph, from the patches that two members share; and what members end at."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats, Ints, from_segments
from dsfab.members.components import Component
from dsfab.members.graph import Member, Node, NodeKind
from dsfab.members.overlaps import SharedPatch
from dsfab.slicing import Overlay
from dsfab.surface import Surface

ENDS = 1.0
"""A member ends at a node if what goes on beyond it is shorter than this share of the other one's width."""
ON_EDGE = 0.05
"""It ends at the edge of the surface if that is nearer than this share of its own width."""


@dataclass(frozen=True, eq=False)
class Joints:
    """Members and the components that they are, with unit normals (n, 3) at the vertices of the overlay."""

    overlay: Overlay
    members: list[Member]
    parts: list[Component]
    normals: Floats

    def nodes(self, shared: list[SharedPatch]) -> list[Node]:
        """The nodes of all overlaps, named in the order of the members, and along the first of both."""
        listed = []
        for overlap in shared:
            pair = min(overlap.a, overlap.b), max(overlap.a, overlap.b)
            points, cells = (overlap.points, overlap.at) if len(overlap.points) else self._ends_within(overlap)
            area = float(self.overlay.sheet.surface.areas[overlap.cells].sum()) / max(len(points), 1)
            if not len(points):
                listed.append((pair, self._grazing(pair, overlap.cells, area)))
            listed += [(pair, self._meeting(pair, *one, area)) for one in zip(points, cells.tolist(), strict=True)]
        listed.sort(key=lambda one: (one[0][0], np.nan_to_num(one[1].at[0]), one[0][1], one[1].point.tolist()))
        digits = len(str(max(len(listed), 100)))
        return [replace(node, id=f"N{number:0{digits}d}") for number, (_, node) in enumerate(listed, 1)]

    def _ends_within(self, overlap: SharedPatch) -> tuple[Floats, Ints]:
        """(k, 3) the end of a line that lies in what it shares with another member, and (k,) its cell: there they meet,
        as two edges of a surface do at its corner."""
        for k, other in ((overlap.a, overlap.b), (overlap.b, overlap.a)):
            line = self.parts[k].line
            if line is None or line.closed or self.parts[other].line is None:
                continue
            for point, cell in ((line.points[0], line.cells[0]), (line.points[-1], line.cells[-1])):
                if cell in overlap.cells:
                    return point[None], np.array([cell])
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)

    def _station(self, k: int, point: Floats) -> float:
        """Arc length of a member's axis at a point (3,) of the line that it was fitted to, or beside it."""
        axis, line = self.members[k].axis, self.parts[k].line
        return axis.station(line.place(point)) if axis and line else float("nan")

    def _meeting(self, pair: tuple[int, int], point: Floats, cell: int, area: float) -> Node:
        """Where the lines of two members cross; it has no name yet."""
        one, two = (self.members[k] for k in pair)
        at = self._station(pair[0], point), self._station(pair[1], point)
        (T, w), (other, width) = (tangent_and_width(*there) for there in zip((one, two), at, strict=True))
        ends = (_beyond(one, at[0]) < ENDS * width) + (_beyond(two, at[1]) < ENDS * w)
        kinds: tuple[NodeKind, ...] = ("crossing", "branch", "end")
        return Node("", kinds[ends], (one.id, two.id), at, _angle(T, other), point, self._normal(cell), area)

    def _grazing(self, pair: tuple[int, int], cells: Ints, area: float) -> Node:
        """What two members share where their middles do not meet: at the one of these cells (c,) in its middle."""
        surface = self.overlay.sheet.surface
        areas, places = surface.areas[cells], surface.centroids[cells]
        middle = int(np.linalg.norm(places - areas @ places / areas.sum(), axis=1).argmin())
        one, two = (self.members[k] for k in pair)
        at = self._station(pair[0], places[middle]), self._station(pair[1], places[middle])
        angle = float("nan")
        if one.axis and two.axis:
            (T, _), (other, _) = (tangent_and_width(*there) for there in zip((one, two), at, strict=True))
            angle = _angle(T, other)
        normal = self._normal(int(cells[middle]))
        return Node("", "grazing", (one.id, two.id), at, angle, places[middle], normal, area)

    def _normal(self, cell: int) -> Floats:
        total = self.normals[self.overlay.sheet.surface.F[cell]].sum(axis=0)
        return np.asarray(total / np.linalg.norm(total))


def tangent_and_width(member: Member, s: float) -> tuple[Floats, float]:
    """(3,) the unit tangent of a member's axis at an arc length, and its width there, metres."""
    assert member.axis is not None
    return member.axis.at(np.array([s]))[1][0], float(np.interp(s, member.axis.s, member.width))


def _beyond(member: Member, s: float) -> float:
    """Metres from a place along a member to its nearer end; infinite where it is closed."""
    return np.inf if member.axis is None or member.axis.closed else min(s, member.length - s)


def _angle(one: Floats, two: Floats) -> float:
    """Degrees, 0 to 90, between unit vectors (3,)."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, two)), abs(one @ two))))


def with_ends(joints: Joints, owner: Ints, nodes: list[Node], surface: Surface) -> list[Member]:
    """The members with what is at both ends of each: the last node, if that is nearer than `ENDS` says; the member that
    it ends in, or that goes on from there; "edge" of the surface; or "free".

    owner : (m, f) the member that each cell is a part of for each field, -1 for none.    surface : before it was cut.
    """
    members, parts = joints.members, joints.parts
    by_id = {member.id: member for member in members}
    on: dict[str, list[tuple[float, Node]]] = {member.id: [] for member in members}
    for node in nodes:
        if node.kind != "grazing":
            for name, s in zip(node.members, node.at, strict=True):
                on[name].append((s, node))
    begins: dict[bytes, list[int]] = {}
    for k, part in enumerate(parts):
        if part.line and not part.line.closed:
            for point in part.line.points[[0, -1]]:
                begins.setdefault(point.tobytes(), []).append(k)
    boundary = surface.V[surface.edges.ends[surface.edges.boundary]]
    found = []
    for k, member in enumerate(members):
        line = parts[k].line
        if member.axis is None or line is None or line.closed:
            found.append(member)
            continue
        ends = []
        for s, side in ((0.0, 0), (member.length, -1)):
            name = _node_at(member, s, on[member.id], by_id)
            others = [*begins[line.points[side].tobytes()], *owner[line.cells[side]].tolist()]
            name = name or next((members[other].id for other in others if other not in (k, -1)), "")
            ends.append(name or _edge_or_free(line.points[side], boundary, ON_EDGE * member.mean_width))
        found.append(replace(member, ends=tuple(ends)))
    return found


def _node_at(member: Member, s: float, on: list[tuple[float, Node]], by_id: dict[str, Member]) -> str:
    """The name of the node, of those on a member with their arc lengths, at its end at an arc length; '' for none."""
    at, node = min(on, key=lambda one: abs(one[0] - s), default=(0.0, None))
    if node is None:
        return ""
    other = 1 - node.members.index(member.id)
    _, width = tangent_and_width(by_id[node.members[other]], node.at[other])
    return node.id if abs(at - s) < ENDS * width else ""


def _edge_or_free(point: Floats, boundary: Floats, near: float) -> str:
    """Whether a point (3,) is on one of the edges (b, 2, 3), metres."""
    on = len(boundary) and from_segments(point, boundary[:, 0], boundary[:, 1]).min() < near
    return "edge" if on else "free"
