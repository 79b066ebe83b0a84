"""Which chains in a row become one line, and the curves of lines.

Chains on one side of a region are wanted to be one, and those of an outline that goes on straight: it has one wall
then. They are one where a curve with fewer spans than theirs is within the tolerance of both.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.arcs import ArcsOnSkins, round_chains, with_arcs
from dsfab.export.network.curves import SampledChain, curves_through, on_skins
from dsfab.export.network.graph import VOID, ChainNet, Loop
from dsfab.export.network.joining import mean_width
from dsfab.export.network.lines import (
    ChainLine,
    End,
    NetLines,
    end_of,
    ends_of,
    node_of,
    with_ends_on_lines,
    with_twins,
)
from dsfab.export.network.parabolas import with_parabolas
from dsfab.export.network.quads import Quad
from dsfab.export.smooth.edges import FLAT, OF_LOOP
from dsfab.export.splines import bernstein

APART = 0.1
"""Share of a span by which the ends of chains in a line are away from its breaks, at least."""

SMOOTH = 10.0
"""Degrees that an outline may turn where two of its chains are one line, if no region needs that."""

OF_CHORD = 1 / 8
"""Share of the mesh's own chord error that is added to the tolerance, a quarter of what walls of smooth solids get: the
skins of a coarse mesh wave, onto which curves are brought afterwards. With half, a torus was 3.8 mm off of 3.4."""

BETWEEN = np.linspace(0, 1, 9)[1:-1]
"""Shares of a cubic where it is asked how far it is off the skins; one shorter than the sheet is thick stays whole."""


class LineFits:
    """The lines of nets; those whose chains have the points that they had are not fitted anew.

    distance : that a solid may be off the mesh, millimetres.    box : (2, 3) where poles should be, millimetres.
    skins : (2, 3) around the skins; parabolas are only taken where their poles, farther out, are in there too.
    away : the ways (k, 6) to both skins from points near them.    closely : whether cubics that stray from these are
    divided.
    """

    def __init__(
        self, distance: float, box: Floats, skins: Floats, away: Callable[[Floats], Floats], closely: bool = False
    ) -> None:
        self.distance, self.box, self.skins, self.away, self.closely = distance, box, skins, away, closely
        self.within = dict[int, float]()
        self.known = dict[tuple[tuple[int, bool], ...], tuple[list[Ints], ChainLine]]()
        self.pulled, self.arcs = dict[int, tuple[ChainLine, ChainLine]](), ArcsOnSkins(away)

    def lines(self, net: ChainNet, chains: Mapping[int, SampledChain], quads: Iterable[Quad], reach: float) -> NetLines:
        """The lines of a net, each with as few spans as its chains have at most."""
        turns, self.within = _Turns(chains, reach), _tolerances(net, chains, self.distance)
        arced = {k: FLAT * self.distance + OF_CHORD * chain.chord for k, chain in chains.items()}
        rounded = round_chains(net, chains, arced)
        links = _links(net, quads, turns, rounded)
        todo, found = _rows(net.chains, links), list[ChainLine]()
        while todo:
            lines = self._fits(net, chains, todo)
            todo = []
            for line, good in zip(lines, self._good(net, chains, lines), strict=True):
                if good:
                    found.append(line)
                else:
                    todo += _halves(line.steps, turns)
        fair = with_ends_on_lines(NetLines(net, self._on_skins(found)))
        # arcs bulge away from what is between an opening's sides
        return with_twins(with_arcs(fair, chains, arced, rounded, self.arcs))

    def _fits(self, net: ChainNet, chains: Mapping[int, SampledChain], rows: list[Loop]) -> list[ChainLine]:
        """Lines through rows of chains."""
        points = {tuple(row): [net.chains[k].points for k, _ in row] for row in rows}
        new = [row for row, now in points.items() if not _same(self.known.get(row), now)]
        samples = [_samples(row, chains) for row in new]
        curves = curves_through([Q for Q, _ in samples], [self._tolerance(row) for row in new])
        for row, (_, at), curve in zip(new, samples, curves, strict=True):
            self.known[row] = points[row], ChainLine(list(row), curve, at)
        return [self.known[row][1] for row in points]

    def _tolerance(self, row: Iterable[tuple[int, bool]]) -> float:
        """Millimetres that a line of some chains may be off them."""
        return min(self.within[k] for k, _ in row)

    def _good(self, net: ChainNet, chains: Mapping[int, SampledChain], lines: list[ChainLine]) -> list[bool]:
        """Whether each is one chain, or near enough to all of its chains with fewer spans than these have alone."""
        maybe = [line for line in lines if len(line.curve.spans) > 1 and self._near(net, line)]
        alone = iter(self._fits(net, chains, [[step] for line in maybe for step in line.steps]))
        fewer = {
            id(line): len(line.curve.spans) < sum(len(next(alone).curve.spans) for _ in line.steps) for line in maybe
        }
        return [
            len(line.steps) == 1 or fewer.get(id(line), len(line.curve.spans) == 1 and self._near(net, line))
            for line in lines
        ]

    def _near(self, net: ChainNet, line: ChainLine) -> bool:
        """Whether a line of several chains is within the tolerance, and none of them ends close to a break of it."""
        nodes, breaks = line.at[1:-1], line.curve.breaks
        if not len(nodes) or line.curve.off > self._tolerance(line.steps) or len(set(ends_of(net, line))) == 1:
            return False
        return len(breaks) == 2 or bool(np.abs(breaks[:, None] - nodes).min() >= APART * np.diff(breaks).min())

    def _on_skins(self, lines: list[ChainLine]) -> list[ChainLine]:
        new = [line for line in lines if id(line) not in self.pulled]
        fine = [line.with_poles_in(self.box) for line in new]
        if self.closely:
            fine = self._halved(fine)
        curves = with_parabolas(on_skins([line.curve for line in fine], self.away), self.distance, self.skins)
        for line, one, curve in zip(new, fine, curves, strict=True):
            self.pulled[id(line)] = line, replace(one, curve=curve)
        return [self.pulled[id(line)][1] for line in lines]

    def _halved(self, lines: list[ChainLine]) -> list[ChainLine]:
        """The lines with those cubics in two that would leave the skins between the places where they are brought onto
        these: a mesh point was 1.5 mm off a patch of which 1.49 were allowed, and the skin .8 off that point."""
        curves = on_skins([line.curve for line in lines], self.away)
        if not curves:
            return lines
        spans = np.concatenate([curve.spans for curve in curves])
        off = self.away((bernstein(BETWEEN) @ spans).reshape(-1, 6)).reshape(len(spans), -1, 3)
        long = np.linalg.norm(spans[:, 3, :3] - spans[:, 0, :3], axis=1) > np.linalg.norm(
            spans[:, 0, :3] - spans[:, 0, 3:], axis=1
        )
        far = long & (np.linalg.norm(off, axis=2).max(axis=1) > FLAT * self.distance)
        each = np.split(far, np.cumsum([len(curve.spans) for curve in curves])[:-1])
        return [line.halved(some) if some.any() else line for line, some in zip(lines, each, strict=True)]


def _tolerances(net: ChainNet, chains: Mapping[int, SampledChain], distance: float) -> dict[int, float]:
    """By chain, millimetres that its curve may be off it: a share of the distance that is allowed and of what the mesh
    does not know of its outline, but so little of a narrow opening that its sides do not cross."""
    found = {k: FLAT * distance + OF_CHORD * chain.chord for k, chain in chains.items()}
    after = {int(chain.points[0]): k for k, chain in net.chains.items() if chain.right == VOID}
    while after:
        start, k = after.popitem()
        loop = [k]
        while (k := after.pop(int(net.chains[k].points[-1]), -1)) >= 0:
            loop.append(k)
        if int(net.chains[loop[-1]].points[-1]) != start:
            continue  # a node of two outlines
        width = mean_width(np.concatenate([chains[k].middle[:-1] for k in loop]))
        found |= {k: min(found[k], OF_LOOP * width) for k in loop}
    return found


def _same(known: tuple[list[Ints], ChainLine] | None, points: list[Ints]) -> bool:
    return known is not None and all(a is b for a, b in zip(known[0], points, strict=True))


def _samples(row: Iterable[tuple[int, bool]], chains: Mapping[int, SampledChain]) -> tuple[Floats, Floats]:
    """(k, 6) points of chains in a row, and the shares of its length where they end."""
    parts = [chains[k].Q[:: 1 if ahead else -1] for k, ahead in row]
    long = [np.linalg.norm(np.diff(part, axis=0), axis=1).sum() for part in parts]
    at = np.concatenate([[0.0], np.cumsum(long)])
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]]), at / at[-1]


class _Turns:
    """By how many degrees one is turned who goes from one end of a chain into another chain."""

    def __init__(self, chains: Mapping[int, SampledChain], reach: float) -> None:
        self.chains, self.reach = chains, reach

    def __call__(self, one: End, two: End) -> float:
        ways = [self.chains[k].direction(end == 0, self.reach)[0] for k, end in (one, two)]
        a, b = (way / np.linalg.norm(way) for way in ways)
        return float(np.degrees(np.arccos(np.clip(-a @ b, -1, 1))))


def _links(net: ChainNet, quads: Iterable[Quad], turn: _Turns, arcs: Collection[int]) -> dict[End, End]:
    """Ends of chains that are one line: between those on a side of a region, and where only the outline goes on.

    Those of arcs go on as an outline does, not as a border between members.
    """
    wanted = list[tuple[int, float, End, End]]()
    for quad in quads:
        for side in quad.sides:
            for before, after in pairwise(side):
                one, two = end_of(before), end_of((after[0], not after[1]))
                if before[0] in arcs or after[0] in arcs or net.on_seam(before[0]) or net.on_seam(after[0]):
                    continue
                wanted.append((0, turn(one, two), one, two))
    starts = {int(c.points[0]): k for k, c in net.chains.items() if c.right == VOID and not net.on_seam(k)}
    for k, chain in net.chains.items():
        j = starts.get(int(chain.points[-1])) if chain.right == VOID and not net.on_seam(k) else None
        if j is not None and j != k and (degrees := turn((k, -1), (j, 0))) < SMOOTH:
            wanted.append((1, degrees, (k, -1), (j, 0)))
    found, used = dict[End, End](), set[int]()
    for _, _, one, two in sorted(wanted):
        node = node_of(net, one)
        if node not in used and one not in found and two not in found:
            found |= {one: two, two: one}
            used.add(node)
    return found


def _rows(chains: Iterable[int], links: Mapping[End, End]) -> list[Loop]:
    """The chains in rows; each is in one."""
    found, known = list[Loop](), set[int]()
    for first in chains:
        if first in known:
            continue
        step = (first, True)
        while (before := links.get(end_of((step[0], not step[1])))) and before[0] != first:
            step = before[0], before[1] == -1
        row = [step]
        while (after := links.get(end_of(row[-1]))) and after[0] != row[0][0]:
            row.append((after[0], after[1] == 0))
        known |= {k for k, _ in row}
        found.append(row)
    return found


def _halves(row: Loop, turn: _Turns) -> list[Loop]:
    """A row divided where it turns most."""
    turns = [turn(end_of(a), end_of((k, not ahead))) for a, (k, ahead) in pairwise(row)]
    i = int(np.argmax(turns)) + 1
    return [row[:i], row[i:]]
