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
"""Part of a line: its number, and the parameters where the part begins and ends."""

End = tuple[int, int]
"""A chain, with 0 for its first point or -1 for its last."""


SHORTEST = 1 / 16
"""Least share of a line's parameters for the parts of a divided cubic. Ends of lines may lie outside of the box."""

OFF_MIDDLE = 1 / 4
"""Largest distance of a division from the middle of a cubic, as a share of it, if a chain ends there."""


@dataclass(frozen=True, eq=False)
class ChainLine:
    """Chains in a row as one curve. at : (k + 1,) parameters where its chains end."""

    steps: Loop
    curve: ChainCurve
    at: Floats

    def outlines(self, net: ChainNet) -> list[tuple[float, float]]:
        """Return pairs of parameters where VOID is on one side; the material is on the left from the first to the
        second."""
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
        """Divide its cubics until all poles lie in a box (2, 3), because CAD programs draw boxes around poles."""
        return self._divided(lambda a, b, P: _within(P, box))

    def halved(self, spans: Bools) -> "ChainLine":
        """Halve the cubics that `spans` (k,) marks."""
        ends = pairwise(self.curve.breaks.tolist())
        some = {both for both, is_one in zip(ends, spans.tolist(), strict=True) if is_one}
        return self._divided(lambda a, b, P: (float(a), float(b)) not in some)

    def _divided(self, whole: Callable[[float, float, Floats], bool]) -> "ChainLine":
        """Divide cubics until `may_stay` accepts them or they are short, each at its middle or at the end of a chain
        near it."""
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
    """Lines of a net. `place` maps each chain to its line and parameters. twins : pairs of lines on both sides of a
    seam."""

    def __init__(self, net: ChainNet, lines: list[ChainLine], twins: dict[int, int] | None = None) -> None:
        self.net, self.lines, self.twins = net, lines, twins or {}
        self.place = dict[int, Part]()
        for i, line in enumerate(lines):
            for (k, ahead), (a, b) in zip(line.steps, pairwise(line.at.tolist()), strict=True):
                self.place[k] = (i, a, b) if ahead else (i, b, a)

    def along(self, step: tuple[int, bool]) -> Part:
        """Line of a step of a loop, with the parameters from which to which the step runs."""
        i, a, b = self.place[step[0]]
        return (i, a, b) if step[1] else (i, b, a)

    def nodes(self, i: int) -> list[int]:
        """Nodes of a line in order."""
        steps = self.lines[i].steps
        return [
            *(node_of(self.net, (k, 0 if ahead else -1)) for k, ahead in steps),
            node_of(self.net, end_of(steps[-1])),
        ]

    def parts(self, some: Sequence[Part]) -> Floats:
        """(k, 4, 6) poles of parts of lines without a break inside, in their direction."""
        if not some:
            return np.zeros((0, 4, 6))
        i, a, b = (np.array(column) for column in zip(*some, strict=True))
        spans, line, first, last = self._spans
        span = np.searchsorted(first + 2 * line, (a + b) / 2 + 2 * i, side="right") - 1
        long = last[span] - first[span]
        return parts_of(spans[span], (a - first[span]) / long, (b - first[span]) / long)

    @cached_property
    def _spans(self) -> tuple[Floats, Ints, Floats, Floats]:
        curves = [line.curve for line in self.lines]
        line = np.repeat(np.arange(len(curves)), [len(curve.spans) for curve in curves])
        first, last = (np.concatenate([curve.breaks[some] for curve in curves]) for some in (np.s_[:-1], np.s_[1:]))
        return np.concatenate([curve.spans for curve in curves]), line, first, last

    def curve(self, k: int) -> ChainCurve:
        """Curve of a chain."""
        return self._curves[k]

    @cached_property
    def _curves(self) -> dict[int, ChainCurve]:
        """Curves of all chains, computed at once, because one by one they take three times as long."""
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
        """Curves of all chains around regions, by number."""
        around = {k for region in regions for loop in self.net.loops[region] for k, _ in loop}
        return {k: self.curve(k) for k in around}


