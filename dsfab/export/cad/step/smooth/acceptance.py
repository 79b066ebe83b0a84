"""Acceptance of smooth pieces: OCCT's findings, gaps, volume and distance from the mesh; data for all layouts."""

from collections.abc import Collection, Container, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.shared.skins import SmoothLimits, prisms, smooth_limits
from dsfab.export.cad.step.smooth.charts import ChartAtlas
from dsfab.export.cad.step.smooth.edges import EdgeTolerances
from dsfab.export.cad.step.smooth.layout import WALL, SheetOutline, chart_fields, sheet_of
from dsfab.export.cad.step.smooth.solid import PieceBuilder, SmoothModel, SmoothPiece, crossings
from dsfab.export.cad.step.worker.reports import OcctFinding
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Part
from dsfab.surface import nearest_places
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corners_of, faces_at

GAP_SHARE = 1 / 20
"""Widest gap between a skin and its edges, as a share of the thickness."""

NEAR_SHARE = 1 / 2
"""A point nearer to the mesh than this share of the allowed distance passes without a look at the local chord error."""


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


class MeshDistances(NamedTuple):
    """One-way distances between a piece and the mesh: the largest, the one with the most excess and its limit; bad
    places."""

    most: float
    worst: float
    allowed: float
    bad: Floats


