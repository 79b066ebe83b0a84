"""Chains in a row as one curve, and arcs at the round corners of openings, tangent to the walls beside them."""

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
from dsfab.export.cad.step.by_members.curves import BETWEEN, ChainCurve, SampledChain, on_skins, parts_of
from dsfab.export.cad.step.by_members.regions import VOID, ChainNet, Loop, ends_at, outline_through, turns

Part = tuple[int, float, float]
"""Of a line: its number, and from which parameter to which it is run through."""

End = tuple[int, int]
"""A chain's first (0) or last (-1) point."""


SHORTEST = 1 / 16
"""Share of a line's parameters that a cubic is at least, if it was longer, where one is divided: ends of lines may be
outside of a box."""

OFF_MIDDLE = 1 / 4
"""Share of a cubic by which the end of a chain is off its middle, at most, where that is divided."""


@dataclass(frozen=True, eq=False)
class ChainLine:
    """steps : chains in order.    curve : of all of them.    at : (k + 1,) its parameters where they end."""

    steps: Loop
    curve: ChainCurve
    at: Floats

    def outlines(self, net: ChainNet) -> list[tuple[float, float]]:
        """Where void is on one side: parameters, the material on the left of the way from the first to the second."""
        found = list[tuple[float, float]]()
        for (k, ahead), (a, b) in zip(self.steps, pairwise(self.at.tolist()), strict=True):
            if net.chains[k].right != VOID or net.on_seam(k):
                continue
            if ahead:
                start, found = (found[-1][0], found[:-1]) if found and found[-1][1] == a else (a, found)
                found.append((start, b))
            else:
                end, found = (found[-1][1], found[:-1]) if found and found[-1][0] == a else (a, found)
                found.append((b, end))
        return found

    def with_poles_in(self, box: Floats) -> "ChainLine":
        """Its cubics divided until all poles are in a box (2, 3), since CAD programs draw boxes around poles."""
        return self._divided(lambda a, b, P: _within(P, box))

    def halved(self, spans: Bools) -> "ChainLine":
        """Some of its cubics (k,) in two."""
        ends = pairwise(self.curve.breaks.tolist())
        some = {both for both, is_one in zip(ends, spans.tolist(), strict=True) if is_one}
        return self._divided(lambda a, b, P: (float(a), float(b)) not in some)

    def _divided(self, whole: Callable[[float, float, Floats], bool]) -> "ChainLine":
        """Its cubics divided until they may stay whole, or are short. One is divided at its middle, or at the end of a
        chain near it, where a wall ends as well."""
        todo = list(zip(self.curve.breaks[:-1], self.curve.breaks[1:], self.curve.spans, strict=True))[::-1]
        breaks, spans = [0.0], list[Floats]()
        while todo:
            a, b, P = todo.pop()
            if whole(a, b, P) or b - a < SHORTEST:
                breaks.append(b)
                spans.append(P)
                continue
            near = self.at[np.abs(self.at - (a + b) / 2) < OFF_MIDDLE * (b - a)]
            x = near[np.argmin(np.abs(near - (a + b) / 2))] if len(near) else (a + b) / 2
            share = (x - a) / (b - a)
            one, two = parts_of(np.stack([P, P]), np.array([0.0, share]), np.array([share, 1.0]))
            one[0], two[3], two[0] = P[0], P[3], one[3]
            todo += [(x, b, two), (a, x, one)]
        if len(spans) == len(self.curve.spans):
            return self
        return replace(self, curve=replace(self.curve, breaks=np.array(breaks), spans=np.stack(spans)))


