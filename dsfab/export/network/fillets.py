"""Round corners of openings, taken into the members beside them.

  B |                B |           A fillet lies in no stripe, and has no angle where its arc meets the members'
    |                  |           edges. Each member gets half of its arc; the corner of the crossing behind it
----c-t--- A   ->  ----m           moves to the middle m of the arc, and with it the sides of the crossing.
  X | )                 '--- A
    t
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats, Ints
from dsfab.export.network.graph import VOID, Chain, ChainNet, Loop
from dsfab.export.network.lifting import Lifting

DETOUR = 2.2
"""A loose region is a fillet if the way along the members behind it is at most so many times its arc: 1.27 of a round
right angle, 1.65 of one of 60 degrees, 3 of a square."""


FLATTER = 4.0
"""The same where only two members are behind it: some of the arc lies within these where their walls were made fair."""


def without_fillets(net: ChainNet, lifting: Lifting) -> ChainNet:
    """The net with every fillet taken into its neighbours; loose regions of another kind stay as they are."""
    work = _Fillets(net, lifting)
    for region in sorted(net.loose & net.loops.keys()):
        work.take(region)
    return work.result()


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
        self.outline = {int(p) for c in net.chains.values() if c.right == VOID for p in (c.points[0], c.points[-1])}

    def take(self, region: int) -> None:
        """A loose region, if it is a fillet."""
        if len(self.loops[region]) != 1:
            return
        inner, arc = _inner_and_arc(self.loops[region][0], self._others(region))
        if not inner or not arc:
            return
        points = np.concatenate([self._points(step)[:-1] for step in arc] + [self._points(arc[-1])[-1:]])
        behind = [int(self._points(step)[-1]) for step in inner[:-1]]
        if any(p in self.place or p in self.outline for p in behind):
            return
        most = DETOUR if len(inner) > 2 else FLATTER
        if sum(self._length(self._points(step)) for step in inner) > most * self._length(points):
            return
        others = [self._other(step) for step in inner]
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

    def _hand_over(self, inner: Loop, others: list[int], halves: list[Ints]) -> None:
        """The parts of an arc, the last one first, to the first and the last of the regions behind it."""
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
        """The points of an arc, with one in its middle, and where that is."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.P[points], axis=0), axis=1))])
        half = way[-1] / 2
        i = int(np.clip(np.searchsorted(way, half) - 1, 0, len(points) - 2))
        t = (half - way[i]) / (way[i + 1] - way[i])
        self.middles.append((int(points[i]), int(points[i + 1]), float(t)))
        self.P[self.count] = (1 - t) * self.P[points[i]] + t * self.P[points[i + 1]]
        self.count += 1
        return np.insert(points, i + 1, self.count - 1), i + 1

    def result(self) -> ChainNet:
        """The new net: sides of crossings moved with their corners."""
        one, two, t = (
            (np.array(x) for x in zip(*self.middles, strict=True)) if self.middles else (np.zeros(0, int),) * 3
        )
        weights = self.net.weights
        rows = [weights, weights[one].multiply(1 - t[:, None]) + weights[two].multiply(t[:, None])]
        moved = [
            k for k, chain in self.chains.items() if {int(chain.points[0]), int(chain.points[-1])} & set(self.place)
        ]
        ends = [
            [self.place.get(int(self.chains[k].points[i]), int(self.chains[k].points[i])) for i in (0, -1)]
            for k in moved
        ]
        between = [self._between(self.chains[k].points, both) for k, both in zip(moved, ends, strict=True)]
        if moved:
            rows.append(self.lifting.weights_at(np.concatenate(between)))
        start = self.count
        for k, both, some in zip(moved, ends, between, strict=True):
            points = np.concatenate([both[:1], np.arange(start, start + len(some)), both[1:]])
            self.chains[k], start = replace(self.chains[k], points=points), start + len(some)
        return ChainNet(
            csr_array(vstack(rows, format="csr")), self.chains, self.loops, frozenset(self.loose), self.net.cell
        )

    def _between(self, points: Ints, ends: list[int]) -> Floats:
        """(k, 3) millimetres along a chain whose ends are elsewhere now."""
        P = self.P[points]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(P, axis=0), axis=1))])
        start, end = self.P[ends[0]] - P[0], self.P[ends[1]] - P[-1]
        x = np.linspace(0, 1, max(len(points), 5))
        at = np.stack([np.interp(x * way[-1], way, c) for c in P.T], axis=1)
        return np.asarray((at + (1 - x)[:, None] * start + x[:, None] * end)[1:-1])


def _inner_and_arc(loop: Loop, others: list[int]) -> tuple[Loop, Loop]:
    """The steps along other regions, and those along the void, each in order; nothing where these are not in one."""
    void = [other == VOID for other in others]
    starts = [i for i in range(len(loop)) if not void[i] and void[i - 1]]
    if len(starts) != 1:
        return [], []
    steps = [*loop[starts[0] :], *loop[: starts[0]]]
    count = len(loop) - sum(void)
    return steps[:count], steps[count:]
