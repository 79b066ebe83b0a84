"""Ends of chains moved along outlines: the borders of a crossing begin where its round corners do."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats, Ints
from dsfab.export.network.graph import VOID, ChainNet, Loop, ends_at, outline_through
from dsfab.export.network.lifting import Lifting

FEWEST_SIDES = 3
"""Of a region, that it keeps."""

FEWEST = 5
"""Points of a chain whose ends are moved, at least."""


def with_moved_ends(net: ChainNet, moves: Mapping[tuple[int, int], int], lifting: Lifting) -> ChainNet:
    """The net with some ends of chains, (chain, 0 or -1), at other points; what is between follows by a share."""
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
    """(k, 3) millimetres along a chain whose ends are elsewhere now."""
    line = P[points]
    way = _way(line)
    start, end = P[ends[0]] - line[0], P[ends[1]] - line[-1]
    x = np.linspace(0, 1, max(len(points), FEWEST))
    at = np.stack([np.interp(x * way[-1], way, c) for c in line.T], axis=1)
    return np.asarray((at + (1 - x)[:, None] * start + x[:, None] * end)[1:-1])


def _way(line: Floats) -> Floats:
    """(k,) lengths along a line (k, 3), from 0."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def without_short_walls(net: ChainNet, lifting: Lifting, most: float) -> ChainNet:
    """The net without walls shorter than `most` millimetres between the ends of two borders: these end in one place.

    Left as they are, walls of a millimetre leave an arc's end at any angle: where members of four feet meet their rim,
    eight of twelve edges were such, and took no fillet.
    """
    P: Floats = np.asarray(net.weights @ lifting.skins.points)
    chains, moves, at = dict(net.chains), dict[tuple[int, int], int](), ends_at(net)
    loops = {region: [list(loop) for loop in some] for region, some in net.loops.items()}
    for k, chain in net.chains.items():
        if chain.right != VOID or _way(P[chain.points])[-1] >= most:
            continue
        before, after = (outline_and_border(net, at[int(chain.points[i])]) for i in (0, -1))
        mine = next(loop for loop in loops[chain.left] if (k, True) in loop)
        if not before or not after or len(mine) <= FEWEST_SIDES:
            continue
        three = ([net.chains[i].points[-2], *net.chains[j].points[:2]] for i, j in (before[:2], after[:2]))
        turned = [turn_at(P[points]) for points in three]
        first = turned[0] < turned[1]  # the end that gives way
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
    """The outline's chains that end and begin where ends of chains are, and the end of the one border there."""
    outline, borders = outline_through(net, ends), [one for one in ends if net.chains[one[0]].right != VOID]
    return (*outline, borders[0]) if outline and len(borders) == 1 else None


def turn_at(three: Floats) -> float:
    """Degrees that a line through three points (3, 3) turns at the middle one."""
    ways = np.diff(three, axis=0)
    long = max(float(np.prod(np.linalg.norm(ways, axis=1))), 1e-300)
    return float(np.degrees(np.arccos(np.clip(ways[0] @ ways[1] / long, -1, 1))))


def with_whole_arcs(net: ChainNet, arcs: Collection[int], lifting: Lifting) -> ChainNet:
    """The net whose crossings have what of their round corners lies in the outlines of members: short chains beside an
    arc that end where nothing else does, and that the member's wall goes on from."""
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
        """What follows an arc (way = 1), or is before it (-1)."""
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
        """The loop of a region with a step; none of the void."""
        return next((loop for loop in self.loops.get(region, []) if step in loop), [])

    def _beyond(self, step: tuple[int, bool]) -> int:
        """The region on the other side of a step."""
        chain = self.chains[step[0]]
        return chain.right if step[1] else chain.left

    def _length(self, points: Ints) -> float:
        return float(_way(self.P[points])[-1])
