"""Which regions have four sides, and how many spans the chains on these need for opposite sides to have equally many.

A side is one chain or several; where they meet, a third chain ends on the side. Each span becomes the side of one
untrimmed patch.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints, cross
from dsfab.export.network.curves import ChainCurve, SampledChain
from dsfab.export.network.graph import ChainNet, Loop

STRAIGHT = 30.0
"""Degrees off 180 within which a node is on a side, not at a corner."""

BLUNT = 60.0
"""Degrees off 180 within which it may be on a side where a region has more than four corners."""

REACH = 3 / 4
"""Of the thickness along a chain, at most, at which its direction is read."""

MOST_ADDED = 6
"""Breaks that are added to each chain at most until opposite sides agree: around some singularities they never do."""

DECIMALS = 12
"""Of breaks that are the same."""

APART = 2e-3
"""Share of a chain that breaks are apart which are added for those of an opposite side."""

CLOSE = 1e-6
"""Share of a chain within which two breaks are one."""


@dataclass(frozen=True, eq=False)
class Quad:
    """A region with four sides in order, each of chains with whether they are run through forwards, it on the left."""

    region: int
    sides: tuple[Loop, Loop, Loop, Loop]


@dataclass(frozen=True, eq=False)
class QuadNet:
    """quads : regions with four sides, opposite ones with equally many spans.    others : the other regions.
    curves : of all chains, by number."""

    quads: list[Quad]
    others: list[int]
    curves: dict[int, ChainCurve]


def quad_net(
    net: ChainNet, chains: Mapping[int, SampledChain], curves: Mapping[int, ChainCurve], reach: float
) -> QuadNet:
    """The quads of a net whose chains have curves; directions are read within `reach`, millimetres."""
    quads, others = list[Quad](), list[int]()
    for region, loops in net.loops.items():
        quad = _quad(region, loops, chains, reach)
        if quad:
            quads.append(quad)
        else:
            others.append(region)
    work = _Matching(quads, chains, _shared_breaks(quads, curves))
    odd = work.odd()
    return QuadNet([q for q in quads if q.region not in odd], [*others, *odd], work.curves)


def _quad(region: int, loops: list[Loop], chains: Mapping[int, SampledChain], reach: float) -> Quad | None:
    if len(loops) != 1 or len(loops[0]) < 4:
        return None
    loop = loops[0]
    angle = _angles(loop, chains, reach)
    corners = _corners(angle)
    if corners is None:
        return None
    stops = [*corners.tolist(), int(corners[0]) + len(loop)]
    one, two, three, four = ([loop[i % len(loop)] for i in range(a, b)] for a, b in pairwise(stops))
    return Quad(region, (one, two, three, four))


def _corners(angle: Floats) -> Ints | None:
    """The four places among interior angles (k,), degrees, where sides begin, or None."""
    off = 180 - angle
    corners = np.flatnonzero(np.abs(off) > STRAIGHT)
    if len(corners) > 4:
        corners = np.sort(np.argsort(-off, kind="stable")[:4])
        rest = np.setdiff1d(np.arange(len(angle)), corners)
        if (np.abs(off[rest]) > BLUNT).any():
            return None
    if len(corners) < 4:
        more = [i for i in np.argsort(-off, kind="stable").tolist() if i not in corners and off[i] > STRAIGHT / 3]
        corners = np.sort(np.concatenate([corners, more[: 4 - len(corners)]]).astype(np.int64))
    return corners if len(corners) == 4 and (off[corners] > 0).all() else None


def _angles(loop: Loop, chains: Mapping[int, SampledChain], reach: float) -> Floats:
    """(k,) interior angles in degrees where each chain of a loop begins."""
    ahead = [chains[k].direction(way, reach) for k, way in loop]
    behind = [chains[k].direction(not way, reach) for k, way in [loop[-1], *loop[:-1]]]
    out, normal, back = (np.stack(rows) for rows in (*zip(*ahead, strict=True), [way for way, _ in behind]))
    sine = np.einsum("ki,ki->k", cross(out, back), normal)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ki,ki->k", out, back))) % 360)


def _shared_breaks(quads: list[Quad], curves: Mapping[int, ChainCurve]) -> dict[int, ChainCurve]:
    """The curves with their breaks at the same shares as those of the chains opposite to them, where both sides have as
    many; and as those opposite to these."""
    links: dict[int, list[tuple[int, bool]]] = {}
    for quad in quads:
        for one, two in ((0, 2), (1, 3)):
            if len(quad.sides[one]) == len(quad.sides[two]):
                for (k, ahead), (j, back) in zip(quad.sides[one], quad.sides[two][::-1], strict=True):
                    links.setdefault(k, []).append((j, ahead == back))
                    links.setdefault(j, []).append((k, ahead == back))
    found, known = dict(curves), set[int]()
    for first in links:
        if first in known:
            continue
        turned, todo = {first: False}, [first]
        while todo:
            k = todo.pop()
            for j, other_way in links[k]:
                if j not in turned:
                    turned[j] = turned[k] != other_way
                    todo.append(j)
        known |= turned.keys()
        breaks = np.unique(
            np.concatenate([np.abs(turned[k] - np.round(curves[k].breaks, DECIMALS)) for k in turned]).round(DECIMALS)
        )
        for k, back in turned.items():
            for x in np.abs(back - breaks):
                if np.abs(found[k].breaks - x).min() > CLOSE:
                    found[k] = found[k].with_break(float(x))
    return found


class _Matching:
    """Breaks added until opposite sides of all quads have equally many spans."""

    def __init__(self, quads: list[Quad], chains: Mapping[int, SampledChain], curves: dict[int, ChainCurve]) -> None:
        self.quads, self.chains, self.curves = quads, chains, curves
        self.of: dict[int, list[Quad]] = {}
        for quad in quads:
            for side in quad.sides:
                for k, _ in side:
                    self.of.setdefault(k, []).append(quad)

    def _counts(self, quad: Quad) -> list[int]:
        return [sum(len(self.curves[k].spans) for k, _ in side) for side in quad.sides]

    def odd(self) -> set[int]:
        """The regions where that would take too many."""
        added, found, todo = dict.fromkeys(self.chains, 0), set[int](), list(self.quads)
        while todo:
            quad = todo.pop()
            for one, two in ((0, 2), (1, 3)):
                counts = self._counts(quad)
                fewer, more = (quad.sides[k] for k in ((one, two) if counts[one] < counts[two] else (two, one)))
                for _ in range(abs(counts[one] - counts[two])):
                    if quad.region in found or sum(added[k] for k, _ in fewer) >= MOST_ADDED * len(fewer):
                        found.add(quad.region)
                        break
                    k = self._add(fewer, more)
                    added[k] += 1
                    todo += [other for other in self.of[k] if other is not quad]
        return found

    def _add(self, side: Loop, other: Loop) -> int:
        """A break on a side, as far along as the break of the opposite one that is farthest from any; returns its
        chain."""
        mine, there = self._shares(side), 1 - self._shares(other)
        away = np.abs(there[:, None] - mine).min(axis=1)
        share = float(there[away.argmax()])
        ends = np.cumsum([self.chains[k].way[-1] for k, _ in side])
        i = min(int(np.searchsorted(ends, share * ends[-1], side="right")), len(side) - 1)
        k, ahead = side[i]
        x = 1 - (ends[i] - share * ends[-1]) / self.chains[k].way[-1]
        x = x if ahead else 1 - x
        if (np.abs(self.curves[k].breaks - x) < APART).any() or not 0 < x < 1:
            return self._halve(side)
        self.curves[k] = self.curves[k].with_break(float(x))
        return k

    def _shares(self, side: Loop) -> Floats:
        """Where the spans of a side end, as shares of its length, 0 and 1 among them."""
        parts = [np.zeros(1)]
        for k, ahead in side:
            breaks = self.curves[k].breaks
            parts.append(parts[-1][-1] + self.chains[k].way[-1] * (breaks[1:] if ahead else 1 - breaks[-2::-1]))
        found = np.concatenate(parts)
        return np.asarray(found / found[-1])

    def _halve(self, side: Loop) -> int:
        """A break in the middle of the longest span of a side; returns its chain."""
        longest = {k: float(np.diff(self.curves[k].breaks).max() * self.chains[k].way[-1]) for k, _ in side}
        k = max(longest, key=lambda k: longest[k])
        breaks = self.curves[k].breaks
        i = int(np.diff(breaks).argmax())
        self.curves[k] = self.curves[k].with_break(float(breaks[i] + breaks[i + 1]) / 2)
        return k
