"""Smooth solids: closed shells with shared edges, and the STEP file."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, plane_cross
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.entities import (
    DIGITS,
    KnotText,
    StepEntities,
    bezier_knots,
    closing,
    header,
    knot_text,
    outward_polyhedron,
    planar_faces,
    references,
)
from dsfab.export.cad.step.file_size import simplified_part, usual_tolerance
from dsfab.export.cad.step.flat_sheets import signed_loop_area
from dsfab.export.cad.step.shared.sheet_outline import WALL, ChartRegion, OutlineRun, SheetOutline
from dsfab.export.cad.step.shared.skins import SmoothLimits, decimals
from dsfab.export.cad.step.smooth.charts import SkinChart, SplinePatch
from dsfab.export.cad.step.smooth.edges import (
    EdgeTolerances,
    OutlineNodes,
    RunKey,
    RunRequest,
    SmoothEdge,
    nodes_of,
    run_key,
    seam_edges,
    wall_edges,
)
from dsfab.export.part import Part, without_collapsed
from dsfab.export.splines import Spline, segment_spline


@dataclass(frozen=True)
class SmoothSkin:
    """Upper and lower face of a region. loops : outlines, the outer loop first.
    Each step of a loop is a pair (edge number, True if the edge runs forwards)."""

    chart: int
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@dataclass(eq=False)
class SmoothPiece:
    """Piece of the sheet, with edges and skins. gap : widest gap at an edge, mm.
    refused : reason why the piece is not a single closed shell, or ''."""

    edges: list[SmoothEdge] = field(default_factory=list)
    keys: list[RunKey] = field(default_factory=list)
    skins: list[SmoothSkin] = field(default_factory=list)
    gap: float = 0.0
    traced: bool = False
    refused: str = ""

    @property
    def faces(self) -> int:
        """Number of faces of the piece: walls, and faces on both skins."""
        return sum(edge.wall for edge in self.edges) + 2 * len(self.skins)

    @property
    def ends(self) -> Floats:
        """(k, 3) start point of each edge on the upper skin, mm."""
        return np.array([edge.upper.poles[0] for edge in self.edges])


@dataclass(frozen=True, eq=False)
class SmoothModel:
    """Pieces of the sheet and the spline surfaces of its charts. thickness : thickness of the sheet, mm."""

    charts: dict[int, SkinChart]
    nodes: OutlineNodes
    pieces: list[SmoothPiece]
    thickness: float


class PieceBuilder:
    """Builder of a sheet's pieces from outlines and charts (spline surfaces over planes)."""

    def __init__(self, sheet: SheetOutline, charts: dict[int, SkinChart], allowed: EdgeTolerances) -> None:
        self.sheet, self.allowed = sheet, allowed
        self.nodes = nodes_of(sheet, charts)
        self._made: dict[tuple[RunKey, int], list[SmoothEdge]] = {}
        self._make(sheet.regions, {})

    def piece(self, number: int, level: dict[RunKey, int], traced: bool = False) -> SmoothPiece:
        """Build the piece with this number. traced : True to write also the curves of edges in surface parameters.
        level  : number of failed checks, by key of an outline part."""
        result, seams = SmoothPiece(traced=traced), dict[RunKey, int]()
        regions = [region for region in self.sheet.regions if region.piece == number]
        self._make(regions, level)
        for region in regions:
            steps = [[self._edges(result, seams, run, level) for run in loop] for loop in region.loops]
            loops = [tuple(chain.from_iterable(loop)) for loop in steps]
            area = [signed_loop_area(_polygon(result, loop, region.chart)) for loop in loops]
            order = sorted(range(len(loops)), key=lambda i: -area[i])
            if not loops or sum(a > 0 for a in area) != 1:
                result.refused = "a part of the sheet, projected onto its plane, has no outer outline, or several"
            result.skins.append(SmoothSkin(region.chart, tuple(loops[i] for i in order)))
        if not any(edge.wall for edge in result.edges):
            result.refused = "it has no outline"
        result.gap = max((edge.gap for edge in result.edges), default=0.0)
        return result

    def _make(self, regions: Iterable[ChartRegion], level: dict[RunKey, int]) -> None:
        walls, seams = dict[tuple[RunKey, int], RunRequest](), dict[tuple[RunKey, int], RunRequest]()
        for chart, run in ((region.chart, run) for region in regions for loop in region.loops for run in loop):
            key, ahead = run_key(run)
            edge_key = key, level.get(key, 0)
            if edge_key not in self._made and edge_key not in seams:
                if run.beyond != WALL and not ahead:
                    run = replace(run, vertices=run.vertices[::-1])
                (walls if run.beyond == WALL else seams)[edge_key] = RunRequest(run, chart, edge_key[1])
        if walls:
            self._made |= zip(walls, wall_edges(list(walls.values()), self.nodes, self.allowed), strict=True)
        if seams:
            new_seams = seam_edges(list(seams.values()), self.nodes, self.sheet, self.allowed)
            self._made |= {edge_key: [edge] for edge_key, edge in zip(seams, new_seams, strict=True)}

    def _edges(
        self, target: SmoothPiece, seams: dict[RunKey, int], run: OutlineRun, level: dict[RunKey, int]
    ) -> list[tuple[int, bool]]:
        key, ahead = run_key(run)
        begin = len(target.edges)
        if run.beyond != WALL and key in seams:
            return [(seams[key], ahead)]
        edges = self._made[key, level.get(key, 0)]
        target.edges += edges
        target.keys += [key] * len(edges)
        if run.beyond == WALL:
            return [(begin + i, True) for i in range(len(edges))]
        seams[key] = begin
        return [(begin, ahead)]


