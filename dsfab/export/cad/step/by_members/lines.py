"""Lines along chains of mesh edges, and arcs at round corners of openings."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_array, lil_array
from scipy.sparse.linalg import spsolve
from scipy.spatial.distance import cdist

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members.curves import SAMPLES_PER_EDGE, ChainCurve, SampledChain, on_skins, parts_of
from dsfab.export.cad.step.by_members.regions import VOID, ChainLoop, ChainNet, ends_at, outline_through, turns

LinePart = tuple[int, float, float]  # part of a line: number of the line, parameters of both ends of the part

ChainEnd = tuple[int, int]  # end of a chain: number of the chain, index (0 or -1) of the end point


@dataclass(frozen=True, eq=False)
class ChainLine:
    """Curve along k consecutive chains of mesh edges. at : (k + 1,) parameters where the chains begin and end."""

    steps: ChainLoop
    curve: ChainCurve
    at: Floats

    def outlines(self, net: ChainNet) -> list[tuple[float, float]]:
        """Return the curve parameters (start, end) of each part of the line on an outline of the sheet.
        From start to end, the material is on the left."""
        pairs = list[tuple[float, float]]()
        for (k, ahead), (a, b) in zip(self.steps, pairwise(self.at.tolist()), strict=True):
            if net.chains[k].right != VOID or net.on_seam(k):
                continue
            if ahead:
                start, pairs = (pairs[-1][0], pairs[:-1]) if pairs and pairs[-1][1] == a else (a, pairs)
                pairs.append((start, b))
            else:
                end, pairs = (pairs[-1][1], pairs[:-1]) if pairs and pairs[-1][0] == a else (a, pairs)
                pairs.append((b, end))
        return pairs

    def with_poles_in(self, box: Floats) -> "ChainLine":
        """Divide long cubics of the curve until all their poles lie in a box (2, 3), mm."""
        return self._divide(lambda a, b, P: bool(((P.reshape(8, 3) >= box[0]) & (P.reshape(8, 3) <= box[1])).all()))

    def with_halved_spans(self, spans: Bools) -> "ChainLine":
        """Halve those cubics of the curve for which `spans` (k,) is True."""
        ends = pairwise(self.curve.breaks.tolist())
        marked = {span for span, is_one in zip(ends, spans.tolist(), strict=True) if is_one}
        return self._divide(lambda a, b, P: (float(a), float(b)) not in marked)

    def _divide(self, may_stay: Callable[[float, float, Floats], bool]) -> "ChainLine":
        shortest = 1 / 16  # shortest span that is divided; otherwise, division may never end
        middle_share = 1 / 4  # a cut at a chain's end must be this near to the cubic's middle, as a share of its length
        todo = list(zip(self.curve.breaks[:-1], self.curve.breaks[1:], self.curve.spans, strict=True))[::-1]
        breaks, spans = [0.0], list[Floats]()
        while todo:
            a, b, P = todo.pop()
            if may_stay(a, b, P) or b - a < shortest:
                breaks.append(b)
                spans.append(P)
                continue
            near_ends = self.at[np.abs(self.at - (a + b) / 2) < middle_share * (b - a)]
            x = near_ends[np.argmin(np.abs(near_ends - (a + b) / 2))] if len(near_ends) else (a + b) / 2
            share = (x - a) / (b - a)
            lower, upper = parts_of(np.stack([P, P]), np.array([0.0, share]), np.array([share, 1.0]))
            lower[0], upper[3], upper[0] = P[0], P[3], lower[3]
            todo += [(x, b, upper), (a, x, lower)]
        if len(spans) == len(self.curve.spans):
            return self
        return replace(self, curve=replace(self.curve, breaks=np.array(breaks), spans=np.stack(spans)))


class NetLines:
    """Curves ("lines") along all chains (rows of mesh edges) between regions.
    twins : number of a line at the seam -> number of the line on the seam's opposite side.
    place : by chain number, the number of the chain's line and the line's parameters at the chain's two ends."""

    def __init__(self, net: ChainNet, lines: list[ChainLine], twins: dict[int, int] | None = None) -> None:
        self.net, self.lines, self.twins = net, lines, twins or {}
        self.place = dict[int, LinePart]()
        for i, line in enumerate(lines):
            for (k, ahead), (a, b) in zip(line.steps, pairwise(line.at.tolist()), strict=True):
                self.place[k] = (i, a, b) if ahead else (i, b, a)

    def line_part(self, step: tuple[int, bool]) -> LinePart:
        """Return the number of a chain's line, and the line's parameters at the chain's start and end.
        step : chain number; False to exchange start and end."""
        i, a, b = self.place[step[0]]
        return (i, a, b) if step[1] else (i, b, a)

    def nodes(self, i: int) -> list[int]:
        """Return the point numbers of the nodes (ends of chains) along line number `i`, in order."""
        steps = self.lines[i].steps
        return [*(self.net.ends(step)[0] for step in steps), self.net.ends(steps[-1])[1]]

    def parts(self, parts: Sequence[LinePart]) -> Floats:
        """Return the poles (k, 4, 6) of k parts of lines, along each part. Each part must lie in a single cubic."""
        if not parts:
            return np.zeros((0, 4, 6))
        i, a, b = (np.array(column) for column in zip(*parts, strict=True))
        spans, line, starts, stops = self._spans
        span = np.searchsorted(starts + 2 * line, (a + b) / 2 + 2 * i, side="right") - 1
        long = stops[span] - starts[span]
        return parts_of(spans[span], (a - starts[span]) / long, (b - starts[span]) / long)

    @cached_property
    def _spans(self) -> tuple[Floats, Ints, Floats, Floats]:
        curves = [line.curve for line in self.lines]
        line = np.repeat(np.arange(len(curves)), [len(curve.spans) for curve in curves])
        starts, stops = (np.concatenate([curve.breaks[part] for curve in curves]) for part in (np.s_[:-1], np.s_[1:]))
        return np.concatenate([curve.spans for curve in curves]), line, starts, stops

    def curve(self, k: int) -> ChainCurve:
        """Return the curve along chain number `k`."""
        return self._curves[k]

    @cached_property
    def _curves(self) -> dict[int, ChainCurve]:
        stops, parts = dict[int, Floats](), list[LinePart]()
        for k, (i, a, b) in self.place.items():
            stops[k] = self.lines[i].curve.stops(min(a, b), max(a, b))
            parts += [(i, x, y) for x, y in pairwise(stops[k].tolist())]
        result, position, poles = dict[int, ChainCurve](), 0, self.parts(parts)
        for k, (i, a, b) in self.place.items():
            x = stops[k]
            spans, position = poles[position : position + len(x) - 1], position + len(x) - 1
            curve = ChainCurve((x - x[0]) / (x[-1] - x[0]), spans, self.lines[i].curve.off)
            result[k] = curve if a < b else curve.backwards()
        return result

    def curves(self, regions: Iterable[int]) -> dict[int, ChainCurve]:
        """Return the curves of all chains around the regions, by chain number."""
        around = {k for region in regions for loop in self.net.loops[region] for k, _ in loop}
        return {k: self.curve(k) for k in around}


