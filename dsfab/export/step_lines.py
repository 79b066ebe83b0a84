"""Stripe edges and centre lines as curves in STEP, `NAME.lines.step`: to rebuild a design, not to receive its faces.

Each line is lines and cubic splines within the tolerance of the lines, one curve between sharp turns, and a composite
curve where there are several. Its name is its id, which names its family, and its length; families are layers with
their colours. Millimetres.
"""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.errors import ExportError
from dsfab.export.curves import SHARP, Curve, fitted, halves
from dsfab.export.part import Part
from dsfab.export.plate_text import Entities, curve_entity
from dsfab.export.readback import TOLERANCE, differs, with_lines
from dsfab.export.step import inspection
from dsfab.export.step_pieces import quoted
from dsfab.export.step_text import header
from dsfab.surface.lines import Line, polyline_length

COLOURS = {"major": (0.12, 0.31, 0.61), "minor": (0.70, 0.15, 0.12), "keep": (0.18, 0.49, 0.20), "rim": (0, 0.47, 0.53)}
"""By family; others are black."""
CLOSEST = 1e-3
"""Millimetres: curves are not asked to be nearer than this when the lines are exact."""
AXES = np.eye(3)


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it has no lines."""
    return with_lines(part, ".lines.step")


def encode(part: Part) -> Iterator[bytes]:
    """One wireframe of all lines, then a layer and a colour for each family."""
    new, layers = Entities(), dict[str, list[int]]()
    for line in part.details.lines:
        layers.setdefault(line.layer, []).append(_line(new, line, max(part.details.tolerance, CLOSEST)))
    everything = ",".join(f"#{k}" for members in layers.values() for k in members)
    curves = new.add(f"GEOMETRIC_CURVE_SET('',({everything}))")
    shape = new.add(f"GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION('',(#18,#{curves}),#14)")
    new.add(f"SHAPE_DEFINITION_REPRESENTATION(#8,#{shape})")
    styled = []
    for layer, members in layers.items():
        listed = ",".join(f"#{k}" for k in members)
        new.add(f"PRESENTATION_LAYER_ASSIGNMENT('{quoted(layer)}','',({listed}))")
        style = _style(new, COLOURS.get(layer.partition("-")[2], (0.0, 0.0, 0.0)))
        styled += [new.add(f"STYLED_ITEM('',(#{style}),#{k})") for k in members]
    listed = ",".join(f"#{k}" for k in styled)
    new.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({listed}),#14)")
    about = f"edges and centre lines as curves within {part.details.tolerance:.2g} mm of the mesh"
    yield header(part.name, about).encode("ascii")
    yield "".join(new.text).encode("ascii")
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def _line(new: Entities, line: Line, tolerance: float) -> int:
    """A curve, or a composite of several."""
    chain = curves_along(line.points, tolerance)
    title = quoted(f"{line.id} {line.length:.3f} mm")
    if len(chain) == 1:
        return curve_entity(new, chain[0], chain[0].poles, title, bounded=True)
    parts = [curve_entity(new, curve, curve.poles, "", bounded=True) for curve in chain]
    segments = [new.add(f"COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{k})") for k in parts]
    return new.add(f"COMPOSITE_CURVE('{title}',({','.join(f'#{k}' for k in segments)}),.F.)")


def curves_along(points: Floats, tolerance: float) -> list[Curve]:
    """A polyline (k, 3) as curves within `tolerance`, millimetres, that begin and end at its sharp turns.

    Where no spline follows it so closely, its own segments.
    """
    at = np.flatnonzero(_sharp(points))
    closed = len(points) > 2 and bool((points[0] == points[-1]).all())
    found = list[Curve]()
    for a, b in pairwise([0, *at.tolist(), len(points) - 1]):
        run = points[a : b + 1]
        curve = fitted(run, tolerance, smooth=closed and not len(at))
        found += [curve] if curve is not None else [c for c in _segments(run) if c is not None]
    return halves(found[0]) if closed and len(found) == 1 else found


def _sharp(points: Floats) -> Bools:
    """(k,) inner vertices of a polyline in space where it turns by more than SHARP."""
    along = np.diff(points, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    turn = np.zeros(len(points), dtype=bool)
    turn[1:-1] = np.einsum("ki,ki->k", along[1:], along[:-1]) < np.cos(SHARP)
    return turn


def _segments(points: Floats) -> list[Curve | None]:
    return [fitted(points[i : i + 2], np.inf) for i in range(len(points) - 1)]


def _style(new: Entities, colour: tuple[float, float, float]) -> int:
    """The presentation style of a line."""
    rgb = new.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    font = new.once("DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous')")
    style = new.add(f"CURVE_STYLE('',#{font},POSITIVE_LENGTH_MEASURE(0.1),#{rgb})")
    return new.add(f"PRESENTATION_STYLE_ASSIGNMENT((#{style}))")


def check(part: Part, path: Path) -> None:
    """Read back with OCCT: no line missing, and as long as they are to the tolerance at their bends."""
    found = inspection(part, path)
    expected = sum(polyline_length(line.points) for line in part.details.lines)
    if found["lines"] != len(part.details.lines):
        raise differs(part, "lines", len(part.details.lines), found["lines"])
    if not abs(found["length"] - expected) <= 5 * TOLERANCE * expected:
        raise ExportError(
            f"the lines of {part.name!r} read back {found['length']:.6g} mm long instead of {expected:.6g} mm; "
            "write .dxf instead"
        )
