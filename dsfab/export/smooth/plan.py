"""What all layouts of a part share, and its pieces built in one of them."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.smooth.acceptance import Gate, Solids
from dsfab.export.smooth.charts import Atlas
from dsfab.export.smooth.edges import Allowed
from dsfab.export.smooth.layout import layout
from dsfab.export.smooth.limits import smooth_limits
from dsfab.export.smooth.outline import WALL, SheetOutline, sheet_of
from dsfab.export.smooth.solid import Builder, SmoothModel, SmoothPiece
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import faces_at
from dsfab.units import MM_PER_M

FIT = 1 / 3
"""Tolerance of the skins, as a share of the distance that is allowed."""

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2), (40.0, 24, 3))
"""Degrees that a chart's normals may lean, charts at least, and where their seeds begin."""

LOOPS = 40
"""Outlines in a chart, about: opening, checking and measuring a face take OCCT their number squared."""

MOST_WALLS = 1500
"""Walls of a sheet that is to be made in a hurry: half a minute at most so far."""


@dataclass(frozen=True, eq=False)
class SmoothSolid:
    """A layout's pieces, who judges them and who builds them anew; asked : those of solids that were not done yet."""

    gate: Gate
    builder: Builder
    model: SmoothModel
    asked: list[int]


class SmoothPlan:
    """A part to be made smooth; raises ExportError where its sheet is not known, or is too large for a hurry."""

    def __init__(self, part: Part) -> None:
        if part.curved is None:
            raise ExportError("smooth STEP needs the sheet, and only its solid is known")
        self.curved, self.solids = part.curved(), Solids(part)
        self.surface = Surface(self.curved.V, self.curved.F)
        self.limits = smooth_limits(self.surface, self.curved, part.tolerance)
        t, distance = self.limits.thickness, self.limits.distance
        self.allowed = Allowed(t, distance, float(np.median(self.limits.chord)))
        if part.hurry:
            self._ask_walls(MOST_WALLS * part.hurry)

    def layouts(self) -> Iterator[Floats]:
        """Fields (n, c) of one layout after another, each once: chart k is where field k is largest.

        The first one is for open sheets only: on a closed surface its charts become too flat, and fits fail.
        """
        if len(self.curved.twins):
            raise ExportError("the surface has one side only, so it has no two skins")
        some = LAYOUTS if self.surface.edges.boundary.any() else LAYOUTS[1:]
        known = set[bytes]()
        for lean, fewest, start in some:
            fields = layout(self.surface, float(np.deg2rad(lean)), max(fewest, self.enough), start)
            chart = fields.argmax(axis=1).tobytes()
            if chart not in known:
                yield fields
            known.add(chart)

    @cached_property
    def whole(self) -> SheetOutline:
        """The sheet in one chart."""
        return sheet_of(self.curved.divided(np.ones((self.surface.n, 1))), self.curved.shift)

    @cached_property
    def gate(self) -> Gate:
        """Judges solids that are not made in charts."""
        return Gate(self.solids, self.whole, self.limits)

    @property
    def enough(self) -> int:
        """Charts for all outlines of the sheet."""
        return sum(len(region.loops) for region in self.whole.regions) // LOOPS + 1

    def _ask_walls(self, most: int) -> None:
        """Raise ExportError where a sheet has too many walls for a hurry."""
        count = sum(run.beyond == WALL for region in self.whole.regions for loop in region.loops for run in loop)
        if count > most:
            raise ExportError(
                f"its smooth solid would have {count} walls, more than {most}, which take too long to be made "
                "unasked; ask for step = 'smooth'"
            )

    def built(self, fields: Floats, done: Collection[int] = ()) -> SmoothSolid:
        """The pieces of all solids but those that are done, in a layout of charts: fields (n, c), the largest names
        the chart. Raises ExportError as soon as a chart fails that the only solid needs: the others take long."""
        atlas = Atlas(self.surface, self.curved, fields, FIT * self.limits.distance)
        needed = set[int]()

        def hopeless(chart: int) -> bool:
            if self.solids.count == 1 and chart in self.curved.divided(atlas.fields).chart:
                needed.add(chart)
            return bool(needed)

        atlas.make(np.unique(fields.argmax(axis=1)[self._near(done)]), hopeless=hopeless)
        if needed:
            raise ExportError(atlas.failed[needed.pop()])
        sheet = sheet_of(self.curved.divided(atlas.fields), self.curved.shift)
        gate = Gate(self.solids, sheet, self.limits)
        asked = _pieces(gate, done)
        atlas.make(np.unique(sheet.chart[np.isin(sheet.piece, asked)]), halve=False)
        why = {k: text for chart, text in atlas.failed.items() for k in np.unique(sheet.piece[sheet.chart == chart])}
        ready = [k for k in asked if k not in why]
        regions = tuple(region for region in sheet.regions if region.piece in ready)
        builder = Builder(replace(sheet, regions=regions), atlas.charts, self.allowed)
        pieces = [
            builder.piece(k, {}) if k in ready else SmoothPiece(refused=why.get(k, "it is done"))
            for k in range(sheet.count)
        ]
        return SmoothSolid(
            gate, builder, SmoothModel(atlas.charts, builder.nodes, pieces, self.limits.thickness), asked
        )

    def _near(self, done: Collection[int]) -> Ints:
        """Vertices of the surface on faces that the pieces of solids may touch that are not done."""
        mine = np.isin(self.whole.piece, _pieces(Gate(self.solids, self.whole, self.limits), done))
        points = self.whole.V[np.unique(self.whole.F[mine])]
        marks = np.zeros(self.surface.n, dtype=bool)
        marks[cKDTree(MM_PER_M * self.surface.V).query(points)[1]] = True
        return np.unique(self.surface.F[faces_at(self.surface.F, marks)])


def _pieces(gate: Gate, done: Collection[int]) -> list[int]:
    """The pieces of solids that are not done yet."""
    return [k for k in range(gate.sheet.count) if int(gate.solid[k]) not in done]
