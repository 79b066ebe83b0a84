"""STEP AP242 with the triangles themselves: a tenth of the size of faceted STEP, and open at once.

Only programs that know tessellated geometry read it, and what they get is a mesh to look at, not a solid to work on:
FreeCAD 0.20 shows nothing and gmsh fails. So it is written on request only. OCCT reads it back.
"""

from collections.abc import Iterator

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.shells import solids_of
from dsfab.export.step_pieces import Numbered, piece_name, product
from dsfab.export.step_text import FACETED_DIGITS, FIRST, header
from dsfab.export.text import listed_rows
from dsfab.limits import READ_BACK

WARNING = "only programs that know AP242 tessellated geometry open it; FreeCAD 0.20 and gmsh do not"


def entities(part: Part) -> Iterator[str]:
    """The text of the file: coordinates and triangles of each solid, its voids among them, and its product."""
    shell, solids = solids_of(part)
    beginning = header(part.name, "triangles of AP242, for viewers", len(solids))
    yield (
        beginning.replace(
            "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
            "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
        )
        .replace("'automotive_design',2000", "'ap242_managed_model_based_3d_engineering',2014")
        .replace("core data for automotive mechanical design processes", "managed model based 3d engineering")
    )
    new = Numbered(FIRST)
    for i, shells in enumerate(solids):
        used, corner = np.unique(part.F[np.isin(shell, shells)], return_inverse=True)
        title, triangles = piece_name(part.name, i, len(solids)), corner.reshape(-1, 3) + 1
        yield from _coordinates(new, part.V[used])
        yield from _face(new, len(used), triangles)
        yield from _product(new, i, title)
    yield "ENDSEC;\nEND-ISO-10303-21;\n"


def expected_bytes(part: Part) -> float:
    """About how long the text will be."""
    digits = np.log10(max(np.abs(part.V).max(), 1.0)) + FACETED_DIGITS + 2.5
    return float(1500 + 3 * (digits + 1) * len(part.V) + (3 * np.log10(len(part.V)) + 8) * len(part.F))


def _coordinates(new: Numbered, points: Floats) -> Iterator[str]:
    yield f"#{new.next()}=COORDINATES_LIST('',{len(points)},("
    yield from listed_rows(f"(%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f),\n", *points.T)
    yield "));\n"


def _face(new: Numbered, count: int, triangles: Ints) -> Iterator[str]:
    """One face with all triangles: no normals, no link to exact geometry, and point i of the list is point i."""
    at = new.next()
    yield f"#{at}=TRIANGULATED_FACE('',#{at - 1},{count},(),$,(),("
    yield from listed_rows("(%d,%d,%d),\n", *triangles.T)
    yield "));\n"


def _product(new: Numbered, i: int, title: str) -> Iterator[str]:
    face = new.free - 1
    shape = new.add(f"TESSELLATED_SOLID('',(#{face}),$)")
    held = new.add(f"TESSELLATED_SHAPE_REPRESENTATION('',(#18,#{shape}),#14)")
    definition = 8 if i == 0 else product(new, title)
    new.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{held})")
    yield "".join(new.text)
    new.text.clear()


def check(part: Part, found: dict[str, float]) -> ReadBack:
    """What was found; raises ExportError unless OCCT found the part's triangles and, to 0.1 %, its volume."""
    if found["triangles"] != len(part.F):
        raise differs(part, "triangles", len(part.F), int(found["triangles"]))
    if not abs(found["volume"] - part.volume) <= READ_BACK * part.volume:
        raise ExportError(f"the triangles of {part.name!r} read back with another volume; write step = 'faceted'")
    return ReadBack(int(found["triangles"]), "triangles", found["volume"] / part.volume - 1)
