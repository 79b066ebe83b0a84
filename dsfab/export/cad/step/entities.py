"""Entities of a STEP file: header, shells, products, colours and faces."""

from collections.abc import Iterable, Iterator
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.export.cad.step.planar import FLATNESS, Polyhedron, polyhedron
from dsfab.export.curves import Curve
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, distinct_rows, require_equal
from dsfab.export.writing import TRAILING_ZEROS, comma_separated_rows, one_line, rows

COLOURS = ((0.62, 0.66, 0.70), (0.80, 0.62, 0.42), (0.45, 0.62, 0.72), (0.60, 0.70, 0.50), (0.72, 0.55, 0.60))
"""Colours of the pieces in turn, as red, green and blue. They are muted, so that edges stay visible."""

DIGITS = 6  # decimals of coordinates (mm) for curves, and for the search for coplanar triangles
DIRECTION_DIGITS = 11  # decimals of directions; rounding moves the end of an edge of 100 m by under 1e-6 mm
FIRST_FREE = 19  # first free entity number after the header of the file

PARAMETER_CONTEXT = (
    "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))"
)

KnotText = tuple[str, str]  # multiplicities of knots, and values of knots, as text


def piece_name(name: str, i: int, pieces: int) -> str:
    """Return the name of a piece: `dome` for a single piece, or `dome 1`, `dome 2` ..."""
    return one_line(name) if pieces == 1 else f"{one_line(name)} {i + 1}"


def closing(shell: Ints, solids: list[list[int]], faces: Ints, free: int, name: str) -> Iterator[str]:
    """Yield the text of the last entities of a STEP file (solids, colours, products), numbered from `free`.
    shell, faces : (f,) shell and entity number of each face.    solids : shells of each solid, the outer first."""
    entities_after = StepEntities(free)
    styles = [_style(entities_after, colour) for colour in COLOURS[: len(solids)]]
    styled = []
    for i, (outer, *voids) in enumerate(solids):
        item = _solid(entities_after, faces, shell, outer, voids)
        shape = entities_after.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',(#18,#{item}),#14)")
        definition = 8 if i == 0 else product(entities_after, piece_name(name, i, len(solids)))
        entities_after.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{shape})")
        styled.append(entities_after.add(f"STYLED_ITEM('',(#{styles[i % len(styles)]}),#{item})"))
    entities_after.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{references(styled)},#14)")
    yield from entities_after.text
    yield "ENDSEC;\nEND-ISO-10303-21;\n"