def with_ends_on_lines(lines: NetLines) -> NetLines:
    """Move ends of lines onto the lines on which they end."""
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
    """Unite the curves on both sides of a seam: the outer poles of one are the inner poles of the other.

    Raises ExportError if the chains on both sides differ.
    """
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
    """Points (6,) of nodes inside lines.

    The ends of a line move nodes that lie on it, and these nodes may be ends of further lines: a linear system.
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
    """Nodes at the ends of a line."""
    (first, ahead), last = line.steps[0], line.steps[-1]
    return node_of(net, (first, 0 if ahead else -1)), node_of(net, end_of(last))


def node_of(net: ChainNet, end: End) -> int:
    """Node at an end of a chain."""
    return int(net.chains[end[0]].points[end[1]])


def end_of(step: tuple[int, bool]) -> End:
    """End of a chain where a step arrives."""
    return step[0], -1 if step[1] else 0


def _within(P: Floats, box: Floats) -> bool:
    points = P.reshape(8, 3)
    return bool((points >= box[0]).all() and (points <= box[1]).all())


CORNER = np.deg2rad(50.0)
"""Turn between two chains of an outline from which on there is a corner."""

BENT = np.deg2rad(10.0)
"""Turn at a vertex from which on an outline is round, see `regions.ROUND`."""

FLATTEST = np.cos(np.deg2rad(25.0))
"""Cosine of the least angle between an arc and a border that ends with it; patches in narrower wedges are folded."""

WIDEST = np.cos(np.deg2rad(80.0))
"""Cosine of the largest angle between an arc's chord and its direction at an end."""

DENSE = np.linspace(0, 1, 65)
"""Parameters where an arc is compared with its chords."""


class ArcsOnSkins:
    """Arcs on both skins with their distance from the chains, memoised by chain. away : vectors (k, 6) from points to
    the skins."""

    def __init__(self, away: Callable[[Floats], Floats]) -> None:
        self.away, self.known = away, dict[int, tuple[SampledChain, bytes, ChainCurve]]()

    def __call__(self, arcs: Mapping[int, ChainCurve], chains: Mapping[int, SampledChain]) -> dict[int, ChainCurve]:
        """Return the arcs on the skins, by chain."""
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
    """Replace lines of round corners by arcs within tolerances (mm, by chain). rounded : the chains of round
    corners."""
    rounds = 4  # an arc that becomes a wall may push others off their chords
    corners = _Corners(lines, rounded)
    arcs = dict[int, ChainCurve]()
    for _ in range(rounds):
        arcs = on(corners.arcs(), chains)
        wrong = {k for k, arc in arcs.items() if arc.off > within[k]}
        arcs = {k: arc for k, arc in arcs.items() if k not in wrong}
        if not wrong:
            break
        corners.round -= wrong
    at = {lines.place[k][0]: arc for k, arc in arcs.items()}
    return NetLines(lines.net, [_replaced(line, at[i]) if i in at else line for i, line in enumerate(lines.lines)])


def _replaced(line: ChainLine, arc: ChainCurve) -> ChainLine:
    return replace(line, curve=arc if line.steps[0][1] else arc.reversed())


def _off(Q: Floats, curve: ChainCurve) -> float:
    line = curve(DENSE)
    return max(float(cdist(Q[:, s : s + 3], line[:, s : s + 3]).min(axis=1).max()) for s in (0, 3))


def round_chains(net: ChainNet, chains: Mapping[int, SampledChain], within: Mapping[int, float]) -> set[int]:
    """Return outline chains with a bent vertex inside, and chords of arcs within tolerances (mm, by chain)."""
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
    """Nodes of outlines with exactly one chain that ends there and one that begins."""
    return {node: two for node, some in ends.items() if (two := outline_through(net, some))}