def _polygon(owner: SmoothPiece, loop: tuple[tuple[int, bool], ...], chart: int) -> Floats:
    pole_rows = [owner.edges[i].flat[chart].poles[:: 1 if ahead else -1] for i, ahead in loop]
    return np.concatenate([poles[:-1] for poles in pole_rows])


ROUNDED = 1e-9  # a point counts as on a chord if its distance is below this fraction of the chord's length


def crossings(piece: SmoothPiece) -> Floats:
    """Return the points (k, 3) on the upper skin where curves of a region's outline cross, mm."""
    return np.concatenate([np.zeros((0, 3)), *(_in_skin(piece, skin) for skin in piece.skins)])


def _in_skin(piece: SmoothPiece, skin: SmoothSkin) -> Floats:
    samples = 16  # each curve has 16 chords
    x = np.linspace(0, 1, samples + 1)
    edges = [piece.edges[i] for loop in skin.loops for i, _ in loop]
    flat = np.stack([edge.flat[skin.chart](x) for edge in edges])
    start, end = flat[:, :-1].reshape(-1, 2), flat[:, 1:].reshape(-1, 2)
    places = np.stack([edge.upper(x[:-1]) for edge in edges]).reshape(-1, 3)
    ends = np.concatenate([edge.upper(x[[0, -1]]) for edge in edges])
    crossing = np.unique(crossing_chords(start, end))
    return np.concatenate([places[crossing], ends[_twisted_ends(edges, skin)]])


def _twisted_ends(edges: list[SmoothEdge], skin: SmoothSkin) -> Ints:
    """Return the numbers of edge ends at sharp corners where two edges cross: 2 * edge, plus 1 for its end."""
    least_cosine = 0.5  # the sides of a sharp corner enclose at most 60 degrees
    forwards = np.array([forwards for loop in skin.loops for _, forwards in loop])
    number = np.split(np.arange(len(forwards)), np.cumsum([len(loop) for loop in skin.loops])[:-1])
    before = np.concatenate([np.roll(numbers, 1) for numbers in number])
    flat = [edge.flat[skin.chart] for edge in edges]
    lines = [curve.poles[:: 1 if ahead else -1] for curve, ahead in zip(flat, forwards, strict=True)]
    middle = np.concatenate([curve(np.array([0.5])) for curve in flat])
    into, out = (np.stack([line[[0, 1, -2, -1]] for line in lines])[i] for i in (before, np.arange(len(forwards))))
    end_tangents = into[:, 3] - into[:, 2], out[:, 1] - out[:, 0]
    middle_vectors = into[:, 3] - middle[before], middle - out[:, 0]
    long = np.prod([np.linalg.norm(v, axis=1) for v in end_tangents], axis=0)
    sharp = np.einsum("ki,ki->k", *end_tangents) < -least_cosine * long
    bad = np.flatnonzero(sharp & (plane_cross(*end_tangents) * plane_cross(*middle_vectors) < 0))
    return np.concatenate([2 * before[bad] + forwards[before[bad]], 2 * bad + ~forwards[bad]])


def crossing_chords(start: Floats, end: Floats) -> Ints:
    """Return the pairs (p, 2) of chords that cross. start, end : (k, 2) end points of the chords."""
    middle, long = (start + end) / 2, np.linalg.norm(end - start, axis=1)
    reach = long.max()
    chord_a, chord_b = cKDTree(middle).query_pairs(reach, output_type="ndarray").T
    apart = np.linalg.norm(middle[chord_a] - middle[chord_b], axis=1)
    is_close = apart <= (1 + ROUNDED) * (long[chord_a] + long[chord_b]) / 2  # distant chords cannot cross
    chord_a, chord_b = chord_a[is_close], chord_b[is_close]
    meet = np.zeros(len(chord_a), dtype=bool)
    for a in (start, end):
        for b in (start, end):
            meet |= np.linalg.norm(a[chord_a] - b[chord_b], axis=1) < 1e-9 * reach
    chord_a, chord_b = chord_a[~meet], chord_b[~meet]
    is_crossing = _lies_across(start, end, chord_a, chord_b) & _lies_across(start, end, chord_b, chord_a)
    return np.stack([chord_a, chord_b], axis=1)[is_crossing]


