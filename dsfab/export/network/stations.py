"""Where opposite sides of a region are divided: its patches are between two stations of one side and two of the other.

0    A         B   1      A patch is one polynomial along its side: there is a station where a line begins, and where
o----+---------+---o      the cubics of one meet, a break. A station of one side has one on the other, a break near
|    :         :   |      by, or a point of the line there. Nothing is asked of regions beyond: to a patch of theirs
o----a---------b---o      such a point is where two of its edges meet.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.curves import SampledChain
from dsfab.export.network.graph import Loop
from dsfab.export.network.lines import NetLines, Part
from dsfab.export.network.quads import Quad

NEAR = 0.1
"""Share of a side by which stations on opposite sides differ at most."""

SNAP = 0.15
"""Share of what is between two stations within which one between them moves to where a line is divided already."""


@dataclass(frozen=True, eq=False)
class QuadSide:
    """parts : of lines in a row.    at : (k + 1,) shares of its length where these end."""

    parts: list[Part]
    at: Floats

    def turned(self) -> "QuadSide":
        """Run through the other way."""
        return QuadSide([(i, b, a) for i, a, b in self.parts[::-1]], 1 - self.at[::-1])


Grid = tuple[list[Part], list[Part], list[Part], list[Part]]
"""Bottom, right, top and left of a region between its stations, opposite ones run through the same way."""


class Stations:
    """The stations of regions; stops : of each line all parameters where it is divided, not in order."""

    def __init__(self, lines: NetLines, chains: Mapping[int, SampledChain]) -> None:
        self.lines, self.chains = lines, chains
        self.stops = [{*line.at.tolist(), *line.curve.breaks.tolist()} for line in lines.lines]

    def cells(self, quad: Quad) -> int:
        """How many patches a region has between its stations."""
        bottom, right, top, left = (self._side(steps) for steps in quad.sides)
        pairs = (bottom, top.turned()), (left.turned(), right)
        along, up = (1 + len(paired(*(np.array(list(self._breaks(side))) for side in two))[0]) for two in pairs)
        return along * up

    def grid(self, quad: Quad) -> Grid:
        """Of a region: its stations are made where they are not there."""
        bottom, right, top, left = (self._side(steps) for steps in quad.sides)
        below, above = self._divided(bottom, top.turned())
        before, after = self._divided(left.turned(), right)
        return below, after, above, before

    def _side(self, steps: Loop) -> QuadSide:
        parts, long = list[Part](), list[float]()
        for step in steps:
            i, a, b = self.lines.along(step)
            way = float(self.chains[step[0]].way[-1])
            if parts and parts[-1][0] == i and parts[-1][2] == a:
                parts[-1] = i, parts[-1][1], b
                long[-1] += way
            else:
                parts.append((i, a, b))
                long.append(way)
        at = np.concatenate([[0.0], np.cumsum(long)])
        return QuadSide(parts, at / at[-1])

    def _breaks(self, side: QuadSide) -> dict[float, tuple[int, float]]:
        """By shares of a side its breaks: a part that begins there, or has one inside, and the parameter."""
        found = dict[float, tuple[int, float]]()
        for p, (i, a, b) in enumerate(side.parts):
            if p:
                found[float(side.at[p])] = p, a
            for x in self.lines.lines[i].curve.breaks.tolist():
                if min(a, b) < x < max(a, b):
                    found[float(side.at[p] + (side.at[p + 1] - side.at[p]) * (x - a) / (b - a))] = p, x
        return dict(sorted(found.items()))

    def _divided(self, one: QuadSide, two: QuadSide) -> tuple[list[Part], list[Part]]:
        """Two opposite sides between as many stations."""
        mine, theirs = self._breaks(one), self._breaks(two)
        pairs = paired(np.array(list(mine)), np.array(list(theirs)))
        return self._between(one, mine, pairs[0]), self._between(two, theirs, pairs[1])

    def _between(self, side: QuadSide, breaks: Mapping[float, tuple[int, float]], shares: Floats) -> list[Part]:
        """The parts of a side between stations; those that are no breaks are new, or where it is divided already."""
        ends, found = np.concatenate([[0.0], shares, [1.0]]), list[Part]()
        p, x = 0, side.parts[0][1]
        for before, share, after in zip(ends, ends[1:-1].tolist(), ends[2:], strict=False):
            q, y = breaks.get(share) or self._new(side, share, float(before), float(after))
            found.append((side.parts[p][0], x, y if q == p else side.parts[p][2]))
            p, x = q, y
        found.append((side.parts[p][0], x, side.parts[p][2]))
        return found

    def _new(self, side: QuadSide, share: float, before: float, after: float) -> tuple[int, float]:
        """A station at a share of a side, between two others."""
        p = int(np.clip(np.searchsorted(side.at, share, side="right") - 1, 0, len(side.parts) - 1))
        i, a, b = side.parts[p]
        long = side.at[p + 1] - side.at[p]
        x = a + (b - a) * (share - side.at[p]) / long
        inside = [y for y in self.stops[i] if min(a, b) < y < max(a, b)]
        if inside:
            near = min(inside, key=lambda y: abs(y - x))
            if abs(near - x) * long < SNAP * abs(b - a) * min(share - before, after - share):
                return p, near
        self.stops[i].add(float(x))
        return p, float(x)


def paired(one: Floats, two: Floats) -> tuple[Floats, Floats]:
    """Shares (k,) of two opposite sides that belong together, of those that each has to have, both in ascending order.

    Two that are near are a pair, and so are all where both sides have as many that are not far from each other; each
    other one gets one as far along between its neighbours.
    """
    if len(one) == len(two) and (np.abs(one - two) < NEAR).all():
        return one, two
    pairs = [(0.0, 0.0), (1.0, 1.0)]
    if len(one) and len(two):
        away = np.abs(one[:, None] - two)
        pairs += [
            (float(one[i]), float(two[j]))
            for i, j in enumerate(away.argmin(axis=1))
            if away[i, j] < NEAR and away[:, j].argmin() == i
        ]
    pairs.sort()
    known = np.array(pairs).T
    pairs += [(float(x), float(np.interp(x, *known))) for x in one if x not in known[0]]
    pairs += [(float(np.interp(y, known[1], known[0])), float(y)) for y in two if y not in known[1]]
    found = np.array(sorted(pairs)[1:-1]).reshape(-1, 2)
    return found[:, 0], found[:, 1]