class StepEntities:
    """Numbered entities of a STEP file and their text."""

    def __init__(self, free: int = FIRST_FREE, extra_digits: int = 0) -> None:
        """Begin an empty list. free : first entity number.    extra_digits : more decimals of points and directions."""
        self.free, self.text = free, list[str]()
        self._digits, self._direction_digits = DIGITS + extra_digits, DIRECTION_DIGITS + extra_digits
        self._numbers, self._points = dict[str, int](), dict[tuple[float, ...], int]()

    def next(self) -> int:
        """Reserve an entity number."""
        self.free += 1
        return self.free - 1

    def add(self, body: str, shared: bool = False) -> int:
        """Add an entity with the text `body`; return its number. shared : True to return an equal entity, if any."""
        if shared:
            return self.once(body)
        self.text.append(f"#{self.free}={body};\n")
        return self.next()

    def once(self, body: str) -> int:
        """Add an entity with the text `body` unless an equal entity exists. Return its number."""
        if body not in self._numbers:
            self._numbers[body] = self.add(body)
        return self._numbers[body]

    def point(self, p: Floats) -> int:
        """Return the entity number of a point p (3,), millimetres."""
        return self.once(f"CARTESIAN_POINT('',{step_list(p, self._digits)})")

    def points(self, points: Floats, digits: int) -> Iterator[int]:
        """Yield entity numbers of points (k, 3), mm, or surface parameters (k, 2), rounded to `digits` decimals."""
        for p in map(tuple, (np.round(points, digits) + 0.0).tolist()):
            if p not in self._points:
                text = ",".join([f"{v:.{digits}f}".rstrip("0") for v in p])
                self._points[p] = self.once(f"CARTESIAN_POINT('',({text}))")
            yield self._points[p]

    def vector(self, d: Floats) -> int:
        """Return the entity number of a unit vector in the direction d (3,)."""
        return self.once(f"VECTOR('',#{self._direction(d)},1.)")

    def _direction(self, d: Floats) -> int:
        return self.once(f"DIRECTION('',{step_list(d / np.linalg.norm(d), self._direction_digits)})")

    def line(self, p: Floats, along: Floats) -> int:
        """Add a line through p (3,), millimetres, along a direction (3,)."""
        vector = self.vector(along)
        return self.add(f"LINE('',#{self.point(p)},#{vector})")

    def plane(self, p: Floats, normal: Floats) -> int:
        """Add a plane through p (3,), millimetres, with a normal (3,)."""
        axes = self.add(f"AXIS2_PLACEMENT_3D('',#{self.point(p)},#{self._direction(normal)},$)")
        return self.add(f"PLANE('',#{axes})")

    def curve(self, curve: Curve, poles: Floats, title: str = "", bounded: bool = False) -> int:
        """Add a curve with poles (p, 3), mm: a spline, or for a straight `curve` a line. Return its entity number.
        bounded : True to write a straight curve as a polyline of two points.    title : name of the entity."""
        if curve.is_straight and bounded:
            return self.add(f"POLYLINE('{title}',{references([self.point(p) for p in poles])})")
        if curve.is_straight:
            return self.line(poles[0], poles[-1] - poles[0])
        return self.spline(curve.degree, [self.point(p) for p in poles], knot_text(curve.knots), title)

    def spline(self, degree: int, poles: list[int], knots: KnotText, title: str = "", shared: bool = False) -> int:
        """Add a B-spline curve. poles : entity numbers of poles.    shared : True to return an equal curve, if any."""
        return self.add(
            f"B_SPLINE_CURVE_WITH_KNOTS('{title}',{degree},{references(poles)},.UNSPECIFIED.,.F.,.F.,"
            f"{knots[0]},{knots[1]},.UNSPECIFIED.)",
            shared,
        )

    def bezier(self, poles: list[int], shared: bool = False) -> int:
        """Add a Bezier curve. shared : True to return an equal curve, if any."""
        return self.spline(len(poles) - 1, poles, bezier_knots(len(poles)), shared=shared)

    def spline_surface(self, degrees: tuple[int, int], rows: Iterable[list[int]], u: KnotText, v: KnotText) -> int:
        """Add a B-spline surface. rows : entity numbers of poles by row.    u, v : knots in each direction, as text."""
        poles = ",".join(references(row) for row in rows)
        return self.add(
            f"B_SPLINE_SURFACE_WITH_KNOTS('',{degrees[0]},{degrees[1]},({poles}),.UNSPECIFIED.,.F.,.F.,.F.,"
            f"{u[0]},{v[0]},{u[1]},{v[1]},.UNSPECIFIED.)"
        )

    def parameter_curve(self, surface: int, curve: int) -> int:
        """Add a parameter-space curve (PCURVE) of a surface. surface, curve : entity numbers."""
        flat = self.once(f"DEFINITIONAL_REPRESENTATION('',(#{curve}),#{self.once(PARAMETER_CONTEXT)})")
        return self.add(f"PCURVE('',#{surface},#{flat})")

    def vertex(self, point: int, shared: bool = False) -> int:
        """Add a vertex. point : entity number of its point.    shared : True to return an equal vertex, if any."""
        return self.add(f"VERTEX_POINT('',#{point})", shared)

    def edge(self, start: int, end: int, curve: int, shared: bool = False) -> int:
        """Add an edge between two vertices along a curve. start, end, curve : entity numbers.
        shared : True to return an equal edge, if any."""
        return self.add(f"EDGE_CURVE('',#{start},#{end},#{curve},.T.)", shared)

    def wire(self, steps: list[tuple[int, bool]], kind: str = "FACE_OUTER_BOUND") -> int:
        """Add a closed loop of edges. steps : entity number of each edge, and True if the edge runs forwards."""
        oriented = [self.add(f"ORIENTED_EDGE('',*,*,#{edge},.{'T' if forwards else 'F'}.)") for edge, forwards in steps]
        loop = self.add(f"EDGE_LOOP('',{references(oriented)})")
        return self.add(f"{kind}('',#{loop},.T.)")

    def face(self, bounds: list[int], surface: int, same_sense: bool = True) -> int:
        """Add a face. same_sense : True if the face has the same normal as its surface."""
        return self.add(f"ADVANCED_FACE('',{references(bounds)},#{surface},.{'T' if same_sense else 'F'}.)")

    def file(self, pieces: list[list[int]], name: str, description: str) -> Iterator[str]:
        """Yield the text of the whole STEP file. pieces : entity numbers of the faces of each solid."""
        yield header(name, description, len(pieces))
        yield "".join(self.text)
        shells = np.repeat(np.arange(len(pieces)), [len(faces) for faces in pieces])
        yield from closing(shells, [[i] for i in range(len(pieces))], np.concatenate(pieces), self.free, name)


