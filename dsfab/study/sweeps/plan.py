"""Sweep files: values to vary, and constraints."""

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite, isnan, log
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomli_w
from annotated_types import Ge, Le, MinLen
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, field_validator, model_validator
from pydantic_core import ErrorDetails

from dsfab.core.errors import PresetError, did_you_mean
from dsfab.core.toml_files import read_toml
from dsfab.core.units import METRES_PER
from dsfab.preset.file import load_preset, require_mesh
from dsfab.preset.model import Preset
from dsfab.study.sizing import sized_preset
from dsfab.study.sweeps.metrics import METRICS

DIGITS = 6  # significant digits of the values in a range


class Range(BaseModel):
    """A range of values from `from` to `to`, including the two ends, with equal steps or equal ratios."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False)

    start: int | float = Field(alias="from")
    to: int | float
    count: Annotated[int, Ge(1)] | None = None
    """Number of values in a full grid."""
    log: bool = False
    """True for values with equal ratios, False for equal steps."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.start < self.to:
            raise ValueError(f"from = {self.start} must be smaller than to = {self.to}")
        if self.log and self.start <= 0:
            raise ValueError(f"log needs positive numbers, and from = {self.start} is not positive")
        return self

    def value_at(self, u: float) -> int | float:
        """Return the value at position u of the range, from 0 (start) to 1 (end)."""
        if self._whole and not self.log:
            return self.start + min(int(u * (self.to - self.start + 1)), int(self.to - self.start))
        value = self._interpolate(u)
        return round(value) if self._whole else float(f"{value:.{DIGITS}g}")

    def grid_values(self) -> list[int | float]:
        """Return `count` values of the range, including its two ends."""
        steps = self.count or 1
        values = [self._interpolate(i / max(steps - 1, 1)) for i in range(steps)]
        if self._whole and all(abs(value - round(value)) < 1e-9 * max(1, abs(value)) for value in values):
            return [round(value) for value in values]
        return [float(f"{value:.{DIGITS}g}") for value in values]

    @property
    def _whole(self) -> bool:
        return isinstance(self.start, int) and isinstance(self.to, int)

    def _interpolate(self, u: float) -> float:
        if self.log:
            return exp(log(self.start) + u * (log(self.to) - log(self.start)))
        return self.start + u * (self.to - self.start)


@dataclass(frozen=True)
class Axis:
    """Preset keys that a sweep varies together. `span` is the range of a single key.
    rows : values to use instead of a range; each row has a value for each key."""

    keys: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...] = ()
    span: Range | None = None

    def grid_changes(self) -> list[dict[str, Any]]:
        """Return a dict from keys to values for each grid point of this axis."""
        rows = self.rows if self.span is None else [(value,) for value in self.span.grid_values()]
        return [dict(zip(self.keys, row, strict=True)) for row in rows]

    def changes_at(self, u: float) -> dict[str, Any]:
        """Return the value of each key at position u of this axis, from 0 (start) to 1 (end)."""
        if self.span is not None:
            return {self.keys[0]: self.span.value_at(u)}
        row = self.rows[min(int(u * len(self.rows)), len(self.rows) - 1)]
        return dict(zip(self.keys, row, strict=True))


def axes(vary: Mapping[str, Sequence[Any] | Range], linked: Sequence[Mapping[str, Sequence[Any]]]) -> list[Axis]:
    """Return the axes (keys that change together) of a sweep: the keys in `vary`, then the tables in `linked`."""
    varied = [
        Axis((key,), span=values) if isinstance(values, Range) else Axis((key,), tuple((value,) for value in values))
        for key, values in vary.items()
    ]
    return varied + [Axis(tuple(table), tuple(zip(*table.values(), strict=True))) for table in linked]


