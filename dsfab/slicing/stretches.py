"""`Stretches`: parts of the chains of walls around openings."""

from bisect import bisect
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.walls import Walls


@dataclass(frozen=True, eq=False)
class Stretches:
    """Parts (p,) of chains, which may run over the beginning of a closed one: there they are two.

    low, high : (q,) metres, all chains laid end to end.    part : (q,) of which part each is.
    """

    low: Floats
    high: Floats
    part: Ints
    before: Floats

    @classmethod
    def of(cls, walls: Walls, chain: Ints, begin: Floats, length: Floats) -> "Stretches":
        """Of chains (p,), from a place (p,) along each, so long (p,), all in metres."""
        before, total = walls.before, walls.total[chain]
        begin = begin % total
        over = np.flatnonzero(begin + length > total)
        low = before[chain] + begin
        high = before[chain] + np.minimum(begin + length, total)
        rest = before[chain[over]]
        low, high = np.append(low, rest), np.append(high, rest + (begin + length - total)[over])
        return cls(low, high, np.append(np.arange(len(chain)), over), before)

    def cover(self, chain: Ints, place: Floats) -> Bools:
        """(k,) which places (k,), metres along chains (k,), lie in them; they must be disjoint."""
        if not len(self.low):
            return np.zeros(len(place), dtype=bool)
        order = np.argsort(self.low)
        x = self.before[chain] + np.maximum(place, 0.0)  # sums of lengths round below 0
        at = np.searchsorted(self.low[order], x, side="right") - 1
        return np.asarray((at >= 0) & (x <= self.high[order][np.maximum(at, 0)]))

    def meet(self, other: "Stretches", count: int) -> Bools:
        """(count,) which of the parts reach into disjoint other ones."""
        if not len(other.low):
            return np.zeros(count, dtype=bool)
        order = np.argsort(other.low)
        at = np.searchsorted(other.low[order], self.high) - 1
        into = (at >= 0) & (other.high[order][np.maximum(at, 0)] > self.low)
        return np.asarray(np.bincount(self.part, into, count) > 0)

    def disjoint(self, count: int) -> Bools:
        """(count,) which of the parts may stay so that none reaches into another: the longer of two."""
        length = np.bincount(self.part, self.high - self.low, count)
        stay, taken = np.ones(count, dtype=bool), list[tuple[float, float]]()
        for k in np.argsort(-length[self.part], kind="stable").tolist():
            low, high = float(self.low[k]), float(self.high[k])
            at = bisect(taken, (low, high))
            if (at and taken[at - 1][1] > low) or (at < len(taken) and taken[at][0] < high):
                stay[self.part[k]] = False
            else:
                taken.insert(at, (low, high))
        return stay