_NOWHERE = MeshDistances(0.0, 0.0, 0.0, np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class MeshSolids:
    """Solids in the mesh of a part, millimetres."""

    part: Part

    @cached_property
    def _shells(self) -> tuple[Ints, list[list[int]]]:
        return solids_of(self.part)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.part.V)

    def distances(self, points: Floats) -> Floats:
        """(k,) distances of points (k, 3) from all triangles."""
        P, V, F = (np.ascontiguousarray(x) for x in (points, self.part.V, self.part.F))
        return np.asarray(np.sqrt(self._triangles.squared_distance(V, F, P)[0]))

    @cached_property
    def _triangles(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(np.ascontiguousarray(self.part.V), np.ascontiguousarray(self.part.F))
        return tree

    def solids_at(self, points: Floats) -> Ints:
        """Return (k,) the solid of the vertex nearest to each point."""
        shell, solids = self._shells
        vertex_shell = np.full(len(self.part.V), -1)
        vertex_shell[self.part.F] = shell[:, None]
        shell_solid = np.empty(int(shell.max()) + 1, dtype=np.int64)
        for i, shells in enumerate(solids):
            shell_solid[shells] = i
        return np.asarray(shell_solid[vertex_shell[self._tree.query(points)[1]]])

    def faces(self, selected: Container[int]) -> Ints:
        """(m, 3) triangles of the chosen solids."""
        shell, solids = self._shells
        shells = [k for i, solid_shells in enumerate(solids) if i in selected for k in solid_shells]
        return np.asarray(self.part.F[np.isin(shell, shells)])

    @property
    def count(self) -> int:
        """Number of solids."""
        return len(self._shells[1])


@dataclass(frozen=True, eq=False)
class PieceJudge:
    """Judge of pieces of a sheet against the solids of a part, millimetres."""

    solids: MeshSolids
    sheet: SheetOutline
    limits: SmoothLimits

    @cached_property
    def solid(self) -> Ints:
        """(p,) solid of the mesh for each piece: the solid of the nearest vertex."""
        sample_vertices = self.sheet.F[np.unique(self.sheet.piece, return_index=True)[1], 0]
        return self.solids.solids_at((self.sheet.V + self.sheet.D)[sample_vertices])

    def remaining_triangles(self, finished: set[int]) -> Ints:
        """(m, 3) triangles of all solids that are not done."""
        return self.solids.faces(set(range(self.solids.count)) - finished)

    def verdicts(self, pieces: dict[int, SmoothPiece], findings: dict[int, OcctFinding]) -> dict[int, Acceptance]:
        """Judge pieces, given by number, with OCCT's findings about the pieces that OCCT read."""
        distances = self._distances({k: findings[k] for k in pieces if k in findings and findings[k].tessellates})
        return {
            k: self._verdict(k, piece, findings.get(k), distances.get(k, (_NOWHERE, _NOWHERE)))
            for k, piece in pieces.items()
        }

    def _verdict(
        self, k: int, piece: SmoothPiece, finding: OcctFinding | None, away: tuple[MeshDistances, MeshDistances]
    ) -> Acceptance:
        if piece.refused or finding is None:
            return Acceptance(piece.refused or "OCCT did not read it within the time limit")
        limits, mesh_volume, gap = self.limits, self.volumes[k], max(piece.gap, finding.gap)
        forth, back = away
        worst_way = max(away, key=lambda distances: distances.worst - distances.allowed)
        sound = finding.valid and finding.closed
        is_near = worst_way.worst <= worst_way.allowed
        tests = (
            (sound, "OCCT finds it invalid"),
            (finding.faces == piece.faces, f"OCCT reads {finding.faces} faces instead of {piece.faces}"),
            (finding.tessellates, "OCCT makes no triangles of a face"),
            (
                gap <= GAP_SHARE * limits.thickness,
                f"a gap of {gap:.3g} mm is wider than {GAP_SHARE * limits.thickness:.3g} mm",
            ),
            (is_near, f"it is {worst_way.worst:.2g} mm off the mesh, more than {worst_way.allowed:.2g} mm"),
            (
                abs(finding.volume - mesh_volume) <= (CHANGED_VOLUME + self.excess_volumes[k]) * mesh_volume,
                f"its volume is off by {finding.volume / mesh_volume - 1:.1%}",
            ),
        )
        reason = next((text for passed, text in tests if not passed), "")
        bad = np.concatenate([forth.bad, back.bad])
        if not (sound and finding.tessellates):
            bad = finding.bad if len(finding.bad) else crossings(piece)
        if sound and finding.tessellates and is_near and gap <= GAP_SHARE * limits.thickness:
            bad = bad[:0]
        elif not len(bad):
            bad = piece.ends
        return Acceptance(reason, bad, forth.most, back.most, finding.volume)

    @cached_property
    def volumes(self) -> Floats:
        """(p,) volume of each piece in the mesh, cubic millimetres: sum of the prisms between the skins."""
        return self._sum(np.ones(len(self.sheet.F)))

    @cached_property
    def excess_volumes(self) -> Floats:
        """(p,) share by which the volume of each piece may be larger, because the mesh cuts curves short."""
        sheet = self.sheet
        upper = (sheet.V + sheet.D)[sheet.F].mean(axis=1)  # points on a skin halve the search time
        share = self.limits.rounder[self.limits.nearest(upper)]
        return np.maximum(self._sum(share) / self.volumes, 0.0)

    def _sum(self, share: Floats) -> Floats:
        sheet = self.sheet
        volumes = share * prisms(sheet.V, sheet.D, sheet.F)
        return np.asarray(np.bincount(sheet.piece, volumes, sheet.count), dtype=np.float64)

    def _distances(self, findings: dict[int, OcctFinding]) -> dict[int, tuple[MeshDistances, MeshDistances]]:
        away = dict[int, tuple[MeshDistances, MeshDistances]]()
        points = self.solids.part.V
        for solid in {int(self.solid[k]) for k in findings}:
            mesh, these = self.solids.faces({solid}), [k for k in findings if self.solid[k] == solid]
            V = np.concatenate([findings[k].V for k in these])
            start = np.cumsum([0, *(len(findings[k].V) for k in these)])
            F = np.concatenate([findings[k].F + i for k, i in zip(these, start, strict=False)])
            back = self._farthest(points, mesh, V, F)
            for k in these:
                away[k] = (self._farthest(findings[k].V, findings[k].F, points, mesh), back)
        return away

    def distances(self, V: Floats, F: Ints) -> tuple[MeshDistances, MeshDistances]:
        """Return distances of the triangles V (n, 3), F (m, 3) of all solids from the part's triangles, and back."""
        part = self.solids.part
        return self._farthest(V, F, part.V, part.F), self._farthest(part.V, part.F, V, F)

    def excess_distances(self, points: Floats) -> Floats:
        """(k,) excess of points (k, 3) over their allowed distance from the mesh; negative for near points."""
        away = self.solids.distances(points)
        is_far = away > NEAR_SHARE * self.limits.distance  # near points need no local limit
        away[is_far] -= self.limits.allowed_distances(points[is_far])
        away[~is_far] -= self.limits.distance
        return away

    def _farthest(self, V: Floats, F: Ints, V2: Floats, F2: Ints) -> MeshDistances:
        corners = corners_of(F, np.ones(len(F), dtype=bool), len(V))
        points = np.concatenate([V[corners], V[F].mean(axis=1)])
        away = nearest_places(points, V2, F2).distance
        far_points = points[away > self.limits.distance]  # near points need no local limit
        if not len(far_points):
            return MeshDistances(float(away.max()), float(away.max()), self.limits.distance, far_points)
        far_distances, allowed = away[away > self.limits.distance], self.limits.allowed_distances(far_points)
        k = int((far_distances - allowed).argmax())
        return MeshDistances(
            float(away.max()), float(far_distances[k]), float(allowed[k]), far_points[far_distances > allowed]
        )


FIT_SHARE = 1 / 3
"""Tolerance of the skins, as a share of the allowed distance."""

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2), (40.0, 24, 3))
"""Layouts: largest angle (degrees) of normals from a chart's mean normal, smallest number of charts, and seed."""