def with_ends_on_lines(lines: NetLines) -> NetLines:
    """If a line ends at an inner node of a second line, move this end onto the second line."""
    points = _points_on(lines)
    moved = list[ChainLine]()
    for line in lines.lines:
        nodes, curve = ends_of(lines.net, line), line.curve
        if points.keys().isdisjoint(nodes):
            moved.append(line)
            continue
        start, end = (points.get(node, pole) for node, pole in zip(nodes, curve.spans[[0, -1], [0, -1]], strict=True))
        moved.append(replace(line, curve=curve.with_ends(start, end)))
    return NetLines(lines.net, moved)


def with_twins(lines: NetLines) -> NetLines:
    """Use the same curve on the two sides of the seam where a one-sided sheet was cut open.
    Raises ExportError if the chains on the two sides differ."""
    net, result, twins = lines.net, list(lines.lines), dict[int, int]()
    seam = {tuple(net.chains[k].points.tolist()): lines.place[k][0] for k in net.chains if net.on_seam(k)}
    for points, i in seam.items():
        j = seam.get(tuple(net.twins[p] for p in points))
        if j is None:
            raise ExportError("borders of members do not match at the seam where dsfab cut the one-sided sheet open")
        twins[i] = j
        if i < j:
            curve = result[i].curve
            result[j] = replace(result[j], curve=replace(curve, spans=np.roll(curve.spans, 3, axis=2)))
    return NetLines(net, result, twins)


