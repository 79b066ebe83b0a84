"""Middles of evenly spaced members: where a phase of a `Chart` is a whole number, joined across its cuts.

Neighbours may see a phase in another sign, count lines by twos, or see none: so chords are found face by face and told
to be one line by where they meet the edges of the mesh, not by what they are numbered there.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing.chart import SAME, Chart
from dsfab.slicing.clip import Spans, clipped
from dsfab.slicing.sheet import Sheet
from dsfab.surface import chains
from dsfab.surface.topology import EdgeTable, edge_table

NEAR = 1e-5
"""Two faces cross an edge in the same place if that differs by less, as a share of the edge."""


class Middle(NamedTuple):
    """A line along the middle of a member: its number, as most of it is seen, and points (k, 3) in metres."""

    number: int
    points: Floats


@dataclass(frozen=True, eq=False)
class Chords:
    """Segments of middles, each between two nodes; one that runs along an edge may be seen by both faces there.

    link   : (l, 2) nodes.                point  : (nodes, 3) metres.
    of     : (v,) the segment of a view.  face   : (v,) of the chart.    number : (v,) of the line, in the finest lines.
    at     : (v, 2, 3) both nodes of the segment in barycentric coordinates of the face.
    """

    link: Ints
    point: Floats
    of: Ints
    face: Ints
    number: Ints
    at: Floats

    @classmethod
    def on(cls, chart: Chart, family: int, half_width: Floats) -> "Chords":
        """Those of a family in faces where it has a phase, and a half-width (n,) over 0 at every corner.

             |                  A face has a chord for every whole number between two of its corners, from side to
        ---o-+-o---  k          side or from a corner; and one along a side both of whose ends are on k.
             |
        """
        y, scale = (x[:, family][chart.surface.F] for x in (chart.z, chart.scale))
        wide = chart.carry(half_width)[chart.surface.F].min(axis=1) > 0
        live = np.flatnonzero((scale > 0).all(axis=1) & wide)
        low = np.ceil(y[live].min(axis=1) - SAME)
        count = (np.floor(y[live].max(axis=1) + SAME) - low + 1).astype(np.int64)
        face = np.repeat(live, count)
        level = low.repeat(count) + np.arange(len(face)) - (np.cumsum(count) - count).repeat(count)
        d = y[face] - level[:, None]
        d[np.abs(d) <= SAME] = 0.0
        chord = ((d > 0).any(axis=1) & (d < 0).any(axis=1)) | ((d == 0).sum(axis=1) == 2)
        face, level, d = face[chord], level[chord], d[chord]
        number = np.rint(level / scale[face, 0]).astype(np.int64)
        return cls._joined(chart, face, number, d)

    @classmethod
    def _joined(cls, chart: Chart, face: Ints, number: Ints, d: Floats) -> "Chords":
        """Chords where fields d (v, 3) at the corners of faces (v,) are 0."""
        ahead = np.roll(d, -1, axis=1)
        place = np.nonzero(np.concatenate([d == 0, d * ahead < 0], axis=1))[1].reshape(-1, 2)  # corners, then sides
        t = np.where(d * ahead < 0, d / np.where(d == ahead, 1.0, d - ahead), 0.0)
        corner, share = place % 3, np.take_along_axis(t, place % 3, axis=1)
        at = (1 - share)[..., None] * np.eye(3)[corner] + share[..., None] * np.eye(3)[(corner + 1) % 3]
        node, point = _nodes(chart, face[:, None], corner, place < 3, share)
        turned = node[:, 0] > node[:, 1]
        node[turned], at[turned] = node[turned, ::-1], at[turned, ::-1]
        link, of = np.unique(node, axis=0, return_inverse=True)
        return cls(link, point, of.ravel(), face, number, at)


def _nodes(chart: Chart, face: Ints, corner: Ints, whole: np.ndarray, share: Floats) -> tuple[Ints, Floats]:
    """(v, 2) the nodes at corners (where `whole`) or on the sides after them, and (nodes, 3) their points, metres."""
    V, vertex = np.unique(chart.surface.V, axis=0, return_inverse=True)  # cuts of the chart are no edges of the sheet
    F = vertex.ravel()[chart.surface.F]
    edges: EdgeTable = edge_table(F)
    start, side = F[face, corner], edges.of[face, corner]
    t = np.where(edges.ends[side, 0] == start, share, 1 - share)
    on_side = np.flatnonzero(~whole.ravel())
    side, t = side.ravel()[on_side], t.ravel()[on_side]
    order = np.lexsort([t, side])
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(side[order]) != 0) | (np.diff(t[order]) > NEAR)
    node = start.ravel().copy()
    node[on_side[order]] = len(V) + np.cumsum(new) - 1
    first = order[new]
    a, b = (V[edges.ends[side[first], k]] for k in (0, 1))
    return node.reshape(-1, 2), np.concatenate([V, a + t[first, None] * (b - a)])


def middles(chart: Chart, family: int, half_width: Floats, sheet: Sheet, F: Ints, passing: Ints) -> list[Middle]:
    """The middles of one family's members on what is kept of the surface.

    half_width : (n,) in periods: material is |z - k| < d, and where d is 0 there is no member.
    sheet      : what is kept.    F : (m, 3) the uncut faces.
    passing    : values of `sheet.family`; lines that run through cells of these alone are left out: that is where a
                 line of the chart, which no member was drawn along, passes below another member.
    """
    chords = Chords.on(chart, family, half_width)
    spans = clipped(chart, chords.face, chords.at, chords.of, sheet, F)
    through = np.isin(sheet.family[spans.cell], passing, invert=True)
    drawn = np.zeros(len(spans.begin), dtype=bool)
    drawn[spans.of_pair[through]] = True
    number = np.zeros(len(chords.link), dtype=np.int64)
    number[chords.of[::-1]] = chords.number[::-1]
    link, point = _pieces(chords, spans)
    found = []
    for nodes, passed in chains(link[:, 0], link[:, 1], len(point)):
        points = point[nodes]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if drawn[passed].any() and lengths.any():
            distinct = np.concatenate([[True], lengths > 0])
            found.append(Middle(mostly(number[spans.segment[passed]], lengths), points[distinct]))
    return found


def _pieces(chords: Chords, spans: Spans) -> tuple[Ints, Floats]:
    """(p, 2) the nodes of what is left of the segments, at most two at each, and the points of all nodes.

    Where a segment is cut it gets a node of its own, and where more than two meet, each does: there all of them end.
    """
    link = chords.link[spans.segment]
    a, b = (chords.point[link[:, k]] for k in (0, 1))
    crowded = np.bincount(link.ravel(), minlength=len(chords.point))[link] > 2
    points, count = [chords.point], len(chords.point)
    for k, (t, whole) in enumerate(((spans.begin, 0.0), (spans.end, 1.0))):
        own = np.flatnonzero((t != whole) | crowded[:, k])
        points.append(a[own] + t[own, None] * (b - a)[own])
        link[own, k] = count + np.arange(len(own))
        count += len(own)
    return link, np.concatenate(points)


def mostly(number: Ints, weight: Floats) -> int:
    """The number (k,) with the largest sum of weights (k,)."""
    values, of = np.unique(number, return_inverse=True)
    return int(values[np.argmax(np.bincount(of.ravel(), weight))])
