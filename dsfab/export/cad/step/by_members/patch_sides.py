"""Sides of four-sided regions: their corners, the chains that become one line, and divisions of opposite sides."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, cross
from dsfab.export.cad.step.by_members.curves import SampledChain, curves_through, on_skins, with_parabolas
from dsfab.export.cad.step.by_members.lines import (
    ArcsOnSkins,
    ChainLine,
    End,
    NetLines,
    Part,
    end_of,
    ends_of,
    node_of,
    round_chains,
    with_arcs,
    with_ends_on_lines,
    with_twins,
)
from dsfab.export.cad.step.by_members.regions import VOID, ChainNet, Loop, mean_width
from dsfab.export.cad.step.smooth.edges import FLAT, OF_LOOP
from dsfab.export.splines import bernstein

REACH = 3 / 4
"""Largest distance along a chain, over the thickness, at which its direction is measured."""


@dataclass(frozen=True, eq=False)
class Quad:
    """Region with four sides in order; each side is a row of chains with the region on the left."""

    region: int
    sides: tuple[Loop, Loop, Loop, Loop]


def quads_of(net: ChainNet, chains: Mapping[int, SampledChain], reach: float) -> tuple[list[Quad], list[int]]:
    """Separate regions with four sides from all others. reach : millimetres within which directions are measured."""
    quads, others = list[Quad](), list[int]()
    for region, loops in net.loops.items():
        quad = _quad(region, loops, chains, reach)
        if quad:
            quads.append(quad)
        else:
            others.append(region)
    return quads, others


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
    """Indices of the four corners among interior angles (k,) in degrees, or None."""
    blunt = 60.0  # the same for regions with more than four corners
    straight = 30.0  # degrees off 180 within which a node is no corner
    off = 180 - angle
    corners = np.flatnonzero(np.abs(off) > straight)
    if len(corners) > 4:
        corners = np.sort(np.argsort(-off, kind="stable")[:4])
        rest = np.setdiff1d(np.arange(len(angle)), corners)
        if (np.abs(off[rest]) > blunt).any():
            return None
    if len(corners) < 4:
        more = [i for i in np.argsort(-off, kind="stable").tolist() if i not in corners and off[i] > straight / 3]
        corners = np.sort(np.concatenate([corners, more[: 4 - len(corners)]]).astype(np.int64))
    return corners if len(corners) == 4 and (off[corners] > 0).all() else None


def _angles(loop: Loop, chains: Mapping[int, SampledChain], reach: float) -> Floats:
    """(k,) interior angles in degrees where each chain of a loop begins."""
    ahead = [chains[k].direction(way, reach) for k, way in loop]
    behind = [chains[k].direction(not way, reach) for k, way in [loop[-1], *loop[:-1]]]
    out, normal, back = (np.stack(rows) for rows in (*zip(*ahead, strict=True), [way for way, _ in behind]))
    sine = np.einsum("ki,ki->k", cross(out, back), normal)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ki,ki->k", out, back))) % 360)


@dataclass(frozen=True, eq=False)
class QuadSide:
    """parts : consecutive parts of lines.    at : (k + 1,) shares of the side's length where they end."""

    parts: list[Part]
    at: Floats

    def turned(self) -> "QuadSide":
        """Return the side in the opposite direction."""
        return QuadSide([(i, b, a) for i, a, b in self.parts[::-1]], 1 - self.at[::-1])


Grid = tuple[list[Part], list[Part], list[Part], list[Part]]
"""Bottom, right, top and left of a region between its stations; opposite sides run in the same direction."""