def _lies_across(start: Floats, end: Floats, line: Ints, chord: Ints) -> Bools:
    along = (end - start)[line]
    long = np.linalg.norm(along, axis=1)
    to, past = start[chord] - start[line], end[chord] - start[line]
    start_side, end_side = plane_cross(along, to) / long, plane_cross(along, past) / long
    return np.asarray((start_side * end_side < 0) & (np.minimum(np.abs(start_side), np.abs(end_side)) > ROUNDED * long))


class SmoothText:
    """Writer that adds the pieces of a sheet to a STEP file."""

    def __init__(self, entity_list: StepEntities, model: SmoothModel) -> None:
        self.new, self.model = entity_list, model
        self._points = partial(entity_list.points, digits=decimals(model.thickness))
        self._skins: dict[tuple[int, bool], int] = {}

    def piece(self, piece: SmoothPiece) -> list[int]:
        """Add the faces of a piece to the file, and return their entity numbers."""
        entity_list = self.new
        node_points = {v: self.model.nodes.at[v] for edge in piece.edges for v in (edge.start, edge.end)}
        vertices = {v: [entity_list.vertex(p) for p in self._points(pair)] for v, pair in node_points.items()}
        edges, faces = list[tuple[int, int]](), list[int]()
        poles = [[list(self._points(line.poles)) for line in (edge.upper, edge.lower)] for edge in piece.edges]
        surfaces = [self._wall(x, through) if x.wall else 0 for x, through in zip(piece.edges, poles, strict=True)]
        sides = dict[int, list[tuple[int, str, int]]]()
        for edge, wall in zip(piece.edges, surfaces, strict=True):
            if wall:
                sides.setdefault(edge.start, []).append((wall, "start", edge.spans))
                sides.setdefault(edge.end, []).append((wall, "end", edge.spans))
        posts = {v: self._post(vertices[v], node_points[v], sides[v] if piece.traced else []) for v in sorted(sides)}
        for edge, wall, (above, below) in zip(piece.edges, surfaces, poles, strict=True):
            flat = {k: self._line(curve, edge.spans) for k, curve in edge.flat.items() if piece.traced}
            ends = vertices[edge.start], vertices[edge.end]
            wall_surface = wall if piece.traced else 0
            upper = self._edge(edge, above, flat, wall_surface, True, (ends[0][0], ends[1][0]))
            lower = self._edge(edge, below, flat, wall_surface, False, (ends[0][1], ends[1][1]))
            edges.append((upper, lower))
            if wall:
                steps = [(lower, True), (posts[edge.end], True), (upper, False), (posts[edge.start], False)]
                faces.append(entity_list.face([entity_list.wire(steps)], wall))
        return faces + [face for skin in piece.skins for face in self._skin_faces(skin, edges)]

    def _skin_faces(self, skin: SmoothSkin, edges: list[tuple[int, int]]) -> tuple[int, int]:
        above = [[(edges[i][0], forwards) for i, forwards in loop] for loop in skin.loops]
        below = [[(edges[i][1], not forwards) for i, forwards in reversed(loop)] for loop in skin.loops]
        upper_wires, lower_wires = (
            [self.new.wire(steps, "FACE_BOUND" if j else "FACE_OUTER_BOUND") for j, steps in enumerate(loops)]
            for loops in (above, below)
        )
        upper = self.new.face(upper_wires, self._skin(skin.chart, True))
        return upper, self.new.face(lower_wires, self._skin(skin.chart, False), same_sense=False)

    def _post(self, vertices: list[int], ends: Floats, sides: list[tuple[int, str, int]]) -> int:
        line = self._line(segment_spline(ends[1], ends[0]), 1)
        return self._edge_curve(line, [self._on_wall(*side) for side in sides], (vertices[1], vertices[0]))

    def _edge(
        self, edge: SmoothEdge, poles: list[int], flat: dict[int, int], wall: int, above: bool, ends: tuple[int, int]
    ) -> int:
        surface_curves = [self.new.parameter_curve(self._skin(chart, above), curve) for chart, curve in flat.items()]
        if wall:
            surface_curves.append(self._on_wall(wall, "upper" if above else "lower", edge.spans))
        curve = self._curve(edge.upper if above else edge.lower, poles, edge.spans)
        return self._edge_curve(curve, surface_curves, ends)

    def _edge_curve(self, line: int, surface_curves: list[int], ends: tuple[int, int]) -> int:
        if surface_curves:
            line = self.new.add(f"SURFACE_CURVE('',#{line},{references(surface_curves)},.CURVE_3D.)")
        return self.new.edge(*ends, line)

    def _on_wall(self, wall: int, side: str, spans: int) -> int:
        u, v = int(side == "end"), int(side == "upper")
        along = "(1.,0.)" if side in ("lower", "upper") else "(0.,1.)"
        start = self.new.once(f"CARTESIAN_POINT('',({u * spans}.,{v}.))")
        direction = self.new.once(f"DIRECTION('',{along})")
        vector = self.new.once(f"VECTOR('',#{direction},1.)")
        return self.new.parameter_curve(wall, self.new.once(f"LINE('',#{start},#{vector})"))

    def _line(self, curve: Spline, spans: int) -> int:
        return self._curve(curve, list(self._points(curve.poles)), spans)

    def _curve(self, curve: Spline, through: list[int], spans: int) -> int:
        return self.new.spline(curve.degree, through, _shared_knot_text(spans * curve.knots))

    def _wall(self, edge: SmoothEdge, poles: list[list[int]]) -> int:
        upper, lower = poles
        rows = map(list, zip(lower, upper, strict=True))
        knots = _shared_knot_text(edge.spans * edge.lower.knots)
        return self.new.spline_surface((edge.lower.degree, 1), rows, knots, bezier_knots(2))

    def _skin(self, chart: int, above: bool) -> int:
        if (chart, above) not in self._skins:
            patch: SplinePatch = self.model.charts[chart].upper if above else self.model.charts[chart].lower
            rows, (u, v) = (list(self._points(row)) for row in patch.poles), map(_shared_knot_text, (patch.u, patch.v))
            self._skins[chart, above] = self.new.spline_surface((3, 3), rows, u, v)
        return self._skins[chart, above]


