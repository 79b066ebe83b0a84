"""The entities of a STEP file for flat sheets: planes with wires of lines and splines, and walls straight across.

          top edge                       A wall is a plane or a SURFACE_OF_LINEAR_EXTRUSION of its lower edge, seen
     q' <----------- p'                  here from outside. The skins are planes; their wires are the same curves
     |               ^                   in two heights. No edge or vertex is written twice, so closed is closed.
post |     wall      | post
     v               |
     q  -----------> p   lower edge (counter-clockwise about the material, seen from above: it lies behind)
"""

from collections.abc import Iterator

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.curves import Curve
from dsfab.export.plate import Plate
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import DIGITS, DIRECTION_DIGITS, FIRST, header
from dsfab.export.text import TRAILING_ZEROS


class Entities:
    """The numbered entities; points and directions are written once."""

    def __init__(self, more: int = 0) -> None:
        """more : decimals of points and directions over the usual ones."""
        self.text: list[str] = []
        self._digits, self._direction_digits = DIGITS + more, DIRECTION_DIGITS + more
        self._known: dict[str, int] = {}

    def add(self, body: str) -> int:
        """The number of a new entity."""
        number = self.free
        self.text.append(f"#{number}={body};\n")
        return number

    @property
    def free(self) -> int:
        """The number that the next entity gets."""
        return FIRST + len(self.text)

    def once(self, body: str) -> int:
        """The number of an entity that may be there already."""
        if body not in self._known:
            self._known[body] = self.add(body)
        return self._known[body]

    def point(self, p: Floats) -> int:
        """The number of a point p (3,), millimetres."""
        return self.once(f"CARTESIAN_POINT('',{step_list(p, self._digits)})")

    def direction(self, d: Floats) -> int:
        """The number of a direction d (3,) of any length."""
        return self.once(f"DIRECTION('',{step_list(d / np.linalg.norm(d), self._direction_digits)})")

    def line(self, p: Floats, along: Floats) -> int:
        """The number of a new line through p (3,), millimetres, along a direction (3,)."""
        vector = self.once(f"VECTOR('',#{self.direction(along)},1.)")
        return self.add(f"LINE('',#{self.point(p)},#{vector})")

    def plane(self, p: Floats, normal: Floats) -> int:
        """The number of a new plane through p (3,), millimetres, with a normal (3,)."""
        axes = self.add(f"AXIS2_PLACEMENT_3D('',#{self.point(p)},#{self.direction(normal)},$)")
        return self.add(f"PLANE('',#{axes})")

    def wire(self, steps: list[tuple[int, bool]], kind: str = "FACE_OUTER_BOUND") -> int:
        """A bound of edges, each with whether it is run through forwards."""
        oriented = [self.add(f"ORIENTED_EDGE('',*,*,#{edge},.{'T' if way else 'F'}.)") for edge, way in steps]
        loop = self.add(f"EDGE_LOOP('',{references(oriented)})")
        return self.add(f"{kind}('',#{loop},.T.)")

    def face(self, bounds: list[int], surface: int, same: bool = True) -> int:
        """A face; same : whether it looks where its surface's normal points."""
        return self.add(f"ADVANCED_FACE('',{references(bounds)},#{surface},.{'T' if same else 'F'}.)")


def plate_entities(plate: Plate, name: str) -> Iterator[str]:
    """The text of the file: a solid for each piece."""
    yield header(name, f"flat solid, outline within {plate.deviation:.2g} mm of the mesh", len(plate.pieces))
    new, shells, faces = Entities(), list[int](), list[int]()
    for i, loops in enumerate(plate.pieces):
        made = _piece(new, plate, loops)
        faces += made
        shells += [i] * len(made)
    yield "".join(new.text)
    yield from closing(np.array(shells), [[i] for i in range(len(plate.pieces))], np.array(faces), new.free, name)


