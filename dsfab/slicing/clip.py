"""Segments inside faces of the uncut surface, clipped to the cells of a sheet in the same faces."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, Ints, sorted_order
from dsfab.slicing.chart import Chart
from dsfab.slicing.polygon_mesh import places
from dsfab.slicing.sheet import Sheet

INSIDE = 1e-9
"""A point this far outside a cell is in it still, as a share of the uncut face: cells leave no gap between them."""

LEAST = 1e-7
"""Shorter parts of a segment, and shorter gaps in it, are those of rounding."""


class Spans(NamedTuple):
    """What is left of segments.

    segment : (p,) of which.    begin, end : (p,) from where to where, 0 to 1.
    of_pair : (q,) the part that a pair of segment and cell belongs to, and cell : (q,) that cell.
    """

    segment: Ints
    begin: Floats
    end: Floats
    of_pair: Ints
    cell: Ints


def clipped(chart: Chart, face: Ints, at: Floats, of: Ints, sheet: Sheet, F: Ints) -> Spans:
    """The parts of segments that lie on cells of a sheet.

    face, at, of : (v,) faces of the chart, (v, 2, 3) both ends there, and the segment that this is a view of; two faces
                   may see the same segment, along the edge between them.
    F            : (m, 3) the uncut faces.
    """
    ends = at @ _in_parents(chart.weights, chart.surface.F[face], chart.parent[face], F)  # on the uncut faces
    order = sorted_order(sheet.parent)
    parents = sheet.parent[order]
    begin, end = (np.searchsorted(parents, chart.parent[face], side=side) for side in ("left", "right"))
    view = np.repeat(np.arange(len(face)), end - begin)
    cell = order[np.arange(len(view)) - (np.cumsum(end - begin) - end)[view]]
    corners = _in_parents(sheet.weights, sheet.surface.F[cell], sheet.parent[cell], F)
    low, high = _inside(ends[view, :, :2], corners[..., :2])
    some = high - low > LEAST
    return _united(of[view[some]], low[some], high[some], cell[some])


def _in_parents(weights: csr_array, F: Ints, parent: Ints, uncut: Ints) -> Floats:
    """(k, 3, 3) the corners of triangles F (k, 3) in barycentric coordinates of their parents (k,)."""
    entries = weights[F.ravel()].tocoo()
    row, column = (index.astype(np.int64) for index in entries.coords)
    found = np.zeros((3 * len(F), 3))
    np.add.at(found, (row, places(uncut[parent[row // 3]], column)), entries.data)
    return found.reshape(-1, 3, 3)


def _inside(ends: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """(q,) from where to where segments (q, 2, 2) are inside triangles (q, 3, 2); nowhere if the second is less."""
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    side = np.roll(corners, -1, axis=1) - corners
    area = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    for c in range(3):
        to = ends - corners[:, c, None]
        length = np.linalg.norm(side[:, c], axis=1) * np.sign(area)
        depth = (side[:, c, None, 0] * to[..., 1] - side[:, c, None, 1] * to[..., 0]) / length[:, None] + INSIDE
        begin, end = depth.T
        t = begin / np.where(begin == end, 1.0, begin - end)
        low = np.where((begin < 0) & (end >= 0), np.maximum(low, t), low)
        high = np.where((begin >= 0) & (end < 0), np.minimum(high, t), high)
        high = np.where((begin < 0) & (end < 0), -1.0, high)
    return low, high


def _united(segment: Ints, begin: Floats, end: Floats, cell: Ints) -> Spans:
    """Parts that touch or overlap, as one each."""
    order = np.lexsort([begin, segment])
    segment, begin, end, cell = segment[order], begin[order], end[order], cell[order]
    upto = np.maximum.accumulate(2.0 * segment + end)  # no part of one segment reaches the next
    new = np.ones(len(segment), dtype=bool)
    new[1:] = 2.0 * segment[1:] + begin[1:] > upto[:-1] + LEAST
    first = np.flatnonzero(new)
    last = np.maximum.reduceat(end, first) if len(first) else end
    start = np.where(begin[first] < LEAST, 0.0, begin[first])
    return Spans(segment[first], start, np.where(last > 1 - LEAST, 1.0, last), np.cumsum(new) - 1, cell)