MOST_WALLS = 1500
"""Most walls of a sheet if the part has an effort limit: these take half a minute at most."""


@dataclass(frozen=True, eq=False)
class SmoothSolid:
    """A layout's pieces with their judge and builder. asked : pieces whose solids are not finished."""

    gate: PieceJudge
    builder: PieceBuilder
    model: SmoothModel
    asked: list[int]


class SmoothPlan:
    """Plan for a part's smooth file; raises ExportError if its sheet is unknown, or too large for the effort limit."""

    def __init__(self, part: Part) -> None:
        if part.curved is None:
            raise ExportError("smooth STEP needs the sheet, and only its solid is known")
        self.curved, self.solids = part.curved(), MeshSolids(part)
        self.surface = Surface(self.curved.V, self.curved.F)
        self.limits = smooth_limits(self.surface, self.curved, part.tolerance)
        t, distance = self.limits.thickness, self.limits.distance
        self.allowed = EdgeTolerances(t, distance, float(np.median(self.limits.chord)))
        if part.hurry:
            self._require_few_walls(MOST_WALLS * part.hurry)

    def layouts(self) -> Iterator[Floats]:
        """Yield the fields (n, c) of distinct layouts: chart k covers the part where field k is largest.

        The first layout is for open sheets only, because its charts become too oblique on a closed surface.
        """
        if len(self.curved.twins):
            raise ExportError("the surface has one side only, so it has no two skins")
        settings = LAYOUTS if self.surface.edges.boundary.any() else LAYOUTS[1:]
        seen = set[bytes]()
        for lean, fewest, start in settings:
            fields = chart_fields(self.surface, float(np.deg2rad(lean)), max(fewest, self.chart_count), start)
            chart = fields.argmax(axis=1).tobytes()
            if chart not in seen:
                yield fields
            seen.add(chart)

    @cached_property
    def whole(self) -> SheetOutline:
        """The sheet in a single chart."""
        return sheet_of(self.curved.divided(np.ones((self.surface.n, 1))), self.curved.shift)

    @cached_property
    def gate(self) -> PieceJudge:
        """Judge for solids before they are divided into charts."""
        return PieceJudge(self.solids, self.whole, self.limits)

    @property
    def chart_count(self) -> int:
        """Number of charts that suffices for all outlines."""
        loops = 40  # a chart has about 40 outlines, because OCCT's time grows with the square of their number
        return sum(len(region.loops) for region in self.whole.regions) // loops + 1

    def _require_few_walls(self, limit: int) -> None:
        count = sum(run.beyond == WALL for region in self.whole.regions for loop in region.loops for run in loop)
        if count > limit:
            raise ExportError(
                f"its smooth solid would have {count} walls, more than {limit}, which take too long to be made "
                "unasked; ask for step = 'smooth'"
            )

    def build(self, fields: Floats, finished: Collection[int] = ()) -> SmoothSolid:
        """Build the pieces of all solids that are not done, in a layout of fields (n, c).

        Raises ExportError as soon as a chart fails that the only solid needs, because all further charts take long.
        """
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
        return SmoothSolid(
            gate, builder, SmoothModel(atlas.charts, builder.nodes, pieces, self.limits.thickness), requested
        )

    def _unfinished_vertices(self, finished: Collection[int]) -> Ints:
        is_unfinished = np.isin(
            self.whole.piece, _unfinished_pieces(PieceJudge(self.solids, self.whole, self.limits), finished)
        )
        points = self.whole.V[np.unique(self.whole.F[is_unfinished])]
        marks = np.zeros(self.surface.n, dtype=bool)
        marks[cKDTree(MM_PER_M * self.surface.V).query(points)[1]] = True
        return np.unique(self.surface.F[faces_at(self.surface.F, marks)])


def _unfinished_pieces(gate: PieceJudge, finished: Collection[int]) -> list[int]:
    return [k for k in range(gate.sheet.count) if int(gate.solid[k]) not in finished]