def _piece(new: Entities, plate: Plate, loops: tuple[tuple[Curve, ...], ...]) -> list[int]:
    """The faces of one piece: its walls, and the two skins."""
    axes, heights = plate.outlines.axes, plate.outlines.height
    walls, skins = list[int](), ([], [])  # type: tuple[list[int], tuple[list[int], list[int]]]
    for j, loop in enumerate(loops):
        kind = "FACE_BOUND" if j else "FACE_OUTER_BOUND"
        ends = [np.stack([_lifted(c.poles[:1], axes, h)[0] for c in loop]) for h in heights]
        vertices = [[new.add(f"VERTEX_POINT('',#{new.point(p)})") for p in row] for row in ends]
        posts = [
            new.add(f"EDGE_CURVE('',#{v},#{w},#{new.line(p, axes[2])},.T.)")
            for v, w, p in zip(*vertices, ends[0], strict=True)
        ]
        edges = list[tuple[int, int]]()
        for k, curve in enumerate(loop):
            after = (k + 1) % len(loop)
            poles = [_lifted(curve.poles, axes, h) for h in heights]
            lines = [curve_entity(new, curve, p) for p in poles]
            low, high = (
                new.add(f"EDGE_CURVE('',#{row[k]},#{row[after]},#{line},.T.)")
                for row, line in zip(vertices, lines, strict=True)
            )
            edges.append((low, high))
            wire = new.wire([(low, True), (posts[after], True), (high, False), (posts[k], False)])
            walls.append(new.face([wire], _wall(new, curve, poles[0], lines[0], axes[2])))
        skins[0].append(new.wire([(low, False) for low, _ in reversed(edges)], kind))
        skins[1].append(new.wire([(high, True) for _, high in edges], kind))
    corner = _lifted(loops[0][0].poles[:1], axes, heights[0])[0], _lifted(loops[0][0].poles[:1], axes, heights[1])[0]
    bottom = new.face(skins[0], new.plane(corner[0], -axes[2]))
    return [*walls, bottom, new.face(skins[1], new.plane(corner[1], axes[2]))]


def _lifted(points: Floats, axes: Floats, height: float) -> Floats:
    """Points of the plane in space."""
    return np.asarray(points @ axes[:2] + height * axes[2])


def curve_entity(new: Entities, curve: Curve, poles: Floats, title: str = "", bounded: bool = False) -> int:
    """A line (bounded: a polyline of two points), or a spline, with poles (p, 3), millimetres: each knot once, with how
    often it counts."""
    if curve.straight and bounded:
        return new.add(f"POLYLINE('{title}',{references([new.point(p) for p in poles])})")
    if curve.straight:
        return new.line(poles[0], poles[-1] - poles[0])
    knots, times = np.unique(curve.knots, return_counts=True)
    through = references([new.point(p) for p in poles])
    counts = ",".join(str(k) for k in times.tolist())
    return new.add(
        f"B_SPLINE_CURVE_WITH_KNOTS('{title}',{curve.degree},{through},.UNSPECIFIED.,.F.,.F.,({counts}),"
        f"{step_list(knots, DIGITS)},.UNSPECIFIED.)"
    )


def _wall(new: Entities, curve: Curve, poles: Floats, line: int, across: Floats) -> int:
    """The surface above a curve, whose normal points to the right of it: outwards."""
    if curve.straight:
        return new.plane(poles[0], np.cross(poles[-1] - poles[0], across))
    vector = new.once(f"VECTOR('',#{new.direction(across)},1.)")
    return new.add(f"SURFACE_OF_LINEAR_EXTRUSION('',#{line},#{vector})")


def step_list(values: Floats, digits: int) -> str:
    """The values (k,) as '(1.5,0.,-2.)': without the zeros at the end of each."""
    text = ",".join(f"{v:.{digits}f}" for v in (np.round(values, digits) + 0.0).tolist())
    return TRAILING_ZEROS.sub(r"\1", f"({text})")


def references(numbers: list[int]) -> str:
    """The entities of these numbers as '(#7,#8,#9)'."""
    return "(" + ",".join(f"#{k}" for k in numbers) + ")"
