"""Drawings in the format DXF (R2010)."""

import io
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.core.units import MM_PER_M
from dsfab.export.curves import (
    Curve,
    chains,
    check_curves,
    curve_tolerance,
    curves_along,
    joined_segments,
    sample_parameters,
)
from dsfab.export.drawing.views import DrawingView, views
from dsfab.export.members import graph_of, rounded_lists
from dsfab.export.part import MemberShape, Part
from dsfab.export.readback import ReadBack, require_equal
from dsfab.export.writing import one_line
from dsfab.surface import StructureLine, polyline_length, simplified_line

APPLICATION = "DSFAB"
COLOURS = {"major": 5, "minor": 1, "keep": 3, "rim": 4, "boundary": 7}
"""Colour number of each family of lines in the AutoCAD palette: blue, red, green, cyan; black on white paper."""
WEIGHTS = {"boundary": 50, "edge": 25, "centre": 13}  # widths of lines, in hundredths of a millimetre


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a DXF drawing of a part's lines."""
    with reproducible_output():
        document = new_document(part)
        space = document.modelspace()
        flat = bool((part.V[:, 2] == part.V[0, 2]).all())
        for line, chain in zip(part.details.lines, chains(part), strict=True):
            for entity in add_curves(space, chain, flat, _layer(document, line)):
                entity.set_xdata(APPLICATION, [(1000, line.id), (1040, line.length)])
        if not flat:
            _add_views(document, part)
        data = dxf_bytes(document)
    yield data


def new_document(part: Part) -> Any:
    """Return a new ezdxf drawing in millimetres, without lines."""
    import ezdxf

    document = ezdxf.new("R2010", setup=["linetypes"])
    document.header["$INSUNITS"], document.header["$MEASUREMENT"] = 4, 1
    document.header["$LWDISPLAY"] = 1
    document.header["$LTSCALE"] = float(np.ptp(part.box, axis=0).max()) / 1000
    document.header.custom_vars.append("program", f"dsfab {__version__}")
    document.header.custom_vars.append("unit", "millimetre")
    document.header.custom_vars.append("curves within", f"{curve_tolerance(part):.2g} mm")
    document.appids.add(APPLICATION)
    return document


def dxf_bytes(document: Any) -> bytes:
    """Return the bytes of an ezdxf document as a file."""
    document.classes.add_required_classes(document.dxfversion)
    document.classes.classes = dict(sorted(document.classes.classes.items()))  # ezdxf adds classes in any order
    text = io.StringIO()
    document.write(text)
    return text.getvalue().encode(document.output_encoding, errors="dxfreplace")


def _add_views(document: Any, part: Part) -> None:
    gap = 0.15 * float(np.ptp(part.box, axis=0).max())
    position = np.array([part.box[1, 0] + 3 * gap, part.box[0, 1]])
    for view in views(part):
        _add_view(document, view, position - view.low, gap / 5, part.details.tolerance, one_line(part.name))
        position = position + [view.extent[0] + 2 * gap, 0.0]


def add_curves(space: Any, chain: list[Curve], flat: bool, layer: str) -> Iterator[Any]:
    """Add the curves of a line to a DXF drawing, and yield the new entities."""
    for run in joined_segments(chain):
        if isinstance(run, Curve):
            poles, knots = run.poles.tolist(), run.knots.tolist()
            yield space.add_open_spline(poles, run.degree, knots, dxfattribs={"layer": layer})
        else:
            yield add_polyline(space, run, flat, layer)


def _add_view(document: Any, view: DrawingView, shift: Floats, height: float, tolerance: float, name: str) -> None:
    space, prefix = document.modelspace(), view.title.split()[0].upper() + "-"
    for line, run in view.runs:
        run = simplified_line(run, tolerance)
        add_polyline(space, np.c_[run + shift, np.zeros(len(run))], True, _layer(document, line, prefix))
    if prefix + "TEXT" not in document.layers:
        document.layers.add(prefix + "TEXT")
    text = space.add_text(f"{name}: {view.title.lower()}", height=height, dxfattribs={"layer": prefix + "TEXT"})
    text.set_placement(tuple(view.low + shift - [0.0, 2.5 * height]))


def add_polyline(space: Any, points: Floats, flat: bool, layer: str) -> Any:
    """Add a polyline (k, 3) to a DXF drawing, and return its entity. flat : True if all points have the same z."""
    closed = len(points) > 2 and bool((points[0] == points[-1]).all())
    points = points[:-1] if closed else points
    if not flat:
        return space.add_polyline3d(points.tolist(), close=closed, dxfattribs={"layer": layer})
    attributes = {"layer": layer, "elevation": float(points[0, 2])}
    return space.add_lwpolyline(points[:, :2].tolist(), close=closed, dxfattribs=attributes)