def _points_on(lines: NetLines) -> dict[int, Floats]:
    net, inner_nodes = lines.net, list[tuple[int, int, float]]()
    for i, line in enumerate(lines.lines):
        inner_nodes += [(node, i, x) for node, x in zip(lines.nodes(i)[1:-1], line.at[1:-1].tolist(), strict=True)]
    if not inner_nodes:
        return {}
    number = {node: r for r, (node, _, _) in enumerate(inner_nodes)}
    right, A = np.zeros((len(inner_nodes), 6)), lil_array((len(inner_nodes), len(inner_nodes)))
    A.setdiag(1.0)
    for r, (_, i, x) in enumerate(inner_nodes):
        curve, ends = lines.lines[i].curve, ends_of(net, lines.lines[i])
        right[r] = curve(np.array([x]))[0]
        for node, share, pole in zip(ends, (1 - x, x), curve.spans[[0, -1], [0, -1]], strict=True):
            if node in number:
                A[r, number[node]] -= share
                right[r] -= share * pole
    points = np.asarray(spsolve(csc_array(A), right)).reshape(len(inner_nodes), 6)
    return {node: points[r] for node, r in number.items()}


def ends_of(net: ChainNet, line: ChainLine) -> tuple[int, int]:
    """Return the point numbers of the first and the last node of a line."""
    return net.ends(line.steps[0])[0], net.ends(line.steps[-1])[1]


def node_of(net: ChainNet, end: ChainEnd) -> int:
    """Return the point number of the node at an end of a chain."""
    return int(net.chains[end[0]].points[end[1]])


def end_of(step: tuple[int, bool]) -> ChainEnd:
    """Return the end (chain number, 0 or -1) at which a loop of chains leaves a chain.
    step : chain number, and True if the loop runs in the chain's own direction."""
    return step[0], -1 if step[1] else 0


CORNER_ANGLE = np.deg2rad(50.0)  # smallest bend between two chains at a corner of an outline, radians

BEND_ANGLE = np.deg2rad(10.0)  # smallest bend at a vertex of a round outline, radians, as in `ROUND_COSINE`


class ArcsOnSkins:
    """Function that moves arcs onto the two skins of the sheet.
    away : function of pairs of points (k, 6); returns the vectors (k, 6) to the outer and inner skin, mm."""

    def __init__(self, away: Callable[[Floats], Floats]) -> None:
        self.away, self.known = away, dict[int, tuple[SampledChain, bytes, ChainCurve]]()

    def __call__(self, arcs: Mapping[int, ChainCurve], chains: Mapping[int, SampledChain]) -> dict[int, ChainCurve]:
        poles = {k: arc.spans.tobytes() for k, arc in arcs.items()}
        changed = [k for k in arcs if k not in self.known or self.known[k][:2] != (chains[k], poles[k])]
        for k, curve in zip(changed, on_skins([arcs[k] for k in changed], self.away), strict=True):
            self.known[k] = chains[k], poles[k], replace(curve, off=_largest_distance(chains[k].Q, curve))
        return {k: self.known[k][2] for k in arcs}