class Stations:
    """Stations: the points that divide opposite sides of regions alike. stops : divisions of each line."""

    def __init__(self, lines: NetLines, chains: Mapping[int, SampledChain]) -> None:
        self.lines, self.chains = lines, chains
        self.stops = [{*line.at.tolist(), *line.curve.breaks.tolist()} for line in lines.lines]

    def cells(self, quad: Quad) -> int:
        """Number of patches of a region between its stations."""
        bottom, right, top, left = (self._side(steps) for steps in quad.sides)
        pairs = (bottom, top.turned()), (left.turned(), right)
        along, up = (1 + len(paired(*(np.array(list(self._breaks(side))) for side in two))[0]) for two in pairs)
        return along * up

    def grid(self, quad: Quad) -> Grid:
        """Return the sides of a region between stations; adds stations if needed."""
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
        """Breaks of a side by share of its length: the part with the break, and the parameter."""
        found = dict[float, tuple[int, float]]()
        for p, (i, a, b) in enumerate(side.parts):
            if p:
                found[float(side.at[p])] = p, a
            for x in self.lines.lines[i].curve.breaks.tolist():
                if min(a, b) < x < max(a, b):
                    found[float(side.at[p] + (side.at[p + 1] - side.at[p]) * (x - a) / (b - a))] = p, x
        return dict(sorted(found.items()))

    def _divided(self, one: QuadSide, two: QuadSide) -> tuple[list[Part], list[Part]]:
        mine, theirs = self._breaks(one), self._breaks(two)
        pairs = paired(np.array(list(mine)), np.array(list(theirs)))
        return self._between(one, mine, pairs[0]), self._between(two, theirs, pairs[1])

    def _between(self, side: QuadSide, breaks: Mapping[float, tuple[int, float]], shares: Floats) -> list[Part]:
        """Parts of a side between stations. Stations without a break are new, or lie at an existing division."""
        ends, found = np.concatenate([[0.0], shares, [1.0]]), list[Part]()
        p, x = 0, side.parts[0][1]
        for before, share, after in zip(ends, ends[1:-1].tolist(), ends[2:], strict=False):
            q, y = breaks.get(share) or self._new(side, share, float(before), float(after))
            found.append((side.parts[p][0], x, y if q == p else side.parts[p][2]))
            p, x = q, y
        found.append((side.parts[p][0], x, side.parts[p][2]))
        return found

    def _new(self, side: QuadSide, share: float, before: float, after: float) -> tuple[int, float]:
        snap = 0.15  # share of the distance between two stations within which a new one moves to an existing division
        p = int(np.clip(np.searchsorted(side.at, share, side="right") - 1, 0, len(side.parts) - 1))
        i, a, b = side.parts[p]
        long = side.at[p + 1] - side.at[p]
        x = a + (b - a) * (share - side.at[p]) / long
        inside = [y for y in self.stops[i] if min(a, b) < y < max(a, b)]
        if inside:
            near = min(inside, key=lambda y: abs(y - x))
            if abs(near - x) * long < snap * abs(b - a) * min(share - before, after - share):
                return p, near
        self.stops[i].add(float(x))
        return p, float(x)


def paired(one: Floats, two: Floats) -> tuple[Floats, Floats]:
    """Return pairs of shares (k,) of two opposite sides, ascending, from the shares that each side needs.

    Near shares form a pair; so do all if both sides have as many and none differ by much. A share without a partner
    gets one by interpolation between its neighbours.
    """
    near = 0.1  # largest difference of paired stations, as a share of a side
    if len(one) == len(two) and (np.abs(one - two) < near).all():
        return one, two
    pairs = [(0.0, 0.0), (1.0, 1.0)]
    if len(one) and len(two):
        away = np.abs(one[:, None] - two)
        pairs += [
            (float(one[i]), float(two[j]))
            for i, j in enumerate(away.argmin(axis=1))
            if away[i, j] < near and away[:, j].argmin() == i
        ]
    pairs.sort()
    known = np.array(pairs).T
    pairs += [(float(x), float(np.interp(x, *known))) for x in one if x not in known[0]]
    pairs += [(float(np.interp(y, known[1], known[0])), float(y)) for y in two if y not in known[1]]
    found = np.array(sorted(pairs)[1:-1]).reshape(-1, 2)
    return found[:, 0], found[:, 1]


OF_CHORD = 1 / 8
"""Share of the mesh's chord error in the tolerance, a quarter of that for walls of smooth solids. Skins of a coarse
mesh wave, and curves are moved onto them later. With 1/2 a torus was 3.8 mm off where 3.4 are allowed."""

BETWEEN = np.linspace(0, 1, 9)[1:-1]
"""Parameters where the distance of a cubic from the skins is measured. Cubics shorter than the thickness are not
divided."""


