"""Stripe edges and centre lines as curves in STEP, `NAME.lines.step`: to rebuild a design, not to receive its faces.

Each line is lines and cubic splines within the tolerance of the lines, one curve between sharp turns, and a composite
curve where there are several. Its name is its id, which names its family, and its length; families are layers with
their colours. Millimetres.
"""

from collections.abc import Iterator
from pathlib import Path

from dsfab.export.along import chains, check_length, within
from dsfab.export.curves import Curve, halves
from dsfab.export.part import Part
from dsfab.export.plate_text import Entities, curve_entity
from dsfab.export.readback import ReadBack, differs, with_lines
from dsfab.export.step import inspection
from dsfab.export.step_pieces import quoted
from dsfab.export.step_text import header
from dsfab.surface import StructureLine

COLOURS = {"major": (0.12, 0.31, 0.61), "minor": (0.70, 0.15, 0.12), "keep": (0.18, 0.49, 0.20), "rim": (0, 0.47, 0.53)}
"""By family; others are black."""


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it has no lines."""
    return with_lines(part, ".lines.step")


def encode(part: Part) -> Iterator[bytes]:
    """One wireframe of all lines, then a layer and a colour for each family."""
    new, layers = Entities(), dict[str, list[int]]()
    for line, chain in zip(part.details.lines, chains(part), strict=True):
        layers.setdefault(line.layer, []).append(_line(new, line, chain))
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
    about = f"edges and centre lines as curves within {within(part):.2g} mm of the mesh"
    yield header(part.name, about).encode("ascii")
    yield "".join(new.text).encode("ascii")
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def _line(new: Entities, line: StructureLine, chain: list[Curve]) -> int:
    """A curve, or a composite of several; OCCT wants two of a closed one."""
    chain = halves(chain[0]) if line.closed and len(chain) == 1 else chain
    title = quoted(f"{line.id} {line.length:.3f} mm")
    if len(chain) == 1:
        return curve_entity(new, chain[0], chain[0].poles, title, bounded=True)
    parts = [curve_entity(new, curve, curve.poles, "", bounded=True) for curve in chain]
    segments = [new.add(f"COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{k})") for k in parts]
    return new.add(f"COMPOSITE_CURVE('{title}',({','.join(f'#{k}' for k in segments)}),.F.)")


def _style(new: Entities, colour: tuple[float, float, float]) -> int:
    """The presentation style of a line."""
    rgb = new.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    font = new.once("DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous')")
    style = new.add(f"CURVE_STYLE('',#{font},POSITIVE_LENGTH_MEASURE(0.1),#{rgb})")
    return new.add(f"PRESENTATION_STYLE_ASSIGNMENT((#{style}))")


def check(part: Part, path: Path) -> ReadBack:
    """Read back with OCCT: no line missing, and as long as they are to the tolerance at their bends."""
    found = inspection(part, path)
    if found["lines"] != len(part.details.lines):
        raise differs(part, "lines", len(part.details.lines), found["lines"])
    return ReadBack(found["lines"], "lines", check_length(part, found["length"]), "length")
