"""Entities of a STEP file: header, shells, products and colours, planar faces, and tessellated faces (AP242)."""

from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.export.cad.step.planar import FLATNESS, Polyhedron
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs, distinct
from dsfab.export.writing import TRAILING_ZEROS, listed_rows, one_line, rows

COLOURS = ((0.62, 0.66, 0.70), (0.80, 0.62, 0.42), (0.45, 0.62, 0.72), (0.60, 0.70, 0.50), (0.72, 0.55, 0.60))
"""Red, green and blue of the pieces, in turns: muted, so that edges stay visible."""


def piece_name(name: str, i: int, pieces: int) -> str:
    """`dome` when it is alone, `dome 1`, `dome 2` ... when there are more."""
    return one_line(name) if pieces == 1 else f"{one_line(name)} {i + 1}"


def closing(shell: Ints, solids: list[list[int]], faces: Ints, free: int, name: str) -> Iterator[str]:
    """Solids, products, colours and the end of the file, in numbers from `free` on.

    shell : (f,) the shell of each face, whose entity is faces[i]. solids : the shells of each, the outer one first.
    The product of the first piece is in the header; every other one gets its own.
    """
    new = Numbered(free)
    styles = [_style(new, colour) for colour in COLOURS[: len(solids)]]
    styled = []
    for i, (outer, *voids) in enumerate(solids):
        item = _solid(new, faces, shell, outer, voids)
        shape = new.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',(#18,#{item}),#14)")
        definition = 8 if i == 0 else product(new, piece_name(name, i, len(solids)))
        new.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{shape})")
        styled.append(new.add(f"STYLED_ITEM('',(#{styles[i % len(styles)]}),#{item})"))
    listed = ",".join(f"#{k}" for k in styled)
    new.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({listed}),#14)")
    yield from new.text
    yield "ENDSEC;\nEND-ISO-10303-21;\n"


class Numbered:
    """Entities with the numbers that follow `free`."""

    def __init__(self, free: int) -> None:
        self.free, self.text = free, list[str]()

    def next(self) -> int:
        """The number of an entity whose text is written elsewhere."""
        self.free += 1
        return self.free - 1

    def add(self, body: str) -> int:
        """The number of a new entity."""
        self.text.append(f"#{self.free}={body};\n")
        return self.next()


def product(new: Numbered, name: str) -> int:
    """A product with the contexts of the header; returns its PRODUCT_DEFINITION_SHAPE."""
    title = quoted(name)
    made = new.add(f"PRODUCT('{title}','{title}','',(#3))")
    formation = new.add(f"PRODUCT_DEFINITION_FORMATION('','',#{made})")
    definition = new.add(f"PRODUCT_DEFINITION('design','',#{formation},#6)")
    new.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{made}))")
    return new.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")


def _style(new: Numbered, colour: tuple[float, float, float]) -> int:
    """The presentation style of a surface colour."""
    at = new.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    for body in (
        "FILL_AREA_STYLE_COLOUR('',#%d)",
        "FILL_AREA_STYLE('',(#%d))",
        "SURFACE_STYLE_FILL_AREA(#%d)",
        "SURFACE_SIDE_STYLE('',(#%d))",
        "SURFACE_STYLE_USAGE(.BOTH.,#%d)",
        "PRESENTATION_STYLE_ASSIGNMENT((#%d))",
    ):
        at = new.add(body % at)
    return at


def _solid(new: Numbered, faces: Ints, shell: Ints, outer: int, voids: list[int]) -> int:
    """The solid inside one shell and outside others, which are written facing outwards and reversed here."""
    shells = [
        new.add(f"CLOSED_SHELL('',({','.join(f'#{k}' for k in faces[shell == i].tolist())}))") for i in [outer, *voids]
    ]
    inner = [new.add(f"ORIENTED_CLOSED_SHELL('',*,#{k},.F.)") for k in shells[1:]]
    if not inner:
        return new.add(f"MANIFOLD_SOLID_BREP('',#{shells[0]})")
    return new.add(f"BREP_WITH_VOIDS('',#{shells[0]},({','.join(f'#{k}' for k in inner)}))")


def quoted(name: str) -> str:
    """The inside of a STEP string: quotes doubled, and what is not ASCII in hexadecimal (ISO 10303-21, 6.4.3)."""
    name = name.replace("\\", "\\\\").replace("'", "''")
    return "".join(c if c.isascii() else f"\\X4\\{ord(c):08X}\\X0\\" for c in name)


DIGITS = 6
"""Decimals of coordinates of curves, and of the solid that planes are found on: 1e-6 mm."""