class NetLines:
    """The lines of a net; `place` says of each chain in which line it is, and between which parameters.
    twins : lines on both sides of a seam, by each other."""

    def __init__(self, net: ChainNet, lines: list[ChainLine], twins: dict[int, int] | None = None) -> None:
        self.net, self.lines, self.twins = net, lines, twins or {}
        self.place = dict[int, Part]()
        for i, line in enumerate(lines):
            for (k, ahead), (a, b) in zip(line.steps, pairwise(line.at.tolist()), strict=True):
                self.place[k] = (i, a, b) if ahead else (i, b, a)

    def along(self, step: tuple[int, bool]) -> Part:
        """The line of a step of a loop, and the parameters from which to which it runs."""
        i, a, b = self.place[step[0]]
        return (i, a, b) if step[1] else (i, b, a)

    def nodes(self, i: int) -> list[int]:
        """The nodes of a line, in order."""
        steps = self.lines[i].steps
        return [
            *(node_of(self.net, (k, 0 if ahead else -1)) for k, ahead in steps),
            node_of(self.net, end_of(steps[-1])),
        ]

    def parts(self, some: Sequence[Part]) -> Floats:
        """(k, 4, 6) poles of parts of lines that have no break inside, backwards where they run so."""
        if not some:
            return np.zeros((0, 4, 6))
        i, a, b = (np.array(column) for column in zip(*some, strict=True))
        spans, line, first, last = self._spans
        span = np.searchsorted(first + 2 * line, (a + b) / 2 + 2 * i, side="right") - 1
        long = last[span] - first[span]
        return parts_of(spans[span], (a - first[span]) / long, (b - first[span]) / long)

    @cached_property
    def _spans(self) -> tuple[Floats, Ints, Floats, Floats]:
        """Poles (k, 4, 6) of the cubics of all lines, the lines they are of, and between which breaks they are."""
        curves = [line.curve for line in self.lines]
        line = np.repeat(np.arange(len(curves)), [len(curve.spans) for curve in curves])
        first, last = (np.concatenate([curve.breaks[some] for curve in curves]) for some in (np.s_[:-1], np.s_[1:]))
        return np.concatenate([curve.spans for curve in curves]), line, first, last

    def curve(self, k: int) -> ChainCurve:
        """Of a chain."""
        return self._curves[k]

    @cached_property
    def _curves(self) -> dict[int, ChainCurve]:
        """Of all chains, by number: one by one they take three times as long."""
        stops, parts = dict[int, Floats](), list[Part]()
        for k, (i, a, b) in self.place.items():
            stops[k] = self.lines[i].curve.stops(min(a, b), max(a, b))
            parts += [(i, x, y) for x, y in pairwise(stops[k].tolist())]
        found, at, poles = dict[int, ChainCurve](), 0, self.parts(parts)
        for k, (i, a, b) in self.place.items():
            x = stops[k]
            spans, at = poles[at : at + len(x) - 1], at + len(x) - 1
            curve = ChainCurve((x - x[0]) / (x[-1] - x[0]), spans, self.lines[i].curve.off)
            found[k] = curve if a < b else curve.reversed()
        return found

    def curves(self, regions: Iterable[int]) -> dict[int, ChainCurve]:
        """Of the chains around regions, by number."""
        around = {k for region in regions for loop in self.net.loops[region] for k, _ in loop}
        return {k: self.curve(k) for k in around}


def with_ends_on_lines(lines: NetLines) -> NetLines:
    """The lines with their ends moved onto others that these are on."""
    at = _points_on(lines)
    moved = list[ChainLine]()
    for line in lines.lines:
        nodes, curve = ends_of(lines.net, line), line.curve
        if at.keys().isdisjoint(nodes):
            moved.append(line)
            continue
        start, end = (at.get(node, pole) for node, pole in zip(nodes, curve.spans[[0, -1], [0, -1]], strict=True))
        moved.append(replace(line, curve=curve.with_ends(start, end)))
    return NetLines(lines.net, moved)


def with_twins(lines: NetLines) -> NetLines:
    """The lines whose curves on both sides of a seam are one: the outer poles of each are the inner ones of the other.
    Raises ExportError where chains of one side are not those of the other."""
    net, found, twins = lines.net, list(lines.lines), dict[int, int]()
    seam = {tuple(net.chains[k].points.tolist()): lines.place[k][0] for k in net.chains if net.on_seam(k)}
    for points, i in seam.items():
        j = seam.get(tuple(net.twins[p] for p in points))
        if j is None:
            raise ExportError("the sheet is not divided alike on both sides of where its one side was cut open")
        twins[i] = j
        if i < j:
            curve = found[i].curve
            found[j] = replace(found[j], curve=replace(curve, spans=np.roll(curve.spans, 3, axis=2)))
    return NetLines(net, found, twins)


