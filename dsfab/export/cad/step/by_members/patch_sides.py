"""Sides of four-sided regions."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, cross
from dsfab.export.cad.step.by_members.curves import SampledChain, curves_as_parabolas, curves_through, on_skins
from dsfab.export.cad.step.by_members.lines import (
    ArcsOnSkins,
    ChainEnd,
    ChainLine,
    LinePart,
    NetLines,
    end_of,
    ends_of,
    node_of,
    round_chains,
    with_arcs,
    with_ends_on_lines,
    with_twins,
)
from dsfab.export.cad.step.by_members.regions import VOID, ChainLoop, ChainNet, mean_width
from dsfab.export.cad.step.shared.skins import LOOP_SHARE, OUTLINE_SHARE
from dsfab.export.splines import bernstein, polyline_length

REACH_SHARE = 3 / 4  # length over which a chain's direction is measured, as a fraction of the thickness


@dataclass(frozen=True, eq=False)
class Quad:
    """Region with four sides, listed in order around the region. The region is on the left of each side."""

    region: int
    sides: tuple[ChainLoop, ChainLoop, ChainLoop, ChainLoop]


def quad_of(region: int, loops: list[ChainLoop], chains: Mapping[int, SampledChain], reach: float) -> Quad | None:
    """Divide a region's outline into four sides at its corners; return None without four clear corners.
    reach : length (mm) over which the direction at a corner is measured."""
    if len(loops) != 1 or len(loops[0]) < 4:
        return None
    loop = loops[0]
    corners = _corners(_angles(loop, chains, reach))
    if corners is None:
        return None
    stops = [*corners.tolist(), int(corners[0]) + len(loop)]
    side_1, side_2, side_3, side_4 = ([loop[i % len(loop)] for i in range(a, b)] for a, b in pairwise(stops))
    return Quad(region, (side_1, side_2, side_3, side_4))


def _corners(angle: Floats) -> Ints | None:
    blunt_limit = 60.0  # degrees; a region with a larger bend at a fifth node does not have four sides
    straight_limit = 30.0  # a node with a smaller bend (degrees) is not a corner
    deviation = 180 - angle
    corners = np.flatnonzero(np.abs(deviation) > straight_limit)
    if len(corners) > 4:
        corners = np.sort(np.argsort(-deviation, kind="stable")[:4])
        rest = np.setdiff1d(np.arange(len(angle)), corners)
        if (np.abs(deviation[rest]) > blunt_limit).any():
            return None
    if len(corners) < 4:
        ranked = np.argsort(-deviation, kind="stable").tolist()
        candidates = [i for i in ranked if i not in corners and deviation[i] > straight_limit / 3]
        corners = np.sort(np.concatenate([corners, candidates[: 4 - len(corners)]]).astype(np.int64))
    return corners if len(corners) == 4 and (deviation[corners] > 0).all() else None


def _angles(loop: ChainLoop, chains: Mapping[int, SampledChain], reach: float) -> Floats:
    ahead = [chains[k].direction(forwards, reach) for k, forwards in loop]
    behind = [chains[k].direction(not forwards, reach) for k, forwards in [loop[-1], *loop[:-1]]]
    out, normal, back = (np.stack(rows) for rows in (*zip(*ahead, strict=True), [forwards for forwards, _ in behind]))
    sine = np.einsum("ki,ki->k", cross(out, back), normal)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ki,ki->k", out, back))) % 360)


@dataclass(frozen=True, eq=False)
class QuadSide:
    """Side of a four-sided region: k parts of lines. at : (k + 1,) ends of the parts, as fractions of the side."""

    parts: list[LinePart]
    at: Floats

    def backwards(self) -> "QuadSide":
        return QuadSide([(i, b, a) for i, a, b in self.parts[::-1]], 1 - self.at[::-1])


SideGrid = tuple[list[LinePart], list[LinePart], list[LinePart], list[LinePart]]
"""Bottom, right, top and left side of a region, each divided into parts. Opposite sides run in the same direction."""


class SideStations:
    """Points ("stations") that divide the sides of regions into parts. stops : parameters of the stations by line."""

    def __init__(self, lines: NetLines, chains: Mapping[int, SampledChain]) -> None:
        self.lines, self.chains = lines, chains
        self.stops = [{*line.at.tolist(), *line.curve.breaks.tolist()} for line in lines.lines]

    def cells(self, quad: Quad) -> int:
        """Return the number of patches of the region `quad`."""
        bottom_side, right_side, top_side, left_side = (self._side(steps) for steps in quad.sides)
        pairs = (bottom_side, top_side.backwards()), (left_side.backwards(), right_side)
        along, up = (1 + len(paired_shares(*(np.array(list(self._breaks(side))) for side in two))[0]) for two in pairs)
        return along * up

    def grid(self, quad: Quad) -> SideGrid:
        """Return the sides of a region, divided at stations (dividing points). Add missing stations to `stops`."""
        bottom_side, right_side, top_side, left_side = (self._side(steps) for steps in quad.sides)
        below, above = self._divide_sides(bottom_side, top_side.backwards())
        before, after = self._divide_sides(left_side.backwards(), right_side)
        return below, after, above, before

    def _side(self, steps: ChainLoop) -> QuadSide:
        parts, long = list[LinePart](), list[float]()
        for step in steps:
            i, a, b = self.lines.line_part(step)
            length = float(self.chains[step[0]].lengths[-1])
            if parts and parts[-1][0] == i and parts[-1][2] == a:
                parts[-1] = i, parts[-1][1], b
                long[-1] += length
            else:
                parts.append((i, a, b))
                long.append(length)
        ends = np.concatenate([[0.0], np.cumsum(long)])
        return QuadSide(parts, ends / ends[-1])

    def _breaks(self, side: QuadSide) -> dict[float, tuple[int, float]]:
        by_share = dict[float, tuple[int, float]]()
        for p, (i, a, b) in enumerate(side.parts):
            if p:
                by_share[float(side.at[p])] = p, a
            for x in self.lines.lines[i].curve.breaks.tolist():
                if min(a, b) < x < max(a, b):
                    by_share[float(side.at[p] + (side.at[p + 1] - side.at[p]) * (x - a) / (b - a))] = p, x
        return dict(sorted(by_share.items()))

    def _divide_sides(self, first_side: QuadSide, second_side: QuadSide) -> tuple[list[LinePart], list[LinePart]]:
        first_breaks, second_breaks = self._breaks(first_side), self._breaks(second_side)
        pairs = paired_shares(np.array(list(first_breaks)), np.array(list(second_breaks)))
        first_parts = self._parts_between(first_side, first_breaks, pairs[0])
        return first_parts, self._parts_between(second_side, second_breaks, pairs[1])

    def _parts_between(self, side: QuadSide, breaks: Mapping[float, tuple[int, float]], cuts: Floats) -> list[LinePart]:
        ends, parts = np.concatenate([[0.0], cuts, [1.0]]), list[LinePart]()
        p, x = 0, side.parts[0][1]
        for before, share, after in zip(ends, ends[1:-1].tolist(), ends[2:], strict=False):
            q, y = breaks.get(share) or self._add_station(side, share, float(before), float(after))
            parts.append((side.parts[p][0], x, y if q == p else side.parts[p][2]))
            p, x = q, y
        parts.append((side.parts[p][0], x, side.parts[p][2]))
        return parts

    def _add_station(self, side: QuadSide, share: float, before: float, after: float) -> tuple[int, float]:
        snap_share = 0.15  # a cut moves to an existing dividing point within 0.15 x the distance to the next cut
        p = int(np.clip(np.searchsorted(side.at, share, side="right") - 1, 0, len(side.parts) - 1))
        i, a, b = side.parts[p]
        long = side.at[p + 1] - side.at[p]
        x = a + (b - a) * (share - side.at[p]) / long
        inside = [y for y in self.stops[i] if min(a, b) < y < max(a, b)]
        if inside:
            nearest = min(inside, key=lambda y: abs(y - x))
            if abs(nearest - x) * long < snap_share * abs(b - a) * min(share - before, after - share):
                return p, nearest
        self.stops[i].add(float(x))
        return p, float(x)


def paired_shares(first_shares: Floats, second_shares: Floats) -> tuple[Floats, Floats]:
    """Return k pairs of dividing points of two opposite sides, as ascending fractions (k,) of each side's length.
    first_shares, second_shares : old dividing points of each side, as fractions of the side's length."""
    tolerance = 0.1  # paired dividing points differ by less than this fraction of a side
    if len(first_shares) == len(second_shares) and (np.abs(first_shares - second_shares) < tolerance).all():
        return first_shares, second_shares
    pairs = [(0.0, 0.0), (1.0, 1.0)]
    if len(first_shares) and len(second_shares):
        away = np.abs(first_shares[:, None] - second_shares)
        pairs += [
            (float(first_shares[i]), float(second_shares[j]))
            for i, j in enumerate(away.argmin(axis=1))
            if away[i, j] < tolerance and away[:, j].argmin() == i
        ]
    pairs.sort()
    fixed = np.array(pairs).T
    pairs += [(float(x), float(np.interp(x, *fixed))) for x in first_shares if x not in fixed[0]]
    pairs += [(float(np.interp(y, fixed[1], fixed[0])), float(y)) for y in second_shares if y not in fixed[1]]
    shares = np.array(sorted(pairs)[1:-1]).reshape(-1, 2)
    return shares[:, 0], shares[:, 1]


