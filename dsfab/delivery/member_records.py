"""The members and nodes of a design as plain records for files: lengths in millimetres, curvatures per metre."""

from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import Member, MemberAxis, MemberGraph, Node
from dsfab.units import MM_PER_M

DIGITS, CURVATURE = 4, 9
"""Decimals of millimetres, and of curvatures per metre."""


def graph_records(graph: MemberGraph) -> dict[str, Any]:
    """What a file says of a graph: notes, members and nodes."""
    return {
        "notes": list(graph.notes),
        "members": [_member(graph, member) | _counted(graph, k) for k, member in enumerate(graph.members)],
        "nodes": [_node(node) for node in graph.nodes],
    }


def _member(graph: MemberGraph, member: Member) -> dict[str, Any]:
    width = member.width if member.axis else np.array([member.mean_width])
    return {
        "id": member.id,
        "kind": member.kind,
        "family": member.family,
        "stripe": member.stripe,
        "part": member.part,
        "closed": bool(member.axis and member.axis.closed),
        "length": _mm(member.length),
        "area": round(MM_PER_M**2 * member.area, 1),
        "width": {
            "median": _mm(member.mean_width),
            "least": _mm(float(width.min())),
            "greatest": _mm(float(width.max())),
        },
        "ends": list(member.ends),
        "nodes": [node.id for node in graph.along[member.id]],
        "bays": _rounded(MM_PER_M * graph.bays(member.id)),
        "axis": _axis(member.axis, member.sides) if member.axis else None,
    }


def _counted(graph: MemberGraph, k: int) -> dict[str, Any]:
    """Of the area of a member what it does not leave to those that cross it, and who these are."""
    cells = graph.members[k].cells
    owner = graph.owner[cells]
    own = float(graph.sheet.surface.areas[cells[owner == k]].sum())
    others = [graph.members[other].id for other in np.unique(owner).tolist() if other != k]
    return {"own_area": round(MM_PER_M**2 * own, 1), "counted_with": others}


def _axis(axis: MemberAxis, sides: Floats) -> dict[str, Any]:
    """Station by station."""
    metres = {"s": axis.s, "points": axis.P, "left": sides[:, 0], "right": sides[:, 1]}
    lengths = {name: _rounded(MM_PER_M * values) for name, values in metres.items()}
    directions = {"normals": _rounded(axis.N, CURVATURE)}
    return lengths | directions | {name: _rounded(getattr(axis, name), CURVATURE) for name in ("kg", "kn", "tg")}


def _node(node: Node) -> dict[str, Any]:
    return {
        "id": node.id,
        "kind": node.kind,
        "members": list(node.members),
        "at": [_mm(s) for s in node.at],
        "angle": _number(node.angle, 3),
        "area": round(MM_PER_M**2 * node.area, 1),
        "point": _rounded(MM_PER_M * node.point),
        "normal": _rounded(node.normal, CURVATURE),
    }


def _mm(metres: float) -> float | None:
    return _number(MM_PER_M * metres, DIGITS)


def _number(value: float, digits: int) -> float | None:
    """None where there is none."""
    return None if np.isnan(value) else round(value, digits) + 0.0


def _rounded(values: Floats, digits: int = DIGITS) -> list[Any]:
    """As lists, without negative zeros."""
    found: list[Any] = (values.round(digits) + 0.0).tolist()
    return found