def _points_on(lines: NetLines) -> dict[int, Floats]:
    """Points (6,) of the nodes that lie on lines, between the ends of these.

    A line that ends on another moves where that goes, and this one where those go that it ends on itself: such points
    are linear in each other.
    """
    net, on = lines.net, list[tuple[int, int, float]]()
    for i, line in enumerate(lines.lines):
        on += [(node, i, x) for node, x in zip(lines.nodes(i)[1:-1], line.at[1:-1].tolist(), strict=True)]
    if not on:
        return {}
    number = {node: r for r, (node, _, _) in enumerate(on)}
    right, A = np.zeros((len(on), 6)), lil_array((len(on), len(on)))
    A.setdiag(1.0)
    for r, (_, i, x) in enumerate(on):
        curve, ends = lines.lines[i].curve, ends_of(net, lines.lines[i])
        right[r] = curve(np.array([x]))[0]
        for node, share, pole in zip(ends, (1 - x, x), curve.spans[[0, -1], [0, -1]], strict=True):
            if node in number:
                A[r, number[node]] -= share
                right[r] -= share * pole
    points = np.asarray(spsolve(csc_array(A), right)).reshape(len(on), 6)
    return {node: points[r] for node, r in number.items()}


def ends_of(net: ChainNet, line: ChainLine) -> tuple[int, int]:
    """The nodes where a line ends."""
    (first, ahead), last = line.steps[0], line.steps[-1]
    return node_of(net, (first, 0 if ahead else -1)), node_of(net, end_of(last))


def node_of(net: ChainNet, end: End) -> int:
    """The node at an end of a chain."""
    return int(net.chains[end[0]].points[end[1]])


def end_of(step: tuple[int, bool]) -> End:
    """The end of a chain where a step arrives."""
    return step[0], -1 if step[1] else 0


def _within(P: Floats, box: Floats) -> bool:
    """Whether poles (4, 6) on both skins are in a box."""
    points = P.reshape(8, 3)
    return bool((points >= box[0]).all() and (points <= box[1]).all())


CORNER = np.deg2rad(50.0)
"""Turn from one chain of an outline to the next from which on there is a corner."""

BENT = np.deg2rad(10.0)
"""Turn at one vertex from which on an outline is round there, as in `graph`: where a coarse mesh bends, outlines turn
with it, and are straight."""

FLATTEST = np.cos(np.deg2rad(25.0))
"""Cosine of the least angle between an arc and a border between members that ends where it does: patches in narrower
wedges are folded."""

WIDEST = np.cos(np.deg2rad(80.0))
"""Cosine of the largest angle between an arc's chord and its direction at an end."""

ROUNDS = 4
"""How often arcs that are off their chords become walls, which may do the same to others."""

DENSE = np.linspace(0, 1, 65)
"""Where an arc is compared with its chords."""


class ArcsOnSkins:
    """Arcs on both skins, with how far chains are off them; those of a chain that were asked before are not made anew.

    away : the ways (k, 6) to both skins from points near them.
    """

    def __init__(self, away: Callable[[Floats], Floats]) -> None:
        self.away, self.known = away, dict[int, tuple[SampledChain, bytes, ChainCurve]]()

    def __call__(self, arcs: Mapping[int, ChainCurve], chains: Mapping[int, SampledChain]) -> dict[int, ChainCurve]:
        """By chain."""
        poles = {k: arc.spans.tobytes() for k, arc in arcs.items()}
        new = [k for k in arcs if not self._same(k, chains[k], poles[k])]
        for k, curve in zip(new, on_skins([arcs[k] for k in new], self.away), strict=True):
            self.known[k] = chains[k], poles[k], replace(curve, off=_off(chains[k].Q, curve))
        return {k: self.known[k][2] for k in arcs}

    def _same(self, k: int, chain: SampledChain, poles: bytes) -> bool:
        return k in self.known and self.known[k][0] is chain and self.known[k][1] == poles


def with_arcs(
    lines: NetLines,
    chains: Mapping[int, SampledChain],
    within: Mapping[int, float],
    rounded: Collection[int],
    on: ArcsOnSkins,
) -> NetLines:
    """The lines, those of round corners as arcs as far as these are within tolerances (millimetres, by chain) of them.

    rounded : the chains of round corners.
    """
    corners = _Corners(lines, rounded)
    arcs = dict[int, ChainCurve]()
    for _ in range(ROUNDS):
        arcs = on(corners.arcs(), chains)
        wrong = {k for k, arc in arcs.items() if arc.off > within[k]}
        arcs = {k: arc for k, arc in arcs.items() if k not in wrong}
        if not wrong:
            break
        corners.round -= wrong
    at = {lines.place[k][0]: arc for k, arc in arcs.items()}
    return NetLines(lines.net, [_replaced(line, at[i]) if i in at else line for i, line in enumerate(lines.lines)])


