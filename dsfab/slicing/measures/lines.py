"""Lines of a cut sheet: edges of members, middle lines of members, and corners of the outline."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, sorted_order
from dsfab.core.limits import SAME_PHASE
from dsfab.slicing.cutting.cells import nearest_levels
from dsfab.slicing.cutting.polygon_mesh import corner_places
from dsfab.slicing.cutting.sheet import VOID, LineKind, Sheet
from dsfab.slicing.measures.chart import Chart
from dsfab.surface import Surface, chains
from dsfab.surface.fields import CornerField, Kind, StructureLine, Track, level_lines, polyline_length
from dsfab.surface.topology import EdgeTable, edge_table, half_edges


class Labels(NamedTuple):
    """Outline edges (k,) of a material sheet.
    half_edge, start, end : the half-edge, and its first and its last vertex.
    curve  : number of the line with this edge, in `Sheet.lines`; -1 - k for the edge of a stripe of field k.
    family : number of the field that made the material; `VOID` (-1) on the boundary of the uncut surface."""

    half_edge: Ints
    start: Ints
    end: Ints
    curve: Ints
    family: Ints


def outline_labels(sheet: Sheet) -> Labels:
    """Return the outline edges of a material sheet."""
    h = sheet.surface.edges.outline
    a, b = (ends[h] for ends in half_edges(sheet.surface.F))
    line = sheet.sides_on.ravel()[h]
    curve = np.where(sheet.lines.kind[line] == LineKind.LEVEL, -1 - sheet.lines.field[line], line)
    return Labels(h, a, b, curve, np.where(line == LineKind.RIM, VOID, sheet.family[h // 3]))


def outline_corners(sheet: Sheet) -> Floats:
    """Return the vertices (k, 3), metres, where two curves of a material sheet's outline meet."""
    _, a, b, *names = outline_labels(sheet)
    curve = np.unique(np.stack(names), axis=1, return_inverse=True)[1].ravel()
    low, high = np.full(sheet.surface.n, np.iinfo(np.int64).max), np.full(sheet.surface.n, np.iinfo(np.int64).min)
    for end in (a, b):
        np.minimum.at(low, end, curve)
        np.maximum.at(high, end, curve)
    return np.asarray(sheet.surface.V[low < high])


LEAST = 1e-7  # Parts shorter than this fraction of a segment are dropped; shorter gaps are closed.


class Spans(NamedTuple):
    """Parts (p,) of segments that lie on a sheet.
    segment : (p,) segment of each part.    begin, end : (p,) positions of the part's ends on the segment, 0 to 1.
    of_pair, cell : (q,) pairs of a part and a cell that the part crosses."""

    segment: Ints
    begin: Floats
    end: Floats
    of_pair: Ints
    cell: Ints


def clip_segments(chart: Chart, face: Ints, view_ends: Floats, segment: Ints, sheet: Sheet, F: Ints) -> Spans:
    """Return the parts of segments that lie on the cells of a sheet.
    A view gives a segment in coordinates of a chart face. A segment on an edge has two views.
    face      : (v,) the chart's face of each view.    segment : (v,) number of the segment.
    view_ends : (v, 2, 3) ends of the segment in barycentric coordinates of this face.
    F         : (m, 3) faces of the uncut surface."""
    corners = _parent_coordinates(chart.weights, chart.surface.F[face], chart.parent[face], F)
    ends = view_ends @ corners  # barycentric, on the uncut faces
    order = sorted_order(sheet.parent)
    parents = sheet.parent[order]
    begin, end = (np.searchsorted(parents, chart.parent[face], side=side) for side in ("left", "right"))
    view = np.repeat(np.arange(len(face)), end - begin)
    cell = order[np.arange(len(view)) - (np.cumsum(end - begin) - end)[view]]
    corners = _parent_coordinates(sheet.weights, sheet.surface.F[cell], sheet.parent[cell], F)
    low, high = _span_inside(ends[view, :, :2], corners[..., :2])
    long_enough = high - low > LEAST
    return _merge_spans(segment[view[long_enough]], low[long_enough], high[long_enough], cell[long_enough])


