"""Members by name, and the nodes at which members cross, meet or end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, Ints, distances_from_segments, lock, lock_floats
from dsfab.core.limits import SAME_PHASE
from dsfab.members.axes import MemberAxis
from dsfab.members.components import Component, Kind
from dsfab.slicing import Overlay, Sheet
from dsfab.surface import Surface, link_components, require_compas

if TYPE_CHECKING:
    import compas.datastructures


class SharedPatch(NamedTuple):
    """Connected cells (c,) of the sheet in which the members with the numbers a and b overlap.
    points : (k, 3) crossings of the middle lines in these cells, metres.    at : (k,) the cell of each crossing."""

    a: int
    b: int
    cells: Ints
    points: Floats
    at: Ints


@dataclass(frozen=True, eq=False)
class _SharedCells:
    one: int
    two: int
    cells: Ints
    a: Ints
    b: Ints
    patch: Ints

    @classmethod
    def from_fields(cls, overlay: Overlay, member: Ints, field_a: int, field_b: int) -> "_SharedCells | None":
        in_both = (member[:, field_a] >= 0) & (member[:, field_b] >= 0) & (member[:, field_a] != member[:, field_b])
        cells = np.flatnonzero(in_both)
        if not len(cells):
            return None
        place = np.full(len(in_both), -1)
        place[cells] = np.arange(len(cells))
        f, g = place[overlay.adjacent_cells.T]
        inside = (f >= 0) & (g >= 0)
        f, g = f[inside], g[inside]
        a, b = member[cells, field_a], member[cells, field_b]
        same_pair = (a[f] == a[g]) & (b[f] == b[g])
        return cls(field_a, field_b, cells, a, b, link_components(len(cells), f[same_pair], g[same_pair])[1])


def overlaps(overlay: Overlay, member: Ints) -> list[SharedPatch]:
    """Return all connected groups of cells in which two members overlap.
    member : (m, f) number of the member that covers each cell, for each of f layers of the pattern; -1 for none."""
    patches = []
    count = member.shape[1]
    for k in range(count):
        for second in range(k + 1, count):
            if (shared := _SharedCells.from_fields(overlay, member, k, second)) is not None:
                patches += _patches(overlay, shared)
    return patches


def _patches(overlay: Overlay, shared: _SharedCells) -> list[SharedPatch]:
    row, points = _crossings(overlay, shared)
    order = np.argsort(shared.patch, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(shared.patch))[:-1])
    patch = shared.patch[row]
    patches = []
    for number, group in enumerate(groups):
        in_patch = patch == number
        cell_row = group[0]
        cells = shared.cells[group]
        a, b = int(shared.a[cell_row]), int(shared.b[cell_row])
        patches.append(SharedPatch(a, b, cells, points[in_patch], shared.cells[row[in_patch]]))
    return patches


def _crossings(overlay: Overlay, shared: _SharedCells) -> tuple[Ints, Floats]:
    surface, cells = overlay.sheet.surface, shared.cells
    offset_a, offset_b = (overlay.offset[cells, :, field] for field in (shared.one, shared.two))
    crossed = np.sign(offset_a) * np.roll(np.sign(offset_a), -1, axis=1) < 0
    row = np.flatnonzero(crossed.sum(axis=1) == 2)
    side = np.nonzero(crossed[row])[1].reshape(-1, 2)
    F, offset_a, offset_b = surface.F[cells[row]], offset_a[row], offset_b[row]
    begin, end, t = _places_on_sides(offset_a, F, side)
    every = np.arange(len(row))[:, None]
    values = offset_b[every, begin] + t * (offset_b[every, end] - offset_b[every, begin])
    # values keep away from 0, so that a crossing on an edge lies in exactly one of the edge's two cells
    values = np.where(np.abs(values) < SAME_PHASE, np.copysign(SAME_PHASE, offset_b[every, begin]), values)
    meets = np.sign(values[:, 0]) * np.sign(values[:, 1]) < 0
    a, b = surface.V[F[every, begin]], surface.V[F[every, end]]
    points, values = (a + t[..., None] * (b - a))[meets], np.abs(values[meets])
    t = values[:, :1] / values.sum(axis=1, keepdims=True)
    return row[meets], points[:, 0] + t * (points[:, 1] - points[:, 0])


def _places_on_sides(offset: Floats, F: Ints, side: Ints) -> tuple[Ints, Ints, Floats]:
    row = np.arange(len(F))[:, None]
    p, q = side, (side + 1) % 3
    turn = F[row, p] > F[row, q]
    p, q = np.where(turn, q, p), np.where(turn, p, q)
    a, b = np.abs(offset[row, p]), np.abs(offset[row, q])
    return p, q, a / (a + b)


NodeKind = Literal["crossing", "branch", "end", "grazing"]


@dataclass(frozen=True, eq=False)
class Member:
    """A named part of a sheet.
    id     : "A07", "B12b", "rim 1".
    kind   : strip, or stub if it is less than twice as long as wide; rim and band along edges; ring and disc around
             a support or load. A fill (between members) and a plate have no axis.
    family : family of the pattern: "major", "minor", "keep", "rim"; or "" for a fill.
    stripe : number of the stripe.    part : number among the members of this stripe, from 1.
    cells  : (c,) cells of `MemberGraph.sheet`, including cells below other members.    area : area of these cells, m2.
    axis   : axis along the middle, or None.
    sides  : (k, 2) widths (m) to the left and right of each point of the axis; (0, 2) without an axis.
    ends   : at begin and end: name of a node or member, "edge" of the sheet, or "free"; empty if closed."""

    id: str
    kind: Kind
    family: str
    stripe: int
    part: int
    cells: Ints
    area: float
    axis: MemberAxis | None
    sides: Floats
    ends: tuple[str, ...]

    def __post_init__(self) -> None:
        lock(self, "cells", np.int64, (None,))
        lock_floats(self, sides=(None, 2))

    @property
    def curve(self) -> MemberAxis:
        """Axis of the member. The member must have an axis."""
        assert self.axis is not None
        return self.axis

    @property
    def length(self) -> float:
        """Length of the member's axis, metres; 0 without an axis."""
        return self.axis.length if self.axis else 0.0

    @property
    def width(self) -> Floats:
        """Widths (k,) of the member at the points of its axis, metres."""
        return np.asarray(self.sides.sum(axis=1))

    @property
    def mean_width(self) -> float:
        """Median width along the axis, metres."""
        return float(np.median(self.width)) if self.axis else float(np.sqrt(self.area))


