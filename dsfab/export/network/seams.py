r"""Borders between members that would end along a round corner: they end where they meet it steeply instead.

  W |              W |            A border that goes on where a wall ends leaves no room for a patch beside the arc:
    |                |            its end moves along the round corner, into the middle of the arc or to where the arc
----s- - -  ->   ----.   _s- -    begins or ends, where that is steeper. What it passes gets another region.
     \_               \_/ C
  C    \_               \_
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.arcs import BENT, CORNER
from dsfab.export.network.ends import outline_and_border, turn_at, with_moved_ends
from dsfab.export.network.graph import VOID, Chain, ChainNet, Loop, ends_at
from dsfab.export.network.lifting import Lifting

STEEP = 30.0
"""Degrees between a border and an outline from which on its end stays where it is."""

STEEPER = 15.0
"""Degrees that a place has to be steeper by, at least."""

SHARP = 20.0
"""Degrees that an outline turns by where a border is in the way, at least: so sharp an edge asks for a fillet. To move
all others made 5 % more faces of a dome."""

ENOUGH = 45.0
"""Degrees from which on a place is as good as a steeper one."""

LONGEST = 2.0
"""Length of a chord of a round corner, times the thickness, at most."""

ROUNDS = 3
"""How often ends are moved: chords of one corner may be several chains."""


def with_steep_ends(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """The net whose borders end on round corners steeply; thickness in millimetres."""
    for _ in range(ROUNDS):
        work = _Ends(net, np.asarray(net.weights @ lifting.skins.points), thickness)
        for node in sorted(work.nodes):
            work.take(node)
        if not work.moves:
            break
        net = with_moved_ends(replace(net, chains=work.chains, loops=work.loops), work.moves, lifting)
    return net


class _Ends:
    """nodes : with the chains of the outline before and after each, and a border's end there."""

    def __init__(self, net: ChainNet, P: Floats, thickness: float) -> None:
        self.P, self.t = P, thickness
        self.chains, self.free = dict(net.chains), max(net.chains, default=-1) + 1
        self.loops = {region: [list(loop) for loop in loops] for region, loops in net.loops.items()}
        at = ends_at(net)
        self.degree = {node: len(ends) for node, ends in at.items()}
        self.nodes = {node: three for node, ends in at.items() if (three := outline_and_border(net, ends))}
        self.moves, self.changed = dict[tuple[int, int], int](), set[int]()

    def take(self, node: int) -> None:
        """Move the end of the border at a node, if there is a steeper place."""
        before, after, (seam, end) = self.nodes[node]
        if self.changed & {before, after, seam} or turn_at(self._beside(before, after)) < SHARP:
            return
        line = self.chains[seam].points if end == 0 else self.chains[seam].points[::-1]
        anchor = self._anchor(line)
        now = self._angle_at(before, after, anchor)
        if now >= STEEP:
            return
        places = [(self._steepness(k, i, anchor), k, i) for k in (before, after) for i in self._places(k, node)]
        best, k, i = max(places, key=self._worth, default=(0.0, -1, 0))
        if best < now + STEEPER or not self._moved(k, i, node, (seam, end)):
            return
        self.changed |= {before, after, seam}

    def _worth(self, place: tuple[float, int, int]) -> tuple[float, bool, float]:
        """Of a place, degrees at a point of a chain: an arc's own end is as good as any, and leaves the arc whole."""
        steep, k, i = place
        return min(steep, ENOUGH), i in (0, len(self.chains[k].points) - 1), steep

    def _anchor(self, line: Ints) -> Floats:
        """(3,) the point of a border as far from its end as the sheet is thick."""
        P = self.P[line]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(P, axis=0), axis=1))])
        return np.array([np.interp(min(self.t, way[-1]), way, column) for column in P.T])

    def _beside(self, before: int, after: int) -> Floats:
        """(3, 3) the points of an outline before, at and after a node."""
        one, two = self.chains[before].points, self.chains[after].points
        return self.P[[one[-2], two[0], two[1]]]

    def _angle_at(self, before: int, after: int, anchor: Floats) -> float:
        """Degrees between an outline where one chain goes on as another and a border with an anchor: a wall keeps its
        direction."""
        P = self._beside(before, after)
        weights = [1.0 - (self._is_round(j) and not self._is_round(k)) for j, k in ((before, after), (after, before))]
        return _angle(P, weights, anchor)

    def _is_round(self, k: int) -> bool:
        """Whether a chain is short, as chords of round corners are, or bends."""
        line = self.P[self.chains[k].points]
        return len(_bent(line)) > 0 or float(np.linalg.norm(line[-1] - line[0])) < LONGEST * self.t

    def _places(self, k: int, node: int) -> list[int]:
        """Points of a chain of a round corner where a border may end: bent ones inside, and its other end if free."""
        points = self.chains[k].points
        long = np.linalg.norm(np.diff(self.P[points], axis=0), axis=1)
        inside = _bent(self.P[points]).tolist()
        other = len(points) - 1 if points[0] == node else 0
        chords = np.concatenate([[0], inside, [len(points) - 1]]).astype(int)
        if max(long[a:b].sum() for a, b in pairwise(chords)) > LONGEST * self.t:
            return []
        return [*inside, other] if self._next(k, other) >= 0 else inside

    def _next(self, k: int, i: int) -> int:
        """The chain of the outline beyond an end of a chain where only these two meet, and it turns a little; or -1."""
        node = int(self.chains[k].points[i])
        if self.degree.get(node) != 2:
            return -1
        region = self.chains[k].left
        loop = next(loop for loop in self.loops[region] if (k, True) in loop)
        j = loop[(loop.index((k, True)) + (1 if i else -1)) % len(loop)][0]
        if len(loop) < 4 or j == k or self.chains[j].right != VOID or j in self.changed:
            return -1
        return j if BENT < np.deg2rad(turn_at(self._beside(k, j) if i else self._beside(j, k))) < CORNER else -1

    def _steepness(self, k: int, i: int, anchor: Floats) -> float:
        """Degrees between the outline and a border with an anchor that ends at a point of a chain."""
        points = self.chains[k].points
        if 0 < i < len(points) - 1:
            return _angle(self.P[points[i - 1 : i + 2]], [1.0, 1.0], anchor)
        j = self._next(k, i)
        return self._angle_at(k, j, anchor) if i else self._angle_at(j, k, anchor)

    def _moved(self, k: int, i: int, node: int, border: tuple[int, int]) -> bool:
        """Whether a border's end could be moved from a node to a point of a chain that ends there."""
        chain = self.chains[k]
        ahead = int(chain.points[0]) == node
        passed, rest = (chain.points[: i + 1], chain.points[i:]) if ahead else (chain.points[i:], chain.points[: i + 1])
        seam, end = border
        mine, other = self.chains[seam].left, self.chains[seam].right
        region = other if mine == chain.left else mine
        loop, theirs = self._loop(chain.left, k), self._loop(region, seam)
        if region == chain.left or not loop or not theirs:
            return False
        at = theirs.index(next(step for step in theirs if step[0] == seam))
        self.chains[self.free] = Chain(passed, region, VOID)
        theirs.insert(at if ahead else at + 1, (self.free, True))
        if len(rest) > 1:
            self.chains[k] = replace(chain, points=rest)
        else:
            loop.remove((k, True))
            del self.chains[k]
        self.moves[seam, end] = int(chain.points[i])
        self.changed.add(self.free)
        self.free += 1
        return True

    def _loop(self, region: int, k: int) -> Loop:
        """The loop of a region with a chain, if it runs through that once."""
        some = [loop for loop in self.loops[region] for step in loop if step[0] == k]
        return some[0] if len(some) == 1 else []


def _bent(line: Floats) -> Ints:
    """Which inner points of a line (k, 3) it turns at."""
    way = np.diff(line, axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    return 1 + np.flatnonzero(np.einsum("ki,ki->k", way[:-1], way[1:]) < np.cos(BENT))


def _angle(three: Floats, weights: list[float], anchor: Floats) -> float:
    """Degrees between the way from the middle one of three points to an anchor and the line through it whose direction
    is the mean of those on both sides."""
    ways = np.diff(three, axis=0)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    along, there = weights @ ways, anchor - three[1]
    cosine = abs(along @ there) / max(float(np.linalg.norm(along) * np.linalg.norm(there)), 1e-300)
    return float(np.degrees(np.arccos(min(1.0, cosine))))
