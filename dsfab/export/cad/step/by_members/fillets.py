"""Fillets at round corners of openings: taken into the regions beside them, with borders moved to their ends."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainNet, Loop, ends_at, outline_through
from dsfab.export.cad.step.shared.lifting import Lifting


def with_moved_ends(net: ChainNet, moves: Mapping[tuple[int, int], int], lifting: Lifting) -> ChainNet:
    """Move ends of chains, (chain, 0 or -1), to other points; the points between move by a linear share."""
    P: Floats = np.asarray(net.weights @ lifting.skins.points)
    ends = {
        k: [moves.get((k, i), int(net.chains[k].points[i])) for i in (0, -1)]
        for k in dict.fromkeys(k for k, _ in moves)
    }
    if not ends:
        return net
    between = [_between(P, net.chains[k].points, both) for k, both in ends.items()]
    rows = lifting.weights_at(np.concatenate(between))
    chains, start = dict(net.chains), len(P)
    for (k, both), some in zip(ends.items(), between, strict=True):
        points = np.concatenate([both[:1], np.arange(start, start + len(some)), both[1:]])
        chains[k], start = replace(chains[k], points=points), start + len(some)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)


def _between(P: Floats, points: Ints, ends: list[int]) -> Floats:
    """(k, 3) points in mm along a chain with moved ends."""
    fewest = 5  # points of a chain with moved ends
    line = P[points]
    way = _way(line)
    start, end = P[ends[0]] - line[0], P[ends[1]] - line[-1]
    x = np.linspace(0, 1, max(len(points), fewest))
    at = np.stack([np.interp(x * way[-1], way, c) for c in line.T], axis=1)
    return np.asarray((at + (1 - x)[:, None] * start + x[:, None] * end)[1:-1])


def _way(line: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def without_short_walls(net: ChainNet, lifting: Lifting, most: float) -> ChainNet:
    """Remove walls shorter than `shortest` mm between the ends of two borders, which then end in one place.

    Such walls leave an arc's end at any angle: where members of four feet meet their rim, eight of twelve edges were
    such walls and took no fillet.
    """
    fewest_sides = 3  # a region keeps at least three sides
    P: Floats = np.asarray(net.weights @ lifting.skins.points)
    chains, moves, at = dict(net.chains), dict[tuple[int, int], int](), ends_at(net)
    loops = {region: [list(loop) for loop in some] for region, some in net.loops.items()}
    for k, chain in net.chains.items():
        if chain.right != VOID or _way(P[chain.points])[-1] >= most:
            continue
        before, after = (outline_and_border(net, at[int(chain.points[i])]) for i in (0, -1))
        mine = next(loop for loop in loops[chain.left] if (k, True) in loop)
        if not before or not after or len(mine) <= fewest_sides:
            continue
        three = ([net.chains[i].points[-2], *net.chains[j].points[:2]] for i, j in (before[:2], after[:2]))
        turned = [turn_at(P[points]) for points in three]
        first = turned[0] < turned[1]  # the straighter end gives way
        other, border = (before[0], before[2]) if first else (after[1], after[2])
        if other not in chains or chains[other].left == chain.left or border in moves:
            continue
        both = [chains[other].points, chain.points][:: 1 if first else -1]
        chains[other] = replace(chains[other], points=np.concatenate([both[0], both[1][1:]]))
        moves[border] = int(chain.points[-1 if first else 0])
        mine.remove((k, True))
        del chains[k]
    return with_moved_ends(replace(net, chains=chains, loops=loops), moves, lifting)


def outline_and_border(net: ChainNet, ends: list[tuple[int, int]]) -> tuple[int, int, tuple[int, int]] | None:
    """Return the outline's chains that end and begin at a node, and the end of its only border there; None
    otherwise."""
    outline, borders = outline_through(net, ends), [one for one in ends if net.chains[one[0]].right != VOID]
    return (*outline, borders[0]) if outline and len(borders) == 1 else None


def turn_at(three: Floats) -> float:
    """Turn in degrees at the middle of three points (3, 3)."""
    ways = np.diff(three, axis=0)
    long = max(float(np.prod(np.linalg.norm(ways, axis=1))), 1e-300)
    return float(np.degrees(np.arccos(np.clip(ways[0] @ ways[1] / long, -1, 1))))


def with_whole_arcs(net: ChainNet, arcs: Collection[int], lifting: Lifting) -> ChainNet:
    """Give crossings those parts of their round corners that lie in outlines of members.

    Such a part is a short chain beside an arc; no border ends between them, and the wall of the member continues it.
    """
    work = _Arcs(net, np.asarray(net.weights @ lifting.skins.points), frozenset(arcs))
    for arc in arcs:
        for way in (-1, 1):
            work.take(arc, way)
    return with_moved_ends(replace(net, chains=work.chains, loops=work.loops), work.moves, lifting)


class _Arcs:
    def __init__(self, net: ChainNet, P: Floats, arcs: frozenset[int]) -> None:
        self.P, self.chains, self.arcs = P, dict(net.chains), arcs
        self.loops = {region: [list(loop) for loop in loops] for region, loops in net.loops.items()}
        self.moves = dict[tuple[int, int], int]()
        ends = [int(chain.points[i]) for chain in net.chains.values() for i in (0, -1)]
        self.degree = np.bincount(ends, minlength=len(P))

    def take(self, arc: int, way: int) -> None:
        """Take the chain after an arc (way = 1) or before it (-1)."""
        chain = self.chains[arc]
        loop = self._loop(chain.left, (arc, True))
        border, ahead = loop[(loop.index((arc, True)) + way) % len(loop)]
        mine = self._loop(self._beyond((border, ahead)), (border, not ahead))
        if len(mine) < 4:
            return
        at, node = mine.index((border, not ahead)), -1 if way > 0 else 0
        rest, wall = (mine[(at + i * way) % len(mine)] for i in (1, 2))
        points = self.chains[rest[0]].points
        walls = self._beyond(rest) == VOID == self._beyond(wall)
        if (
            not walls
            or rest[0] in self.arcs
            or self.degree[points[node]] != 2
            or self._length(points) > self._length(chain.points)
        ):
            return
        both = [chain.points, points[1:]] if way > 0 else [points, chain.points[1:]]
        self.chains[arc] = replace(chain, points=np.concatenate(both))
        self.moves[border, 0 if ahead == (way > 0) else -1] = int(points[node])
        mine.remove(rest)
        del self.chains[rest[0]]

    def _loop(self, region: int, step: tuple[int, bool]) -> Loop:
        return next((loop for loop in self.loops.get(region, []) if step in loop), [])

    def _beyond(self, step: tuple[int, bool]) -> int:
        chain = self.chains[step[0]]
        return chain.right if step[1] else chain.left

    def _length(self, points: Ints) -> float:
        return float(_way(self.P[points])[-1])


def without_fillets(net: ChainNet, lifting: Lifting) -> ChainNet:
    """Take every fillet into the neighbouring regions; other loose regions stay."""
    work = _Fillets(net, lifting)
    for region in sorted(net.loose & net.loops.keys()):
        work.take(region)
    return with_whole_arcs(work.result(), work.arcs, lifting)


class _Fillets:
    def __init__(self, net: ChainNet, lifting: Lifting) -> None:
        self.net, self.lifting = net, lifting
        P: Floats = np.asarray(net.weights @ lifting.skins.points)
        self.P = np.concatenate([P, np.zeros((len(net.loose), 3))])
        self.count, self.free = len(P), len(net.chains)
        self.middles = list[tuple[int, int, float]]()
        self.chains, self.loops = dict(net.chains), {r: [list(x) for x in loops] for r, loops in net.loops.items()}
        self.loose = set(net.loose)
        self.place = dict[int, int]()
        self.moved = dict[tuple[int, int], int]()
        self.arcs = list[int]()
        self.at = dict[int, list[int]]()
        for k, chain in net.chains.items():
            for p in {int(chain.points[0]), int(chain.points[-1])}:
                self.at.setdefault(p, []).append(k)
        self.outline = {int(p) for c in net.chains.values() if c.right == VOID for p in (c.points[0], c.points[-1])}

    def take(self, region: int) -> None:
        flat_detour = 4.0  # the same where only two members are behind: fair walls hold part of the arc
        # Largest length along the members behind a fillet over its arc: 1.27 of a right angle, 1.65 of 60 degrees, 3 of
        # a square.
        detour = 2.2
        if len(self.loops[region]) != 1:
            return
        inner, arc = _inner_and_arc(self.loops[region][0], self._others(region))
        if not inner or not arc:
            return
        points = np.concatenate([self._points(step)[:-1] for step in arc] + [self._points(arc[-1])[-1:]])
        behind = [int(self._points(step)[-1]) for step in inner[:-1]]
        if any(p in self.place or p in self.outline for p in behind):
            return
        most = detour if len(inner) > 2 else flat_detour
        if sum(self._length(self._points(step)) for step in inner) > most * self._length(points):
            return
        others = [self._other(step) for step in inner]
        if self._to_crossing(region, inner, arc, others):
            return
        if len(inner) == 1 or len(set(others)) == 1:
            halves = [points]
        else:
            points, at = self._middle(points)
            halves = [points[at:], points[: at + 1]]
            self.place |= dict.fromkeys(behind, int(points[at]))
        self._hand_over(inner, others, halves)
        for k, _ in arc:
            del self.chains[k]
        del self.loops[region]
        self.loose.discard(region)

    def _to_crossing(self, region: int, inner: Loop, arc: Loop, others: list[int]) -> bool:
        crossing = self._crossing(inner, others)
        if crossing is None or crossing in self.loose:
            return False
        corners = ((0, self._points(inner[0])[[-1, 0]]), (-1, self._points(inner[-1])[[0, -1]]))
        moves = [
            (self._border(int(c), others[i], crossing), int(c), int(end))
            for i, (c, end) in corners
            if others[i] != crossing
        ]
        if any(border < 0 for border, _, _ in moves):
            return False
        own = [(k, not ahead) for (k, ahead), other in zip(inner, others, strict=True) if other == crossing]
        first = own[0] if own else self._leaving(moves[0][0], moves[0][1])
        loop = next((some for some in self.loops[crossing] if first in some), None)
        if loop is None:
            return False
        at = loop.index(first)
        points = np.concatenate([self._points(step)[:-1] for step in arc] + [self._points(arc[-1])[-1:]])
        self.chains[self.free] = Chain(points, crossing, VOID)
        loop[at : at + len(own)] = [(self.free, True)]
        self.arcs.append(self.free)
        self.free += 1
        self.moved |= {(border, c): end for border, c, end in moves}
        self._forget(region, inner, arc, others)
        return True

    def _forget(self, region: int, inner: Loop, arc: Loop, others: list[int]) -> None:
        for (k, ahead), other in zip(inner, others, strict=True):
            for loop in self.loops[other]:
                if (k, not ahead) in loop:
                    loop.remove((k, not ahead))
        for k, _ in [*inner, *arc]:
            del self.chains[k]
        del self.loops[region]
        self.loose.discard(region)

    def _crossing(self, inner: Loop, others: list[int]) -> int | None:
        """Return the region behind a fillet that borders on both members beside it, or is by far the smaller one."""
        smaller = 0.6  # the region with a border shorter than this share of the other's border is the crossing
        if len(inner) == 3 and len(set(others)) == 3:
            return others[1]
        if len(inner) != 2 or others[0] == others[1]:
            return None
        corner = int(self._points(inner[0])[-1])
        beside = [self.chains[k] for k in self._ending(corner) if k not in (inner[0][0], inner[1][0])]
        if len(beside) == 1:
            small, large = sorted(others, key=self._around)
            return small if self._around(small) < smaller * self._around(large) else None
        behind = [({c.left, c.right} - {other}) for c in beside for other in others if other in (c.left, c.right)]
        same = len(beside) == 2 and len(behind) == 2 and behind[0] == behind[1] and VOID not in behind[0]
        return behind[0].pop() if same else None

    def _around(self, region: int) -> float:
        return sum(self._length(self._points(step)) for loop in self.loops[region] for step in loop)

    def _border(self, corner: int, member: int, crossing: int) -> int:
        """Return the only chain between two regions that ends at a corner, or -1."""
        some = [
            k
            for k in self._ending(corner)
            if {self.chains[k].left, self.chains[k].right} == {member, crossing} and (k, corner) not in self.moved
        ]
        return some[0] if len(some) == 1 else -1

    def _ending(self, point: int) -> list[int]:
        return [k for k in self.at.get(point, []) if k in self.chains]

    def _leaving(self, k: int, point: int) -> tuple[int, bool]:
        return k, int(self.chains[k].points[0]) == point

    def _hand_over(self, inner: Loop, others: list[int], halves: list[Ints]) -> None:
        """Give the parts of an arc, the last one first, to the first and the last region behind it."""
        for i, ((k, ahead), other) in enumerate(zip(inner, others, strict=True)):
            new: Loop = []
            half = halves[0] if i == 0 else halves[-1] if i == len(inner) - 1 and len(halves) > 1 else None
            if half is not None:
                self.chains[self.free] = Chain(half, other, VOID)
                new = [(self.free, True)]
                self.free += 1
            for loop in self.loops[other]:
                if (k, not ahead) in loop:
                    at = loop.index((k, not ahead))
                    loop[at : at + 1] = new
            del self.chains[k]

    def _others(self, region: int) -> list[int]:
        return [self._other(step) for step in self.loops[region][0]]

    def _other(self, step: tuple[int, bool]) -> int:
        chain = self.chains[step[0]]
        return chain.right if step[1] else chain.left

    def _points(self, step: tuple[int, bool]) -> Ints:
        points = self.chains[step[0]].points
        return points if step[1] else points[::-1]

    def _length(self, points: Ints) -> float:
        return float(np.linalg.norm(np.diff(self.P[points], axis=0), axis=1).sum())

    def _middle(self, points: Ints) -> tuple[Ints, int]:
        """Insert the middle of an arc into its points; return the points and its index."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.P[points], axis=0), axis=1))])
        half = way[-1] / 2
        i = int(np.clip(np.searchsorted(way, half) - 1, 0, len(points) - 2))
        t = (half - way[i]) / (way[i + 1] - way[i])
        self.middles.append((int(points[i]), int(points[i + 1]), float(t)))
        self.P[self.count] = (1 - t) * self.P[points[i]] + t * self.P[points[i + 1]]
        self.count += 1
        return np.insert(points, i + 1, self.count - 1), i + 1

    def result(self) -> ChainNet:
        one, two, t = (
            (np.array(x) for x in zip(*self.middles, strict=True)) if self.middles else (np.zeros(0, int),) * 3
        )
        weights = self.net.weights
        rows = [weights, weights[one].multiply(1 - t[:, None]) + weights[two].multiply(t[:, None])]
        net = replace(
            self.net,
            weights=csr_array(vstack(rows, format="csr")),
            chains=self.chains,
            loops=self.loops,
            loose=frozenset(self.loose),
        )
        moves = {
            (k, i): self.moved.get((k, int(chain.points[i])), self.place.get(int(chain.points[i]), -1))
            for k, chain in self.chains.items()
            for i in (0, -1)
        }
        return with_moved_ends(net, {end: point for end, point in moves.items() if point >= 0}, self.lifting)


def _inner_and_arc(loop: Loop, others: list[int]) -> tuple[Loop, Loop]:
    """Return the steps along other regions and along the void; empty unless each is one run."""
    void = [other == VOID for other in others]
    starts = [i for i in range(len(loop)) if not void[i] and void[i - 1]]
    if len(starts) != 1:
        return [], []
    steps = [*loop[starts[0] :], *loop[: starts[0]]]
    count = len(loop) - sum(void)
    return steps[:count], steps[count:]