def knot_text(knots: Floats, digits: int = DIGITS) -> KnotText:
    """Format the knots (k,) of a spline as two STEP lists: their multiplicities and their different values."""
    values, times = np.unique(knots, return_counts=True)
    return "(" + ",".join(str(k) for k in times.tolist()) + ")", step_list(values, digits)


def bezier_knots(count: int) -> KnotText:
    """Format the knots of a Bezier curve with `count` poles as two STEP lists: multiplicities and values."""
    return f"({count},{count})", "(0.,1.)"


def step_list(values: Floats, digits: int) -> str:
    """Format values (k,) as '(1.5,0.,-2.)', without trailing zeros."""
    text = ",".join(f"{v:.{digits}f}" for v in (np.round(values, digits) + 0.0).tolist())
    return TRAILING_ZEROS.sub(r"\1", f"({text})")


def references(numbers: Iterable[int]) -> str:
    """Format entity numbers as '(#7,#8,#9)'."""
    return "(" + ",".join(f"#{k}" for k in numbers) + ")"


def product(entity_list: StepEntities, name: str) -> int:
    """Add a product; return the number of its PRODUCT_DEFINITION_SHAPE."""
    title = step_string(name)
    product_number = entity_list.add(f"PRODUCT('{title}','{title}','',(#3))")
    formation = entity_list.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product_number})")
    definition = entity_list.add(f"PRODUCT_DEFINITION('design','',#{formation},#6)")
    entity_list.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product_number}))")
    return entity_list.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")


def _style(entity_list: StepEntities, colour: tuple[float, float, float]) -> int:
    number = entity_list.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    for body in (
        "FILL_AREA_STYLE_COLOUR('',#%d)",
        "FILL_AREA_STYLE('',(#%d))",
        "SURFACE_STYLE_FILL_AREA(#%d)",
        "SURFACE_SIDE_STYLE('',(#%d))",
        "SURFACE_STYLE_USAGE(.BOTH.,#%d)",
        "PRESENTATION_STYLE_ASSIGNMENT((#%d))",
    ):
        number = entity_list.add(body % number)
    return number


def _solid(entity_list: StepEntities, faces: Ints, shell: Ints, outer: int, voids: list[int]) -> int:
    shells = [entity_list.add(f"CLOSED_SHELL('',{references(faces[shell == i].tolist())})") for i in [outer, *voids]]
    inner = [entity_list.add(f"ORIENTED_CLOSED_SHELL('',*,#{k},.F.)") for k in shells[1:]]
    if not inner:
        return entity_list.add(f"MANIFOLD_SOLID_BREP('',#{shells[0]})")
    return entity_list.add(f"BREP_WITH_VOIDS('',#{shells[0]},{references(inner)})")


def step_string(name: str) -> str:
    """Return `name` with the characters escaped for a STEP string [ISO 10303-21, 6.4.3]."""
    name = name.replace("\\", "\\\\").replace("'", "''")
    return "".join(c if c.isascii() else f"\\X4\\{ord(c):08X}\\X0\\" for c in name)


FACETED_DIGITS = 5  # decimals (mm) of corners of planar faces; the file states this precision

_COORDINATES = f"(%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f,%.{FACETED_DIGITS}f)"
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


def outward_polyhedron(part: Part) -> tuple[Polyhedron, list[list[int]]]:
    """Return a part's planar faces with outward normals, and the shell numbers of each solid, its outer shell first."""
    shell, solids = solids_of(part)
    inward = np.isin(shell, [i for _, *inner in solids for i in inner])
    return polyhedron(part.V, np.where(inward[:, None], part.F[:, ::-1], part.F), shell), solids


def entities(shape: Polyhedron, solids: list[list[int]], name: str) -> Iterator[str]:
    """Yield the text of a STEP file of a polyhedron. solids : shells of each solid, the outer shell first."""
    yield header(name, "solid with planar faces", len(solids))
    texts, faces, free = planar_faces(shape, FIRST_FREE)
    yield from texts
    yield from closing(shape.shell, solids, faces, free, name)