CHORD_SHARE = 1 / 8
"""Fraction of the mesh's chord error that is added to the tolerance of curves. Larger fractions make tori inexact."""


class LineFits:
    """Fit of curves to chains of mesh edges.
    distance : allowed distance of the solid from the mesh, mm.    box : (2, 3) box that must contain all poles, mm.
    skins    : (2, 3) box around the two skins of the sheet, mm.
    away     : function of pairs of points (k, 6); returns the vectors (k, 6) to the skins, mm.
    closely  : True to halve long cubics that are too far from the skins."""

    def __init__(
        self, distance: float, box: Floats, skins: Floats, away: Callable[[Floats], Floats], closely: bool = False
    ) -> None:
        self.distance, self.box, self.skins, self.away, self.closely = distance, box, skins, away, closely
        self.within = dict[int, float]()
        self.known = dict[tuple[tuple[int, bool], ...], tuple[list[Ints], ChainLine]]()
        self.pulled, self.arcs = dict[int, tuple[ChainLine, ChainLine]](), ArcsOnSkins(away)

    def lines(self, net: ChainNet, chains: Mapping[int, SampledChain], quads: Iterable[Quad], reach: float) -> NetLines:
        """Fit a curve to each chain of mesh edges. reach : length (mm) over which a chain's direction is measured."""
        turns, self.within = partial(chain_turn, chains, reach), chain_tolerances(net, chains, self.distance)
        arced = {k: OUTLINE_SHARE * self.distance + CHORD_SHARE * chain.chord for k, chain in chains.items()}
        rounded = round_chains(net, chains, arced)
        todo, accepted = _rows(net.chains, line_links(net, quads, turns, rounded)), list[ChainLine]()
        while todo:
            lines = self._fits(net, chains, todo)
            todo = []
            for line, is_good in zip(lines, self._are_good(net, chains, lines), strict=True):
                if is_good:
                    accepted.append(line)
                else:
                    todo += _halves(line.steps, turns)
        fair = with_ends_on_lines(NetLines(net, self._on_skins(accepted)))
        # arcs come last, because they bulge from the chains and must not change the other lines
        return with_twins(with_arcs(fair, chains, arced, rounded, self.arcs))

    def _fits(self, net: ChainNet, chains: Mapping[int, SampledChain], rows: list[ChainLoop]) -> list[ChainLine]:
        points = {tuple(row): [net.chains[k].points for k, _ in row] for row in rows}
        cached = {row: self.known[row][0] for row in points if row in self.known}
        missing = [x for x, now in points.items() if list(map(id, cached.get(x, []))) != list(map(id, now))]
        samples = [_samples(row, chains) for row in missing]
        curves = curves_through([Q for Q, _ in samples], [self._tolerance(row) for row in missing])
        for row, (_, chain_ends), curve in zip(missing, samples, curves, strict=True):
            self.known[row] = points[row], ChainLine(list(row), curve, chain_ends)
        return [self.known[row][1] for row in points]

    def _tolerance(self, row: Iterable[tuple[int, bool]]) -> float:
        return min(self.within[k] for k, _ in row)

    def _are_good(self, net: ChainNet, chains: Mapping[int, SampledChain], lines: list[ChainLine]) -> list[bool]:
        maybe = [x for x in lines if len(x.curve.spans) > 1 and self._is_near(net, x)]
        runs = iter(self._fits(net, chains, [[step] for x in maybe for step in x.steps]))
        fewer = {id(x): len(x.curve.spans) < sum(len(next(runs).curve.spans) for _ in x.steps) for x in maybe}
        return [len(x.steps) == 1 or fewer.get(id(x), len(x.curve.spans) == 1 and self._is_near(net, x)) for x in lines]

    def _is_near(self, net: ChainNet, line: ChainLine) -> bool:
        least_distance = 0.1  # least distance between chain joints and ends of cubics / length of the shortest cubic
        nodes, breaks = line.at[1:-1], line.curve.breaks
        if not len(nodes) or line.curve.off > self._tolerance(line.steps) or len(set(ends_of(net, line))) == 1:
            return False
        return len(breaks) == 2 or bool(np.abs(breaks[:, None] - nodes).min() >= least_distance * np.diff(breaks).min())

    def _on_skins(self, lines: list[ChainLine]) -> list[ChainLine]:
        missing = [line for line in lines if id(line) not in self.pulled]
        fine = [line.with_poles_in(self.box) for line in missing]
        if self.closely:
            fine = self.halved_strays(fine)
        curves = curves_as_parabolas(on_skins([line.curve for line in fine], self.away), self.distance, self.skins)
        for line, fine_line, curve in zip(missing, fine, curves, strict=True):
            self.pulled[id(line)] = line, replace(fine_line, curve=curve)
        return [self.pulled[id(line)][1] for line in lines]

    def halved_strays(self, lines: list[ChainLine]) -> list[ChainLine]:
        """Halve the long cubics of lines that are too far from the skins."""
        curves = on_skins([line.curve for line in lines], self.away)
        if not curves:
            return lines
        poles = np.concatenate([curve.spans for curve in curves])
        samples = bernstein(np.linspace(0, 1, 9)[1:-1]) @ poles
        vectors = self.away(samples.reshape(-1, 6)).reshape(len(poles), -1, 3)
        chord, thick = (poles[:, 0, :3] - end for end in (poles[:, 3, :3], poles[:, 0, 3:]))
        is_long = np.linalg.norm(chord, axis=1) > np.linalg.norm(thick, axis=1)
        is_far = is_long & (np.linalg.norm(vectors, axis=2).max(axis=1) > OUTLINE_SHARE * self.distance)
        marks = np.split(is_far, np.cumsum([len(curve.spans) for curve in curves])[:-1])
        return [x.with_halved_spans(flags) if flags.any() else x for x, flags in zip(lines, marks, strict=True)]