FACETED_DIGITS = 5
"""Decimals of the corners of planar faces: 1e-5 mm, the precision that the file states. Planes are found before."""

DIRECTION_DIGITS = 11
"""Decimals of directions: under 1e-6 mm at the end of an edge of 100 m."""

NORMAL_REACH = 1e-6
"""Millimetres that the digits of its normal may turn a planar face off its place, at its far end."""

_POINT = f"CARTESIAN_POINT('',(%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f))"
_RATIOS = "DIRECTION('',(%d.,%d.,%d.))"

_HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('{description}, unit: millimetre'),'2;1');
FILE_NAME('{name}','1970-01-01T00:00:00',('dsfab'),(''),'dsfab {version}','dsfab {version}','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('core data for automotive mechanical design processes');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT('{product}','{product}','',(#3));
#5=PRODUCT_DEFINITION_FORMATION('','',#4);
#6=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#7=PRODUCT_DEFINITION('design','',#5,#6);
#8=PRODUCT_DEFINITION_SHAPE('','',#7);
#9=PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#4));
#10=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#11=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#12=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#13=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({tolerance}),#10,'distance_accuracy_value','');
#14=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#13))\
GLOBAL_UNIT_ASSIGNED_CONTEXT((#10,#11,#12))REPRESENTATION_CONTEXT('',''));
#15=CARTESIAN_POINT('',(0.,0.,0.));
#16=DIRECTION('',(0.,0.,1.));
#17=DIRECTION('',(1.,0.,0.));
#18=AXIS2_PLACEMENT_3D('',#15,#16,#17);
"""
FIRST = 19
"""The first free entity number after the header."""


def entities(shape: Polyhedron, solids: list[list[int]], name: str) -> Iterator[str]:
    """The text of the file. solids: the shells of each, the outer one first, then its voids (which face outwards)."""
    yield header(name, "solid with planar faces", len(solids))
    texts, faces, free = planar_faces(shape, FIRST)
    yield from texts
    yield from closing(shape.shell, solids, faces, free, name)


def planar_faces(shape: Polyhedron, start: int) -> tuple[Iterator[str], Ints, int]:
    """The text of the faces in numbers from `start` on, the number (f,) of each, and the first free number."""
    vectors = distinct(_ratios(shape))
    digits = _digits(shape)
    normals = distinct(np.round(shape.normals, digits))
    v, d, e, f = (len(x) for x in (shape.points, vectors[0], shape.edges, shape.normals))
    s, o, n = len(shape.steps), len(shape.loops) - 1, len(normals[0])
    blocks = _blocks([v, v, d, d, e, e, s, o, o, n, f, f, f], start)
    return _tables(shape, vectors, normals, digits, blocks), np.array(blocks[12]), blocks[12].stop


def _tables(
    shape: Polyhedron, vectors: tuple[Floats, Ints], normals: tuple[Floats, Ints], digits: int, blocks: list[range]
) -> Iterator[str]:
    """Table after table: what one needs is let go before the next is made.

    vectors, normals : the different ones as they are written, and which one each edge or face has.
    digits           : decimals of normals.
    """
    points, vertices, dirs, units, lines, edges, steps, loops, bounds, axes, placements, planes, faces = blocks
    p, q = shape.edges.T
    outer = np.isin(np.arange(len(bounds)), shape.faces[:-1])
    yield from _table(points, _POINT, *(_corners(shape) / 10**FACETED_DIGITS).T)
    yield from _table(vertices, "VERTEX_POINT('',#%d)", points)
    yield from _table(dirs, _RATIOS, *vectors[0].T)
    yield from _table(units, "VECTOR('',#%d,1.)", dirs)
    yield from _table(lines, "LINE('',#%d,#%d)", points.start + p, units.start + vectors[1])
    yield from _table(edges, "EDGE_CURVE('',#%d,#%d,#%d,.T.)", vertices.start + p, vertices.start + q, lines)
    way = np.where(shape.forward, "T", "F")
    yield from _table(steps, "ORIENTED_EDGE('',*,*,#%d,.%s.)", edges.start + shape.steps, way)
    yield from _table(loops, "EDGE_LOOP('',(%s))", _Lists(steps.start, shape.loops))
    yield from _table(bounds, "FACE_%sBOUND('',#%d,.T.)", np.where(outer, "OUTER_", ""), loops)
    yield from _table(axes, f"DIRECTION('',(%.{digits}f,%.{digits}f,%.{digits}f))", *normals[0].T)
    at = points.start + shape.origin
    yield from _table(placements, "AXIS2_PLACEMENT_3D('',#%d,#%d,$)", at, axes.start + normals[1])
    yield from _table(planes, "PLANE('',#%d)", placements)
    yield from _table(faces, "ADVANCED_FACE('',(%s),#%d,.T.)", _Lists(bounds.start, shape.faces), planes)


def _ratios(shape: Polyhedron) -> Floats:
    """(e, 3) directions of the edges in smallest whole numbers: between the corners as they are written, exactly.

    A direction need not have length 1 (ISO 10303-42). Edges along an axis share one, whatever their lengths.
    """
    corners = _corners(shape)
    along = corners[shape.edges[:, 1]] - corners[shape.edges[:, 0]]
    return np.asarray(along / np.maximum(np.gcd.reduce(along, axis=1), 1)[:, None])


def _corners(shape: Polyhedron) -> Ints:
    """(p, 3) the corners in units of their last decimal."""
    return np.asarray(np.rint(shape.points * 10**FACETED_DIGITS), dtype=np.int64)


def _digits(shape: Polyhedron) -> int:
    """Decimals of normals, such that no plane is turned by more than NORMAL_REACH at the far end of its face."""
    face = np.repeat(np.arange(len(shape.normals)), np.diff(shape.loops[shape.faces]))
    corner = shape.edges[shape.steps, np.where(shape.forward, 0, 1)]
    reach = max(float(np.abs(x[corner] - x[shape.origin[face]]).max()) for x in shape.points.T)
    return int(np.clip(np.ceil(np.log10(np.sqrt(3) * reach / NORMAL_REACH)), 1, DIRECTION_DIGITS))


def faceted_bytes(shape: Polyhedron) -> float:
    """How long the text of `entities` will be, from its numbers of rows; to a tenth, less if directions repeat."""
    v, e, f = len(shape.points), len(shape.edges), len(shape.normals)
    steps, bounds = len(shape.steps), len(shape.loops) - 1
    reference = np.log10(FIRST + 2 * v + 4 * e + steps + 2 * bounds + 4 * f) + 1.5  # digits of a number, and its #
    digits = np.log10(max(np.abs(shape.points).max(), 1.0)) + FACETED_DIGITS + 1.5
    ratio = np.log10(np.abs(_ratios(shape)) + 1).mean() + 2.5
    point, direction = 25 + reference + 3 * digits, 20 + reference
    vertex = 22 + 2 * reference
    edge = direction + 3 * ratio + (15 + 2 * reference) + (13 + 3 * reference) + (25 + 4 * reference)
    step, bound = 32 + 3 * reference, 45 + 4 * reference
    face = direction + 3 * (_digits(shape) + 3.5) + (31 + 3 * reference) + (14 + 2 * reference) + (27 + 4 * reference)
    return float(1500 + v * (point + vertex) + e * edge + steps * step + bounds * bound + f * face)


def header(name: str, description: str, pieces: int = 1) -> str:
    """The beginning of the file: entities 1 to 18, among them the product of the first of the pieces.

    Its time is fixed, since the same solid gives the same file; ISO 10303-21 does not allow to leave it out.
    """
    title = quoted(one_line(name))
    product = quoted(piece_name(name, 0, pieces))
    return _HEADER.format(
        name=title, product=product, version=__version__, tolerance=f"{FLATNESS:.1E}", description=description
    )


def _blocks(counts: list[int], begin: int) -> list[range]:
    """Entity numbers for tables of so many rows, one after the other."""
    return [range(a, b) for a, b in pairwise(accumulate(counts, initial=begin))]


def _table(numbers: range, template: str, *columns: Any) -> Iterator[str]:
    """One entity per row; numbers lose the zeros at their end, a quarter of the file."""
    return (TRAILING_ZEROS.sub(r"\1", text) for text in rows(f"#%d={template};\n", numbers, *columns))


class _Lists:
    """'#7,#8,#9' for each run of entities begin + start[i] ... begin + start[i + 1] - 1, made when it is asked for."""

    def __init__(self, begin: int, start: Ints) -> None:
        self.begin, self.start = begin, start

    def __getitem__(self, wanted: slice) -> list[str]:
        start = self.start[wanted.start : wanted.stop + 1].tolist()
        named = [f"#{self.begin + k}" for k in range(start[0], start[-1])]
        return [",".join(named[a - start[0] : b - start[0]]) for a, b in pairwise(start)]


WARNING = "only programs that know AP242 tessellated geometry open it; FreeCAD 0.20 and gmsh do not"


def tessellated_entities(part: Part) -> Iterator[str]:
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
