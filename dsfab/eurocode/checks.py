"""`CodeCheck`: a formula of a standard by its name and clause; `Utilisation`: what was found of all bays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, Ints, locked
from dsfab.eurocode.bays import MemberBays


class CodeCheck(NamedTuple):
    """What is checked, in words, and the clause and formula that say how."""

    name: str
    clause: str

    def __str__(self) -> str:
        return f"{self.name}, {self.clause}"


Found = dict[CodeCheck, Floats]
"""By check, (b, 5) at the stations of each bay, or (b, 1) of the bay as a whole: 1 is what it can bear."""


@dataclass(frozen=True, eq=False)
class Utilisation:
    """What bays bear over what they can bear: 1 is full.

    bays     : b of them.    checks : c of them.    standard : that they are from, or why there is none.
    values   : by case or combination that is judged, (b, c), the largest along each bay.
    station  : by the same, (b, c) the station in 0 to 4 where it is; 0 where it is of the bay as a whole.
    assumed  : sentences: what was taken for granted.    unchecked : what nobody looked at.
    combined : whether cases are combinations with partial factors.
    """

    bays: MemberBays
    checks: tuple[CodeCheck, ...]
    standard: str
    values: Mapping[str, Floats]
    station: Mapping[str, Ints]
    assumed: tuple[str, ...]
    unchecked: tuple[str, ...]
    combined: bool = True

    def __post_init__(self) -> None:
        shape = (len(self.bays.member), len(self.checks))
        for name, kind in (("values", np.float64), ("station", np.int64)):
            rows = {case: locked(one, kind, shape) for case, one in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(rows))

    @cached_property
    def cases(self) -> tuple[str, ...]:
        """The cases and combinations that were judged."""
        return tuple(self.values)

    @cached_property
    def _all(self) -> Floats:
        """(b, k, c) by case."""
        return np.stack([self.values[case] for case in self.cases], axis=1)

    @cached_property
    def worst(self) -> Floats:
        """(b, c) the largest of all cases."""
        return np.asarray(self._all.max(axis=1))

    @cached_property
    def largest(self) -> Floats:
        """(b,) of all checks and cases."""
        return np.asarray(self.worst.max(axis=1))

    def governing(self, bay: int) -> tuple[CodeCheck, str, int]:
        """The check, the case and the station (0 to 4) that decide over a bay."""
        k, c = np.unravel_index(int(self._all[bay].argmax()), self._all[bay].shape)
        case = self.cases[int(k)]
        return self.checks[int(c)], case, int(self.station[case][bay, int(c)])

    @cached_property
    def order(self) -> Ints:
        """(b,) numbers of the bays, the one that bears most of what it can first."""
        return np.argsort(-self.largest, kind="stable")

    @cached_property
    def by_member(self) -> dict[str, float]:
        """The largest of each member, by name."""
        found: dict[str, float] = {}
        for name, value in zip(self.bays.member, self.largest.tolist(), strict=True):
            found[name] = max(found.get(name, 0.0), value)
        return found

    def worst_bays(self, count: int) -> list[int]:
        """Of the members that bear most of what they can, the worst bay of each, worst first."""
        seen: dict[str, int] = {}
        for bay in self.order.tolist():
            seen.setdefault(self.bays.member[bay], bay)
        return list(seen.values())[:count]

    @property
    def told(self) -> str:
        """A sentence: the worst of all."""
        bay = int(self.order[0])
        check, case, _ = self.governing(bay)
        over = [name for name, value in self.by_member.items() if value > 1]
        under = f" under {case}" if len(self.cases) > 1 else ""
        count = f"{len(over)} of {len(self.by_member)} members are over 100 %" if over else "no member is over 100 %"
        return f"{self.bays.member[bay]} bears most, {self.largest[bay]:.0%} ({check}){under}; {count}"
