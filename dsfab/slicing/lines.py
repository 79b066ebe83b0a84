"""The lines of a cut sheet: its edges by the family whose stripes they bound, and the middles of its members."""

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.chart import Chart
from dsfab.slicing.chords import middles, mostly
from dsfab.slicing.corners import Labels, outline_labels
from dsfab.slicing.polygon_mesh import places
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.slicing.snap import nearest
from dsfab.surface.corner_field import CornerField
from dsfab.surface.lines import Kind, StructureLine, Track, level_lines, polyline_length
from dsfab.surface.mesh import Surface

BOUNDARY = "boundary"
"""The family of an edge that lies on the boundary of the uncut surface."""

STRIPES = ("major", "minor")
"""The families of a chart, in its order."""


class CornerLines(NamedTuple):
    """A field of evenly spaced stripes and the values of their middles: each face sees it in a sign of its own."""

    field: CornerField
    levels: Floats


Phase = Floats | CornerLines | None
"""z (n,) on the uncut surface, integers at the middles of stripes; or that at corners; or None for no stripes."""


def edge_lines(sheet: Sheet, uncut: Surface, names: Sequence[str], phases: Sequence[Phase]) -> list[StructureLine]:
    """The outline of a kept sheet, cut into lines wherever it passes from one family or stripe to another.

    names  : of the fields that the sheet was cut by; a cell's `family` is an index into them.
    phases : for each field. An edge belongs to the stripe k that the cell beside it is a part of: z is next to k. Of
             phases at corners k is what the face sees; a line is numbered as most of it is.
    Together the lines are the boundary of the sheet, each edge of it once, with the material on the left.
    """
    labels = outline_labels(sheet, uncut)
    stripes = _Stripes(sheet, uncut, phases, labels)
    of_half_edge = {int(a): i for i, a in enumerate(labels.half_edge)}
    chosen: list[tuple[str, int, Floats]] = []
    for loop, along in _loops(sheet.surface):
        at = np.array([of_half_edge[h] for h in along])
        points = sheet.surface.V[loop]
        for run in _runs(stripes.changes(at, loop)):
            family = int(labels.family[at[run[0]]])
            line = points[[*run.tolist(), (run[-1] + 1) % len(points)]]
            stripe = mostly(stripes.number[at[run]], np.linalg.norm(np.diff(line, axis=0), axis=1))
            chosen.append((BOUNDARY if family == VOID else names[family], stripe, line))
    return _numbered("edge", chosen)