class LineFits:
    """Fits of lines, memoised by chains with unchanged points.

    distance : largest distance of a solid from the mesh, mm.    box : (2, 3) for the poles, mm.
    skins    : (2, 3) box around the skins; a parabola's poles must lie in it.
    away     : vectors (k, 6) from points to both skins.    closely : divide cubics that stray from the skins.
    """

    def __init__(
        self, distance: float, box: Floats, skins: Floats, away: Callable[[Floats], Floats], closely: bool = False
    ) -> None:
        self.distance, self.box, self.skins, self.away, self.closely = distance, box, skins, away, closely
        self.within = dict[int, float]()
        self.known = dict[tuple[tuple[int, bool], ...], tuple[list[Ints], ChainLine]]()
        self.pulled, self.arcs = dict[int, tuple[ChainLine, ChainLine]](), ArcsOnSkins(away)

    def lines(self, net: ChainNet, chains: Mapping[int, SampledChain], quads: Iterable[Quad], reach: float) -> NetLines:
        """Fit the lines of a net, each with at most as many spans as its chains have alone."""
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
        # arcs come last: they bulge away from the material between an opening's sides
        return with_twins(with_arcs(fair, chains, arced, rounded, self.arcs))

    def _fits(self, net: ChainNet, chains: Mapping[int, SampledChain], rows: list[Loop]) -> list[ChainLine]:
        points = {tuple(row): [net.chains[k].points for k, _ in row] for row in rows}
        new = [row for row, now in points.items() if not _same(self.known.get(row), now)]
        samples = [_samples(row, chains) for row in new]
        curves = curves_through([Q for Q, _ in samples], [self._tolerance(row) for row in new])
        for row, (_, at), curve in zip(new, samples, curves, strict=True):
            self.known[row] = points[row], ChainLine(list(row), curve, at)
        return [self.known[row][1] for row in points]

    def _tolerance(self, row: Iterable[tuple[int, bool]]) -> float:
        return min(self.within[k] for k, _ in row)

    def _good(self, net: ChainNet, chains: Mapping[int, SampledChain], lines: list[ChainLine]) -> list[bool]:
        """Return whether each line is one chain, or close to its chains with fewer spans than they have alone."""
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
        apart = 0.1  # least distance of chain ends from breaks, as a share of a span
        nodes, breaks = line.at[1:-1], line.curve.breaks
        if not len(nodes) or line.curve.off > self._tolerance(line.steps) or len(set(ends_of(net, line))) == 1:
            return False
        return len(breaks) == 2 or bool(np.abs(breaks[:, None] - nodes).min() >= apart * np.diff(breaks).min())

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
        """Halve cubics that would leave the skins between the places where they are moved onto them.

        A mesh point was 1.5 mm off such a patch where 1.49 are allowed, with the skin 0.8 mm off that point.
        """
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
    """Tolerance of each chain, mm: a share of the allowed distance and of the chord error, less at narrow openings."""
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
    """(k, 6) points of consecutive chains, and shares of the length where they end."""
    parts = [chains[k].Q[:: 1 if ahead else -1] for k, ahead in row]
    long = [np.linalg.norm(np.diff(part, axis=0), axis=1).sum() for part in parts]
    at = np.concatenate([[0.0], np.cumsum(long)])
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]]), at / at[-1]


class _Turns:
    """Angle in degrees between the end of one chain and the continuation in another."""

    def __init__(self, chains: Mapping[int, SampledChain], reach: float) -> None:
        self.chains, self.reach = chains, reach

    def __call__(self, one: End, two: End) -> float:
        ways = [self.chains[k].direction(end == 0, self.reach)[0] for k, end in (one, two)]
        a, b = (way / np.linalg.norm(way) for way in ways)
        return float(np.degrees(np.arccos(np.clip(-a @ b, -1, 1))))


def _links(net: ChainNet, quads: Iterable[Quad], turn: _Turns, arcs: Collection[int]) -> dict[End, End]:
    """Pair chain ends that form one line: inside a side of a region, and along outlines that only continue.

    Arcs continue outlines, but not borders between members.
    """
    smooth = 10.0  # degrees that an outline may turn where two of its chains become one line
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
        if j is not None and j != k and (degrees := turn((k, -1), (j, 0))) < smooth:
            wanted.append((1, degrees, (k, -1), (j, 0)))
    found, used = dict[End, End](), set[int]()
    for _, _, one, two in sorted(wanted):
        node = node_of(net, one)
        if node not in used and one not in found and two not in found:
            found |= {one: two, two: one}
            used.add(node)
    return found


def _rows(chains: Iterable[int], links: Mapping[End, End]) -> list[Loop]:
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
    turns = [turn(end_of(a), end_of((k, not ahead))) for a, (k, ahead) in pairwise(row)]
    i = int(np.argmax(turns)) + 1
    return [row[:i], row[i:]]
