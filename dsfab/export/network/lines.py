"""Chains in a row as one curve, where others end beside them: a region's side is then one curve, and one patch.

      |                    Seen from below, nothing happens where the third chain ends: both chains are parts of one
------T-------             line, a curve fitted to both. T lies on it, and the third chain is moved to end there.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_array, lil_array
from scipy.sparse.linalg import spsolve

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.network.curves import ChainCurve, parts_of
from dsfab.export.network.graph import VOID, ChainNet, Loop

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
