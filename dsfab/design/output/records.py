"""Plain records of a design for files: members, nodes, beam model, section forces and utilisation."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.materials import MATERIALS
from dsfab.core.units import MM_PER_M
from dsfab.design import Design
from dsfab.export import MemberShape
from dsfab.members import Member, MemberAxis, MemberGraph, Node
from dsfab.statics import CONVENTION, SectionForces
from dsfab.surface import Surface
from dsfab.thickening import SHIFT, closed_skin, offsets

if TYPE_CHECKING:
    from dsfab.members.eurocode import Utilisation
    from dsfab.members.frame import Frame


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
    """Return the area of a member without crossings that count for other members, and the names of those members."""
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


def beam_records(design: Design) -> dict[str, Any]:
    """Return `frame_records` of a design with `actions` by case, `description`, and `told`: sentences on agreement of
    beams and sheet.

    Raises StaticsError if no member has an axis, or if nothing carries a load.
    """
    return frame_records(design.frame) | {
        "actions": dict(design.frame.actions),
        "description": design.preset.description,
        "told": [agreement.summary for agreement in design.frame_agreement()],
    }


def frame_records(frame: "Frame") -> dict[str, Any]:
    """Return `frame`, columns of the beam model (see `dsfab.members.frame.Frame`), and `material`."""
    named = MATERIALS.get(frame.material.name)
    names = (
        *("points", "nodes", "ends", "width", "thickness", "eccentricity", "length", "fixed", "spring"),
        *("area", "inertia", "shear_area"),
    )
    return {
        "frame": {name: getattr(frame, name) for name in names}
        | {
            "z": frame.axes[:, 2],
            "member": [frame.members[k] if k >= 0 else "" for k in frame.member],
            "loads": dict(frame.loads),
            "combinations": {name: dict(factors) for name, factors in frame.combinations.items()},
        },
        "material": {
            "name": frame.material.name,
            "young": frame.material.young,
            "shear": frame.material.shear,
            "poisson": frame.material.poisson,
            "density": frame.material.density,
            "expansion": named.expansion if named else None,
        },
    }


COLUMNS = ("N [N]", "Vy [N]", "Vz [N]", "Mt [N m]", "My [N m]", "Mz [N m]")


def bar_records(design: Design) -> dict[str, Any]:
    """Return `bars` by member, and `columns`, the names of the six forces.

    Each has `bay` (k,), the place `s` (k,) along the axis, and `forces` (k, 6) by case and combination, with the
    `least` and the `greatest` of several.

    Raises StaticsError if the cut sheet does not carry its loads.
    """
    bars = {}
    for name, forces in design.member_forces.items():
        least, greatest = np.moveaxis(forces.envelope, -1, 0)
        several = {"least": least, "greatest": greatest} if len(forces.forces) > 1 else {}
        bars[name] = {"bay": list(forces.bay), "s": forces.s, "forces": {**forces.forces, **several}}
    return {"bars": bars, "columns": list(COLUMNS)}


def utilisation_records(design: Design) -> dict[str, Any]:
    """Return `utilisation` of a design, for a file.

    `rows` by bay, worst first: `member`, `bay`, numbers and words as in `export.utilisation`; `checks`, names with
    clauses; `standard`, `assumed`, `unchecked`, sentences; `told`, the worst of all.

    Raises StaticsError if neither the material nor a strength is set, or if nothing carries a load.
    """
    return utilisation_rows(design.member_utilisation)


def utilisation_rows(utilisation: "Utilisation") -> dict[str, Any]:
    """Return `utilisation_records` of a computed utilisation."""
    bays, rows = utilisation.bays, []
    for bay in utilisation.order.tolist():
        check, case, station = utilisation.governing(bay)
        rows.append(
            {
                "member": bays.member[bay],
                "bay": bays.name[bay],
                "utilisation": float(utilisation.largest[bay]),
                "check": check.name,
                "clause": check.clause,
                "case": case,
                "along": float(bays.s[bay, station]),
                "width": float(bays.width[bay, station]),
                "length": float(bays.length[bay]),
                "forces": bays.forces[case][bay, station],
                "each": utilisation.worst[bay],
            }
        )
    words = {"standard": utilisation.standard, "assumed": utilisation.assumed, "unchecked": utilisation.unchecked}
    facts = {"rows": rows, "checks": [str(check) for check in utilisation.checks], "thickness": bays.thickness}
    return {"utilisation": {**words, **facts, "told": [utilisation.summary]}, "columns": list(COLUMNS)}


def force_records(design: Design) -> dict[str, Any]:
    """Return section forces of a design, for a file.

    `convention`, lines of text; `faces`, columns (m,) or (m, 3); `cases`, by name, the columns of each load case and
    combination.

    Raises StaticsError if the cut sheet does not carry its loads.
    """
    forces_by_case = design.section_forces
    surface, first_case = design.sheet.surface, next(iter(forces_by_case.values()))
    faces = {
        "centre [m]": surface.centroids,
        "area [m2]": surface.areas,
        "local x [1]": first_case.frame[:, 0],
        "local y [1]": first_case.frame[:, 1],
        "normal [1]": surface.normals,
    }
    return {
        "convention": list(CONVENTION),
        "faces": faces,
        "cases": {name: _columns(forces) for name, forces in forces_by_case.items()},
    }


def _columns(forces: SectionForces) -> dict[str, Floats]:
    columns: dict[str, Floats] = {}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        for index, axes in enumerate(("x", "y", "xy")):
            columns[f"{name}_{axes} [{unit}]"] = getattr(forces, name)[:, index]
    columns |= {f"q_{axis} [N/m]": np.asarray(forces.q[:, index]) for index, axis in enumerate("xy")}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        values, angle, direction = forces.principal(name)
        columns |= {f"{name}_{index} [{unit}]": np.asarray(values[:, index - 1]) for index in (1, 2)}
        columns[f"{name}_1 from local x [degrees]"] = angle
        columns[f"{name}_1 direction [1]"] = direction
    return columns