class _Stripes:
    """The stripes that the edges of an outline belong to."""

    def __init__(self, sheet: Sheet, uncut: Surface, phases: Sequence[Phase], labels: Labels) -> None:
        self.family, self.cell, self.phases = labels.family, labels.half_edge // 3, phases
        self.parent, self.weights, self.F = sheet.parent[self.cell], sheet.weights, uncut.F
        self.number = np.zeros(len(self.cell), dtype=np.int64)
        for k, phase in enumerate(phases):
            if phase is not None and (mine := labels.family == k).any():
                self.number[mine] = self._numbers(sheet, phase, self.cell[mine])

    def _numbers(self, sheet: Sheet, phase: Floats | CornerLines, cell: Ints) -> Ints:
        """(k,) of the stripes that cells (k,) are part of."""
        corners = sheet.surface.F[cell]
        if not isinstance(phase, CornerLines):
            return np.asarray(np.rint(sheet.carry(phase)[corners].mean(axis=1)), dtype=np.int64)
        z = phase.field.corners(self.F).mean(axis=2)
        entries = self.weights[corners.ravel()].tocoo()
        row, column = (index.astype(np.int64) for index in entries.coords)
        parent = sheet.parent[cell][row // 3]
        seen = entries.data * z[parent, places(self.F[parent], column)]
        z = np.bincount(row // 3, seen, len(cell)) / 3
        return np.asarray(np.rint(nearest(z, phase.levels)), dtype=np.int64)

    def changes(self, at: Ints, loop: Ints) -> Bools:
        """(k,) whether edges `at` (k,) around a loop of vertices belong to another stripe than the one before.

        Where both see a stripe of the same field at corners, its number is carried from one face to the other.
        """
        before = np.roll(at, 1)
        number = self.number[before].astype(np.float64)
        for k, phase in enumerate(self.phases):
            if isinstance(phase, CornerLines):
                both = np.flatnonzero((self.family[at] == k) & (self.family[before] == k))
                f, g = self.parent[at[both]], self.parent[before[both]]
                rows = self.weights[loop[both]]
                base = rows.indices[rows.indptr[:-1]].astype(np.int64)  # a corner of both
                here, there = (f, places(self.F[f], base)), (g, places(self.F[g], base))
                sign = phase.field.sign[here] * phase.field.sign[there]
                shift = phase.field.shift[here] - sign * phase.field.shift[there]
                number[both] = sign * number[both] + shift
        return np.asarray((self.family[at] != self.family[before]) | (self.number[at] != number))


def centre_lines(sheet: Sheet, name: str, phase: Floats, half_width: Floats) -> list[StructureLine]:
    """The middles z = k of one family's members, for all integers k, on what is kept of the surface.

    phase, half_width : z and d (n,) on the uncut surface, in periods: material is |z - k| < d. Where d is 0 there is no
    member, and no middle even if other material lies there. Both fields are linear in each cell of the sheet, so the
    lines are exact; that they end with the sheet needs no clipping.
    """
    z = sheet.carry(phase)
    levels = np.arange(np.floor(z.min()), np.ceil(z.max()) + 1)
    member = sheet.carry(np.minimum(half_width, 1.0))[sheet.surface.F].min(axis=1) > 0
    tracks: list[Track] = level_lines(sheet.surface, z, levels, member)
    return _numbered("centre", [(name, int(levels[track.level]), track.points) for track in tracks])


def chart_lines(
    sheet: Sheet, uncut: Surface, names: Sequence[str], name: str, chart: Chart, half_width: Floats
) -> list[StructureLine]:
    """`centre_lines` of evenly spaced members: each as long as it is drawn, ended on the middle of the one it meets.

    names      : of the fields that the sheet was cut by.    name : "major" or "minor".
    half_width : (n,) on the uncut surface, in periods of the lines that are drawn.
    """
    family = STRIPES.index(name)
    passing = np.array([k for k, other in enumerate(names) if other == STRIPES[1 - family]], dtype=np.int64)
    found = middles(chart, family, half_width, sheet, uncut.F, passing)
    return _numbered("centre", [(name, line.number, line.points) for line in found])


def _numbered(kind: Kind, chosen: list[tuple[str, int, Floats]]) -> list[StructureLine]:
    """The lines with their parts numbered, the longest of each stripe first."""
    groups = defaultdict[tuple[str, int], list[tuple[float, Floats]]](list)
    for family, number, points in chosen:
        groups[family, number].append((polyline_length(points), points))
    return [
        StructureLine(kind, family, number, part, points, length)
        for family, number in sorted(groups)
        for part, (length, points) in enumerate(sorted(groups[family, number], key=lambda one: -one[0]), 1)
    ]


def _loops(surface: Surface) -> list[tuple[Ints, list[int]]]:
    """The boundary as loops of vertices, and the half-edge from each to the next.

    The surface is on the left of a loop, unless it has one side only: then half-edges may run against it.
    """
    table = surface.edges
    half_edge = table.order[table.start[:-1][table.boundary]]
    start, end = surface.F.ravel(), np.roll(surface.F, -1, axis=1).ravel()
    by_ends = {(int(end[h]), int(start[h])): int(h) for h in half_edge}
    by_ends |= {(int(start[h]), int(end[h])): int(h) for h in half_edge}
    return [
        (loop, [by_ends[int(a), int(b)] for a, b in zip(loop, np.roll(loop, -1), strict=True)])
        for loop in surface.loops
    ]


def _runs(change: Bools) -> list[Ints]:
    """The positions of a loop in runs, each of which begins where something changes; all in one if nothing does."""
    begin = np.flatnonzero(change)
    if not len(begin):
        return [np.arange(len(change))]
    order = (begin[0] + np.arange(len(change))) % len(change)
    return np.split(order, begin[1:] - begin[0])
