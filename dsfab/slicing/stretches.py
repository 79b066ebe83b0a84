"""`Stretches`: parts of the chains of walls around openings."""

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
        before, total = np.cumsum(walls.total) - walls.total, walls.total[chain]
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

    def disjoint(self, count: int) -> Bools:
        """(count,) which of the parts may stay so that none reaches over another: the first of two."""
        stay, end = np.ones(count, dtype=bool), -np.inf
        for k in np.argsort(self.low, kind="stable").tolist():
            part = self.part[k]
            if self.low[k] < end:
                stay[part] = False
            elif stay[part]:
                end = self.high[k]
        return stay
