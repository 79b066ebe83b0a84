"""`MemberGraph`: the members of a design by their names, and the nodes at which they meet."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.members.axis import MemberAxis
from dsfab.members.bands import Kind
from dsfab.slicing import Sheet
from dsfab.surface import require_compas

if TYPE_CHECKING:
    import compas.datastructures

NodeKind = Literal["crossing", "branch", "end", "grazing"]

STUBS = 0.01
"""A larger share of the sheet in stubs is told."""


@dataclass(frozen=True, eq=False)
class Member:
    """A part of a sheet that a person can name.

    id     : "A07", "B12b", "rim 1": letters for the families, numbers along the structure, small letters for parts of
             one stripe that turns back or branches.
    kind   : strip, or stub if it is under twice as long as it is wide; rim and band along edges; ring and disc around
             what is kept; plate and fill without an axis.
    family : of the pattern: "major", "minor", "keep", "rim"; or "" for a fill.
    stripe : its number in the phase of the family, as most of it sees it.    part : 1, 2, ... of one stripe.
    cells  : (c,) of the graph's sheet, those below other members included.
    area   : of these, square metres.
    axis   : along its middle, or None.
    sides  : (k, 2) metres that it reaches to the left and to the right of each station of the axis; (0, 2) without.
    ends   : what is at its beginning and at its end: the name of a node, "edge" of the surface, "free"; none if closed.
    """

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
        lock(self, "sides", np.float64, (None, 2))

    @property
    def length(self) -> float:
        """Along its axis, metres; 0 without."""
        return self.axis.length if self.axis else 0.0

    @property
    def width(self) -> Floats:
        """(k,) at the stations of its axis, metres."""
        return np.asarray(self.sides.sum(axis=1))

    @property
    def mean_width(self) -> float:
        """Median over its axis, metres; the side of a square of the same area without one."""
        return float(np.median(self.width)) if self.axis else float(np.sqrt(self.area))


@dataclass(frozen=True, eq=False)
class Node:
    """Where two members are on each other.

    kind    : crossing, where both go on; branch, where one of them ends; end, where both do; grazing, where they share
              material but their middles do not meet.
    members : their names.    at : (2,) arc length along the axis of each, metres; NaN without an axis.
    angle   : between them, degrees, 0 to 90; NaN where one has no axis.
    point   : (3,) metres, and normal : (3,) of the surface there.    area : that both share, square metres.
    """

    id: str
    kind: NodeKind
    members: tuple[str, str]
    at: tuple[float, float]
    angle: float
    point: Floats
    normal: Floats
    area: float

    def __post_init__(self) -> None:
        lock(self, "point", np.float64, (3,))
        lock(self, "normal", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class MemberGraph:
    """All members and nodes of a design.

    sheet  : the kept sheet, its cells divided along the edges of members that lie below others as well. Every cell is
             in one member at least.
    source : (m,) the cell of the design's sheet that each cell is a part of.
    """

    sheet: Sheet
    source: Ints
    members: tuple[Member, ...]
    nodes: tuple[Node, ...]

    def __post_init__(self) -> None:
        lock(self, "source", np.int64, (self.sheet.surface.m,))

    @cached_property
    def by_id(self) -> dict[str, Member]:
        """The members by their names."""
        return {member.id: member for member in self.members}

    @cached_property
    def along(self) -> dict[str, tuple[Node, ...]]:
        """By the names of members, the nodes on each along its axis; those that graze it are left out."""
        found: dict[str, list[tuple[float, Node]]] = {member.id: [] for member in self.members}
        for node in self.nodes:
            if node.kind != "grazing":
                for name, s in zip(node.members, node.at, strict=True):
                    found[name].append((s, node))
        return {name: tuple(node for _, node in sorted(some, key=lambda one: one[0])) for name, some in found.items()}

    @cached_property
    def owner(self) -> Ints:
        """(m,) the number of the member that each cell of the sheet is counted with: the widest of those that it is in,
        of as wide ones the first. So all together have the area of the sheet."""
        found = np.full(self.sheet.surface.m, -1)
        for k in sorted(range(len(self.members)), key=lambda k: (self.members[k].mean_width, -k)):
            found[self.members[k].cells] = k
        return found

    def bays(self, name: str) -> Floats:
        """(b,) arc lengths from node to node along a member, metres; of a closed one the last goes on to the first."""
        axis, nodes = self.by_id[name].axis, self.along[name]
        if axis is None or not nodes:
            return np.empty(0)
        s = np.array([node.at[node.members.index(name)] for node in nodes])
        return np.diff(s, append=s[0] + axis.length) if axis.closed else np.diff(s)

    def to_compas(self) -> "compas.datastructures.Graph":
        """Nodes with x, y, z, metres, and an edge for each bay with its `member` and its `length` along the axis.

        Raises SurfaceError where compas is not installed.
        """
        return _compas_graph(self)

    @cached_property
    def stub_share(self) -> float:
        """Share of the sheet's area in members that are under twice as long as they are wide."""
        return sum(member.area for member in self._of_kind("stub")) / self.sheet.surface.area

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what a person should know before building these members."""
        found = []
        stubs, grazing = self._of_kind("stub"), [node for node in self.nodes if node.kind == "grazing"]
        if self.stub_share > STUBS:
            found.append(
                f"{len(stubs)} stubs, under twice as long as they are wide, hold {self.stub_share:.1%} of the sheet"
            )
        if grazing:
            found.append(f"{len(grazing)} overlaps are no nodes: members graze there, and their middles do not meet")
        return tuple(found)

    def _of_kind(self, kind: Kind) -> list[Member]:
        return [member for member in self.members if member.kind == kind]


def _compas_graph(graph: MemberGraph) -> "compas.datastructures.Graph":
    """The nodes at which members meet, and their bays as edges; see `MemberGraph.to_compas`.

    Where two bays join the same two nodes, the edge is of the shorter: a graph has one edge between two nodes.
    """
    require_compas()
    from compas.datastructures import Graph

    made = Graph(name="members")
    for node in graph.nodes:
        x, y, z = node.point.tolist()
        facts = {"kind": node.kind, "members": list(node.members), "angle": node.angle}
        made.add_node(node.id, x=x, y=y, z=z, attr_dict=facts)
    for member in graph.members:
        nodes = graph.along[member.id]
        after = (*nodes[1:], nodes[0]) if nodes and member.axis and member.axis.closed else nodes[1:]
        for bay, (one, other) in zip(graph.bays(member.id).tolist(), zip(nodes, after, strict=False), strict=False):
            known = made.edge_attribute((one.id, other.id), "length") if made.has_edge((one.id, other.id)) else None
            if one.id != other.id and (known is None or bay < known):
                made.add_edge(one.id, other.id, attr_dict={"member": member.id, "length": bay})
    return made
