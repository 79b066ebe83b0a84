"""Constraints such as 'pieces == 1' and 'min_width >= 8 mm': which runs count among the good ones."""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isnan

from dsfab.errors import PresetError, did_you_mean
from dsfab.study.sweeps.metrics import METRICS
from dsfab.units import METRES_PER

EQUAL = 1e-3
"""Numbers that differ by less than this share count as equal: a share of 40 % is met by 0.4003."""

_FORM = re.compile(r"^\s*([a-z_]+)\s*(<=|>=|==|!=|=|<|>)\s*([-+0-9.eE]+)\s*([a-z]*)\s*$")


def _equal(one: float, other: float) -> bool:
    return abs(one - other) <= EQUAL * abs(other)


_HOLDS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
    "==": _equal,
    "=": _equal,
    "!=": lambda one, other: not _equal(one, other),
}


@dataclass(frozen=True)
class Constraint:
    """`metric` compared with a limit in SI units."""

    metric: str
    sign: str
    limit: float

    @classmethod
    def parsed(cls, text: str) -> "Constraint":
        """Of 'pieces == 1' or 'min_width >= 8 mm'; raises PresetError."""
        found = _FORM.match(text)
        try:
            name, sign, value, unit = found.groups() if found else ("", "", "", "")
            limit = float(value) * METRES_PER[unit or "m"]
        except (ValueError, KeyError):
            raise PresetError(
                f"constraint {text!r} is not METRIC SIGN NUMBER; write 'pieces == 1' or 'min_width >= 8 mm'"
            ) from None
        if name not in METRICS:
            raise PresetError(
                f"constraint {text!r}: metric {name!r} is not known{did_you_mean(name, METRICS)}; "
                f"use {', '.join(METRICS)}"
            )
        return cls(name, sign, limit)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether measured values meet it; what was not measured does not."""
        value = values.get(self.metric, float("nan"))
        return not isnan(value) and _HOLDS[self.sign](value, self.limit)

    def missed_by(self, values: Mapping[str, float]) -> float:
        """By which share of its limit it is missed: 0 where it holds, infinite where nothing was measured."""
        value = values.get(self.metric, float("nan"))
        if isnan(value):
            return float("inf")
        return 0.0 if self.holds(values) else abs(value - self.limit) / max(abs(self.limit), 1e-12)
