"""Smooth STEP of a part: build pieces, let OCCT check each, refit what it refuses, and use facets for the rest.

charts, skins -> all pieces -> file -> `findings`  -> `PieceJudge` -> refused pieces: tighter curves
 ^                                                                       |  still refused
 '---------------- another layout of charts, for these only -------------'-> faceted, piece by piece
"""

from contextlib import ExitStack
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, distances_from_segments
from dsfab.core.derived import derived
from dsfab.core.errors import ExportError
from dsfab.core.limits import DEFLECTION
from dsfab.core.sparse.cholesky import one_blas_thread
from dsfab.export.cad.step.file_size import BudgetError, require_budget
from dsfab.export.cad.step.shared.sheet_outline import WALL, SheetOutline
from dsfab.export.cad.step.shared.skins import GAP_SHARE, SmoothLimits
from dsfab.export.cad.step.smooth import acceptance
from dsfab.export.cad.step.smooth.acceptance import Acceptance, SmoothPlan, SmoothSolid
from dsfab.export.cad.step.smooth.edges import LEVEL_FACTORS, RunKey
from dsfab.export.cad.step.smooth.solid import SmoothModel, SmoothPiece, SmoothPieceFile, crossings, file_text, rest_of
from dsfab.export.cad.step.worker.reports import OcctFinding, findings, occt
from dsfab.export.part import Part
from dsfab.export.subprocesses import PreparedProgram

REFITS = 2
"""Number of times that the refused pieces of a layout are built again with tighter curves."""

CLOSEST = len(LEVEL_FACTORS) - 1
"""Highest level of tighter curves, see `LEVEL_FACTORS`."""


class _AcceptedPiece(NamedTuple):
    model: SmoothModel
    number: int
    verdict: Acceptance


@derived
def smooth_file(part: Part) -> SmoothPieceFile:
    """Return the smooth file of a part, computed once for each part; raises ExportError if no piece can be smooth."""
    return _SmoothSearch(part).search()


def first_draft(part: Part) -> tuple[int, int]:
    """Return faces and bytes of a part's first smooth file without checks; raises ExportError without pieces."""
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
        self.inspected, self.most = 0, 6000  # after 6000 faces (1 to 2 minutes of OCCT) no further layout is tried
        self.taken, self.reason, self.pieces = list[_AcceptedPiece](), "", 0
        self.left: Ints = part.F
        self.done = set[int]()
        self.last, self.text = list[tuple[SmoothModel, int]](), ""

    def search(self) -> SmoothPieceFile:
        """Accept each solid in the first layout in which all its pieces pass; solids may use different layouts."""
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
        # With more refused places than this, refits do not help. Of seven sheets with 1100 to 3800 faces, five had at
        # most 2 such places, and two had 104 and 216, which refits did not cure.
        hopeless = 40
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
            judged = {k: model.pieces[k] for k in todo}
            verdicts |= acceptance.verdicts(gate, judged, self._findings(program, model, ready))
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
        seconds = 120 + 0.1 * count  # many times the usual processor time, because a check may never end
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
    """Raise the level of the runs nearest to the `bad` points (k, 3), mm; return False if no level can rise."""
    piece = model.pieces[k]
    x = np.linspace(0, 1, 9)
    samples = np.concatenate([curve(x) for edge in piece.edges for curve in (edge.upper, edge.lower)])
    tree = cKDTree(samples)
    reach = np.atleast_1d(tree.query(bad)[0]) + 1e-3 * model.thickness
    hit = {i // (2 * len(x)) for point, r in zip(bad, reach, strict=True) for i in tree.query_ball_point(point, r)}
    keys = {piece.keys[i] for i in hit if level.get(piece.keys[i], 0) < CLOSEST}
    level |= {key: level.get(key, 0) + 1 for key in keys}
    return bool(keys)


def rebuild_until_sound(built: SmoothSolid, k: int, level: dict[RunKey, int]) -> None:
    """Rebuild a piece until no curve crosses, leaves a gap or leaves the mesh, or until no tighter fit is possible."""
    model, corners = built.model, _corners(built.gate.sheet, k)
    for _ in range(CLOSEST):
        piece = model.pieces[k]
        gaping = piece.ends[[edge.gap > GAP_SHARE * model.thickness for edge in piece.edges]]
        stray = astray(piece, corners, built.gate.limits)
        bad = np.concatenate([crossings(piece), gaping, stray])
        if not len(bad) or not raise_levels(model, k, level, bad):
            return
        model.pieces[k] = built.builder.piece(k, level)


def astray(piece: SmoothPiece, corners: Floats, limits: SmoothLimits) -> Floats:
    """Return (k, 3) mesh corners (n, 3) at walls that are farther from the piece's edges than allowed.

    OCCT's triangles would show such corners, too, but another round with OCCT takes seconds.
    """
    chord_count, nearest_count = 64, 4  # chords along an edge, and near chords whose distance from a corner counts
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