def planar_faces(shape: Polyhedron, start: int) -> tuple[Iterator[str], Ints, int]:
    """Return the text of the faces, with entity numbers from `start`.
    Return also the entity number (f,) of each face, and the first free number."""
    vectors = distinct_rows(_ratios(shape))
    digits = _digits(shape)
    normals = distinct_rows(np.round(shape.normals, digits))
    v, d, e, f = (len(x) for x in (shape.points, vectors[0], shape.edges, shape.normals))
    s, o, n = len(shape.steps), len(shape.loops) - 1, len(normals[0])
    blocks = [range(a, b) for a, b in pairwise(accumulate([v, v, d, d, e, e, s, o, o, n, f, f, f], initial=start))]
    return _tables(shape, vectors, normals, digits, blocks), np.array(blocks[12]), blocks[12].stop


def _tables(
    shape: Polyhedron, vectors: tuple[Floats, Ints], normals: tuple[Floats, Ints], digits: int, blocks: list[range]
) -> Iterator[str]:
    points, vertices, dirs, units, lines, edges, steps, loops, bounds, axes, placements, planes, faces = blocks
    p, q = shape.edges.T
    outer = np.isin(np.arange(len(bounds)), shape.faces[:-1])
    yield from _table(points, f"CARTESIAN_POINT('',{_COORDINATES})", *(_corners(shape) / 10**FACETED_DIGITS).T)
    yield from _table(vertices, "VERTEX_POINT('',#%d)", points)
    yield from _table(dirs, _RATIOS, *vectors[0].T)
    yield from _table(units, "VECTOR('',#%d,1.)", dirs)
    yield from _table(lines, "LINE('',#%d,#%d)", points.start + p, units.start + vectors[1])
    yield from _table(edges, "EDGE_CURVE('',#%d,#%d,#%d,.T.)", vertices.start + p, vertices.start + q, lines)
    flags = np.where(shape.forward, "T", "F")
    yield from _table(steps, "ORIENTED_EDGE('',*,*,#%d,.%s.)", edges.start + shape.steps, flags)
    yield from _table(loops, "EDGE_LOOP('',(%s))", _Lists(steps.start, shape.loops))
    yield from _table(bounds, "FACE_%sBOUND('',#%d,.T.)", np.where(outer, "OUTER_", ""), loops)
    yield from _table(axes, f"DIRECTION('',(%.{digits}f,%.{digits}f,%.{digits}f))", *normals[0].T)
    origins = points.start + shape.origin
    yield from _table(placements, "AXIS2_PLACEMENT_3D('',#%d,#%d,$)", origins, axes.start + normals[1])
    yield from _table(planes, "PLANE('',#%d)", placements)
    yield from _table(faces, "ADVANCED_FACE('',(%s),#%d,.T.)", _Lists(bounds.start, shape.faces), planes)


def _ratios(shape: Polyhedron) -> Floats:
    """Return the exact direction (e, 3) of each edge as the smallest possible whole numbers."""
    corners = _corners(shape)
    along = corners[shape.edges[:, 1]] - corners[shape.edges[:, 0]]
    return np.asarray(along / np.maximum(np.gcd.reduce(along, axis=1), 1)[:, None])


def _corners(shape: Polyhedron) -> Ints:
    return np.asarray(np.rint(shape.points * 10**FACETED_DIGITS), dtype=np.int64)


def _digits(shape: Polyhedron) -> int:
    reach_mm = 1e-6  # largest movement (mm) of a face's corners if the face's normal is rounded
    face = np.repeat(np.arange(len(shape.normals)), np.diff(shape.loops[shape.faces]))
    corner = shape.edges[shape.steps, np.where(shape.forward, 0, 1)]
    reach = max(float(np.abs(x[corner] - x[shape.origin[face]]).max()) for x in shape.points.T)
    return int(np.clip(np.ceil(np.log10(np.sqrt(3) * reach / reach_mm)), 1, DIRECTION_DIGITS))


def faceted_bytes(shape: Polyhedron) -> float:
    """Return an estimate of the size (bytes) of a faceted STEP file."""
    v, e, f = len(shape.points), len(shape.edges), len(shape.normals)
    steps, bounds = len(shape.steps), len(shape.loops) - 1
    reference = np.log10(FIRST_FREE + 2 * v + 4 * e + steps + 2 * bounds + 4 * f) + 1.5  # length of an id like #123
    digits = np.log10(max(np.abs(shape.points).max(), 1.0)) + FACETED_DIGITS + 1.5
    ratio = np.log10(np.abs(_ratios(shape)) + 1).mean() + 2.5
    point, direction = 25 + reference + 3 * digits, 20 + reference
    vertex = 22 + 2 * reference
    edge = direction + 3 * ratio + (15 + 2 * reference) + (13 + 3 * reference) + (25 + 4 * reference)
    step, bound = 32 + 3 * reference, 45 + 4 * reference
    face = direction + 3 * (_digits(shape) + 3.5) + (31 + 3 * reference) + (14 + 2 * reference) + (27 + 4 * reference)
    return float(1500 + v * (point + vertex) + e * edge + steps * step + bounds * bound + f * face)


