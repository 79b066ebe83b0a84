"""Smooth STEP file of a part, in pieces that OCCT checks.

1. Build all pieces with one division into charts, write a file, and let OCCT check it.
2. Build refused pieces again, with smaller tolerances of curves.
3. Divide solids that are still refused into other charts. If no division is left, these solids become faceted."""

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, distances_from_segments
from dsfab.core.derived import derived
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME, DEFLECTION
from dsfab.core.sparse.cholesky import one_blas_thread
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.file_size import BudgetError, require_budget
from dsfab.export.cad.step.shared.plan import MeshDistances, PieceJudge, SolidPlan
from dsfab.export.cad.step.shared.sheet_outline import WALL, OutlineRun, SheetOutline, sheet_of
from dsfab.export.cad.step.shared.skins import GAP_SHARE, SmoothLimits
from dsfab.export.cad.step.smooth.chart_fields import chart_fields
from dsfab.export.cad.step.smooth.charts import ChartAtlas
from dsfab.export.cad.step.smooth.edges import LEVEL_FACTORS, EdgeTolerances, RunKey
from dsfab.export.cad.step.smooth.solid import (
    PieceBuilder,
    SmoothModel,
    SmoothPiece,
    SmoothPieceFile,
    crossings,
    file_text,
    rest_of,
)
from dsfab.export.cad.step.worker.reports import OcctFinding, findings, occt
from dsfab.export.part import Part
from dsfab.export.subprocesses import PreparedProgram
from dsfab.surface.topology import faces_at


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Verdict on a smooth piece of a sheet. volume : mm3.    reason : reason for a refusal; '' if accepted.
    bad : (k, 3) places where smaller tolerances may help.
    there, back : largest distances from piece to mesh, and from mesh to piece, mm."""

    reason: str
    bad: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    there: float = 0.0
    back: float = 0.0
    volume: float = 0.0


_NOWHERE = MeshDistances(0.0, 0.0, 0.0, np.zeros((0, 3)))


def all_verdicts(
    gate: PieceJudge, pieces: dict[int, SmoothPiece], findings: dict[int, OcctFinding]
) -> dict[int, Acceptance]:
    """Return each piece's verdict. gate : comparison with the mesh.    findings : OCCT's findings by piece number."""
    distances = _distances(gate, {k: findings[k] for k in pieces if k in findings and findings[k].tessellates})
    return {
        k: piece_verdict(gate, k, piece, findings.get(k), distances.get(k, (_NOWHERE, _NOWHERE)))
        for k, piece in pieces.items()
    }


def piece_verdict(
    gate: PieceJudge, k: int, piece: SmoothPiece, finding: OcctFinding | None, away: tuple[MeshDistances, MeshDistances]
) -> Acceptance:
    """Return the verdict on piece k. finding : OCCT's finding about the piece; None if OCCT failed.
    away : distances from piece to mesh, and from mesh to piece."""
    if piece.refused or finding is None:
        return Acceptance(piece.refused or "OCCT did not read a smooth piece of the sheet within the time limit")
    mesh_volume, gap, widest = gate.volumes[k], max(piece.gap, finding.gap), GAP_SHARE * gate.limits.thickness
    forth, back = away
    worst_way = max(away, key=lambda distances: distances.worst - distances.allowed)
    sound = finding.valid and finding.closed
    is_near = worst_way.worst <= worst_way.allowed
    is_kept = abs(finding.volume - mesh_volume) <= (CHANGED_VOLUME + gate.excess_volumes[k]) * mesh_volume
    tests = (
        (sound, "OCCT finds it invalid"),
        (finding.faces == piece.faces, f"OCCT reads {finding.faces} faces in a smooth piece instead of {piece.faces}"),
        (finding.tessellates, "OCCT cannot divide a face of a smooth piece into triangles"),
        (gap <= widest, f"a gap between faces is {gap:.3g} mm wide; the limit is {widest:.3g} mm"),
        (is_near, f"a smooth piece is {worst_way.worst:.2g} mm from the mesh; the limit is {worst_way.allowed:.2g} mm"),
        (
            is_kept,
            f"the volume of a smooth piece differs from that of the mesh by {finding.volume / mesh_volume - 1:.1%}",
        ),
    )
    reason = next((text for passed, text in tests if not passed), "")
    bad = np.concatenate([forth.bad, back.bad])
    if not (sound and finding.tessellates):
        bad = finding.bad if len(finding.bad) else crossings(piece)
    if sound and finding.tessellates and is_near and gap <= widest:
        bad = bad[:0]
    elif not len(bad):
        bad = piece.ends
    return Acceptance(reason, bad, forth.most, back.most, finding.volume)


def _distances(gate: PieceJudge, findings: dict[int, OcctFinding]) -> dict[int, tuple[MeshDistances, MeshDistances]]:
    away = dict[int, tuple[MeshDistances, MeshDistances]]()
    points = gate.solids.part.V
    for solid in {int(gate.solid[k]) for k in findings}:
        mesh, these = gate.solids.faces({solid}), [k for k in findings if gate.solid[k] == solid]
        V = np.concatenate([findings[k].V for k in these])
        start = np.cumsum([0, *(len(findings[k].V) for k in these)])
        F = np.concatenate([findings[k].F + i for k, i in zip(these, start, strict=False)])
        back = gate.farthest(points, mesh, V, F)
        for k in these:
            away[k] = (gate.farthest(findings[k].V, findings[k].F, points, mesh), back)
    return away


FIT_SHARE = 1 / 3  # tolerance of skins / allowed distance from the mesh

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2), (40.0, 24, 3))
"""Divisions into charts: largest angle (degrees) of normals to their mean, fewest charts, random seed."""

MOST_WALLS = 1500  # largest number of walls, unless the user asks for a smooth file; more walls take over half a minute


@dataclass(frozen=True, eq=False)
class SmoothSolid:
    """Smooth pieces of a sheet that is divided into charts.
    gate : comparison of the sheet with the mesh.    asked : numbers of the pieces to build."""

    gate: PieceJudge
    builder: PieceBuilder
    model: SmoothModel
    asked: list[int]


class SmoothPlan(SolidPlan):
    """Data for a smooth STEP file. Raises ExportError if the sheet is unknown or has too many walls."""

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        t, distance = self.limits.thickness, self.limits.distance
        self.allowed = EdgeTolerances(t, distance, float(np.median(self.limits.chord)))
        limit = MOST_WALLS * part.hurry
        if part.hurry and (count := sum(run.beyond == WALL for loop in self._loops for run in loop)) > limit:
            raise ExportError(
                f"the smooth solid would have {count} walls; for more than {limit} walls, dsfab writes a smooth file "
                f"only on request: write step = 'smooth'"
            )

    @property
    def _loops(self) -> list[tuple[OutlineRun, ...]]:
        return [loop for region in self.whole.regions for loop in region.loops]

    def layouts(self) -> Iterator[Floats]:
        """Yield the divisions into charts as fields (n, c). Chart k is the part where field k is largest.
        Raises ExportError for a one-sided surface."""
        if len(self.curved.twins):
            raise ExportError("the surface is one-sided, so the solid does not have two separate outer surfaces")
        outlines = 40  # largest mean number of outlines per chart; OCCT's time grows with the number's square
        settings = LAYOUTS if self.surface.edges.boundary.any() else LAYOUTS[1:]
        seen = set[bytes]()
        for lean, fewest, start in settings:
            count = max(fewest, len(self._loops) // outlines + 1)
            fields = chart_fields(self.surface, float(np.deg2rad(lean)), count, start)
            chart = fields.argmax(axis=1).tobytes()
            if chart not in seen:
                yield fields
            seen.add(chart)

    def build(self, fields: Floats, finished: Collection[int] = ()) -> SmoothSolid:
        """Build the pieces of all solids without the numbers `finished`. fields : (n, c), a column for each chart.
        Raises ExportError if the part has only one solid and a chart fails."""
        atlas = ChartAtlas(self.surface, self.curved, fields, FIT_SHARE * self.limits.distance)
        needed = set[int]()

        def hopeless(chart: int) -> bool:
            if self.solids.count == 1 and chart in self.curved.divided(atlas.fields).chart:
                needed.add(chart)
            return bool(needed)

        atlas.make(np.unique(fields.argmax(axis=1)[self.unfinished_vertices(finished)]), hopeless=hopeless)
        if needed:
            raise ExportError(atlas.failed[needed.pop()])
        sheet = sheet_of(self.curved.divided(atlas.fields), self.curved.shift)
        gate = PieceJudge(self.solids, sheet, self.limits)
        requested = _unfinished_pieces(gate, finished)
        atlas.make(np.unique(sheet.chart[np.isin(sheet.piece, requested)]), halve=False)
        why = {k: text for chart, text in atlas.failed.items() for k in np.unique(sheet.piece[sheet.chart == chart])}
        ready = [k for k in requested if k not in why]
        regions = tuple(region for region in sheet.regions if region.piece in ready)
        builder = PieceBuilder(replace(sheet, regions=regions), atlas.charts, self.allowed)
        pieces = [
            builder.piece(k, {}) if k in ready else SmoothPiece(refused=why.get(k, "it is done"))
            for k in range(sheet.count)
        ]
        model = SmoothModel(atlas.charts, builder.nodes, pieces, self.limits.thickness)
        return SmoothSolid(gate, builder, model, requested)

    def unfinished_vertices(self, finished: Collection[int]) -> Ints:
        """Return the surface vertices (k,) near solids with numbers that are not in `finished`."""
        is_unfinished = np.isin(self.whole.piece, _unfinished_pieces(self.gate, finished))
        points = self.whole.V[np.unique(self.whole.F[is_unfinished])]
        marks = np.zeros(self.surface.n, dtype=bool)
        marks[cKDTree(MM_PER_M * self.surface.V).query(points)[1]] = True
        return np.unique(self.surface.F[faces_at(self.surface.F, marks)])


def _unfinished_pieces(gate: PieceJudge, finished: Collection[int]) -> list[int]:
    return [k for k in range(gate.sheet.count) if int(gate.solid[k]) not in finished]


REFITS = 2  # a refused piece is built again at most twice, with smaller tolerances of its curves
CLOSEST = len(LEVEL_FACTORS) - 1  # highest level of a curve; a higher level means a smaller tolerance


class _AcceptedPiece(NamedTuple):
    model: SmoothModel
    number: int
    verdict: Acceptance


@derived
def smooth_file(part: Part) -> SmoothPieceFile:
    """Return a part's smooth STEP file. Raises ExportError if all pieces are refused."""
    return _SmoothSearch(part).search()