@dataclass(frozen=True, eq=False)
class Node:
    """The overlap of two members.
    kind    : crossing: no member ends. branch: one member ends. end: two end. grazing: middle lines do not meet.
    members : names of the members.    at : (2,) arc length along the axis of each member, metres; NaN without an axis.
    angle   : angle between the members, degrees, 0 to 90; NaN without an axis.
    point   : (3,) metres.    normal : (3,) normal of the surface.    area : area of the overlap, m2."""

    id: str
    kind: NodeKind
    members: tuple[str, str]
    at: tuple[float, float]
    angle: float
    point: Floats
    normal: Floats
    area: float

    def __post_init__(self) -> None:
        lock_floats(self, point=(3,), normal=(3,))


@dataclass(frozen=True, eq=False)
class MemberGraph:
    """Members and nodes of a design. sheet : sheet of the design, divided along the edges of all members.
    source : (m,) cell of the design's sheet that contains each cell."""

    sheet: Sheet
    source: Ints
    members: tuple[Member, ...]
    nodes: tuple[Node, ...]

    def __post_init__(self) -> None:
        lock(self, "source", np.int64, (self.sheet.surface.m,))

    @cached_property
    def by_id(self) -> dict[str, Member]:
        return {member.id: member for member in self.members}

    @cached_property
    def nodes_along(self) -> dict[str, tuple[Node, ...]]:
        """Nodes along the axis of each member, except nodes of kind "grazing"; by name of the member."""
        stations = stations_of_nodes(self.members, self.nodes)
        return {name: tuple(node for _, node in sorted(pairs, key=itemgetter(0))) for name, pairs in stations.items()}

    @cached_property
    def owner(self) -> Ints:
        """Number (m,) of the widest member that covers each cell."""
        numbers = np.full(self.sheet.surface.m, -1)
        for k in sorted(range(len(self.members)), key=lambda k: (self.members[k].mean_width, -k)):
            numbers[self.members[k].cells] = k
        return numbers

    def bays(self, name: str) -> Floats:
        """Return lengths (b,) of a member's bays (parts between nodes), m."""
        axis, nodes = self.by_id[name].axis, self.nodes_along[name]
        if axis is None or not nodes:
            return np.empty(0)
        s = np.array([node.at[node.members.index(name)] for node in nodes])
        return np.diff(s, append=s[0] + axis.length) if axis.closed else np.diff(s)

    def to_compas(self) -> "compas.datastructures.Graph":
        """Return nodes with x, y, z (m), and an edge for each part of a member between two nodes.
        Raises SurfaceError if compas is not installed."""
        require_compas()
        from compas.datastructures import Graph

        result = Graph(name="members")
        for node in self.nodes:
            x, y, z = node.point.tolist()
            facts = {"kind": node.kind, "members": list(node.members), "angle": node.angle}
            result.add_node(node.id, x=x, y=y, z=z, attr_dict=facts)
        for member in self.members:
            nodes = self.nodes_along[member.id]
            after = (*nodes[1:], nodes[0]) if nodes and member.axis and member.axis.closed else nodes[1:]
            for bay, (a, b) in zip(self.bays(member.id).tolist(), zip(nodes, after, strict=False), strict=False):
                pair = a.id, b.id
                shortest = result.edge_attribute(pair, "length") if result.has_edge(pair) else None
                if a.id != b.id and (shortest is None or bay < shortest):
                    result.add_edge(a.id, b.id, attr_dict={"member": member.id, "length": bay})
        return result

    @cached_property
    def stub_share(self) -> float:
        """Fraction of the sheet's area in members of kind "stub" (less than twice as long as wide)."""
        return sum(member.area for member in self._stubs) / self.sheet.surface.area

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the builder about stubs, and about overlaps of members that are not nodes."""
        lines = []
        stubs, grazing = self._stubs, [node for node in self.nodes if node.kind == "grazing"]
        if self.stub_share > 0.01:
            lines.append(
                f"{len(stubs)} stubs (members less than twice as long as wide) cover {self.stub_share:.1%} of the sheet"
            )
        if grazing:
            lines.append(
                f"{len(grazing)} x members graze: their overlap is no node, because their middle lines do not meet"
            )
        return tuple(lines)

    @property
    def _stubs(self) -> list[Member]:
        return [member for member in self.members if member.kind == "stub"]


def stations_of_nodes(members: Sequence[Member], nodes: Sequence[Node]) -> dict[str, list[tuple[float, Node]]]:
    """Return the nodes of each member with arc lengths (m) along the axis, except nodes of kind "grazing"."""
    stations: dict[str, list[tuple[float, Node]]] = {member.id: [] for member in members}
    for node in nodes:
        if node.kind != "grazing":
            for name, s in zip(node.members, node.at, strict=True):
                stations[name].append((s, node))
    return stations


ENDS = 1.0  # Longest piece of a member beyond its end node, in widths of the crossing member.


@dataclass(frozen=True, eq=False)
class Joints:
    """Members, the cells of each member (`parts`), and unit normals (n, 3) at the vertices."""

    overlay: Overlay
    members: list[Member]
    parts: list[Component]
    normals: Floats

    def nodes(self, shared: list[SharedPatch]) -> list[Node]:
        """Return the nodes in the overlaps `shared`: a node at each crossing of middle lines, at least 1 in each."""
        listed = []
        for overlap in shared:
            pair = min(overlap.a, overlap.b), max(overlap.a, overlap.b)
            points, cells = (overlap.points, overlap.at) if len(overlap.points) else self._ends_within(overlap)
            area = float(self.overlay.sheet.surface.areas[overlap.cells].sum()) / max(len(points), 1)
            if not len(points):
                listed.append((pair, self._grazing(pair, overlap.cells, area)))
            crossings = zip(points, cells.tolist(), strict=True)
            listed += [(pair, self._meeting(pair, *crossing, area)) for crossing in crossings]
        listed.sort(key=lambda row: (row[0][0], np.nan_to_num(row[1].at[0]), row[0][1], row[1].point.tolist()))
        digits = len(str(max(len(listed), 100)))
        return [replace(node, id=f"N{number:0{digits}d}") for number, (_, node) in enumerate(listed, 1)]

    def _ends_within(self, overlap: SharedPatch) -> tuple[Floats, Ints]:
        for k, neighbour in ((overlap.a, overlap.b), (overlap.b, overlap.a)):
            line = self.parts[k].line
            if line is None or line.closed or self.parts[neighbour].line is None:
                continue
            for point, cell in ((line.points[0], line.cells[0]), (line.points[-1], line.cells[-1])):
                if cell in overlap.cells:
                    return point[None], np.array([cell])
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)

    def _station(self, k: int, point: Floats) -> float:
        axis, line = self.members[k].axis, self.parts[k].line
        return axis.station(line.place(point)) if axis and line else float("nan")

    def _meeting(self, pair: tuple[int, int], point: Floats, cell: int, area: float) -> Node:
        member_a, member_b = (self.members[k] for k in pair)
        places = self._station(pair[0], point), self._station(pair[1], point)
        (T, w), (tangent, width) = tangent_and_width(member_a, places[0]), tangent_and_width(member_b, places[1])
        ends = (_length_beyond(member_a, places[0]) < ENDS * width) + (_length_beyond(member_b, places[1]) < ENDS * w)
        kinds: tuple[NodeKind, ...] = ("crossing", "branch", "end")
        names, angle = (member_a.id, member_b.id), _angle(T, tangent)
        return Node("", kinds[ends], names, places, angle, point, self._normal(cell), area)

    def _grazing(self, pair: tuple[int, int], cells: Ints, area: float) -> Node:
        surface = self.overlay.sheet.surface
        areas, places = surface.areas[cells], surface.centroids[cells]
        middle = int(np.linalg.norm(places - areas @ places / areas.sum(), axis=1).argmin())
        member_a, member_b = (self.members[k] for k in pair)
        lengths = self._station(pair[0], places[middle]), self._station(pair[1], places[middle])
        angle = float("nan")
        if member_a.axis and member_b.axis:
            angle = _angle(*(tangent_and_width(*place)[0] for place in zip((member_a, member_b), lengths, strict=True)))
        normal = self._normal(int(cells[middle]))
        return Node("", "grazing", (member_a.id, member_b.id), lengths, angle, places[middle], normal, area)

    def _normal(self, cell: int) -> Floats:
        total = self.normals[self.overlay.sheet.surface.F[cell]].sum(axis=0)
        return np.asarray(total / np.linalg.norm(total))


def tangent_and_width(member: Member, s: float) -> tuple[Floats, float]:
    """Return the unit tangent (3,) and the width (m) at arc length `s` of a member's axis."""
    return member.curve.frames_at(np.array([s]))[1][0], float(np.interp(s, member.curve.s, member.width))