def _parent_coordinates(weights: csr_array, F: Ints, parent: Ints, uncut: Ints) -> Floats:
    entries = weights[F.ravel()].tocoo()
    row, column = (index.astype(np.int64) for index in entries.coords)
    coordinates = np.zeros((3 * len(F), 3))
    np.add.at(coordinates, (row, corner_places(uncut[parent[row // 3]], column)), entries.data)
    return coordinates.reshape(-1, 3, 3)


def _span_inside(ends: Floats, corners: Floats) -> tuple[Floats, Floats]:
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    side = np.roll(corners, -1, axis=1) - corners
    area = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    for c in range(3):
        to = ends - corners[:, c, None]
        length = np.linalg.norm(side[:, c], axis=1) * np.sign(area)
        depth = (side[:, c, None, 0] * to[..., 1] - side[:, c, None, 1] * to[..., 0]) / length[:, None] + 1e-9
        begin, end = depth.T
        t = begin / np.where(begin == end, 1.0, begin - end)
        low = np.where((begin < 0) & (end >= 0), np.maximum(low, t), low)
        high = np.where((begin >= 0) & (end < 0), np.minimum(high, t), high)
        high = np.where((begin < 0) & (end < 0), -1.0, high)
    return low, high


def _merge_spans(segment: Ints, begin: Floats, end: Floats, cell: Ints) -> Spans:
    order = np.lexsort([begin, segment])
    segment, begin, end, cell = segment[order], begin[order], end[order], cell[order]
    upto = np.maximum.accumulate(2.0 * segment + end)  # on a common axis, segment s lies from 2 s to 2 s + 1
    begins_span = np.ones(len(segment), dtype=bool)
    begins_span[1:] = 2.0 * segment[1:] + begin[1:] > upto[:-1] + LEAST
    first_rows = np.flatnonzero(begins_span)
    span_end = np.maximum.reduceat(end, first_rows) if len(first_rows) else end
    start = np.where(begin[first_rows] < LEAST, 0.0, begin[first_rows])
    span_end = np.where(span_end > 1 - LEAST, 1.0, span_end)
    return Spans(segment[first_rows], start, span_end, np.cumsum(begins_span) - 1, cell)


class Middle(NamedTuple):
    """A middle line of a member: points (k, 3), metres, and the line's number."""

    number: int
    points: Floats


@dataclass(frozen=True, eq=False)
class Chords:
    """Segments of middle lines. A view gives a segment in coordinates of a face; a segment on an edge has two views.
    link   : (l, 2) nodes at the ends of the segments.    point : (nodes, 3) positions of the nodes, metres.
    of     : (v,) the segment of a view.    face : (v,) the chart's face of a view.
    number : (v,) number of the middle line in the family.
    at     : (v, 2, 3) ends of the segment in barycentric coordinates of the face."""

    link: Ints
    point: Floats
    of: Ints
    face: Ints
    number: Ints
    at: Floats

    @classmethod
    def from_chart(cls, chart: Chart, family: int, half_width: Floats) -> "Chords":
        """Return a family's segments in faces with a phase and a positive `half_width` (n,).

             |                  Line k has a segment in a face if k lies between the phases at the face's corners.
        ---o-+-o---  k
             |"""
        y, scale = (x[:, family][chart.surface.F] for x in (chart.z, chart.scale))
        wide = chart.carry(half_width)[chart.surface.F].min(axis=1) > 0
        live = np.flatnonzero((scale > 0).all(axis=1) & wide)
        low = np.ceil(y[live].min(axis=1) - SAME_PHASE)
        count = (np.floor(y[live].max(axis=1) + SAME_PHASE) - low + 1).astype(np.int64)
        face = np.repeat(live, count)
        level = low.repeat(count) + np.arange(len(face)) - (np.cumsum(count) - count).repeat(count)
        d = y[face] - level[:, None]
        d[np.abs(d) <= SAME_PHASE] = 0.0
        chord = ((d > 0).any(axis=1) & (d < 0).any(axis=1)) | ((d == 0).sum(axis=1) == 2)
        face, level, d = face[chord], level[chord], d[chord]
        number = np.rint(level / scale[face, 0]).astype(np.int64)
        return cls._from_zeros(chart, face, number, d)

    @classmethod
    def _from_zeros(cls, chart: Chart, face: Ints, number: Ints, d: Floats) -> "Chords":
        ahead = np.roll(d, -1, axis=1)
        meets = np.concatenate([d == 0, d * ahead < 0], axis=1)  # columns: 3 corners, 3 sides
        crossed_slot = np.nonzero(meets)[1].reshape(-1, 2)
        t = np.where(d * ahead < 0, d / np.where(d == ahead, 1.0, d - ahead), 0.0)
        corner, share = crossed_slot % 3, np.take_along_axis(t, crossed_slot % 3, axis=1)
        coordinates = (1 - share)[..., None] * np.eye(3)[corner] + share[..., None] * np.eye(3)[(corner + 1) % 3]
        node, point = _nodes(chart, face[:, None], corner, crossed_slot < 3, share)
        turned = node[:, 0] > node[:, 1]
        node[turned], coordinates[turned] = node[turned, ::-1], coordinates[turned, ::-1]
        link, segment = np.unique(node, axis=0, return_inverse=True)
        return cls(link, point, segment.ravel(), face, number, coordinates)


def _nodes(chart: Chart, face: Ints, corner: Ints, at_corner: np.ndarray, share: Floats) -> tuple[Ints, Floats]:
    V, vertex = np.unique(chart.surface.V, axis=0, return_inverse=True)  # joins both sides of each cut
    F = vertex.ravel()[chart.surface.F]
    edges: EdgeTable = edge_table(F)
    start, side = F[face, corner], edges.of[face, corner]
    t = np.where(edges.ends[side, 0] == start, share, 1 - share)
    on_side = np.flatnonzero(~at_corner.ravel())
    side, t = side.ravel()[on_side], t.ravel()[on_side]
    order = np.lexsort([t, side])
    begins_node = np.ones(len(order), dtype=bool)
    begins_node[1:] = (np.diff(side[order]) != 0) | (np.diff(t[order]) > 1e-5)
    node = start.ravel().copy()
    node[on_side[order]] = len(V) + np.cumsum(begins_node) - 1
    first_side = order[begins_node]
    a, b = (V[edges.ends[side[first_side], k]] for k in (0, 1))
    return node.reshape(-1, 2), np.concatenate([V, a + t[first_side, None] * (b - a)])


def member_middles(chart: Chart, family: int, half_width: Floats, sheet: Sheet, F: Ints, passing: Ints) -> list[Middle]:
    """Return the middle lines of a family's members, where the sheet has material.
    half_width : (n,) half width of members / distance between middle lines; 0 means no member.
    sheet      : the material.    F : (m, 3) faces of the uncut surface.
    passing    : fields of the crossing family. A line that lies in their material alone is left out."""
    chords = Chords.from_chart(chart, family, half_width)
    spans = clip_segments(chart, chords.face, chords.at, chords.of, sheet, F)
    through = np.isin(sheet.family[spans.cell], passing, invert=True)
    visible = np.zeros(len(spans.begin), dtype=bool)
    visible[spans.of_pair[through]] = True
    number = np.zeros(len(chords.link), dtype=np.int64)
    number[chords.of[::-1]] = chords.number[::-1]
    link, point = _pieces(chords, spans)
    result = []
    for nodes, passed in chains(link[:, 0], link[:, 1], len(point)):
        points = point[nodes]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if visible[passed].any() and lengths.any():
            distinct = np.concatenate([[True], lengths > 0])
            result.append(Middle(dominant_number(number[spans.segment[passed]], lengths), points[distinct]))
    return result


def _pieces(chords: Chords, spans: Spans) -> tuple[Ints, Floats]:
    link = chords.link[spans.segment]
    a, b = (chords.point[link[:, k]] for k in (0, 1))
    crowded = np.bincount(link.ravel(), minlength=len(chords.point))[link] > 2
    points, count = [chords.point], len(chords.point)
    for k, (t, full_length) in enumerate(((spans.begin, 0.0), (spans.end, 1.0))):
        new_node_rows = np.flatnonzero((t != full_length) | crowded[:, k])
        points.append(a[new_node_rows] + t[new_node_rows, None] * (b - a)[new_node_rows])
        link[new_node_rows, k] = count + np.arange(len(new_node_rows))
        count += len(new_node_rows)
    return link, np.concatenate(points)


def dominant_number(number: Ints, weight: Floats) -> int:
    """Return the number with the largest sum of weights (k,), among numbers (k,)."""
    values, group = np.unique(number, return_inverse=True)
    return int(values[np.argmax(np.bincount(group.ravel(), weight))])


BOUNDARY = "boundary"  # The family name of edges on the boundary of the uncut surface.
STRIPES = ("major", "minor")  # The families of a chart, in order.


class CornerLines(NamedTuple):
    """Field of evenly spaced stripes at the corners of faces, and the levels (k,) of the middle lines."""

    field: CornerField
    levels: Floats


Phase = Floats | CornerLines | None
"""Phase of a family of stripes: (n,) at the uncut vertices, whole on middle lines; or `CornerLines`; or None."""


def edge_lines(sheet: Sheet, uncut: Surface, names: Sequence[str], phases: Sequence[Phase]) -> list[StructureLine]:
    """Divide the outline of a material sheet into lines, at each change of family or stripe.
    names  : names of the fields of the cut, in the order of their numbers.
    phases : phase of each field, a whole number on middle lines.
    The material is on the left of the lines."""
    labels = outline_labels(sheet)
    stripes = _Stripes(sheet, uncut, phases, labels)
    of_half_edge = {int(a): i for i, a in enumerate(labels.half_edge)}
    chosen: list[tuple[str, int, Floats]] = []
    for loop, along in _loops(sheet.surface):
        edges = np.array([of_half_edge[h] for h in along])
        points = sheet.surface.V[loop]
        for run in _runs(stripes.changes(edges, loop)):
            family = int(labels.family[edges[run[0]]])
            line = points[[*run.tolist(), (run[-1] + 1) % len(points)]]
            stripe = dominant_number(stripes.number[edges[run]], np.linalg.norm(np.diff(line, axis=0), axis=1))
            chosen.append((BOUNDARY if family == VOID else names[family], stripe, line))
    return _structure_lines("edge", chosen)


class _Stripes:
    def __init__(self, sheet: Sheet, uncut: Surface, phases: Sequence[Phase], labels: Labels) -> None:
        self.family, self.cell, self.phases, self.curve = labels.family, labels.half_edge // 3, phases, labels.curve
        self.parent, self.weights, self.F = sheet.parent[self.cell], sheet.weights, uncut.F
        self.number = np.zeros(len(self.cell), dtype=np.int64)
        for k, phase in enumerate(phases):
            if phase is not None and (own_edges := labels.family == k).any():
                self.number[own_edges] = self._numbers(sheet, phase, self.cell[own_edges])

    def _numbers(self, sheet: Sheet, phase: Floats | CornerLines, cell: Ints) -> Ints:
        corners = sheet.surface.F[cell]
        if not isinstance(phase, CornerLines):
            return np.asarray(np.rint(sheet.carry(phase)[corners].mean(axis=1)), dtype=np.int64)
        z = phase.field.corners(self.F).mean(axis=2)
        entries = self.weights[corners.ravel()].tocoo()
        row, column = (index.astype(np.int64) for index in entries.coords)
        parent = sheet.parent[cell][row // 3]
        seen = entries.data * z[parent, corner_places(self.F[parent], column)]
        z = np.bincount(row // 3, seen, len(cell)) / 3
        return np.asarray(np.rint(nearest_levels(z, phase.levels)), dtype=np.int64)

    def changes(self, edges: Ints, loop: Ints) -> Bools:
        """Return a mask (k,) of edges in a loop that differ from the previous edge in family, line or stripe."""
        before = np.roll(edges, 1)
        number = self.number[before].astype(np.float64)
        for k, phase in enumerate(self.phases):
            if isinstance(phase, CornerLines):
                same_field = np.flatnonzero((self.family[edges] == k) & (self.family[before] == k))
                f, g = self.parent[edges[same_field]], self.parent[before[same_field]]
                rows = self.weights[loop[same_field]]
                base = rows.indices[rows.indptr[:-1]].astype(np.int64)  # a vertex of both uncut faces f and g
                place, place_before = (f, corner_places(self.F[f], base)), (g, corner_places(self.F[g], base))
                sign = phase.field.sign[place] * phase.field.sign[place_before]
                shift = phase.field.shift[place] - sign * phase.field.shift[place_before]
                number[same_field] = sign * number[same_field] + shift
        changes = (self.family[edges] != self.family[before]) | (self.curve[edges] != self.curve[before])
        return np.asarray(changes | (self.number[edges] != number))


def centre_lines(sheet: Sheet, name: str, phase: Floats, half_width: Floats) -> list[StructureLine]:
    """Return the middle lines z = k of a family's members on the sheet, for whole numbers k.
    phase, half_width : z and d (n,) at the n uncut vertices. A member lies where |z - k| < d."""
    z = sheet.carry(phase)
    levels = np.arange(np.floor(z.min()), np.ceil(z.max()) + 1)
    member = sheet.carry(np.minimum(half_width, 1.0))[sheet.surface.F].min(axis=1) > 0
    tracks: list[Track] = level_lines(sheet.surface, z, levels, member)
    return _structure_lines("centre", [(name, int(levels[track.level]), track.points) for track in tracks])


def chart_lines(
    sheet: Sheet, uncut: Surface, names: Sequence[str], name: str, chart: Chart, half_width: Floats
) -> list[StructureLine]:
    """Return middle lines of a family's evenly spaced members.
    names      : names of all fields of the cut.    name : "major" or "minor".
    half_width : (n,) half width of a member / distance between neighbouring members, at the uncut vertices."""
    family = STRIPES.index(name)
    passing = np.array([k for k, field_name in enumerate(names) if field_name == STRIPES[1 - family]], dtype=np.int64)
    lines = member_middles(chart, family, half_width, sheet, uncut.F, passing)
    return _structure_lines("centre", [(name, line.number, line.points) for line in lines])


def _structure_lines(kind: Kind, chosen: list[tuple[str, int, Floats]]) -> list[StructureLine]:
    groups = defaultdict[tuple[str, int], list[tuple[float, Floats]]](list)
    for family, number, points in chosen:
        groups[family, number].append((polyline_length(points), points))
    return [
        StructureLine(kind, family, number, part, points, length)
        for family, number in sorted(groups)
        for part, (length, points) in enumerate(sorted(groups[family, number], key=lambda one: -one[0]), 1)
    ]


def _loops(surface: Surface) -> list[tuple[Ints, list[int]]]:
    half_edge, (start, end) = surface.edges.outline, half_edges(surface.F)
    by_ends = {(int(end[h]), int(start[h])): int(h) for h in half_edge}
    by_ends |= {(int(start[h]), int(end[h])): int(h) for h in half_edge}
    return [
        (loop, [by_ends[int(a), int(b)] for a, b in zip(loop, np.roll(loop, -1), strict=True)])
        for loop in surface.loops
    ]


def _runs(change: Bools) -> list[Ints]:
    begin = np.flatnonzero(change)
    if not len(begin):
        return [np.arange(len(change))]
    order = (begin[0] + np.arange(len(change))) % len(change)
    return np.split(order, begin[1:] - begin[0])
