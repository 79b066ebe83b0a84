"""The entities of solids by members: Bezier patches on both skins, ruled walls, and the posts between their ends.

All are splines with knots. Quasi-uniform splines say the same with 8 % fewer bytes, and the only reader that was tried
beside OCCT, volmdlr 0.15, knows their names and fails on them.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.beyond import LongSeam
from dsfab.export.network.graph import Loop
from dsfab.export.network.model import NetModel, NetPatch
from dsfab.export.network.parabolas import fewest
from dsfab.export.network.trimmed import TrimmedFace
from dsfab.export.plate_text import Entities, references
from dsfab.export.smooth.text import PLANE, ROUNDING

ALONG = 7
"""Digits after the point of millimetres along edges. An edge that is a part of a patch's side has other poles than the
side, and OCCT takes what is off by less than 1e-7 as exact. What is off by more it measures at some points of an edge;
of one that a fillet makes shorter at others, and where it is off by a thousandth more there, that is invalid."""

OVER = 12
"""Digits after the point of places on surfaces, which are a square."""

NO_SEAMS: Mapping[int, LongSeam] = MappingProxyType({})


class NetText:
    """Writes a model after what `new` holds already; thickness in millimetres. What a model with a seam has twice is
    written once."""

    def __init__(self, new: Entities, model: NetModel, thickness: float) -> None:
        self.new, self.model = new, model
        self._put = new.once if model.seam else new.add
        self.digits = int(np.clip(np.ceil(-np.log10(ROUNDING * thickness)), 2, 6))
        self._numbers = dict[tuple[float, ...], int]()
        self.vertices = [
            [self._put(f"VERTEX_POINT('',#{p})") for p in self._points(both.reshape(2, 3))] for both in model.vertices
        ]
        self.edges = list[list[int]]()

    def faces(self, trimmed: list[TrimmedFace], seams: Mapping[int, LongSeam] = NO_SEAMS) -> list[int]:
        """The numbers of all faces. seams : by edge those that go on beyond it."""
        found, posts = list[int](), dict[tuple[int, int], int]()
        skins: list[NetPatch | TrimmedFace] = [*self.model.patches, *trimmed]
        surfaces = {i: self._surfaces(skins[i]) for i in sorted({i for seam in seams.values() for i in seam.on})}
        self._add_edges(seams, surfaces)
        for i, skin in enumerate(skins):
            loops = skin.loops if isinstance(skin, TrimmedFace) else [skin.loop]
            both = surfaces[i] if i in surfaces else self._surfaces(skin)
            found += [self._skin(loops, both[s], s) for s in (0, 1)]
        for wall in self.model.walls:
            (first, way), (last, ahead) = wall.steps[0], wall.steps[-1]
            start, end = self.model.edges[first], self.model.edges[last]
            one, two = (
                self._post(posts, v) for v in (start.start if way else start.end, end.end if ahead else end.start)
            )
            poles = fewest(wall.poles, 0)
            outer, inner = (list(self._points(poles[:, s : s + 3])) for s in (0, 3))
            surface = self._surface([list(row) for row in zip(inner, outer, strict=True)])
            below = [(self.edges[e][1], way) for e, way in wall.steps]
            above = [(self.edges[e][0], not way) for e, way in wall.steps[::-1]]
            wire = self.new.wire([*below, two, *above, (one[0], not one[1])], "FACE_BOUND")
            found.append(self.new.face([wire], surface))
        return found

    def _surfaces(self, skin: NetPatch | TrimmedFace) -> list[int]:
        """The outer and the inner surface of a face."""
        if isinstance(skin, TrimmedFace):
            digits = ALONG + 1 if skin.exact else ALONG - 1
            return [self._surface(self._grid(poles, digits)) for poles in (skin.outer, skin.inner)]
        both = np.split(fewest(fewest(skin.poles, 0), 1), 2, axis=2)
        return [self._surface(self._grid(poles, ALONG + 1) if skin.within else self._rows(poles)) for poles in both]

    def _add_edges(self, seams: Mapping[int, LongSeam], surfaces: Mapping[int, list[int]]) -> None:
        """All edges, of which some are parts of curves that have places on surfaces."""
        given = [seams[e].poles if e in seams else edge.poles for e, edge in enumerate(self.model.edges)]
        self.poles = self._pole_numbers([fewest(poles, 0) for poles in given])
        for e, (edge, two) in enumerate(zip(self.model.edges, self.poles, strict=True)):
            on = seams[e].on if e in seams else {}
            curves = [self._put(bezier(poles)) for poles in two]
            for s in (0, 1) if on else ():
                lines = references([self._on_surface(uv[s], surfaces[i][s]) for i, uv in on.items()])
                curves[s] = self.new.add(f"SURFACE_CURVE('',#{curves[s]},{lines},.PCURVE_S1.)")
            ends = zip(self.vertices[edge.start], self.vertices[edge.end], curves, strict=True)
            self.edges.append([self._put(f"EDGE_CURVE('',#{a},#{b},#{curve},.T.)") for a, b, curve in ends])

    def _on_surface(self, uv: Floats, surface: int) -> int:
        """A curve with poles (k, 2) over a surface."""
        points = [
            self.new.once(f"CARTESIAN_POINT('',({','.join(f'{x:.{OVER}f}'.rstrip('0') for x in p)}))")
            for p in (np.round(uv, OVER) + 0.0).tolist()
        ]
        curve = self.new.add(bezier(points))
        line = self.new.add(f"DEFINITIONAL_REPRESENTATION('',(#{curve}),#{self.new.once(PLANE)})")
        return self.new.add(f"PCURVE('',#{surface},#{line})")

    def _skin(self, loops: list[Loop], surface: int, s: int) -> int:
        """A face of the outer (0) or the inner (1) skin; its loops run the other way there."""
        wires = []
        for i, loop in enumerate(loops):
            steps = [(self.edges[e][s], ahead != bool(s)) for e, ahead in (loop[::-1] if s else loop)]
            wires.append(self.new.wire(steps, "FACE_OUTER_BOUND" if len(loops) > 1 and not i else "FACE_BOUND"))
        return self.new.face(wires, surface, same=not s)

    def _rows(self, poles: Floats) -> list[list[int]]:
        """Of a patch's poles (j, k, 3), which are on edges but for the inner ones."""
        poles = poles.copy()
        poles[1:-1, 1:-1] = np.round(poles[1:-1, 1:-1], self.digits)
        return self._grid(poles, ALONG)

    def _points(self, points: Floats, digits: int = ALONG) -> Iterator[int]:
        """Of points (k, 3), those that are equal once."""
        known = self._numbers
        for p in map(tuple, (np.round(points, digits) + 0.0).tolist()):
            if p not in known:
                text = ",".join([f"{v:.{digits}f}".rstrip("0") for v in p])
                known[p] = self.new.once(f"CARTESIAN_POINT('',({text}))")
            yield known[p]

    def _pole_numbers(self, lines: list[Floats]) -> list[list[list[int]]]:
        """Of the poles of curves (k, 6), on the outer and on the inner skin."""
        found, at = list(self._points(np.concatenate([line[:, s : s + 3] for line in lines for s in (0, 3)]))), 0
        numbers = list[list[list[int]]]()
        for k in map(len, lines):
            numbers.append([found[at : at + k], found[at + k : at + 2 * k]])
            at += 2 * k
        return numbers

    def _grid(self, poles: Floats, digits: int) -> list[list[int]]:
        """Of a grid of points (r, k, 3), row by row."""
        found = list(self._points(poles.reshape(-1, 3), digits))
        return [found[i : i + poles.shape[1]] for i in range(0, len(found), poles.shape[1])]

    def _post(self, posts: dict[tuple[int, int], int], vertex: int) -> tuple[int, bool]:
        """The edge between both points of a vertex, and whether it runs to the outer one."""
        outer, inner = self.vertices[vertex]
        if (outer, inner) in posts:
            return posts[outer, inner], False  # it was made for the other side of a seam
        if (inner, outer) not in posts:
            ends = [next(self._points(self.model.vertices[vertex][None, i : i + 3])) for i in (3, 0)]
            posts[inner, outer] = self.new.add(f"EDGE_CURVE('',#{inner},#{outer},#{self.new.add(bezier(ends))},.T.)")
        return posts[inner, outer], True

    def _surface(self, rows: list[list[int]]) -> int:
        """A Bezier patch, as a spline with one span."""
        poles, (j, k) = ",".join(references(row) for row in rows), (len(rows), len(rows[0]))
        return self.new.add(
            f"B_SPLINE_SURFACE_WITH_KNOTS('',{j - 1},{k - 1},({poles}),.UNSPECIFIED.,.F.,.F.,.F.,"
            f"({j},{j}),({k},{k}),(0.,1.),(0.,1.),.UNSPECIFIED.)"
        )


def bezier(poles: list[int]) -> str:
    """The entity of a Bezier curve through the points with these numbers, as a spline with one span.

    A line too: a polyline that an edge lies on has three points at least (ISO 10303-511, advanced_face).
    """
    k = len(poles)
    return (
        f"B_SPLINE_CURVE_WITH_KNOTS('',{k - 1},{references(poles)},.UNSPECIFIED.,.F.,.F.,({k},{k}),(0.,1.),"
        ".UNSPECIFIED.)"
    )
