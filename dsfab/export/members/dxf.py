"""DXF (R2010): axis, outline and name of each member as a group that has its name, on layers by family.

Layers: MAJOR-AXES, MAJOR-EDGES, MAJOR-NAMES ..., and NODES for points. Everything has the member's name as extended
data of the application DSFAB. Millimetres.
"""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import ExportError
from dsfab.export.along import curves_along, within
from dsfab.export.dxf import (
    APPLICATION,
    COLOURS,
    drawn_curves,
    drawn_polyline,
    dxf_bytes,
    new_document,
    points_along,
    same_bytes,
)
from dsfab.export.member_shape import MemberShape
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.limits import READ_BACK
from dsfab.surface import polyline_length, simplified_line

LETTER = 0.008
"""Height of names, as a share of the longest side of the structure."""


def encode(part: Part) -> Iterator[bytes]:
    """The drawing as text; no date and no random identifier in it."""
    with same_bytes():
        document = new_document(part)
        space = document.modelspace()
        height = LETTER * float(np.ptp(part.box, axis=0).max())
        for shape in part.details.shapes:
            made = list(_member(document, shape, within(part), height))
            for entity in made:
                entity.set_xdata(APPLICATION, [(1000, shape.id)])
            document.groups.new(shape.id, description=f"member {shape.id}").set_data(made)
        for node in part.details.records["nodes"]:
            point = space.add_point(node["point"], dxfattribs={"layer": _layer(document, "", "NODES")})
            point.set_xdata(APPLICATION, [(1000, node["id"])])
        data = dxf_bytes(document)
    yield data


def _member(document: Any, shape: MemberShape, tolerance: float, height: float) -> Iterator[Any]:
    """The entities of a member."""
    space = document.modelspace()
    for line in shape.edges:
        layer = _layer(document, shape.layer, "EDGES")
        yield drawn_polyline(space, simplified_line(line, tolerance), False, layer)
    place = shape.edges[0].mean(axis=0)
    if len(shape.axis):
        yield from drawn_curves(
            space, curves_along(shape.axis, tolerance), False, _layer(document, shape.layer, "AXES")
        )
        place = shape.axis[len(shape.axis) // 2]
    text = space.add_text(shape.id, height=height, dxfattribs={"layer": _layer(document, shape.layer, "NAMES")})
    text.set_placement(tuple(place.tolist()))
    yield text


def _layer(document: Any, family: str, what: str) -> str:
    name = f"{family.upper()}-{what}" if family else what
    if name not in document.layers:
        style = "CENTER" if what == "AXES" else "CONTINUOUS"
        document.layers.add(name, color=COLOURS.get(family, 8), linetype=style)
    return name


def check(part: Part, path: Path) -> ReadBack:
    """Read back by ezdxf with its auditor: no error, millimetres, a group for each member with its axis and edges."""
    import ezdxf

    document = ezdxf.readfile(path)
    errors = document.audit().errors
    if errors or document.header["$INSUNITS"] != 4:
        raise ExportError(f"the DXF file of {part.name!r} has {len(errors)} errors; write .members.json instead")
    groups, shapes = {name: list(group) for name, group in document.groups}, part.details.shapes
    if sorted(groups) != sorted(shape.id for shape in shapes):
        raise differs(part, "members", len(shapes), len(groups))
    total = wanted = 0.0
    for shape in shapes:
        lines = defaultdict[bool, list[Floats]](list)
        for entity in groups[shape.id]:
            if entity.dxftype() != "TEXT":
                lines[entity.dxf.layer.endswith("AXES")].append(points_along(entity))
        found = sum(map(polyline_length, (*lines[True], *lines[False])))
        there = polyline_length(shape.axis) + sum(map(polyline_length, shape.edges))
        if not abs(found - there) <= 10 * READ_BACK * there:
            raise ExportError(
                f"the lines of {shape.id} in {part.name!r} read back changed; write .members.json instead"
            )
        total, wanted = total + found, wanted + there
    return ReadBack(len(shapes), "members", total / wanted - 1, "length")
