"""The entities of a STEP file: five to a planar face, four to an edge, written without building any CAD model.

ADVANCED_FACE -> FACE_OUTER_BOUND -> EDGE_LOOP -> ORIENTED_EDGE -> EDGE_CURVE -> LINE, two VERTEX_POINT
              -> PLANE -> AXIS2_PLACEMENT_3D
"""

from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.export.coplanar import FLATNESS
from dsfab.export.planar import Polyhedron
from dsfab.export.step_pieces import closing, piece_name, quoted
from dsfab.export.text import TRAILING_ZEROS, one_line, rows

DIGITS = 6
"""Decimals of coordinates: 1e-6 mm."""

DIRECTION_DIGITS = 11
"""Decimals of directions: under 1e-6 mm at the end of an edge of 100 m."""

_POINT = f"CARTESIAN_POINT('',(%.{DIGITS}f,%.{DIGITS}f,%.{DIGITS}f))"
_DIRECTION = f"DIRECTION('',(%.{DIRECTION_DIGITS}f,%.{DIRECTION_DIGITS}f,%.{DIRECTION_DIGITS}f))"

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
    along = shape.points[shape.edges[:, 1]] - shape.points[shape.edges[:, 0]]
    directions, direction = _distinct(along / np.linalg.norm(along, axis=1, keepdims=True))
    normals, normal = _distinct(shape.normals)
    v, d, e, f = (len(x) for x in (shape.points, directions, shape.edges, shape.normals))
    s, o, n = len(shape.steps), len(shape.loops) - 1, len(normals)
    points, vertices, dirs, vectors, lines, edges, *rest = _blocks([v, v, d, d, e, e, s, o, o, n, f, f, f])
    steps, loops, bounds, axes, placements, planes, faces, free = rest
    p, q = shape.edges.T
    outer = np.isin(np.arange(len(bounds)), shape.faces[:-1])
    way, kind = np.where(shape.forward, "T", "F"), np.where(outer, "FACE_OUTER_BOUND", "FACE_BOUND")
    yield from _table(points, _POINT, *shape.points.T)
    yield from _table(vertices, "VERTEX_POINT('',#%d)", points)
    yield from _table(dirs, _DIRECTION, *directions.T)
    yield from _table(vectors, "VECTOR('',#%d,1.)", dirs)
    yield from _table(lines, "LINE('',#%d,#%d)", points[p], vectors[direction])
    yield from _table(edges, "EDGE_CURVE('',#%d,#%d,#%d,.T.)", vertices[p], vertices[q], lines)
    yield from _table(steps, "ORIENTED_EDGE('',*,*,#%d,.%s.)", edges[shape.steps], way)
    yield from _table(loops, "EDGE_LOOP('',(%s))", _lists(steps, shape.loops))
    yield from _table(bounds, "%s('',#%d,.T.)", kind, loops)
    yield from _table(axes, _DIRECTION, *normals.T)
    yield from _table(placements, "AXIS2_PLACEMENT_3D('',#%d,#%d,$)", points[shape.origin], axes[normal])
    yield from _table(planes, "PLANE('',#%d)", placements)
    yield from _table(faces, "ADVANCED_FACE('',(%s),#%d,.T.)", _lists(bounds, shape.faces), planes)
    yield from closing(shape.shell, solids, faces, int(free[0]), name)


def faceted_bytes(shape: Polyhedron) -> float:
    """How long the text of `entities` will be, from its numbers of rows; to a tenth, less if directions repeat."""
    v, e, f = len(shape.points), len(shape.edges), len(shape.normals)
    steps, bounds = len(shape.steps), len(shape.loops) - 1
    reference = np.log10(FIRST + 2 * v + 4 * e + steps + 2 * bounds + 4 * f) + 1.5  # digits of a number, and its #
    digits = np.log10(max(np.abs(shape.points).max(), 1.0)) + DIGITS + 1.5
    unit = DIRECTION_DIGITS + 2.0
    point, direction = 25 + reference + 3 * digits, 20 + reference + 3 * unit
    vertex = 22 + 2 * reference
    edge = direction + (15 + 2 * reference) + (13 + 3 * reference) + (25 + 4 * reference)
    step, bound = 32 + 3 * reference, 45 + 4 * reference
    face = direction + (31 + 3 * reference) + (14 + 2 * reference) + (27 + 4 * reference)
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


def _blocks(counts: list[int]) -> list[Ints]:
    """Entity numbers for tables of so many rows, one after the other, and at the end the first free number."""
    start = list(accumulate(counts, initial=FIRST))
    return [np.arange(a, b) for a, b in pairwise([*start, start[-1] + 1])]


def _table(numbers: Ints, template: str, *columns: Any) -> Iterator[str]:
    """One entity per row; numbers lose the zeros at their end, a quarter of the file."""
    return (TRAILING_ZEROS.sub(r"\1", text) for text in rows(f"#%d={template};\n", numbers, *columns))


def _distinct(directions: Floats) -> tuple[Floats, Ints]:
    """The different ones among unit vectors (k, 3), to the digits of the file, and the one of each."""
    units, which = np.unique(np.round(directions, DIRECTION_DIGITS) + 0.0, axis=0, return_inverse=True)
    return units, which.reshape(-1)


def _lists(numbers: Ints, start: Ints) -> list[str]:
    """'#7,#8,#9' for each run numbers[start[i] : start[i + 1]]."""
    named = [f"#{k}" for k in numbers.tolist()]
    return [",".join(named[a:b]) for a, b in pairwise(start.tolist())]
