"""The values of what a sweep varies: lists, ranges, and keys that move together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite, log
from typing import Annotated, Any, Self

from annotated_types import Ge
from pydantic import BaseModel, ConfigDict, Field, model_validator

DIGITS = 6
"""Significant digits of the values in a range: what is typed is what is built."""


class Range(BaseModel):
    """Values from `from` to `to`, both included; whole numbers where both ends are, evenly apart or by factors."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False)

    start: int | float = Field(alias="from")
    to: int | float
    count: Annotated[int, Ge(1)] | None = None
    """How many values a full grid takes."""
    log: bool = False
    """Apart by equal factors instead of equal steps."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.start < self.to:
            raise ValueError(f"from = {self.start} must be smaller than to = {self.to}")
        if self.log and self.start <= 0:
            raise ValueError(f"log runs over positive numbers, from = {self.start} is none")
        return self

    def at(self, u: float) -> int | float:
        """The value at u in 0..1 of the way; of whole numbers, each gets an equal share of the way."""
        if self._whole and not self.log:
            return self.start + min(int(u * (self.to - self.start + 1)), int(self.to - self.start))
        value = self._between(u)
        return round(value) if self._whole else float(f"{value:.{DIGITS}g}")

    def listed(self) -> list[int | float]:
        """`count` values with both ends."""
        steps = self.count or 1
        values = [self._between(i / max(steps - 1, 1)) for i in range(steps)]
        if self._whole and all(abs(value - round(value)) < 1e-9 * max(1, abs(value)) for value in values):
            return [round(value) for value in values]
        return [float(f"{value:.{DIGITS}g}") for value in values]

    @property
    def _whole(self) -> bool:
        return isinstance(self.start, int) and isinstance(self.to, int)

    def _between(self, u: float) -> float:
        if self.log:
            return exp(log(self.start) + u * (log(self.to) - log(self.start)))
        return self.start + u * (self.to - self.start)


@dataclass(frozen=True)
class Axis:
    """One direction of the space of designs: keys that move together, over a range or rows of values."""

    keys: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...] = ()
    span: Range | None = None

    def listed(self) -> list[dict[str, Any]]:
        """All changes along it."""
        rows = self.rows if self.span is None else [(value,) for value in self.span.listed()]
        return [dict(zip(self.keys, row, strict=True)) for row in rows]

    def at(self, u: float) -> dict[str, Any]:
        """The change at u in 0..1; rows get equal shares."""
        if self.span is not None:
            return {self.keys[0]: self.span.at(u)}
        row = self.rows[min(int(u * len(self.rows)), len(self.rows) - 1)]
        return dict(zip(self.keys, row, strict=True))


def axes(vary: Mapping[str, Sequence[Any] | Range], linked: Sequence[Mapping[str, Sequence[Any]]]) -> list[Axis]:
    """The axes of a sweep: one for each key, then one for each table of linked keys."""
    found = [
        Axis((key,), span=values) if isinstance(values, Range) else Axis((key,), tuple((value,) for value in values))
        for key, values in vary.items()
    ]
    return found + [Axis(tuple(table), tuple(zip(*table.values(), strict=True))) for table in linked]


def flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as dotted keys. A table with `from` is a range, and stays; so do those of quoted dotted keys, which
    are values as after --set, and empty ones."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping) and value and "from" not in value and "." not in key:
            found.update(flat(value, f"{prefix}{key}."))
        else:
            found[prefix + key] = value
    return found


def number(text: str) -> int | float:
    """'5' -> 5, '5.0' -> 5.0; raises ValueError for what is no finite number."""
    value: int | float = int(text) if text.strip().lstrip("+-").isdigit() else float(text)
    if not isfinite(value):
        raise ValueError(text)
    return value