def first_draft(part: Part) -> tuple[int, int]:
    """Count faces and bytes of a part's first, unchecked smooth STEP file. Raises ExportError if no piece is built."""
    plan = SmoothPlan(part)
    with one_blas_thread():
        model = plan.build(next(plan.layouts())).model
    which = [k for k, piece in enumerate(model.pieces) if not piece.refused]
    if not which:
        raise ExportError(model.pieces[0].refused)
    return sum(model.pieces[k].faces for k in which), len(file_text(part, [(model, k) for k in which]))


class _SmoothSearch:
    def __init__(self, part: Part) -> None:
        self.part, self.plan = part, SmoothPlan(part)
        self.inspected, self.most = 0, 6000  # after 6000 faces (1 to 2 minutes of OCCT), the search ends
        self.taken, self.reason, self.pieces = list[_AcceptedPiece](), "", 0
        self.left: Ints = part.F
        self.done = set[int]()
        self.last, self.text = list[tuple[SmoothModel, int]](), ""

    def search(self) -> SmoothPieceFile:
        for turn, fields in enumerate(self.plan.layouts(), 1):
            try:
                with ExitStack() as programs:
                    self._judge_layout(programs, fields)
            except BudgetError:
                raise
            except ExportError as error:
                self.reason = str(error)
                if self.part.hurry:
                    break
                continue
            if not len(self.left) or self.inspected > self.most or turn == self.part.hurry:
                break
        if not self.taken:
            raise ExportError(f"{self.reason}; write step = 'faceted'")
        return self._file()

    def _judge_layout(self, programs: ExitStack, fields: Floats) -> None:
        hopeless = 40  # with faults at more than 40 points, a new fit with smaller tolerances does not help
        program = programs.enter_context(occt())
        with one_blas_thread():  # several threads on two busy cores take ten times as long
            built = self.plan.build(fields, self.done)
        gate, model, requested = built.gate, built.model, built.asked
        levels = [dict[RunKey, int]() for _ in model.pieces]
        for k in requested:
            if not model.pieces[k].refused:
                rebuild_until_sound(built, k, levels[k])
        verdicts, todo = dict[int, Acceptance](), requested
        for turn in range(REFITS + 1):
            ready = [k for k in todo if not model.pieces[k].refused]
            verdicts |= all_verdicts(gate, {k: model.pieces[k] for k in todo}, self._findings(program, model, ready))
            todo = [k for k in todo if len(verdicts[k].bad) and raise_levels(model, k, levels[k], verdicts[k].bad)]
            if not todo or turn == REFITS or self.inspected > self.most:
                break
            if self.part.hurry and sum(len(verdicts[k].bad) for k in todo) > hopeless:
                break
            program = programs.enter_context(occt())
            for k in todo:
                model.pieces[k] = built.builder.piece(k, levels[k], traced=turn == REFITS - 1)
        refused = {int(gate.solid[k]) for k in requested if verdicts[k].reason}
        taken = [k for k in requested if int(gate.solid[k]) not in refused]
        self.taken += [_AcceptedPiece(model, k, verdicts[k]) for k in taken]
        self.done |= {int(gate.solid[k]) for k in taken}
        self.reason = next((verdicts[k].reason for k in requested if verdicts[k].reason), "")
        self.left, self.pieces = gate.solids.faces(set(range(gate.solids.count)) - self.done), len(model.pieces)

    def _findings(self, program: PreparedProgram, model: SmoothModel, which: list[int]) -> dict[int, OcctFinding]:
        count = sum(model.pieces[k].faces for k in which)
        self.inspected += count
        self.last = [(model, k) for k in which]
        self.text = file_text(self.part, self.last)
        require_budget(self.part, count, len(self.text))
        seconds = 120 + 0.1 * count  # time limit (many times the usual time), because a check may never end
        results = findings(program, self.text, DEFLECTION * self.plan.limits.distance, seconds) if which else []
        return dict(zip(which, results, strict=True)) if len(results) == len(which) else {}

    def _file(self) -> SmoothPieceFile:
        rest = rest_of(self.part, self.left) if len(self.left) else None
        taken, verdicts = [(model, k) for model, k, _ in self.taken], [verdict for *_, verdict in self.taken]
        text = self.text if rest is None and taken == self.last else file_text(self.part, taken, rest)
        return SmoothPieceFile(
            text=text,
            pieces=self.pieces,
            smooth=len(self.taken),
            faces=text.count("=ADVANCED_FACE("),
            gap=max(model.pieces[k].gap for model, k in taken),
            there=max(verdict.there for verdict in verdicts),
            back=max(verdict.back for verdict in verdicts),
            limits=self.plan.limits,
            volume=sum(verdict.volume for verdict in verdicts),
            refused=self.reason if len(self.left) else "",
        )


