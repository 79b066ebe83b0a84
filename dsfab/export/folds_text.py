"""The entities of a STEP file for folded sheets: planes that share their folds, and ruled walls. See `plate_text`."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.coplanar import FLATNESS
from dsfab.export.curves import Curve
from dsfab.export.folds import Facet, FoldedShape, folded_shape, folded_sheet, is_fold, region_lines
from dsfab.export.part import Part
from dsfab.export.plate import enclosed, outlines_of, plate
from dsfab.export.plate_text import Entities, curve_entity, plate_entities, references, step_list
from dsfab.export.smooth.outline import OutlineRun, Region
from dsfab.export.smooth.seams import Key, run_key
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import DIGITS, header

MORE = 2
"""Decimals of points and directions over the usual ones: edges keep to a plane aslant under 1e-7 mm, the least
tolerance that OCCT gives. Over it a fillet that shortens an edge finds the tolerance of all of it a bit too small."""

Edges = tuple[int, int]
"""The edges of a run on the upper skin and on the lower one."""


def folded_entities(shape: FoldedShape, name: str) -> Iterator[str]:
    """The text of the file: a solid for each piece."""
    pieces = shape.sheet.outline.count
    yield header(name, f"folded solid of flat facets, outline within {shape.deviation:.2g} mm of the mesh", pieces)
    writer = _Writer(shape)
    shells, faces = list[int](), list[int]()
    for region in shape.sheet.outline.regions:
        made = writer.region(region)
        faces += made
        shells += [region.piece] * len(made)
    yield "".join(writer.new.text)
    yield from closing(np.array(shells), [[i] for i in range(pieces)], np.array(faces), writer.new.free, name)


class PlanarFile(NamedTuple):
    """Faces, the text, how far its outline is off the mesh, millimetres, and flat facets: 1 of a sheet in one plane."""

    faces: int
    texts: list[str]
    deviation: float
    facets: int


def planar_file(part: Part) -> PlanarFile:
    """The file of a flat sheet, or of a folded one; raises ExportError, with the reason, for any other solid."""
    folded = folded_sheet(part)
    if folded is None:
        flat = plate(outlines_of(part), part.corners, part.tolerance)
        return PlanarFile(flat.faces, list(plate_entities(flat, part.name)), flat.deviation, 1)
    shape = folded_shape(folded, part.tolerance)
    return PlanarFile(shape.faces, list(folded_entities(shape, part.name)), shape.deviation, folded.count)


class _Writer:
    """Writes regions; what two of them share is written once."""

    def __init__(self, shape: FoldedShape) -> None:
        self.new, self.shape, self.sheet = Entities(more=MORE), shape, shape.sheet
        self.vertices, self.posts, self.edges = dict[int, Edges](), dict[int, int](), dict[Key, Edges]()

    def region(self, region: Region) -> list[int]:
        """The faces of a region: walls, and both skins."""
        facet, lines = self.sheet.facets[region.chart], region_lines(self.sheet, region)
        order = sorted(range(len(lines)), key=lambda i: -enclosed(lines[i][:, :2]))
        faces, bounds = list[int](), (list[int](), list[int]())
        for i in order:
            kind = "FACE_BOUND" if bounds[0] else "FACE_OUTER_BOUND"
            steps = list[tuple[Edges, bool]]()
            for run in region.loops[i]:
                if is_fold(run):
                    steps.append(self._fold(run))
                else:
                    known, walls = self._walls(run, facet)
                    steps += [(both, True) for both in known]
                    faces += walls
            bounds[0].append(self.new.wire([(both[0], ahead) for both, ahead in steps], kind))
            bounds[1].append(self.new.wire([(both[1], not ahead) for both, ahead in reversed(steps)], kind))
        for s, way in ((0, 1), (1, -1)):
            plane = self.new.plane(facet.origin[s], way * facet.axes[s, 2])
            faces.append(self.new.face(bounds[s], plane))
        return faces

    def _fold(self, run: OutlineRun) -> tuple[Edges, bool]:
        """Both edges of a fold, which its two facets share, and whether the run goes along them."""
        key, ahead = run_key(run)
        if key not in self.edges:
            way = run.vertices[[0, -1]] if ahead else run.vertices[[-1, 0]]
            p, q = self.sheet.points[way]
            a, b = (self._vertex(int(v)) for v in way)
            self.edges[key] = self._edges(a, b, [self.new.line(p[s], q[s] - p[s]) for s in (0, 1)])
        return self.edges[key], ahead

    def _walls(self, run: OutlineRun, facet: Facet) -> tuple[list[Edges], list[int]]:
        """Both edges of each wall of a run, and its faces: seen from outside, lower edges go to the right."""
        chain, vertices, posts = self.shape.walls[run_key(run)[0]], list[Edges](), list[int]()
        for v in run.vertices[[0, -1]]:
            vertices.append(self._vertex(int(v)))
            posts.append(self._post(int(v)))
        for i, curve in enumerate(chain[:-1], 1):
            points = facet.lifted(curve.poles[-1:])[0]
            vertices.insert(i, self._new_vertex(points))
            posts.insert(i, self._new_post(vertices[i], points))
        known, faces = list[Edges](), list[int]()
        for i, curve in enumerate(chain):
            poles = facet.lifted(curve.poles)
            curves = [curve_entity(self.new, curve, poles[:, s]) for s in (0, 1)]
            upper, lower = self._edges(vertices[i], vertices[i + 1], curves)
            wire = self.new.wire([(lower, True), (posts[i + 1], True), (upper, False), (posts[i], False)])
            faces.append(self.new.face([wire], self._ruled(curve, poles)))
            known.append((upper, lower))
        return known, faces

    def _edges(self, a: Edges, b: Edges, curves: list[int]) -> Edges:
        """The edges from vertices a to vertices b of both skins."""
        upper, lower = (self.new.add(f"EDGE_CURVE('',#{a[s]},#{b[s]},#{curves[s]},.T.)") for s in (0, 1))
        return upper, lower

    def _vertex(self, v: int) -> Edges:
        if v not in self.vertices:
            self.vertices[v] = self._new_vertex(self.sheet.points[v])
        return self.vertices[v]

    def _post(self, v: int) -> int:
        """The edge from the lower to the upper point of a vertex."""
        if v not in self.posts:
            self.posts[v] = self._new_post(self._vertex(v), self.sheet.points[v])
        return self.posts[v]

    def _new_vertex(self, points: Floats) -> Edges:
        upper, lower = (self.new.add(f"VERTEX_POINT('',#{self.new.point(p)})") for p in points)
        return upper, lower

    def _new_post(self, vertex: Edges, points: Floats) -> int:
        (upper, lower), (p, q) = vertex, points
        return self.new.add(f"EDGE_CURVE('',#{lower},#{upper},#{self.new.line(q, p - q)},.T.)")

    def _ruled(self, curve: Curve, poles: Floats) -> int:
        """The surface between the curves with poles (p, 2, 3), upper and lower; its normal points outwards."""
        upper, lower = poles[:, 0], poles[:, 1]
        across = np.cross(lower[-1] - lower[0], upper[0] - lower[0])
        normal = across / max(float(np.linalg.norm(across)), 1e-300)
        if np.abs((poles - lower[0]) @ normal).max() <= FLATNESS:
            return self.new.plane(lower[0], normal)
        knots, times = np.unique(curve.knots, return_counts=True)
        rows = ",".join(references([self.new.point(p) for p in both]) for both in zip(lower, upper, strict=True))
        counts = ",".join(str(k) for k in times.tolist())
        return self.new.add(
            f"B_SPLINE_SURFACE_WITH_KNOTS('',{curve.degree},1,({rows}),.UNSPECIFIED.,.F.,.F.,.F.,"
            f"({counts}),(2,2),{step_list(knots, DIGITS)},(0.,1.),.UNSPECIFIED.)"
        )
