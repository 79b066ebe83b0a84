"""The entities of smooth solids: spline skins, their edges, posts, and ruled walls.

            upper edge                   An edge on a skin is a spline in space. It may have, as SURFACE_CURVE, the
     q' <-------------- p'               curve over each chart's plane with the same parameter, which both skins share.
     |     ruled wall   ^                The wall is a B-spline surface on the poles of its two edges, seen here from
post |                  | post           outside; its points are those of the edges and are not written twice.
     v                  |
     q  --------------> p   lower edge

Curves on surfaces, a third of a file, can be found again by projection, and OCCT is as quick at that as at reading
them; they are written only of a piece that was refused without them.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.plate_text import Entities, references, step_list
from dsfab.export.smooth.edges import Edge
from dsfab.export.smooth.patches import Patch
from dsfab.export.smooth.solid import SmoothModel, SmoothPiece, SmoothSkin
from dsfab.export.splines import Spline, straight

ROUNDING = 3e-5
"""Coordinates are rounded to this share of the thickness, at most, and to 1e-6 mm at least."""

PLANE = "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))"

SIDES = {"lower": (0, 0, "(1.,0.)"), "upper": (0, 1, "(1.,0.)"), "start": (0, 0, "(0.,1.)"), "end": (1, 0, "(0.,1.)")}
"""Sides of a wall: where they begin, in lengths of its sides, and their direction."""


class SmoothText:
    """Writes pieces of a model after what `new` holds already."""

    def __init__(self, new: Entities, model: SmoothModel) -> None:
        self.new, self.model = new, model
        self.digits = int(np.clip(np.ceil(-np.log10(ROUNDING * model.thickness)), 2, 6))
        self._skins: dict[tuple[int, bool], int] = {}

    def piece(self, piece: SmoothPiece) -> list[int]:
        """The faces of a piece."""
        new = self.new
        at = {v: self.model.nodes.at[v] for edge in piece.edges for v in (edge.start, edge.end)}
        vertices = {v: [new.add(f"VERTEX_POINT('',#{p})") for p in self._points(both)] for v, both in at.items()}
        edges, faces = list[tuple[int, int]](), list[int]()
        poles = [[list(self._points(line.poles)) for line in (edge.upper, edge.lower)] for edge in piece.edges]
        surfaces = [
            self._wall(edge, through) if edge.wall else 0 for edge, through in zip(piece.edges, poles, strict=True)
        ]
        sides = dict[int, list[tuple[int, str, int]]]()
        for edge, wall in zip(piece.edges, surfaces, strict=True):
            if wall:
                sides.setdefault(edge.start, []).append((wall, "start", edge.spans))
                sides.setdefault(edge.end, []).append((wall, "end", edge.spans))
        posts = {v: self._post(vertices[v], at[v], sides[v] if piece.traced else []) for v in sorted(sides)}
        for edge, wall, (above, below) in zip(piece.edges, surfaces, poles, strict=True):
            flat = {k: self._line(curve, edge.spans) for k, curve in edge.flat.items() if piece.traced}
            ends = vertices[edge.start], vertices[edge.end]
            on = wall if piece.traced else 0
            upper = self._edge(edge, above, flat, on, True, (ends[0][0], ends[1][0]))
            lower = self._edge(edge, below, flat, on, False, (ends[0][1], ends[1][1]))
            edges.append((upper, lower))
            if wall:
                steps = [(lower, True), (posts[edge.end], True), (upper, False), (posts[edge.start], False)]
                faces.append(new.face([new.wire(steps)], wall))
        return faces + [face for skin in piece.skins for face in self._both(skin, edges)]

    def _both(self, skin: SmoothSkin, edges: list[tuple[int, int]]) -> tuple[int, int]:
        """The upper and the lower face of a region."""
        new = self.new
        kinds = ["FACE_BOUND" if j else "FACE_OUTER_BOUND" for j in range(len(skin.loops))]
        above = [
            new.wire([(edges[i][0], way) for i, way in loop], k) for loop, k in zip(skin.loops, kinds, strict=True)
        ]
        below = [
            new.wire([(edges[i][1], not way) for i, way in reversed(loop)], k)
            for loop, k in zip(skin.loops, kinds, strict=True)
        ]
        upper = new.face(above, self._skin(skin.chart, True))
        return upper, new.face(below, self._skin(skin.chart, False), same=False)

    def _points(self, points: Floats) -> Iterator[int]:
        """Of points (k, d), written as `step_list` does: rounded all at once, in a third of the time."""
        for p in (np.round(points, self.digits) + 0.0).tolist():
            text = ",".join([f"{v:.{self.digits}f}".rstrip("0") for v in p])
            yield self.new.once(f"CARTESIAN_POINT('',({text}))")

    def _post(self, vertices: list[int], ends: Floats, sides: list[tuple[int, str, int]]) -> int:
        """The edge from the lower to the upper point of a node, between two walls."""
        line = self._line(straight(ends[1], ends[0]), 1)
        on = [self._on_wall(*side) for side in sides]
        return self._trimmed(line, on, (vertices[1], vertices[0]))

    def _edge(
        self, edge: Edge, poles: list[int], flat: dict[int, int], wall: int, above: bool, ends: tuple[int, int]
    ) -> int:
        """An edge's upper or lower curve on the skins of its charts, and on its wall."""
        on = [self._over(self._skin(chart, above), curve) for chart, curve in flat.items()]
        if wall:
            on.append(self._on_wall(wall, "upper" if above else "lower", edge.spans))
        return self._trimmed(self._curve(edge.upper if above else edge.lower, poles, edge.spans), on, ends)

    def _trimmed(self, line: int, on: list[int], ends: tuple[int, int]) -> int:
        curve = self.new.add(f"SURFACE_CURVE('',#{line},{references(on)},.CURVE_3D.)") if on else line
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

    def _line(self, curve: Spline, spans: int) -> int:
        """A curve whose poles are not written yet."""
        return self._curve(curve, list(self._points(curve.poles)), spans)

    def _curve(self, curve: Spline, through: list[int], spans: int) -> int:
        """A curve with the parameters 0 to `spans`.

        A line too: a polyline that an edge lies on has three points at least (ISO 10303-511, advanced_face).
        """
        poles = references(through)
        times, knots = _counted(spans * curve.knots)
        return self.new.add(
            f"B_SPLINE_CURVE_WITH_KNOTS('',{curve.degree},{poles},.UNSPECIFIED.,.F.,.F.,{times},{knots},.UNSPECIFIED.)"
        )

    def _wall(self, edge: Edge, poles: list[list[int]]) -> int:
        """The ruled surface between an edge's two curves; its normal points to their right: outwards."""
        upper, lower = poles
        rows = ",".join(references(list(row)) for row in zip(lower, upper, strict=True))
        return self._surface((edge.lower.degree, 1), rows, edge.spans * edge.lower.knots, np.array([0.0, 0, 1, 1]))

    def _skin(self, chart: int, above: bool) -> int:
        if (chart, above) not in self._skins:
            patch: Patch = self.model.charts[chart].upper if above else self.model.charts[chart].lower
            poles = ",".join(references(list(self._points(row))) for row in patch.poles)
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
    return _counted_bytes(knots.tobytes())


@lru_cache(maxsize=1024)
def _counted_bytes(knots: bytes) -> tuple[str, str]:
    """Most curves have one of a few lists of knots."""
    values, times = np.unique(np.frombuffer(knots), return_counts=True)
    return "(" + ",".join(str(k) for k in times.tolist()) + ")", step_list(values, 14)