def chain_tolerances(net: ChainNet, chains: Mapping[int, SampledChain], distance: float) -> dict[int, float]:
    """Return the largest distance (mm) of a fitted curve from each chain of mesh edges, by chain number."""
    tolerances = {k: OUTLINE_SHARE * distance + CHORD_SHARE * chain.chord for k, chain in chains.items()}
    after = {int(chain.points[0]): k for k, chain in net.chains.items() if chain.right == VOID}
    while after:
        start, k = after.popitem()
        loop = [k]
        while (k := after.pop(int(net.chains[k].points[-1]), -1)) >= 0:
            loop.append(k)
        if int(net.chains[loop[-1]].points[-1]) != start:
            continue  # two outlines share this node
        width = mean_width(np.concatenate([chains[k].middle[:-1] for k in loop]))
        tolerances |= {k: min(tolerances[k], LOOP_SHARE * width) for k in loop}
    return tolerances


def _samples(row: Iterable[tuple[int, bool]], chains: Mapping[int, SampledChain]) -> tuple[Floats, Floats]:
    parts = [chains[k].Q[:: 1 if ahead else -1] for k, ahead in row]
    ends = np.concatenate([[0.0], np.cumsum([polyline_length(part) for part in parts])])
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]]), ends / ends[-1]


Turn = Callable[[ChainEnd, ChainEnd], float]
"""Function that returns the bend (degrees) between the ends of two consecutive chains of mesh edges."""


