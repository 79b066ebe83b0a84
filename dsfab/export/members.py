"""Facts about members and nodes for files: texts, and rounded lengths in millimetres."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.units import MM_PER_M
from dsfab.export.part import Part

if TYPE_CHECKING:
    from dsfab.members import Member, MemberAxis, MemberGraph, Node

LENGTH_DIGITS, CURVATURE_DIGITS = 4, 9  # decimals of lengths (mm), and of directions and curvatures (1/m)


@dataclass(frozen=True)
class MemberFacts:
    """A member for files: lengths in mm, areas in mm2, names of nodes. counted_with : names of crossing members.
    own_area : area without overlaps that count as area of the members in `counted_with`."""

    member: "Member"
    length: float
    width: float
    area: float
    own_area: float
    counted_with: tuple[str, ...]
    nodes: tuple[str, ...]

    @property
    def words(self) -> dict[str, str]:
        """Facts as texts, by the name of the fact, for CAD files."""
        facts = {key: str(getattr(self.member, key)) for key in ("kind", "family", "stripe")}
        facts = {key: text for key, text in facts.items() if text}
        facts |= {"length_mm": f"{self.length:.1f}", "width_mm": f"{self.width:.1f}"}
        if self.member.ends:
            facts |= {"start": self.member.ends[0], "end": self.member.ends[1]}
        return facts | ({"nodes": " ".join(self.nodes)} if self.nodes else {})


def graph_of(part: Part) -> "MemberGraph":
    assert part.details.members is not None
    return part.details.members


def facts_of_members(part: Part) -> dict[str, MemberFacts]:
    graph, is_whole = graph_of(part), part.details.whole_members
    return {member.id: _facts(graph, k, is_whole) for k, member in enumerate(graph.members)}


def _facts(graph: "MemberGraph", k: int, is_whole: bool) -> MemberFacts:
    member, owner = graph.members[k], graph.owner[graph.members[k].cells]
    area, crossing = _square_mm(member.area), np.unique(owner[owner != k]).tolist()
    own_area = _square_mm(float(graph.sheet.surface.areas[member.cells[owner == k]].sum()))
    return MemberFacts(
        member,
        rounded_mm(member.length),
        rounded_mm(member.mean_width),
        area,
        area if is_whole else own_area,
        () if is_whole else tuple(graph.members[index].id for index in crossing),
        tuple(node.id for node in graph.nodes_along[member.id]),
    )


def member_entries(part: Part) -> list[dict[str, Any]]:
    """Return a dictionary of facts for each member of a part, for a JSON file."""
    return [_member_entry(graph_of(part), facts) for facts in facts_of_members(part).values()]


def _member_entry(graph: "MemberGraph", facts: MemberFacts) -> dict[str, Any]:
    member = facts.member
    width = member.width if member.axis else np.array([member.mean_width])
    return {
        **{key: getattr(member, key) for key in ("id", "kind", "family", "stripe", "part")},
        "closed": bool(member.axis and member.axis.closed),
        "length": facts.length,
        "area": facts.area,
        "width": {
            "median": facts.width,
            "least": rounded_mm(float(width.min())),
            "greatest": rounded_mm(float(width.max())),
        },
        "ends": list(member.ends),
        "nodes": list(facts.nodes),
        "bays": rounded_lists(MM_PER_M * graph.bays(member.id)),
        "axis": _axis(member.axis, member.sides) if member.axis else None,
        "own_area": facts.own_area,
        "counted_with": list(facts.counted_with),
    }


def _axis(axis: "MemberAxis", sides: Floats) -> dict[str, Any]:
    metres = {"s": axis.s, "points": axis.P, "left": sides[:, 0], "right": sides[:, 1]}
    others = {"normals": axis.N, "kg": axis.kg, "kn": axis.kn, "tg": axis.tg}
    return {name: rounded_lists(MM_PER_M * values) for name, values in metres.items()} | {
        name: rounded_lists(values, CURVATURE_DIGITS) for name, values in others.items()
    }


def node_entry(node: "Node") -> dict[str, Any]:
    """Return a dictionary of facts about a node, for a JSON file."""
    return {
        "id": node.id,
        "kind": node.kind,
        "members": list(node.members),
        "at": [None if np.isnan(s) else rounded_mm(s) for s in node.at],
        "angle": None if np.isnan(node.angle) else round(node.angle, 3) + 0.0,
        "area": _square_mm(node.area),
        "point": rounded_lists(MM_PER_M * node.point),
        "normal": rounded_lists(node.normal, CURVATURE_DIGITS),
    }


def rounded_mm(metres: float) -> float:
    """Convert a length from metres to millimetres, and round it for files."""
    return round(MM_PER_M * metres, LENGTH_DIGITS) + 0.0


def rounded_lists(values: Floats, digits: int = LENGTH_DIGITS) -> list[Any]:
    """Convert an array to nested lists of numbers with `digits` decimals, for files."""
    lists: list[Any] = (values.round(digits) + 0.0).tolist()
    return lists


def _square_mm(square_metres: float) -> float:
    return round(MM_PER_M**2 * square_metres, 1)