def raise_levels(model: SmoothModel, k: int, level: dict[RunKey, int], bad: Floats) -> bool:
    """Use smaller tolerances for piece k's curves near `bad` points (b, 3), mm. Return True if a tolerance changes.
    level : number of failed checks, by key of an outline part."""
    piece = model.pieces[k]
    x = np.linspace(0, 1, 9)
    tree = cKDTree(np.concatenate([curve(x) for edge in piece.edges for curve in (edge.upper, edge.lower)]))
    reach = np.atleast_1d(tree.query(bad)[0]) + 1e-3 * model.thickness
    hit = {i // (2 * len(x)) for point, r in zip(bad, reach, strict=True) for i in tree.query_ball_point(point, r)}
    keys = {piece.keys[i] for i in hit if level.get(piece.keys[i], 0) < CLOSEST}
    level |= {key: level.get(key, 0) + 1 for key in keys}
    return bool(keys)


def rebuild_until_sound(built: SmoothSolid, k: int, level: dict[RunKey, int]) -> None:
    """Rebuild piece k with smaller tolerances of curves, until the piece passes simple checks of distances."""
    model, corners = built.model, _corners(built.gate.sheet, k)
    for _ in range(CLOSEST):
        piece = model.pieces[k]
        gaping = piece.ends[[edge.gap > GAP_SHARE * model.thickness for edge in piece.edges]]
        bad = np.concatenate([crossings(piece), gaping, astray(piece, corners, built.gate.limits)])
        if not len(bad) or not raise_levels(model, k, level, bad):
            return
        model.pieces[k] = built.builder.piece(k, level)


def astray(piece: SmoothPiece, corners: Floats, limits: SmoothLimits) -> Floats:
    """Return the mesh corners (k, 3) too far from the piece's edges. corners : (n, 3) all mesh corners at walls."""
    chord_count, nearest_count = 64, 4  # number of chords per edge, and of nearest chords to compare with a corner
    x = np.linspace(0, 1, chord_count + 1)
    lines = np.stack([curve(x) for edge in piece.edges if edge.wall for curve in (edge.upper, edge.lower)])
    start, end = lines[:, :-1].reshape(-1, 3), lines[:, 1:].reshape(-1, 3)
    nearest_chords = cKDTree((start + end) / 2).query(corners, nearest_count)[1]
    away = distances_from_segments(corners[:, None], start[nearest_chords], end[nearest_chords]).min(axis=1)
    is_far = away > limits.distance
    return np.asarray(corners[is_far][away[is_far] > limits.allowed_distances(corners[is_far])])


def _corners(sheet: SheetOutline, k: int) -> Floats:
    runs = [run for region in sheet.regions if region.piece == k for loop in region.loops for run in loop]
    v = np.unique(np.concatenate([run.vertices for run in runs if run.beyond == WALL]))
    return np.concatenate([sheet.V[v] + sheet.D[v], sheet.V[v] - sheet.D[v]])
