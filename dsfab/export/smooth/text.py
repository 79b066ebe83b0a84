"""The entities of smooth solids: spline skins with curves on them, posts, and ruled walls.

            upper edge                   An edge on a skin is a SURFACE_CURVE: a spline in space, and the curve over
     q' <-------------- p'               each chart's plane with the same parameter, which both skins share. The wall
     |     ruled wall   ^                is a B-spline surface on the poles of its two edges, seen here from outside;
post |                  | post           its points are those of the edges and are not written twice.
     v                  |
     q  --------------> p   lower edge
"""

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.plate_text import Entities, listed, references
from dsfab.export.smooth.edges import Edge
from dsfab.export.smooth.solid import Model, Piece
from dsfab.export.smooth.splines import Patch, Spline, straight

ROUNDING = 1e-5
"""Coordinates are rounded to this share of the thickness, at most, and to 1e-6 mm at least."""

PLANE = "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))"

SIDES = {"lower": (0, 0, "(1.,0.)"), "upper": (0, 1, "(1.,0.)"), "start": (0, 0, "(0.,1.)"), "end": (1, 0, "(0.,1.)")}
"""Sides of a wall: where they begin, in lengths of its sides, and their direction."""


class SmoothText:
    """Writes pieces of a model after what `new` holds already."""

    def __init__(self, new: Entities, model: Model) -> None:
        self.new, self.model = new, model
        self.digits = int(np.clip(np.ceil(-np.log10(ROUNDING * model.thickness)), 2, 6))
        self._skins: dict[tuple[int, bool], int] = {}

    def piece(self, piece: Piece) -> list[int]:
        """The faces of a piece."""
        new = self.new
        at = {v: self.model.nodes.at[v] for edge in piece.edges for v in (edge.start, edge.end)}
        vertices = {v: [new.add(f"VERTEX_POINT('',#{self._point(p)})") for p in both] for v, both in at.items()}
        edges, faces = list[tuple[int, int]](), list[int]()
        surfaces = [self._wall(edge) if edge.wall else 0 for edge in piece.edges]
        sides = dict[int, list[tuple[int, str, int]]]()
        for edge, wall in zip(piece.edges, surfaces, strict=True):
            if wall:
                sides.setdefault(edge.start, []).append((wall, "start", edge.spans))
                sides.setdefault(edge.end, []).append((wall, "end", edge.spans))
        posts = {v: self._post(vertices[v], at[v], sides[v]) for v in sorted(sides)}
        for edge, wall in zip(piece.edges, surfaces, strict=True):
            flat = {k: self._curve(curve, edge.spans) for k, curve in edge.flat.items()}
            ends = vertices[edge.start], vertices[edge.end]
            upper = self._edge(edge, flat, wall, True, (ends[0][0], ends[1][0]))
            lower = self._edge(edge, flat, wall, False, (ends[0][1], ends[1][1]))
            edges.append((upper, lower))
            if wall:
                steps = [(lower, True), (posts[edge.end], True), (upper, False), (posts[edge.start], False)]
                faces.append(new.face([new.wire(steps)], wall))
        for skin in piece.skins:
            kinds = ["FACE_BOUND" if j else "FACE_OUTER_BOUND" for j in range(len(skin.loops))]
            above = [
                new.wire([(edges[i][0], way) for i, way in loop], k) for loop, k in zip(skin.loops, kinds, strict=True)
            ]
            below = [
                new.wire([(edges[i][1], not way) for i, way in reversed(loop)], k)
                for loop, k in zip(skin.loops, kinds, strict=True)
            ]
            faces.append(new.face(above, self._skin(skin.chart, True)))
            faces.append(new.face(below, self._skin(skin.chart, False), same=False))
        return faces

    def _point(self, p: Floats) -> int:
        return self.new.once(f"CARTESIAN_POINT('',{listed(p, self.digits)})")

    def _post(self, vertices: list[int], ends: Floats, sides: list[tuple[int, str, int]]) -> int:
        """The edge from the lower to the upper point of a node, between two walls."""
        line = self._curve(straight(ends[1], ends[0]), 1)
        on = [self._on_wall(*side) for side in sides]
        return self._trimmed(line, on, (vertices[1], vertices[0]))

    def _edge(self, edge: Edge, flat: dict[int, int], wall: int, above: bool, ends: tuple[int, int]) -> int:
        """An edge's upper or lower curve on the skins of its charts, and on its wall."""
        on = [self._over(self._skin(chart, above), curve) for chart, curve in flat.items()]
        if wall:
            on.append(self._on_wall(wall, "upper" if above else "lower", edge.spans))
        return self._trimmed(self._curve(edge.upper if above else edge.lower, edge.spans), on, ends)

    def _trimmed(self, line: int, on: list[int], ends: tuple[int, int]) -> int:
        curve = self.new.add(f"SURFACE_CURVE('',#{line},{references(on)},.CURVE_3D.)")
        return self.new.add(f"EDGE_CURVE('',#{ends[0]},#{ends[1]},#{curve},.T.)")

    def _over(self, surface: int, curve: int) -> int:
        """A curve of a surface's parameters."""
        shown = self.new.once(f"DEFINITIONAL_REPRESENTATION('',(#{curve}),#{self.new.once(PLANE)})")
        return self.new.add(f"PCURVE('',#{surface},#{shown})")

    def _on_wall(self, wall: int, side: str, spans: int) -> int:
        """A side of a wall, whose parameters run from 0 to `spans` along it and to 1 upwards."""
        u, v, along = SIDES[side]
        start = self.new.once(f"CARTESIAN_POINT('',({u * spans}.,{v}.))")
        way = self.new.once(f"DIRECTION('',{along})")
        vector = self.new.once(f"VECTOR('',#{way},1.)")
        return self._over(wall, self.new.once(f"LINE('',#{start},#{vector})"))

    def _curve(self, curve: Spline, spans: int) -> int:
        """A curve with the parameters 0 to `spans`; a line is the shortest to write as a polyline, which has 0 to 1."""
        poles = references([self._point(p) for p in curve.poles])
        if curve.degree == 1 and spans == 1:
            return self.new.add(f"POLYLINE('',{poles})")
        times, knots = _counted(spans * curve.knots)
        return self.new.add(
            f"B_SPLINE_CURVE_WITH_KNOTS('',{curve.degree},{poles},.UNSPECIFIED.,.F.,.F.,{times},{knots},.UNSPECIFIED.)"
        )

    def _wall(self, edge: Edge) -> int:
        """The ruled surface between an edge's two curves; its normal points to their right: outwards."""
        rows = ((self._point(p), self._point(q)) for p, q in zip(edge.lower.poles, edge.upper.poles, strict=True))
        poles = ",".join(references(list(row)) for row in rows)
        return self._surface((edge.lower.degree, 1), poles, edge.spans * edge.lower.knots, np.array([0.0, 0, 1, 1]))

    def _skin(self, chart: int, above: bool) -> int:
        if (chart, above) not in self._skins:
            patch: Patch = self.model.charts[chart].upper if above else self.model.charts[chart].lower
            poles = ",".join(references([self._point(p) for p in row]) for row in patch.poles)
            self._skins[chart, above] = self._surface((3, 3), poles, patch.u, patch.v)
        return self._skins[chart, above]

    def _surface(self, degrees: tuple[int, int], poles: str, u: Floats, v: Floats) -> int:
        (many, knots), (times, others) = _counted(u), _counted(v)
        return self.new.add(
            f"B_SPLINE_SURFACE_WITH_KNOTS('',{degrees[0]},{degrees[1]},({poles}),.UNSPECIFIED.,.F.,.F.,.F.,"
            f"{many},{times},{knots},{others},.UNSPECIFIED.)"
        )


def _counted(knots: Floats) -> tuple[str, str]:
    """How often each knot counts, and the knots."""
    values, times = np.unique(knots, return_counts=True)
    return "(" + ",".join(str(k) for k in times.tolist()) + ")", listed(values, 14)