def with_arcs(
    lines: NetLines,
    chains: Mapping[int, SampledChain],
    tolerances: Mapping[int, float],
    rounded: Collection[int],
    arcs_on_skins: ArcsOnSkins,
) -> NetLines:
    """Replace lines along round corners by arcs, unless an arc is too far from its chain of mesh edges.
    tolerances : by chain, largest distance of its arc, mm.    rounded : numbers of the chains at round corners."""
    rounds = 4  # after the removal of an arc, neighbouring arcs change and may be too far from their chains
    corners = _Corners(lines, rounded)
    arcs = dict[int, ChainCurve]()
    for _ in range(rounds):
        arcs = arcs_on_skins(corners.arcs(), chains)
        rejected = {k for k, arc in arcs.items() if arc.off > tolerances[k]}
        arcs = {k: arc for k, arc in arcs.items() if k not in rejected}
        if not rejected:
            break
        corners.round -= rejected
    result = list(lines.lines)
    for k, arc in arcs.items():
        i = lines.place[k][0]
        result[i] = replace(result[i], curve=arc if result[i].steps[0][1] else arc.backwards())
    return NetLines(lines.net, result)


def _largest_distance(Q: Floats, curve: ChainCurve) -> float:
    line = curve(np.linspace(0, 1, 65))
    return max(float(cdist(Q[:, s : s + 3], line[:, s : s + 3]).min(axis=1).max()) for s in (0, 3))


def round_chains(net: ChainNet, chains: Mapping[int, SampledChain], tolerances: Mapping[int, float]) -> set[int]:
    """Return the numbers of the chains of outline edges at round corners.
    tolerances : by chain number, the largest distance of an arc from the chain, mm."""
    nodes = _nodes(net, ends_at(net))
    angles = dict(zip(nodes, _turns([(chains[a], chains[b]) for a, b in nodes.values()]), strict=True))
    outlines = [k for k, chain in net.chains.items() if chain.right == VOID]
    bent = dict(zip(outlines, _bends([chains[k] for k in outlines]), strict=True))
    round_numbers = set[int]()
    for k in outlines:
        turns_at_ends, line = [angles.get(int(net.chains[k].points[i]), 0.0) for i in (0, -1)], chains[k]
        chord = (
            min(turns_at_ends) > BEND_ANGLE
            and max(turns_at_ends) < CORNER_ANGLE
            and float(line.lengths[-1]) * sum(turns_at_ends) / 16 <= tolerances[k]
        )
        if chord or bent[k]:
            round_numbers.add(k)
    return round_numbers


def _nodes(net: ChainNet, ends: Mapping[int, list[tuple[int, int]]]) -> dict[int, tuple[int, int]]:
    return {node: pair for node, chain_ends in ends.items() if (pair := outline_through(net, chain_ends))}


class _Corners:
    def __init__(self, lines: NetLines, rounded: Collection[int]) -> None:
        self.lines, self.net = lines, lines.net
        self.ends = ends_at(self.net)
        self.nodes = _nodes(self.net, self.ends)
        self.curves = {k: lines.curve(k) for k, chain in self.net.chains.items() if chain.right == VOID}
        self.round = {k for k in rounded if len(lines.lines[lines.place[k][0]].steps) == 1}
        self.known = dict[tuple[int, bool, bool], Floats | None]()
        self.made = dict[int, tuple[Floats | None, Floats | None, ChainCurve | None]]()

    def arcs(self) -> dict[int, ChainCurve]:
        result = dict[int, ChainCurve]()
        for k in sorted(self.round):
            arc = self._arc(k, *(self._known_way(int(self.net.chains[k].points[i])) for i in (0, -1)))
            if arc is not None:
                result[k] = arc
        return result

    def _arc(self, k: int, start: Floats | None, end: Floats | None) -> ChainCurve | None:
        if start is None and end is None:
            return None
        if k not in self.made or self.made[k][0] is not start or self.made[k][1] is not end:
            P, Q = self.curves[k].spans[[0, -1]]
            start_direction = _scaled_direction(P[1] - P[0]) if start is None else start
            end_direction = _scaled_direction(Q[3] - Q[2]) if end is None else end
            self.made[k] = start, end, _arc_between(P[0], Q[3], start_direction, end_direction)
        return self.made[k][2]

    def _known_way(self, node: int) -> Floats | None:
        if node not in self.nodes:
            return None
        before, after = self.nodes[node]
        kind = node, before in self.round, after in self.round
        if kind not in self.known:
            self.known[kind] = self._way(node, before, after)
        return self.known[kind]

    def _way(self, node: int, before: int, after: int) -> Floats | None:
        flattest = 25.0  # degrees; smallest angle between a border and an arc; in smaller angles, patches fold over
        P, Q = self.curves[before].spans[-1], self.curves[after].spans[0]
        way_before, way_after = _scaled_direction(P[3] - P[2]), _scaled_direction(Q[1] - Q[0])
        if _mean_direction(way_before) @ _mean_direction(way_after) < np.cos(CORNER_ANGLE):
            return None
        d = way_after if before in self.round else way_before
        if before in self.round and after in self.round:
            d = self._on_circle(before, after)
        seams = [(k, end) for k, end in self.ends[node] if self.net.chains[k].right != VOID]
        limit = np.cos(np.deg2rad(flattest))
        steep = all(abs(_mean_direction(d) @ self._seam_way(seam, end)) < limit for seam, end in seams)
        return d if steep else None

    def _on_circle(self, before: int, after: int) -> Floats:
        spans_before, spans_after = self.curves[before].spans, self.curves[after].spans
        a, b, c = spans_before[0, 0], spans_before[-1, -1], spans_after[-1, -1]
        length_before, length_after = (float(np.linalg.norm(_mean_direction(chord))) for chord in (b - a, c - b))
        return _scaled_direction((b - a) * length_after / length_before + (c - b) * length_before / length_after)

    def _seam_way(self, k: int, end: int) -> Floats:
        P = self.lines.curve(k).spans[end]
        direction = _mean_direction(P[1] - P[0]) if end == 0 else _mean_direction(P[2] - P[3])
        return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-300))


