"""What files of members hold, in millimetres, and what another reader must find in them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.member_shape import MemberShape
from dsfab.export.part import Part, in_single_precision, open_edges
from dsfab.export.readback import ReadBack, differs
from dsfab.limits import READ_BACK
from dsfab.surface import signed_volume

COLOURS = {"major": (31, 78, 156), "minor": (179, 38, 30), "keep": (46, 125, 50), "rim": (0, 121, 134)}
"""Of layers; others are grey."""
GREY = (120, 120, 120)


def with_shapes(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without members."""
    if not part.details.shapes:
        raise ExportError(f"{part.name!r} has no members to write; only a design knows them: use design.write(...)")
    return part


def with_single_shapes(part: Part) -> Part:
    """The part with its members in single precision."""
    return replace(with_shapes(part), details=replace(part.details, shapes=tuple(map(_single, part.details.shapes))))


def _single(shape: MemberShape) -> MemberShape:
    held = in_single_precision(Part(shape.V, shape.F, shape.id, is_solid=True))
    return replace(shape, V=held.V, F=held.F)


def member_entries(part: Part) -> dict[str, Mapping[str, Any]]:
    """What is known of each member, by its name (see `dsfab.delivery.member_records`), millimetres."""
    return {entry["id"]: entry for entry in part.details.records["members"]}


def member_facts(entry: Mapping[str, Any]) -> dict[str, str]:
    """What an object of a drawing program may say of itself."""
    facts = {key: str(entry[key]) for key in ("kind", "family", "stripe") if entry[key] != ""}
    facts |= {"length_mm": f"{entry['length']:.1f}", "width_mm": f"{entry['width']['median']:.1f}"}
    if entry["ends"]:
        facts |= {"start": entry["ends"][0], "end": entry["ends"][1]}
    return facts | ({"nodes": " ".join(entry["nodes"])} if entry["nodes"] else {})


def layer_colour(layer: str) -> tuple[int, int, int]:
    """Red, green, blue of 255."""
    return COLOURS.get(layer, GREY)


def check_shapes(part: Part, found: Mapping[str, tuple[Floats, Ints]]) -> ReadBack:
    """What was found; raises ExportError unless these are the part's members by name, each V (n, 3), millimetres, and
    F (m, 3) closed, of as many triangles, at its place, with its volume to 0.1 %."""
    shapes = part.details.shapes
    if [shape.id for shape in shapes] != list(found):
        raise differs(part, "members", len(shapes), len(found))
    total = there = 0.0
    for shape in shapes:
        V, F = found[shape.id]
        if len(F) != len(shape.F) or open_edges(F):
            raise differs(part, f"triangles in {shape.id}", len(shape.F), len(F))
        one, other = (signed_volume(*mesh) for mesh in ((shape.V, shape.F), (V, F)))
        size = float(np.ptp(shape.V, axis=0).max())
        moved = float(np.abs(V[F].mean(axis=(0, 1)) - shape.V[shape.F].mean(axis=(0, 1))).max())
        if not (abs(one - other) <= READ_BACK * one and moved <= READ_BACK * size):
            raise ExportError(f"the member {shape.id} of {part.name!r} reads back changed; write .members.json instead")
        total, there = total + one, there + other
    return ReadBack(len(found), "members", there / total - 1)