def _replaced(line: ChainLine, arc: ChainCurve) -> ChainLine:
    """A line of one chain with the curve of this."""
    return replace(line, curve=arc if line.steps[0][1] else arc.reversed())


def _off(Q: Floats, curve: ChainCurve) -> float:
    """The largest distance of points (k, 6) from a curve, on either skin."""
    line = curve(DENSE)
    return max(float(cdist(Q[:, s : s + 3], line[:, s : s + 3]).min(axis=1).max()) for s in (0, 3))


def round_chains(net: ChainNet, chains: Mapping[int, SampledChain], within: Mapping[int, float]) -> set[int]:
    """The chains of outlines that have a bent vertex inside, or are chords of arcs that are within tolerances of them
    (millimetres, by chain)."""
    nodes = _nodes(net, ends_at(net))
    angles = dict(
        zip(nodes, _turns([(chains[before], chains[after]) for before, after in nodes.values()]), strict=True)
    )
    outlines = [k for k, chain in net.chains.items() if chain.right == VOID]
    bent = dict(zip(outlines, _bends([chains[k] for k in outlines]), strict=True))
    found = set[int]()
    for k in outlines:
        two, line = [angles.get(int(net.chains[k].points[i]), 0.0) for i in (0, -1)], chains[k]
        chord = min(two) > BENT and max(two) < CORNER and float(line.way[-1]) * sum(two) / 16 <= within[k]
        if chord or bent[k]:
            found.add(k)
    return found


def _nodes(net: ChainNet, ends: Mapping[int, list[tuple[int, int]]]) -> dict[int, tuple[int, int]]:
    """The nodes of outlines, each with the chain that ends there and the one that begins, if there is one of each."""
    return {node: two for node, some in ends.items() if (two := outline_through(net, some))}


class _Corners:
    """The outlines of a net; round : chains that are to be arcs."""

    def __init__(self, lines: NetLines, rounded: Collection[int]) -> None:
        self.lines, self.net = lines, lines.net
        self.ends = ends_at(self.net)
        self.nodes = _nodes(self.net, self.ends)
        self.curves = {k: lines.curve(k) for k, chain in self.net.chains.items() if chain.right == VOID}
        self.round = {k for k in rounded if len(lines.lines[lines.place[k][0]].steps) == 1}
        self.known = dict[tuple[int, bool, bool], Floats | None]()
        self.made = dict[int, tuple[Floats | None, Floats | None, ChainCurve | None]]()

    def arcs(self) -> dict[int, ChainCurve]:
        """The chains of round corners as arcs; where an outline has no direction at a node, a chain keeps its own."""
        found = dict[int, ChainCurve]()
        for k in sorted(self.round):
            arc = self._arc(k, *(self._known_way(int(self.net.chains[k].points[i])) for i in (0, -1)))
            if arc is not None:
                found[k] = arc
        return found

    def _arc(self, k: int, start: Floats | None, end: Floats | None) -> ChainCurve | None:
        """A chain as an arc with directions (6,) at its ends, made once for these."""
        if start is None and end is None:
            return None
        if k not in self.made or self.made[k][0] is not start or self.made[k][1] is not end:
            P, Q = self.curves[k].spans[[0, -1]]
            one = _scaled(P[1] - P[0]) if start is None else start
            two = _scaled(Q[3] - Q[2]) if end is None else end
            self.made[k] = start, end, _arc(P[0], Q[3], one, two)
        return self.made[k][2]

    def _chord(self, k: int) -> tuple[Floats, Floats]:
        """(6,) twice: where a chain begins and ends."""
        spans = self.curves[k].spans
        return spans[0, 0], spans[-1, -1]

    def _known_way(self, node: int) -> Floats | None:
        """(6,) the direction of an outline at a node, found once for each way in which its chains are round; None where
        it has a corner there, or a seam in its direction."""
        if node not in self.nodes:
            return None
        before, after = self.nodes[node]
        kind = node, before in self.round, after in self.round
        if kind not in self.known:
            self.known[kind] = self._way(node, before, after)
        return self.known[kind]

    def _way(self, node: int, before: int, after: int) -> Floats | None:
        one, two = self._end_ways(before, after)
        if _middle(one) @ _middle(two) < np.cos(CORNER):
            return None
        way = two if before in self.round else one
        if before in self.round and after in self.round:
            way = self._on_circle(before, after)
        seams = [(k, end) for k, end in self.ends[node] if self.net.chains[k].right != VOID]
        steep = all(abs(_middle(way) @ self._seam_way(seam, end)) < FLATTEST for seam, end in seams)
        return way if steep else None

    def _end_ways(self, before: int, after: int) -> tuple[Floats, Floats]:
        """(6,) twice: the directions of two chains where the second begins."""
        P, Q = self.curves[before].spans[-1], self.curves[after].spans[0]
        return _scaled(P[3] - P[2]), _scaled(Q[1] - Q[0])

    def _on_circle(self, before: int, after: int) -> Floats:
        """(6,) of the circle through the ends of two chains in a row, where they meet."""
        (a, b), (_, c) = self._chord(before), self._chord(after)
        one, two = (float(np.linalg.norm(_middle(way))) for way in (b - a, c - b))
        return _scaled((b - a) * two / one + (c - b) * one / two)

    def _seam_way(self, k: int, end: int) -> Floats:
        """(3,) the direction of a chain at an end."""
        P = self.lines.curve(k).spans[end]
        return _unit(_middle(P[1] - P[0]) if end == 0 else _middle(P[2] - P[3]))