def _layer(document: Any, line: StructureLine, prefix: str = "") -> str:
    name = prefix + line.layer.upper()
    if name not in document.layers:
        weight = WEIGHTS.get(line.family, WEIGHTS[line.kind])
        style = "CENTER" if line.kind == "centre" else "CONTINUOUS"
        document.layers.add(name, color=COLOURS.get(line.family, 7), linetype=style, lineweight=weight)
    return name


@contextmanager
def reproducible_output() -> Iterator[None]:
    """Stop ezdxf from writing dates and random identifiers in this context."""
    import ezdxf

    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def check(part: Part, path: Path) -> ReadBack:
    """Read the file back, and compare its unit and lines with the part."""
    document = _sound_document(part, path, ".svg or .csv")
    points_by_line = defaultdict[str, list[Floats]](list)
    for entity in document.modelspace():
        if entity.has_xdata(APPLICATION):
            points_by_line[entity.get_xdata(APPLICATION)[0].value].append(points_along(entity))
    return check_curves(part, points_by_line)


def _sound_document(part: Part, path: Path, instead: str) -> Any:
    import ezdxf

    document = ezdxf.readfile(path)
    errors = document.audit().errors
    if errors or document.header["$INSUNITS"] != 4:
        raise ExportError(f"the DXF file of {part.name!r} has {len(errors)} errors; write {instead} instead")
    return document


def points_along(entity: Any) -> Floats:
    """Return points (k, 3) along a DXF spline or polyline. A closed polyline repeats its first point."""
    if entity.dxftype() == "SPLINE":
        curve = entity.construction_tool()
        return np.array([tuple(point) for point in curve.points(sample_parameters(np.array(entity.knots)))])
    if entity.dxftype() == "LWPOLYLINE":
        flat = np.array([point[:2] for point in entity.get_points()])
        points = np.c_[flat, np.full(len(flat), entity.dxf.elevation)]
    else:
        points = np.array([tuple(vertex.dxf.location) for vertex in entity.vertices])
    return np.concatenate([points, points[:1]]) if entity.is_closed else points


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a DXF drawing of a part's members, with a group for each member."""
    with reproducible_output():
        document = new_document(part)
        space = document.modelspace()
        height = 0.008 * float(np.ptp(part.box, axis=0).max())  # height of letters
        for shape in part.details.shapes:
            entities = list(_member(document, shape, curve_tolerance(part), height))
            for entity in entities:
                entity.set_xdata(APPLICATION, [(1000, shape.id)])
            document.groups.new(shape.id, description=f"member {shape.id}").set_data(entities)
        for node in graph_of(part).nodes:
            place, layer = rounded_lists(MM_PER_M * node.point), _members_layer(document, "", "NODES")
            space.add_point(place, dxfattribs={"layer": layer}).set_xdata(APPLICATION, [(1000, node.id)])
        data = dxf_bytes(document)
    yield data


def _member(document: Any, shape: MemberShape, tolerance: float, height: float) -> Iterator[Any]:
    space = document.modelspace()
    for line in shape.edges:
        layer = _members_layer(document, shape.layer, "EDGES")
        yield add_polyline(space, simplified_line(line, tolerance), False, layer)
    place = shape.edges[0].mean(axis=0)
    if len(shape.axis):
        layer = _members_layer(document, shape.layer, "AXES")
        yield from add_curves(space, curves_along(shape.axis, tolerance), False, layer)
        place = shape.axis[len(shape.axis) // 2]
    text = space.add_text(shape.id, height=height, dxfattribs={"layer": _members_layer(document, shape.layer, "NAMES")})
    text.set_placement(tuple(place.tolist()))
    yield text


def _members_layer(document: Any, family: str, what: str) -> str:
    name = f"{family.upper()}-{what}" if family else what
    if name not in document.layers:
        style = "CENTER" if what == "AXES" else "CONTINUOUS"
        document.layers.add(name, color=COLOURS.get(family, 8), linetype=style)
    return name


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back, and compare its unit and the lines of each member with the part."""
    document = _sound_document(part, path, ".members.json")
    groups, shapes = {name: list(group) for name, group in document.groups}, part.details.shapes
    require_equal(part, "members", sorted(shape.id for shape in shapes), sorted(groups))
    total = total_expected = 0.0
    for shape in shapes:
        lines = defaultdict[bool, list[Floats]](list)
        for entity in groups[shape.id]:
            if entity.dxftype() != "TEXT":
                lines[entity.dxf.layer.endswith("AXES")].append(points_along(entity))
        length_read = sum(map(polyline_length, (*lines[True], *lines[False])))
        length_expected = polyline_length(shape.axis) + sum(map(polyline_length, shape.edges))
        if not abs(length_read - length_expected) <= 10 * READ_BACK * length_expected:
            raise ExportError(
                f"the lines of {shape.id} in {part.name!r} differ when the file is read back; write .members.json"
            )
        total, total_expected = total + length_read, total_expected + length_expected
    return ReadBack(len(shapes), "members", total / total_expected - 1, "length")
