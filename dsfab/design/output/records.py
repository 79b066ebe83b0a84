"""Plain records of a design for files: members, nodes, beam model, section forces and utilisation."""

from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.units import MM_PER_M
from dsfab.design import Design
from dsfab.export import MemberShape
from dsfab.members import Member, MemberAxis, MemberGraph, Node
from dsfab.surface import Surface
from dsfab.thickening import SHIFT, closed_skin, offsets

LENGTH_DIGITS, CURVATURE_DIGITS = 4, 9
"""Decimals of millimetres, and of directions and curvatures per metre."""


def graph_records(graph: MemberGraph) -> dict[str, Any]:
    """Return notes, members and nodes of a graph, for a file."""
    return {
        "notes": list(graph.notes),
        "members": [_member(graph, member) | _area_counts(graph, k) for k, member in enumerate(graph.members)],
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
        "nodes": [node.id for node in graph.nodes_along[member.id]],
        "bays": _rounded_lists(MM_PER_M * graph.bays(member.id)),
        "axis": _axis(member.axis, member.sides) if member.axis else None,
    }


def _area_counts(graph: MemberGraph, k: int) -> dict[str, Any]:
    """Return the area of a member without the parts counted with members that cross it, and the names of these."""
    cells = graph.members[k].cells
    owner = graph.owner[cells]
    own_area = float(graph.sheet.surface.areas[cells[owner == k]].sum())
    crossing = [graph.members[index].id for index in np.unique(owner).tolist() if index != k]
    return {"own_area": round(MM_PER_M**2 * own_area, 1), "counted_with": crossing}


def _axis(axis: MemberAxis, sides: Floats) -> dict[str, Any]:
    metres = {"s": axis.s, "points": axis.P, "left": sides[:, 0], "right": sides[:, 1]}
    lengths = {name: _rounded_lists(MM_PER_M * values) for name, values in metres.items()}
    directions = {"normals": _rounded_lists(axis.N, CURVATURE_DIGITS)}
    return (
        lengths
        | directions
        | {name: _rounded_lists(getattr(axis, name), CURVATURE_DIGITS) for name in ("kg", "kn", "tg")}
    )


def _node(node: Node) -> dict[str, Any]:
    return {
        "id": node.id,
        "kind": node.kind,
        "members": list(node.members),
        "at": [_mm(s) for s in node.at],
        "angle": _number(node.angle, 3),
        "area": round(MM_PER_M**2 * node.area, 1),
        "point": _rounded_lists(MM_PER_M * node.point),
        "normal": _rounded_lists(node.normal, CURVATURE_DIGITS),
    }


def _mm(metres: float) -> float | None:
    return _number(MM_PER_M * metres, LENGTH_DIGITS)


def _number(value: float, digits: int) -> float | None:
    return None if np.isnan(value) else round(value, digits) + 0.0


def _rounded_lists(values: Floats, digits: int = LENGTH_DIGITS) -> list[Any]:
    lists: list[Any] = (values.round(digits) + 0.0).tolist()
    return lists


PLATES = ("disc", "plate", "fill")
"""Kinds of members that are not long and narrow."""


def member_shapes(design: Design) -> tuple[MemberShape, ...]:
    """Return bodies of the members, metres, in the order of their names.

    Members overlap at crossings, so that all bodies together exceed the solid's volume; `own_area` of the records
    counts each area once.
    """
    sheet, options = design.members.sheet, design.preset.thickening
    offset = offsets(design.surface, design.preset.statics.thickness, options.side)
    D = sheet.carry_corners(offset.at_corners(design.surface.F), design.surface.F)
    return tuple(_shape(sheet.surface, D, member, SHIFT[options.side]) for member in design.members.members)


def _shape(surface: Surface, D: Floats, member: Member, shift: int) -> MemberShape:
    used, F = np.unique(surface.F[member.cells], return_inverse=True)
    piece = Surface(surface.V[used], F.reshape(-1, 3))
    V, faces = closed_skin(piece, D[used], shift)
    axis = member.axis.P if member.axis else np.zeros((0, 3))
    edges = tuple(piece.V[np.append(loop, loop[0])] for loop in piece.loops)
    return MemberShape(member.id, member.family or member.kind, V, faces, axis, edges, member.kind in PLATES)