def _turns(pairs: Sequence[tuple[SampledChain, SampledChain]]) -> list[float]:
    """Radians that an outline turns, seen along the sheet's normal, from a chain's end to another's beginning."""
    if not pairs:
        return []
    Q = np.array([[before.Q[-2], before.Q[-1], after.Q[0], after.Q[1]] for before, after in pairs])
    middle, across = (Q[..., :3] + Q[..., 3:]) / 2, Q[:, 2, :3] - Q[:, 2, 3:]
    cosines = turns(middle[:, 1] - middle[:, 0], middle[:, 3] - middle[:, 2], across)
    return [float(x) for x in np.arccos(np.clip(cosines, -1, 1))]


def _bends(chains: Sequence[SampledChain]) -> list[bool]:
    """Whether chains have a vertex inside at which they turn as round corners do, seen along the sheet's normal."""
    parts = [chain.Q[::BETWEEN] for chain in chains]
    if not parts:
        return []
    Q, of = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    way = np.diff((Q[:, :3] + Q[:, 3:]) / 2, axis=0)
    inside = np.flatnonzero(of[2:] == of[:-2])  # and the vertex before it, and the one after it
    cosines = turns(way[inside], way[inside + 1], (Q[:, :3] - Q[:, 3:])[inside + 1])
    bent = set(of[inside[cosines < np.cos(BENT)]].tolist())
    return [i in bent for i in range(len(parts))]


def _arc(start: Floats, end: Floats, one: Floats, two: Floats) -> ChainCurve | None:
    """From a point (6,) to another, with directions (6,) there; None where it would turn too far.

    Handles are those of the cubic nearest to a circle with so long a chord and such a turn, chord / (3 cos^2(turn/4)).
    """
    chord, ways = _middle(end - start), (_middle(one), _middle(two))
    long = float(np.linalg.norm(chord))
    if min(float(way @ chord) for way in ways) < WIDEST * long:
        return None
    turn = float(np.arccos(np.clip(ways[0] @ ways[1], -1, 1)))
    handle = long / (3 * np.cos(turn / 4) ** 2)
    poles = np.stack([start, start + handle * one, end - handle * two, end])
    return ChainCurve(np.array([0.0, 1.0]), poles[None])


def _middle(way: Floats) -> Floats:
    """(3,) of both skins."""
    return np.asarray((way[:3] + way[3:]) / 2)


def _scaled(way: Floats) -> Floats:
    """(6,) with a middle 1 mm long."""
    return np.asarray(way / np.linalg.norm(_middle(way)))


def _unit(way: Floats) -> Floats:
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-300))