def _shared_knot_text(knots: Floats) -> KnotText:
    return _knot_text_of_bytes(knots.tobytes())


@lru_cache(maxsize=1024)
def _knot_text_of_bytes(knots: bytes) -> KnotText:
    digits = 14
    return knot_text(np.frombuffer(knots), digits)


@dataclass(frozen=True, eq=False)
class SmoothPieceFile:
    """Text of a file and its measures. pieces, smooth : number of pieces of the sheet, and of pieces with smooth faces.
    gap         : widest gap between faces and edges of smooth pieces, mm.    volume : total volume, mm3.
    there, back : largest distance of the file from the mesh, and of the mesh from the file, mm.
    refused     : reason why pieces were refused, or ""."""

    text: str
    pieces: int
    smooth: int
    faces: int
    gap: float
    there: float
    back: float
    limits: SmoothLimits
    volume: float
    refused: str

    @property
    def summary(self) -> str:
        """Description of the file for messages."""
        count_text = "" if self.smooth == self.pieces else f"{self.smooth} of {self.pieces} pieces (others faceted), "
        why = f" ({self.refused})" if self.refused else ""
        return (
            f"{count_text}distance at most {self.there:.2g} mm from the solid to the mesh and {self.back:.2g} mm from "
            f"the mesh to the solid ({self.limits.summary}); gaps between faces are under {self.gap:.2g} mm{why}"
        )


def file_text(part: Part, which: list[tuple[SmoothModel, int]], rest: Part | None = None) -> str:
    """Return the STEP text of smooth pieces (`which`: model and number), and of the part `rest` with planar faces."""
    entity_list, about = StepEntities(), "curved solid with outer surfaces of splines"
    writers = {id(model): SmoothText(entity_list, model) for model, _ in which}
    pieces, name = [writers[id(model)].piece(model.pieces[k]) for model, k in which], part.name
    if rest is None:
        return "".join(entity_list.file(pieces, name, about))
    shells, solids = np.repeat(np.arange(len(pieces)), [*map(len, pieces)]), [[i] for i in range(len(pieces))]
    shape, rest_solids = outward_polyhedron(rest)
    texts, numbers, free = planar_faces(shape, entity_list.free)
    solids += [[i + len(which) for i in shells_of_solid] for shells_of_solid in rest_solids]
    end = closing(np.r_[shells, shape.shell + len(which)], solids, np.concatenate([*pieces, numbers]), free, name)
    return "".join([header(name, about, len(solids)), *entity_list.text, *texts, *end])


def rest_of(part: Part, F: Ints) -> Part:
    """Return a part with only the triangles F (m, 3), which no smooth piece replaces. It is simplified if possible."""
    used, local = np.unique(F, return_inverse=True)
    remainder = replace(part, V=part.V[used], F=local.reshape(F.shape))
    try:
        simple = simplified_part(remainder, usual_tolerance(remainder))
        return without_collapsed(simple, np.round(simple.V, DIGITS) + 0.0, f"a STEP file with {DIGITS} decimals")
    except ExportError:
        return remainder
