"""Plan of a smooth solid with its layouts of charts, and acceptance of pieces by OCCT's findings and the mesh."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.shared.plan import MeshDistances, PieceJudge, SolidPlan
from dsfab.export.cad.step.shared.sheet_outline import WALL, OutlineRun, sheet_of
from dsfab.export.cad.step.shared.skins import GAP_SHARE
from dsfab.export.cad.step.smooth.chart_fields import chart_fields
from dsfab.export.cad.step.smooth.charts import ChartAtlas
from dsfab.export.cad.step.smooth.edges import EdgeTolerances
from dsfab.export.cad.step.smooth.solid import PieceBuilder, SmoothModel, SmoothPiece, crossings
from dsfab.export.cad.step.worker.reports import OcctFinding
from dsfab.export.part import Part
from dsfab.surface.topology import faces_at


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Verdict on a piece. reason : reason of a refusal, or ''.    bad : (k, 3) places where tighter curves may help.

    there, back : largest distances of the piece from the mesh and of the mesh from the piece.    volume : of the piece.
    """

    reason: str
    bad: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    there: float = 0.0
    back: float = 0.0
    volume: float = 0.0


_NOWHERE = MeshDistances(0.0, 0.0, 0.0, np.zeros((0, 3)))


def verdicts(
    gate: PieceJudge, pieces: dict[int, SmoothPiece], findings: dict[int, OcctFinding]
) -> dict[int, Acceptance]:
    """Judge pieces, given by number, with OCCT's findings about the pieces that OCCT read."""
    distances = _distances(gate, {k: findings[k] for k in pieces if k in findings and findings[k].tessellates})
    return {
        k: _verdict(gate, k, piece, findings.get(k), distances.get(k, (_NOWHERE, _NOWHERE)))
        for k, piece in pieces.items()
    }


def _verdict(
    gate: PieceJudge, k: int, piece: SmoothPiece, finding: OcctFinding | None, away: tuple[MeshDistances, MeshDistances]
) -> Acceptance:
    if piece.refused or finding is None:
        return Acceptance(piece.refused or "OCCT did not read it within the time limit")
    mesh_volume, gap, widest = gate.volumes[k], max(piece.gap, finding.gap), GAP_SHARE * gate.limits.thickness
    forth, back = away
    worst_way = max(away, key=lambda distances: distances.worst - distances.allowed)
    sound = finding.valid and finding.closed
    is_near = worst_way.worst <= worst_way.allowed
    is_kept = abs(finding.volume - mesh_volume) <= (CHANGED_VOLUME + gate.excess_volumes[k]) * mesh_volume
    tests = (
        (sound, "OCCT finds it invalid"),
        (finding.faces == piece.faces, f"OCCT reads {finding.faces} faces instead of {piece.faces}"),
        (finding.tessellates, "OCCT makes no triangles of a face"),
        (gap <= widest, f"a gap of {gap:.3g} mm is wider than {widest:.3g} mm"),
        (is_near, f"it is {worst_way.worst:.2g} mm off the mesh, more than {worst_way.allowed:.2g} mm"),
        (is_kept, f"its volume is off by {finding.volume / mesh_volume - 1:.1%}"),
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


FIT_SHARE = 1 / 3
"""Tolerance of the skins, as a share of the allowed distance from the mesh."""

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2), (40.0, 24, 3))
"""Layouts: largest angle (degrees) between normals of a chart and their mean, smallest number of charts, and seed."""

MOST_WALLS = 1500
"""Largest number of walls of a sheet if `hurry` is 1; more walls take over half a minute."""


@dataclass(frozen=True, eq=False)
class SmoothSolid:
    """Pieces of a layout with their judge and builder. asked : pieces whose solids are not finished."""

    gate: PieceJudge
    builder: PieceBuilder
    model: SmoothModel
    asked: list[int]


class SmoothPlan(SolidPlan):
    """Plan for a part's smooth file; raises ExportError for an unknown sheet, or too many walls with `hurry`."""

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        t, distance = self.limits.thickness, self.limits.distance
        self.allowed = EdgeTolerances(t, distance, float(np.median(self.limits.chord)))
        limit = MOST_WALLS * part.hurry
        if part.hurry and (count := sum(run.beyond == WALL for loop in self._loops for run in loop)) > limit:
            raise ExportError(
                f"its smooth solid would have {count} walls, more than the {limit} that are made without a request; "
                "write step = 'smooth'"
            )

    @property
    def _loops(self) -> list[tuple[OutlineRun, ...]]:
        return [loop for region in self.whole.regions for loop in region.loops]

    def layouts(self) -> Iterator[Floats]:
        """Yield the fields (n, c) of distinct layouts: chart k covers the part where field k is largest.

        The first layout is for open sheets only, because its charts become too steep on a closed surface.
        """
        if len(self.curved.twins):
            raise ExportError("the surface has one side only, so it has no two skins")
        outlines = 40  # a chart has about 40 outlines, because OCCT's time grows with the square of their number
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
        """Build the pieces of all solids that are not finished, in a layout of fields (n, c).

        If the part has one solid and a chart of it fails, raises ExportError at once, because further charts take
        long."""
        atlas = ChartAtlas(self.surface, self.curved, fields, FIT_SHARE * self.limits.distance)
        needed = set[int]()

        def hopeless(chart: int) -> bool:
            if self.solids.count == 1 and chart in self.curved.divided(atlas.fields).chart:
                needed.add(chart)
            return bool(needed)

        atlas.make(np.unique(fields.argmax(axis=1)[self._unfinished_vertices(finished)]), hopeless=hopeless)
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

    def _unfinished_vertices(self, finished: Collection[int]) -> Ints:
        is_unfinished = np.isin(self.whole.piece, _unfinished_pieces(self.gate, finished))
        points = self.whole.V[np.unique(self.whole.F[is_unfinished])]
        marks = np.zeros(self.surface.n, dtype=bool)
        marks[cKDTree(MM_PER_M * self.surface.V).query(points)[1]] = True
        return np.unique(self.surface.F[faces_at(self.surface.F, marks)])


def _unfinished_pieces(gate: PieceJudge, finished: Collection[int]) -> list[int]:
    return [k for k in range(gate.sheet.count) if int(gate.solid[k]) not in finished]
