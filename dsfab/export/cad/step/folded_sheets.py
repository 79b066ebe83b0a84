"""STEP entities of folded sheets: flat facets and ruled walls."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, group_sums, unit_vectors
from dsfab.core.derived import derived
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.entities import StepEntities, bezier_knots, knot_text
from dsfab.export.cad.step.flat_sheets import (
    GAP_SHARE,
    WIDTH_SHARE,
    NotFlatError,
    frame,
    gaps_between,
    outlines_of,
    plate,
    plate_entities,
    signed_loop_area,
)
from dsfab.export.cad.step.planar import FLATNESS, coplanar_regions
from dsfab.export.cad.step.shared.sheet_outline import WALL, ChartRegion, OutlineRun, SheetOutline, both_skins, sheet_of
from dsfab.export.cad.step.smooth.edges import RunKey, run_key
from dsfab.export.curves import Curve, fitted_curve, split_at_knots
from dsfab.export.part import DividedSheet, Part
from dsfab.export.splines import arc_lengths
from dsfab.surface import CREASE, edge_table


@dataclass(frozen=True, eq=False)
class Facet:
    """Planes of a flat part of a sheet, one on each skin, the upper first, mm. origin : (2, 3) point of each plane.
    axes : (2, 3, 3) right-handed unit vectors: two in each plane, and the normal upwards."""

    origin: Floats
    axes: Floats

    def flat(self, points: Floats) -> Floats:
        """Return coordinates (k, 4) of pairs of points (k, 2, 3): two in the upper plane, then two in the lower."""
        return np.asarray(np.einsum("ksi,sai->ksa", points - self.origin, self.axes[:, :2]).reshape(-1, 4))

    def in_space(self, flat: Floats) -> Floats:
        """Return pairs of points (k, 2, 3), one in each plane, from the coordinates (k, 4) of `flat`."""
        return np.asarray(self.origin + np.einsum("ksa,sai->ksi", flat.reshape(-1, 2, 2), self.axes[:, :2]))


@dataclass(frozen=True, eq=False)
class FlatFacets:
    """Cut sheet with faces in a few planes (facets). Its vertices are not yet exactly in these planes.
    skins : (n, 2, 3) vertices on both skins, mm.    facet : (m,) facet of each face.
    shift : distance of the sheet's middle from the surface / half the thickness: 0, 1 or -1."""

    whole: DividedSheet
    shift: int
    skins: Floats
    facet: Ints
    thickness: float

    @cached_property
    def has_creases(self) -> bool:
        """True if folds over 30 degrees have at least half of the length of all folds."""
        F, upper = self.whole.F, self.skins[:, 0]
        h, k = edge_table(F).pairs.T
        fold = self.facet[h // 3] != self.facet[k // 3]
        h, k = h[fold], k[fold]
        normals = unit_vectors(group_sums(self.facet, area_vectors(upper, F)))
        length = np.linalg.norm(upper[F.ravel()[h - h % 3 + (h + 1) % 3]] - upper[F.ravel()[h]], axis=1)
        turn = np.einsum("ei,ei->e", normals[self.facet[h // 3]], normals[self.facet[k // 3]])
        return bool(2 * length[turn < np.cos(np.radians(CREASE))].sum() >= length.sum() > 0)


@dataclass(frozen=True, eq=False)
class FoldedSheet:
    """Sheet that consists of flat facets, millimetres.
    outline : outlines of all facets; each chart is a facet.    points : (n, 2, 3) vertices on both skins."""

    outline: SheetOutline
    facets: dict[int, Facet]
    points: Floats
    thickness: float

    @property
    def count(self) -> int:
        """Number of facets that have at least two mesh faces."""
        return int((np.bincount(self.outline.chart) > 1).sum())


@derived
def flat_facets(part: Part) -> FlatFacets | None:
    """Return the flat facets of a solid's sheet; None for fewer than two facets."""
    try:
        return _facets(part)
    except ExportError:
        return None  # the sheet is a single plane, or is curved


@derived
def folded_sheet(part: Part) -> FoldedSheet | None:
    """Return the sheet of a solid with flat facets; None for other solids."""
    flat = flat_facets(part)
    try:
        return _mitred_sheet(flat) if flat else None
    except ExportError:
        return None


def _facets(part: Part) -> FlatFacets:
    rough = 1e-4  # largest rounding error of vertices in mesh files, divided by the thickness
    if part.curved is None:
        raise NotFlatError("the solid has no data of the sheet from which dsfab made the solid")
    curved = part.curved()
    if len(curved.twins):
        raise NotFlatError("the surface is one-sided, so the solid does not have two separate outer surfaces")
    divided_sheet = curved.divided(np.ones((len(curved.V), 1)))
    skins = both_skins(divided_sheet, curved.shift)
    thickness = 2 * float(np.median(np.linalg.norm(MM_PER_M * divided_sheet.D, axis=1)))
    table = edge_table(divided_sheet.F)
    planes = [coplanar_regions(skins[:, s], divided_sheet.F, table, rough * thickness)[0] for s in (0, 1)]
    facet = np.unique(np.stack(planes, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    _require_few_facets(facet)
    if float(np.max(cKDTree(part.V).query(skins[np.unique(divided_sheet.F)].reshape(-1, 3))[0])) > rough * thickness:
        raise NotFlatError("the solid does not match the sheet from which dsfab made the solid")
    return FlatFacets(divided_sheet, curved.shift, skins, facet, thickness)


def _mitred_sheet(flat: FlatFacets) -> FoldedSheet:
    F, facet = flat.whole.F, flat.facet
    points, apart = _mitred_vertices(flat.skins, F, facet)
    if apart.any():
        alone = np.where(apart[F].any(axis=1), len(facet) + np.arange(len(facet)), facet)
        facet = np.unique(alone, return_inverse=True)[1].reshape(-1)
        _require_few_facets(facet)
        points = _mitred_vertices(flat.skins, F, facet)[0]
    outline = sheet_of(flat.whole._replace(chart=facet), flat.shift)
    facets = {k: _plane(points, F[facet == k]) for k in range(int(facet.max()) + 1)}
    return FoldedSheet(outline, facets, points, flat.thickness)


def _require_few_facets(facet: Ints) -> None:
    faces_per_facet = 4  # least mean number of triangles per facet; on a curved sheet, each triangle is a facet
    if not 1 < int(facet.max()) + 1 <= len(facet) / faces_per_facet:
        raise NotFlatError("the facets of the sheet are not flat")


def _plane(skins: Floats, F: Ints) -> Facet:
    corners = skins[F].transpose(2, 1, 0, 3)  # axes: skin, corner, face, coordinate
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(vectors, axis=2)
    origin = np.einsum("sm,smi->si", area, corners.mean(axis=1)) / area.sum(axis=1, keepdims=True)
    return Facet(origin, np.stack([frame(n / np.linalg.norm(n)) for n in vectors.sum(axis=1)]))


def _mitred_vertices(skins: Floats, F: Ints, facet: Ints) -> tuple[Floats, Bools]:
    """Move the vertices (n, 2, 3) into the planes of the facets around them.
    Return also a mask (n,): True for vertices at planes without a common point."""
    exact = 1e-5  # largest distance (mm) of a corner from the planes that meet at the corner
    count = np.bincount(facet)
    planes = {int(k): _plane(skins, F[facet == k]) for k in np.flatnonzero(count > 1)}
    pairs = np.unique(np.stack([F, np.repeat(facet[:, None], 3, axis=1)], axis=2).reshape(-1, 2), axis=0)
    pairs = pairs[count[pairs[:, 1]] > 1]
    points, apart = skins.copy(), np.zeros(len(skins), dtype=bool)
    start = np.searchsorted(pairs[:, 0], np.arange(len(skins) + 1))
    for v in np.flatnonzero(np.diff(start)):
        around = [planes[int(k)] for k in pairs[start[v] : start[v + 1], 1]]
        for s in (0, 1):
            N = np.array([plane.axes[s, 2] for plane in around])
            offsets = np.array([plane.axes[s, 2] @ (plane.origin[s] - skins[v, s]) for plane in around])
            move = np.linalg.lstsq(N, offsets, rcond=1e-9)[0]
            points[v, s] += move
            apart[v] |= float(np.abs(N @ move - offsets).max()) > exact
    return points, apart


@dataclass(frozen=True, eq=False)
class FoldedShape:
    """Folded sheet. walls : by part of an outline, the curves along its walls (faces through the thickness).
    The poles (p, 4) of a curve have two coordinates in the upper plane, then two in the lower plane."""

    sheet: FoldedSheet
    walls: dict[RunKey, list[Curve]]

    @property
    def faces(self) -> int:
        """Number of faces of the folded solid."""
        return sum(map(len, self.walls.values())) + 2 * len(self.sheet.outline.regions)

    @property
    def deviation(self) -> float:
        """Largest distance of a curve from the polyline to which it was fitted, millimetres."""
        return max((curve.deviation for chain in self.walls.values() for curve in chain), default=0.0)


def folded_shape(sheet: FoldedSheet, tolerance: float) -> FoldedShape:
    """Fit curves along the walls of a folded sheet within a tolerance (mm). Raises ExportError if a fit fails."""
    walls, least_gap = dict[RunKey, list[Curve]](), tolerance / 8  # least gap between openings and folds, mm
    for region in sheet.outline.regions:
        facet, lines = sheet.facets[region.chart], region_lines(sheet, region)
        gaps = gaps_between([line[:, :2] for line in lines], tolerance, least_gap)
        for loop, gap in zip(region.loops, gaps, strict=True):
            for run in loop:
                if run.beyond == WALL:
                    run_tolerance = min(tolerance, WIDTH_SHARE * run.width / 2, GAP_SHARE * gap)
                    line = facet.flat(sheet.points[run.vertices])
                    walls[run_key(run)[0]] = split_at_knots(_curve(line, run_tolerance))
    return FoldedShape(sheet, walls)


def region_lines(sheet: FoldedSheet, region: ChartRegion) -> list[Floats]:
    """Return a region's loops (k, 4) in the coordinates of `Facet.flat`. The outer loop is counter-clockwise.
    Raises ExportError unless the region has one outer loop."""
    facet = sheet.facets[region.chart]
    lines = [facet.flat(sheet.points[np.concatenate([run.vertices[:-1] for run in loop])]) for loop in region.loops]
    if any(sum(signed_loop_area(line[:, s : s + 2]) > 0 for line in lines) != 1 for s in (0, 2)):
        raise ExportError("a facet of the sheet touches itself, so the outline of this facet is not a single loop")
    return lines


def _curve(line: Floats, tolerance: float) -> Curve:
    upper, lower = (arc_lengths(line[:, s : s + 2]) for s in (0, 2))
    shares = [np.asarray(length / max(float(length[-1]), 1e-300)) for length in (upper, lower)]
    x = np.union1d(*shares)
    columns = [np.interp(x, shares[i // 2], column) for i, column in enumerate(line.T)]
    curve = fitted_curve(np.stack(columns, axis=1), tolerance)
    if curve is None:
        raise ExportError(f"no spline fits an outline of {len(line)} points within {tolerance:.3g} mm")
    return curve


EdgePair = tuple[int, int]  # numbers of an edge (or vertex) on the upper and on the lower skin


class PlanarFile(NamedTuple):
    """STEP text of a flat or folded sheet. deviation : largest distance of outlines from the mesh, mm."""

    faces: int
    texts: list[str]
    deviation: float
    facets: int


def planar_file(part: Part) -> PlanarFile:
    """Return the STEP file of a flat or a folded sheet; raises ExportError for any other solid."""
    folded = folded_sheet(part)
    if folded is None:
        flat = plate(outlines_of(part), part.corners, part.tolerance)
        return PlanarFile(flat.faces, list(plate_entities(flat, part.name)), flat.deviation, 1)
    shape = folded_shape(folded, part.tolerance)
    writer, pieces = _Writer(shape), [list[int]() for _ in range(folded.outline.count)]
    for region in folded.outline.regions:
        pieces[region.piece] += writer.region(region)
    about = f"folded solid of flat facets, outline within {shape.deviation:.2g} mm of the mesh"
    return PlanarFile(shape.faces, list(writer.new.file(pieces, part.name, about)), shape.deviation, folded.count)


class _Writer:
    def __init__(self, shape: FoldedShape) -> None:
        # Two more digits make edges on inclined planes exact to 1e-7 mm, as OCCT's fillets need.
        self.new, self.shape, self.sheet = StepEntities(extra_digits=2), shape, shape.sheet
        self.vertices, self.posts, self.edges = dict[int, EdgePair](), dict[int, int](), dict[RunKey, EdgePair]()

    def region(self, region: ChartRegion) -> list[int]:
        facet, lines = self.sheet.facets[region.chart], region_lines(self.sheet, region)
        order = sorted(range(len(lines)), key=lambda i: -signed_loop_area(lines[i][:, :2]))
        faces, bounds = list[int](), (list[int](), list[int]())
        for i in order:
            kind = "FACE_BOUND" if bounds[0] else "FACE_OUTER_BOUND"
            steps = list[tuple[EdgePair, bool]]()
            for run in region.loops[i]:
                if run.beyond != WALL:
                    steps.append(self._fold(run))
                else:
                    wall_edges, walls = self._walls(run, facet)
                    steps += [(pair, True) for pair in wall_edges]
                    faces += walls
            bounds[0].append(self.new.wire([(pair[0], ahead) for pair, ahead in steps], kind))
            bounds[1].append(self.new.wire([(pair[1], not ahead) for pair, ahead in reversed(steps)], kind))
        for s, sign in ((0, 1), (1, -1)):
            faces.append(self.new.face(bounds[s], self.new.plane(facet.origin[s], sign * facet.axes[s, 2])))
        return faces

    def _fold(self, run: OutlineRun) -> tuple[EdgePair, bool]:
        key, ahead = run_key(run)
        if key not in self.edges:
            end_vertices = run.vertices[[0, -1]] if ahead else run.vertices[[-1, 0]]
            p, q = self.sheet.points[end_vertices]
            a, b = (self._vertex(int(v)) for v in end_vertices)
            self.edges[key] = self._edges(a, b, [self.new.line(p[s], q[s] - p[s]) for s in (0, 1)])
        return self.edges[key], ahead

    def _walls(self, run: OutlineRun, facet: Facet) -> tuple[list[EdgePair], list[int]]:
        chain, vertices, posts = self.shape.walls[run_key(run)[0]], list[EdgePair](), list[int]()
        for v in run.vertices[[0, -1]]:
            vertices.append(self._vertex(int(v)))
            posts.append(self._post(int(v)))
        for i, curve in enumerate(chain[:-1], 1):
            points = facet.in_space(curve.poles[-1:])[0]
            vertices.insert(i, self._new_vertex(points))
            posts.insert(i, self._new_post(vertices[i], points))
        edge_pairs, faces = list[EdgePair](), list[int]()
        for i, curve in enumerate(chain):
            poles = facet.in_space(curve.poles)
            curves = [self.new.curve(curve, poles[:, s]) for s in (0, 1)]
            upper, lower = self._edges(vertices[i], vertices[i + 1], curves)
            wire = self.new.wire([(lower, True), (posts[i + 1], True), (upper, False), (posts[i], False)])
            faces.append(self.new.face([wire], self._ruled_surface(curve, poles)))
            edge_pairs.append((upper, lower))
        return edge_pairs, faces

    def _edges(self, a: EdgePair, b: EdgePair, curves: list[int]) -> EdgePair:
        upper, lower = (self.new.edge(a[s], b[s], curves[s]) for s in (0, 1))
        return upper, lower

    def _vertex(self, v: int) -> EdgePair:
        if v not in self.vertices:
            self.vertices[v] = self._new_vertex(self.sheet.points[v])
        return self.vertices[v]

    def _post(self, v: int) -> int:
        if v not in self.posts:
            self.posts[v] = self._new_post(self._vertex(v), self.sheet.points[v])
        return self.posts[v]

    def _new_vertex(self, points: Floats) -> EdgePair:
        upper, lower = (self.new.vertex(self.new.point(p)) for p in points)
        return upper, lower

    def _new_post(self, vertex: EdgePair, points: Floats) -> int:
        (upper, lower), (p, q) = vertex, points
        return self.new.edge(lower, upper, self.new.line(q, p - q))

    def _ruled_surface(self, curve: Curve, poles: Floats) -> int:
        upper, lower = poles[:, 0], poles[:, 1]
        across = np.cross(lower[-1] - lower[0], upper[0] - lower[0])
        normal = across / max(float(np.linalg.norm(across)), 1e-300)
        if np.abs((poles - lower[0]) @ normal).max() <= FLATNESS:
            return self.new.plane(lower[0], normal)
        rows = [[self.new.point(p) for p in pole_pair] for pole_pair in zip(lower, upper, strict=True)]
        return self.new.spline_surface((curve.degree, 1), rows, knot_text(curve.knots), bezier_knots(2))