def _turns(pairs: Sequence[tuple[SampledChain, SampledChain]]) -> list[float]:
    if not pairs:
        return []
    Q = np.array([[before.Q[-2], before.Q[-1], after.Q[0], after.Q[1]] for before, after in pairs])
    middle, across = (Q[..., :3] + Q[..., 3:]) / 2, Q[:, 2, :3] - Q[:, 2, 3:]
    cosines = turns(middle[:, 1] - middle[:, 0], middle[:, 3] - middle[:, 2], across)
    return [float(x) for x in np.arccos(np.clip(cosines, -1, 1))]


def _bends(chains: Sequence[SampledChain]) -> list[bool]:
    parts = [chain.Q[::SAMPLES_PER_EDGE] for chain in chains]
    if not parts:
        return []
    Q, chain_number = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    directions = np.diff((Q[:, :3] + Q[:, 3:]) / 2, axis=0)
    inside = np.flatnonzero(chain_number[2:] == chain_number[:-2])  # number of the segment before an inner vertex
    cosines = turns(directions[inside], directions[inside + 1], (Q[:, :3] - Q[:, 3:])[inside + 1])
    bent = set(chain_number[inside[cosines < np.cos(BEND_ANGLE)]].tolist())
    return [i in bent for i in range(len(parts))]


def _arc_between(start: Floats, end: Floats, start_direction: Floats, end_direction: Floats) -> ChainCurve | None:
    """Return a nearly circular cubic between two points with given end directions; None for a strong bend."""
    widest = 80.0  # degrees; largest angle between the arc's chord and the arc's direction at an end
    chord, directions = _mean_direction(end - start), (_mean_direction(start_direction), _mean_direction(end_direction))
    long = float(np.linalg.norm(chord))
    if min(float(direction @ chord) for direction in directions) < np.cos(np.deg2rad(widest)) * long:
        return None
    turn = float(np.arccos(np.clip(directions[0] @ directions[1], -1, 1)))
    handle = long / (3 * np.cos(turn / 4) ** 2)
    poles = np.stack([start, start + handle * start_direction, end - handle * end_direction, end])
    return ChainCurve(np.array([0.0, 1.0]), poles[None])


def _mean_direction(direction: Floats) -> Floats:
    return np.asarray((direction[:3] + direction[3:]) / 2)


def _scaled_direction(direction: Floats) -> Floats:
    return np.asarray(direction / np.linalg.norm(_mean_direction(direction)))