def chain_turn(chains: Mapping[int, SampledChain], reach: float, first_end: ChainEnd, second_end: ChainEnd) -> float:
    """Return the bend (degrees) where two chains of mesh edges meet.
    reach : length (mm) over which a chain's direction is measured."""
    directions = [chains[k].direction(end == 0, reach)[0] for k, end in (first_end, second_end)]
    a, b = (direction / np.linalg.norm(direction) for direction in directions)
    return float(np.degrees(np.arccos(np.clip(-a @ b, -1, 1))))


def line_links(net: ChainNet, quads: Iterable[Quad], turn: Turn, arcs: Collection[int]) -> dict[ChainEnd, ChainEnd]:
    """Pair ends of consecutive chains of mesh edges that one curve can follow. arcs : chains at round corners."""
    smooth = 10.0  # degrees; one line follows two chains of an outline only if the bend between them is smaller
    candidates = list[tuple[int, float, ChainEnd, ChainEnd]]()
    for quad in quads:
        for side in quad.sides:
            for before, after in pairwise(side):
                first_end, second_end = end_of(before), end_of((after[0], not after[1]))
                if before[0] in arcs or after[0] in arcs or net.on_seam(before[0]) or net.on_seam(after[0]):
                    continue
                candidates.append((0, turn(first_end, second_end), first_end, second_end))
    starts = {int(c.points[0]): k for k, c in net.chains.items() if c.right == VOID and not net.on_seam(k)}
    for k, chain in net.chains.items():
        j = starts.get(int(chain.points[-1])) if chain.right == VOID and not net.on_seam(k) else None
        if j is not None and j != k and (degrees := turn((k, -1), (j, 0))) < smooth:
            candidates.append((1, degrees, (k, -1), (j, 0)))
    links, used = dict[ChainEnd, ChainEnd](), set[int]()
    for _, _, first_end, second_end in sorted(candidates):
        node = node_of(net, first_end)
        if node not in used and first_end not in links and second_end not in links:
            links |= {first_end: second_end, second_end: first_end}
            used.add(node)
    return links


def _rows(chains: Iterable[int], links: Mapping[ChainEnd, ChainEnd]) -> list[ChainLoop]:
    rows, seen = list[ChainLoop](), set[int]()
    for start in chains:
        if start in seen:
            continue
        step = (start, True)
        while (before := links.get(end_of((step[0], not step[1])))) and before[0] != start:
            step = before[0], before[1] == -1
        row = [step]
        while (after := links.get(end_of(row[-1]))) and after[0] != row[0][0]:
            row.append((after[0], after[1] == 0))
        seen |= {k for k, _ in row}
        rows.append(row)
    return rows


def _halves(row: ChainLoop, turn: Turn) -> list[ChainLoop]:
    turns = [turn(end_of(a), end_of((k, not ahead))) for a, (k, ahead) in pairwise(row)]
    i = int(np.argmax(turns)) + 1
    return [row[:i], row[i:]]