def header(name: str, description: str, pieces: int = 1) -> str:
    """Return the beginning of a STEP file: its header, and the entities 1 to 18."""
    title = step_string(one_line(name))
    product = step_string(piece_name(name, 0, pieces))
    return _HEADER.format(
        name=title, product=product, version=__version__, tolerance=f"{FLATNESS:.1E}", description=description
    )


def _table(numbers: range, template: str, *columns: Any) -> Iterator[str]:
    return (TRAILING_ZEROS.sub(r"\1", text) for text in rows(f"#%d={template};\n", numbers, *columns))


class _Lists:
    def __init__(self, begin: int, start: Ints) -> None:
        self.begin, self.start = begin, start

    def __getitem__(self, rows_range: slice) -> list[str]:
        start = self.start[rows_range.start : rows_range.stop + 1].tolist()
        named = [f"#{self.begin + k}" for k in range(start[0], start[-1])]
        return [",".join(named[a - start[0] : b - start[0]]) for a, b in pairwise(start)]


WARNING = "only programs that know AP242 tessellated geometry open this file; FreeCAD 0.20 and gmsh do not"


def tessellated_entities(part: Part) -> Iterator[str]:
    """Yield the text of a tessellated STEP file, which has triangles instead of faces."""
    shell, solids = solids_of(part)
    beginning = header(part.name, "tessellated solid (AP242), for viewers", len(solids))
    yield (
        beginning.replace(
            "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
            "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
        )
        .replace("'automotive_design',2000", "'ap242_managed_model_based_3d_engineering',2014")
        .replace("core data for automotive mechanical design processes", "managed model based 3d engineering")
    )
    entity_list = StepEntities(FIRST_FREE)
    for i, shells in enumerate(solids):
        used, corner = np.unique(part.F[np.isin(shell, shells)], return_inverse=True)
        number, face = entity_list.next(), entity_list.next()
        yield f"#{number}=COORDINATES_LIST('',{len(used)},("
        yield from comma_separated_rows(f"{_COORDINATES},\n", *part.V[used].T)
        # one face with all triangles; point i is row i of the coordinates
        yield f"));\n#{face}=TRIANGULATED_FACE('',#{number},{len(used)},(),$,(),("
        yield from comma_separated_rows("(%d,%d,%d),\n", *(corner.reshape(-1, 3) + 1).T)
        yield "));\n"
        yield from _product(entity_list, i, piece_name(part.name, i, len(solids)))
    yield "ENDSEC;\nEND-ISO-10303-21;\n"


def expected_bytes(part: Part) -> float:
    """Return an estimate of the size (bytes) of a tessellated STEP file, which has triangles."""
    digits = np.log10(max(np.abs(part.V).max(), 1.0)) + FACETED_DIGITS + 2.5
    return float(1500 + 3 * (digits + 1) * len(part.V) + (3 * np.log10(len(part.V)) + 8) * len(part.F))


def _product(entity_list: StepEntities, i: int, title: str) -> Iterator[str]:
    shape = entity_list.add(f"TESSELLATED_SOLID('',(#{entity_list.free - 1}),$)")
    representation = entity_list.add(f"TESSELLATED_SHAPE_REPRESENTATION('',(#18,#{shape}),#14)")
    definition = 8 if i == 0 else product(entity_list, title)
    entity_list.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{representation})")
    yield "".join(entity_list.text)
    entity_list.text.clear()


def check(part: Part, report: dict[str, float]) -> ReadBack:
    """Compare OCCT's report on a tessellated file with the part, and return the result.
    Raises ExportError if the number of triangles or the volume differs."""
    require_equal(part, "triangles", len(part.F), int(report["triangles"]))
    if not abs(report["volume"] - part.volume) <= READ_BACK * part.volume:
        raise ExportError(f"OCCT reads a wrong volume from the STEP file of {part.name!r}; write step = 'faceted'")
    return ReadBack(int(report["triangles"]), "triangles", report["volume"] / part.volume - 1)