def dotted_keys(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested tables as a flat table with dotted keys, such as "pattern.rim".
    Some tables are not flattened: ranges, empty tables, and tables with a dot in their key."""
    entries: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping) and value and "from" not in value and "." not in key:
            entries.update(dotted_keys(value, f"{prefix}{key}."))
        else:
            entries[prefix + key] = value
    return entries


def number(text: str) -> int | float:
    """Return the number that a text contains, as int or float. Raises ValueError for other texts, inf and nan."""
    value: int | float = int(text) if text.strip().lstrip("+-").isdigit() else float(text)
    if not isfinite(value):
        raise ValueError(text)
    return value


_FORM = re.compile(r"^\s*([a-z_]+)\s*(<=|>=|==|!=|=|<|>)\s*([-+0-9.eE]+)\s*([a-z]*)\s*$")


def _equal(value: float, limit: float) -> bool:
    return abs(value - limit) <= 1e-3 * abs(limit)


_HOLDS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
    "==": _equal,
    "=": _equal,
    "!=": lambda value, limit: not _equal(value, limit),
}


@dataclass(frozen=True)
class Constraint:
    """A condition on the results of a run, in SI units."""

    metric: str
    sign: str
    limit: float

    @classmethod
    def from_text(cls, text: str) -> "Constraint":
        """Return the constraint that a text describes, such as 'min_width >= 8 mm'. Raises PresetError."""
        match = _FORM.match(text)
        try:
            name, sign, value, unit = match.groups() if match else ("", "", "", "")
            limit = float(value) * METRES_PER[unit or "m"]
        except (ValueError, KeyError):
            raise PresetError(
                f"constraint {text!r} is not METRIC SIGN NUMBER; write for instance 'min_width >= 8 mm'"
            ) from None
        if name not in METRICS:
            raise PresetError(
                f"constraint {text!r}: metric {name!r} is not known{did_you_mean(name, METRICS)}; "
                f"use {', '.join(METRICS)}"
            )
        return cls(name, sign, limit)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Return True if the measured values, by name of the metric, meet the constraint."""
        value = values.get(self.metric, float("nan"))
        return not isnan(value) and _HOLDS[self.sign](value, self.limit)

    def missed_by(self, values: Mapping[str, float]) -> float:
        """Return |value - limit| / |limit|, but 0 if the constraint holds, and inf if the metric is missing."""
        value = values.get(self.metric, float("nan"))
        if isnan(value):
            return float("inf")
        return 0.0 if self.holds(values) else abs(value - self.limit) / max(abs(self.limit), 1e-12)


Kept = Literal["picture", "preset", "sheet", "solid"]
Format = Literal["stl", "3mf", "step", "obj", "ply", "glb"]
Listed = Annotated[tuple[Any, ...], MinLen(1)]


def _kind_of_values(values: Any) -> str:
    return "range" if isinstance(values, dict | Range) else "list"


Values = Annotated[Annotated[Range, Tag("range")] | Annotated[Listed, Tag("list")], Discriminator(_kind_of_values)]
USUAL = ("kept_share", "sheet_mass", "pieces", "compliance")  # default metrics of `dsfab sweep`


class Search(BaseModel):
    """Section [search] of a sweep file: the metric to optimise, and the number of designs to evaluate."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    metric: str
    evaluations: Annotated[int, Ge(1)] = 200

    @field_validator("metric")
    @classmethod
    def _check_metric(cls, name: str) -> str:
        return _metric(name)


class Plan(BaseModel):
    """Content of a sweep file. Paths in the file are relative to the file's folder."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: str
    """Name of a shipped preset, or a TOML file."""
    mesh: str | None = None
    """Mesh file that replaces the preset's surface."""
    set: dict[str, Any] = {}
    """Preset values that are equal in all runs, by dotted key."""
    vary: dict[str, Values] = {}
    """Preset keys to vary, in dotted form, each with a list of values or a range {from, to, count, log}."""
    linked: tuple[dict[str, Listed], ...] = ()
    """Tables that map preset keys to lists of equal length. All keys of a table change together."""
    sampling: Annotated[str, Field(pattern=r"^(grid|sobol:[1-9]\d*|lhs:[1-9]\d*|csv:.+)$")] = "grid"
    """Choice of the runs. grid: all combinations; sobol:N or lhs:N: N points; csv:FILE: a run for each row."""
    seed: Annotated[int, Ge(0), Le(2**31)] = 0
    """Seed of sobol, lhs and search; equal seeds give equal points."""
    metrics: Annotated[tuple[str, ...], MinLen(1)] = USUAL
    """Names of the metrics to measure in each run; values are in SI units."""
    constraints: tuple[str, ...] = ()
    """Conditions such as "pieces == 1". Runs that do not meet all conditions are never among the best runs."""
    keep: tuple[Kept, ...] = ("picture",)
    """Kinds of files to keep from each run."""
    formats: tuple[Format, ...] = ("stl",)
    """File formats of the solids that the sweep keeps from its runs."""
    size: Annotated[str, Field(pattern=r"^[1-9]\d{1,3}x[1-9]\d{1,3}$")] = "480x360"
    """Size of the pictures in pixels."""
    view: str = "iso"
    """View of the pictures: iso, top, front, side, or azimuth,elevation in degrees."""
    search: Search | None = None

    @field_validator("set", "vary", mode="before")
    @classmethod
    def _flatten(cls, tables: Any) -> Any:
        return dotted_keys(tables) if isinstance(tables, dict) else tables

    @field_validator("linked", mode="before")
    @classmethod
    def _flatten_tables(cls, tables: Any) -> Any:
        if not isinstance(tables, list):
            return tables
        return [dotted_keys(table) if isinstance(table, dict) else table for table in tables]

    @field_validator("metrics")
    @classmethod
    def _check_metrics(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(_metric(name) for name in names))

    @field_validator("constraints")
    @classmethod
    def _readable(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            _check_text(Constraint.from_text, text)
        return texts

    @model_validator(mode="after")
    def _possible(self) -> "Plan":
        wrong = [*self._uneven_links(), *self._repeated_keys(), *self._missing_counts()]
        if not self.vary and not self.linked and not self.sampling.startswith("csv:"):
            wrong.append("the sweep varies no key; give [vary] at least one key with its values")
        if self.sampling.startswith("csv:") and (self.vary or self.linked):
            wrong.append("a csv file gives all points; leave [vary] and [[linked]] out, or use another sampling")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def _uneven_links(self) -> list[str]:
        mistakes = []
        for table in self.linked:
            lengths = {key: len(values) for key, values in table.items()}
            if len(set(lengths.values())) > 1:
                lengths_text = ", ".join(f"{key} {length}" for key, length in lengths.items())
                mistakes.append(f"linked keys need lists of equal length, but the lengths are: {lengths_text}")
        return mistakes

    def _repeated_keys(self) -> list[str]:
        keys = [key for axis in axes(self.vary, ()) for key in axis.keys] + [k for table in self.linked for k in table]
        return [f"{key} is varied twice" for key in dict.fromkeys(keys) if keys.count(key) > 1]

    def _missing_counts(self) -> list[str]:
        if self.sampling != "grid" or self.search is not None:
            return []
        return [
            f'vary.{key} needs count = ... for a full grid (or sampling = "sobol:200")'
            for key, values in self.vary.items()
            if isinstance(values, Range) and values.count is None
        ]

    @property
    def axes(self) -> list[Axis]:
        return axes(self.vary, self.linked)

    @property
    def limits(self) -> list[Constraint]:
        return [Constraint.from_text(text) for text in self.constraints]

    @property
    def measured_metrics(self) -> tuple[str, ...]:
        """Names of all metrics that each run must measure, including the metrics in constraints and search."""
        names = [*self.metrics, *(limit.metric for limit in self.limits)]
        return tuple(dict.fromkeys(names + ([self.search.metric] if self.search else [])))


def _metric(name: str) -> str:
    if name not in METRICS:
        raise ValueError(f"metric {name!r} is not known{did_you_mean(name, METRICS)}; use {', '.join(METRICS)}")
    return name


def _check_text(check: Any, text: str) -> None:
    try:
        check(text)
    except PresetError as error:
        raise ValueError(str(error)) from None


def load_plan(path: Path) -> Plan:
    """Return the plan in a sweep file. Raises PresetError, with all mistakes in its message."""
    return plan_from(read_plan(path), f"sweep {path.name}")


def read_plan(path: Path) -> dict[str, Any]:
    """Return the tables of a sweep file without a check. Raises PresetError if the file cannot be read."""
    return _from_folder(read_toml(path, "sweep"), path.absolute().parent)


def plan_from(values: Mapping[str, Any], source: str = "sweep") -> Plan:
    """Return a plan from nested tables. Raises PresetError, with all mistakes in its message.
    source : name of the source of the tables in this message."""
    try:
        return Plan.model_validate(dict(values))
    except ValidationError as error:
        mistakes = dict.fromkeys(_sentence(detail) for detail in error.errors())
        raise PresetError(f"{source}: {'; '.join(mistakes)}") from None


def plan_toml(plan: Plan) -> str:
    """Return the complete plan as a TOML text. The order of the varied keys is preserved."""
    values = plan.model_dump(mode="json", exclude_none=True, by_alias=True)
    vary = values.pop("vary")
    lines = [_line(key, value) for key, value in vary.items()]
    return "\n".join([tomli_w.dumps(values).rstrip(), "", "[vary]", *lines, ""])


def _line(key: str, value: Any) -> str:
    if isinstance(value, dict):
        inner = ", ".join(tomli_w.dumps({name: part}).strip() for name, part in value.items())
        return f"{tomli_w.dumps({key: 0}).partition(' = ')[0]} = {{ {inner} }}"
    return tomli_w.dumps({key: value}).rstrip()


def base_preset(plan: Plan) -> Preset:
    """Return the preset that all runs of a plan change. Raises PresetError if the preset is invalid."""
    preset = load_preset(plan.preset, plan.set, plan.mesh)
    if plan.mesh is None:
        require_mesh(preset)
    return sized_preset(preset)


def _from_folder(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    for key in ("preset", "mesh"):
        value = values.get(key)
        if isinstance(value, str) and (folder / value).is_file():
            values[key] = str(folder / value)
    sampling = values.get("sampling")
    if isinstance(sampling, str) and sampling.startswith("csv:"):
        values["sampling"] = f"csv:{folder / sampling.removeprefix('csv:')}"
    return values


def _sentence(detail: ErrorDetails) -> str:
    words = [str(part) for part in detail["loc"] if part not in ("range", "list")]
    key, kind = ".".join(words) or "sweep", detail["type"]
    if kind == "extra_forbidden":
        models: dict[str, Any] = {"search": Search, "vary": Range}
        fields = models.get(words[0], Plan).model_fields if len(words) > 1 else Plan.model_fields
        known_keys = [field.alias or name for name, field in fields.items()]
        return f"unknown key {key}{did_you_mean(words[-1], known_keys)} (known here: {', '.join(known_keys)})"
    if kind == "missing":
        return f"{key} is missing"
    if kind == "value_error":
        return f"{key}: {detail['ctx']['error']}" if words else str(detail["ctx"]["error"])
    if key == "sampling":
        return f"sampling = {detail['input']!r}: use grid, sobol:200, lhs:200 or csv:points.csv"
    if kind == "too_short":
        return f"{key} has no values; give at least one"
    text = detail["msg"].removeprefix("Input ")
    return f"{key} = {detail['input']!r}: {text[:1].lower()}{text[1:]}"