class _Corners:
    """Outlines of a net. round : chains that become arcs."""

    def __init__(self, lines: NetLines, rounded: Collection[int]) -> None:
        self.lines, self.net = lines, lines.net
        self.ends = ends_at(self.net)
        self.nodes = _nodes(self.net, self.ends)
        self.curves = {k: lines.curve(k) for k, chain in self.net.chains.items() if chain.right == VOID}
        self.round = {k for k in rounded if len(lines.lines[lines.place[k][0]].steps) == 1}
        self.known = dict[tuple[int, bool, bool], Floats | None]()
        self.made = dict[int, tuple[Floats | None, Floats | None, ChainCurve | None]]()

    def arcs(self) -> dict[int, ChainCurve]:
        """Return the chains of round corners as arcs; without a common direction at a node a chain keeps its own."""
        found = dict[int, ChainCurve]()
        for k in sorted(self.round):
            arc = self._arc(k, *(self._known_way(int(self.net.chains[k].points[i])) for i in (0, -1)))
            if arc is not None:
                found[k] = arc
        return found

    def _arc(self, k: int, start: Floats | None, end: Floats | None) -> ChainCurve | None:
        if start is None and end is None:
            return None
        if k not in self.made or self.made[k][0] is not start or self.made[k][1] is not end:
            P, Q = self.curves[k].spans[[0, -1]]
            one = _scaled(P[1] - P[0]) if start is None else start
            two = _scaled(Q[3] - Q[2]) if end is None else end
            self.made[k] = start, end, _arc(P[0], Q[3], one, two)
        return self.made[k][2]

    def _chord(self, k: int) -> tuple[Floats, Floats]:
        """(6,) twice: start and end of a chain."""
        spans = self.curves[k].spans
        return spans[0, 0], spans[-1, -1]

    def _known_way(self, node: int) -> Floats | None:
        """(6,) direction of an outline at a node, memoised; None at a corner, or where a border leaves in that
        direction."""
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
        """(6,) twice: directions of two chains where the second begins."""
        P, Q = self.curves[before].spans[-1], self.curves[after].spans[0]
        return _scaled(P[3] - P[2]), _scaled(Q[1] - Q[0])

    def _on_circle(self, before: int, after: int) -> Floats:
        """(6,) tangent where two consecutive chains meet, of the circle through their ends."""
        (a, b), (_, c) = self._chord(before), self._chord(after)
        one, two = (float(np.linalg.norm(_middle(way))) for way in (b - a, c - b))
        return _scaled((b - a) * two / one + (c - b) * one / two)

    def _seam_way(self, k: int, end: int) -> Floats:
        """(3,) direction of a chain at an end."""
        P = self.lines.curve(k).spans[end]
        return _unit(_middle(P[1] - P[0]) if end == 0 else _middle(P[2] - P[3]))


def _turns(pairs: Sequence[tuple[SampledChain, SampledChain]]) -> list[float]:
    """Angles in radians, seen along the sheet's normal, between the end of a chain and the beginning of another."""
    if not pairs:
        return []
    Q = np.array([[before.Q[-2], before.Q[-1], after.Q[0], after.Q[1]] for before, after in pairs])
    middle, across = (Q[..., :3] + Q[..., 3:]) / 2, Q[:, 2, :3] - Q[:, 2, 3:]
    cosines = turns(middle[:, 1] - middle[:, 0], middle[:, 3] - middle[:, 2], across)
    return [float(x) for x in np.arccos(np.clip(cosines, -1, 1))]


def _bends(chains: Sequence[SampledChain]) -> list[bool]:
    """Whether chains have a vertex inside that bends like a round corner, seen along the sheet's normal."""
    parts = [chain.Q[::BETWEEN] for chain in chains]
    if not parts:
        return []
    Q, of = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    way = np.diff((Q[:, :3] + Q[:, 3:]) / 2, axis=0)
    inside = np.flatnonzero(of[2:] == of[:-2])  # index of the vertex before each inner vertex
    cosines = turns(way[inside], way[inside + 1], (Q[:, :3] - Q[:, 3:])[inside + 1])
    bent = set(of[inside[cosines < np.cos(BENT)]].tolist())
    return [i in bent for i in range(len(parts))]


def _arc(start: Floats, end: Floats, one: Floats, two: Floats) -> ChainCurve | None:
    """Arc between two points (6,) with directions (6,); None if it would turn too far.

    Handles are those of the cubic nearest to a circle with this chord and turn: chord / (3 cos^2(turn/4)).
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
    """(3,) mean of both skins."""
    return np.asarray((way[:3] + way[3:]) / 2)


def _scaled(way: Floats) -> Floats:
    """(6,) scaled so that the mean of both skins has length 1 mm."""
    return np.asarray(way / np.linalg.norm(_middle(way)))


def _unit(way: Floats) -> Floats:
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-300))