def _length_beyond(member: Member, s: float) -> float:
    return np.inf if member.axis is None or member.axis.closed else min(s, member.length - s)


def _angle(a: Floats, b: Floats) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b))))


def with_ends(joints: Joints, owner: Ints, nodes: list[Node], surface: Surface) -> list[Member]:
    """Return the members with their field `ends`: the node or member at each end, "edge" or "free".
    owner   : (m, f) member that covers each cell, for each of f layers; -1 for none.    surface : before the cut."""
    members, parts = joints.members, joints.parts
    by_id = {member.id: member for member in members}
    nodes_on = stations_of_nodes(members, nodes)
    begins: dict[bytes, list[int]] = {}
    for k, part in enumerate(parts):
        if part.line and not part.line.closed:
            for point in part.line.points[[0, -1]]:
                begins.setdefault(point.tobytes(), []).append(k)
    boundary = surface.V[surface.edges.ends[surface.edges.boundary]]
    result = []
    for k, member in enumerate(members):
        line = parts[k].line
        if member.axis is None or line is None or line.closed:
            result.append(member)
            continue
        ends = []
        for s, side in ((0.0, 0), (member.length, -1)):
            name = _node_at(member, s, nodes_on[member.id], by_id)
            numbers = [*begins[line.points[side].tobytes()], *owner[line.cells[side]].tolist()]
            name = name or next((members[number].id for number in numbers if number not in (k, -1)), "")
            ends.append(name or _edge_or_free(line.points[side], boundary, 0.05 * member.mean_width))
        result.append(replace(member, ends=tuple(ends)))
    return result


def _node_at(member: Member, s: float, nodes_on: list[tuple[float, Node]], by_id: dict[str, Member]) -> str:
    place, node = min(nodes_on, key=lambda one: abs(one[0] - s), default=(0.0, None))
    if node is None:
        return ""
    neighbour = 1 - node.members.index(member.id)
    _, width = tangent_and_width(by_id[node.members[neighbour]], node.at[neighbour])
    return node.id if abs(place - s) < ENDS * width else ""


def _edge_or_free(point: Floats, boundary: Floats, tolerance: float) -> str:
    is_on_edge = len(boundary) and distances_from_segments(point, boundary[:, 0], boundary[:, 1]).min() < tolerance
    return "edge" if is_on_edge else "free"
