"""The lines of a cut sheet: its edges by the family whose stripes they bound, and the middles of its members."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing.corners import outline_labels
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.surface.lines import Kind, Line, Track, level_lines, polyline_length
from dsfab.surface.mesh import Surface

BOUNDARY = "boundary"
"""The family of an edge that lies on the boundary of the uncut surface."""


def edge_lines(sheet: Sheet, uncut: Surface, names: Sequence[str], phases: Sequence[Floats | None]) -> list[Line]:
    """The outline of a kept sheet, cut into lines wherever it passes from one family or stripe to another.

    names  : of the fields that the sheet was cut by; a cell's `family` is an index into them.
    phases : for each field, z (n,) on the uncut surface, whose integers are the middles of its stripes, or None where
             it draws no stripes. An edge belongs to the stripe k that the cell beside it is a part of: z is next to k.
    Together the lines are the boundary of the sheet, each edge of it once, with the material on the left.
    """
    labels = outline_labels(sheet, uncut)
    number = np.zeros(len(labels.half_edge), dtype=np.int64)
    for k, z in enumerate(phases):
        if z is not None and (mine := labels.family == k).any():
            corners = sheet.surface.F[labels.half_edge[mine] // 3]
            number[mine] = np.rint(sheet.carry(z)[corners].mean(axis=1))
    of_half_edge = {int(a): i for i, a in enumerate(labels.half_edge)}
    chosen: list[tuple[str, int, Floats]] = []
    for loop, along in _loops(sheet.surface):
        at = np.array([of_half_edge[h] for h in along])
        points = sheet.surface.V[loop]
        label = np.stack([labels.family[at], number[at]], axis=1)
        for run in _runs(label):
            family, stripe = (int(value) for value in label[run[0]])
            line = points[[*run.tolist(), (run[-1] + 1) % len(points)]]
            chosen.append((BOUNDARY if family == VOID else names[family], stripe, line))
    return _numbered("edge", chosen)


def centre_lines(sheet: Sheet, name: str, phase: Floats, half_width: Floats) -> list[Line]:
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


def _numbered(kind: Kind, chosen: list[tuple[str, int, Floats]]) -> list[Line]:
    """The lines with their parts numbered, the longest of each stripe first."""
    groups = defaultdict[tuple[str, int], list[tuple[float, Floats]]](list)
    for family, number, points in chosen:
        groups[family, number].append((polyline_length(points), points))
    return [
        Line(kind, family, number, part, points, length)
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


def _runs(label: Ints) -> list[Ints]:
    """The positions of a loop in runs of equal label (k, 2); the first run begins where the label changes."""
    change = np.flatnonzero((label != np.roll(label, 1, axis=0)).any(axis=1))
    if not len(change):
        return [np.arange(len(label))]
    order = (change[0] + np.arange(len(label))) % len(label)
    return np.split(order, change[1:] - change[0])
