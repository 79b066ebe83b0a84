"""`Plan`: what a sweep is. The one place where the keys of a sweep file, their defaults and ranges are written down."""

from typing import Annotated, Any, Literal

from annotated_types import Ge, Le, MinLen
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, field_validator, model_validator

from dsfab.errors import PresetError, did_you_mean
from dsfab.study.sweeps.constraints import Constraint
from dsfab.study.sweeps.metrics import METRICS
from dsfab.study.sweeps.values import Axis, Range, axes, flat

Kept = Literal["picture", "preset", "sheet", "solid"]
Format = Literal["stl", "3mf", "step", "obj", "ply", "glb"]
Listed = Annotated[tuple[Any, ...], MinLen(1)]


def _kind_of_values(given: Any) -> str:
    return "range" if isinstance(given, dict | Range) else "list"


Values = Annotated[
    Annotated[Range, Tag("range")] | Annotated[Listed, Tag("list")],
    Discriminator(_kind_of_values),
]

USUAL = ("kept_share", "sheet_mass", "pieces", "compliance")
"""What `dsfab sweep` measures when nothing is asked."""


class Search(BaseModel):
    """[search]: instead of sampling, look for the least (or most) of a metric."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    metric: str
    evaluations: Annotated[int, Ge(1)] = 200

    @field_validator("metric")
    @classmethod
    def _known(cls, name: str) -> str:
        return _metric(name)


class Plan(BaseModel):
    """A sweep file. Paths in it start at its folder."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: str
    """Name of a shipped preset, or a TOML file."""
    mesh: str | None = None
    """Mesh file that takes the place of the preset's surface."""
    set: dict[str, Any] = {}
    """Dotted keys and values that hold for all runs."""
    vary: dict[str, Values] = {}
    """Dotted keys, each with a list of values or a range {from, to, count, log}."""
    linked: tuple[dict[str, Listed], ...] = ()
    """Tables of keys that move together: equally long lists."""
    sampling: Annotated[str, Field(pattern=r"^(grid|sobol:[1-9]\d*|lhs:[1-9]\d*|csv:.+)$")] = "grid"
    """grid: all combinations; sobol:N or lhs:N: N points; csv:FILE: one run for each row."""
    seed: Annotated[int, Ge(0), Le(2**31)] = 0
    """Of sobol, lhs and search: the same seed gives the same points."""
    metrics: Annotated[tuple[str, ...], MinLen(1)] = USUAL
    """What is measured, in SI units."""
    constraints: tuple[str, ...] = ()
    """Such as "pieces == 1": runs that miss one are shown, but are not among the best."""
    keep: tuple[Kept, ...] = ("picture",)
    """What is kept of each run besides its numbers."""
    formats: tuple[Format, ...] = ("stl",)
    """Formats of kept solids."""
    size: Annotated[str, Field(pattern=r"^[1-9]\d{1,3}x[1-9]\d{1,3}$")] = "480x360"
    """Pixels of the pictures."""
    view: str = "iso"
    """Side of the pictures: iso, top, front, side, or azimuth,elevation in degrees."""
    search: Search | None = None

    @field_validator("set", "vary", mode="before")
    @classmethod
    def _flat(cls, given: Any) -> Any:
        return flat(given) if isinstance(given, dict) else given

    @field_validator("linked", mode="before")
    @classmethod
    def _flat_tables(cls, given: Any) -> Any:
        return [flat(one) if isinstance(one, dict) else one for one in given] if isinstance(given, list) else given

    @field_validator("metrics")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(_metric(name) for name in names))

    @field_validator("constraints")
    @classmethod
    def _readable(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            _told(Constraint.parsed, text)
        return texts

    @model_validator(mode="after")
    def _possible(self) -> "Plan":
        wrong = [*self._uneven(), *self._twice(), *self._countless()]
        if not self.vary and not self.linked and not self.sampling.startswith("csv:"):
            wrong.append("nothing is varied; give [vary] at least one key with its values")
        if self.sampling.startswith("csv:") and (self.vary or self.linked):
            wrong.append("a csv gives all points; leave [vary] and [[linked]] out, or take another sampling")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def _uneven(self) -> list[str]:
        found = []
        for table in self.linked:
            lengths = {key: len(values) for key, values in table.items()}
            if len(set(lengths.values())) > 1:
                told = ", ".join(f"{key} {length}" for key, length in lengths.items())
                found.append(f"linked keys need lists of one length, here: {told}")
        return found

    def _twice(self) -> list[str]:
        keys = [key for axis in axes(self.vary, ()) for key in axis.keys] + [k for table in self.linked for k in table]
        return [f"{key} is varied twice" for key in dict.fromkeys(keys) if keys.count(key) > 1]

    def _countless(self) -> list[str]:
        if self.sampling != "grid" or self.search is not None:
            return []
        return [
            f'vary.{key} needs count = ... for a full grid (or sampling = "sobol:200")'
            for key, values in self.vary.items()
            if isinstance(values, Range) and values.count is None
        ]

    @property
    def axes(self) -> list[Axis]:
        """What is varied."""
        return axes(self.vary, self.linked)

    @property
    def limits(self) -> list[Constraint]:
        """The constraints."""
        return [Constraint.parsed(text) for text in self.constraints]

    @property
    def measured(self) -> tuple[str, ...]:
        """Metrics, with those that constraints and the search need."""
        wanted = [*self.metrics, *(limit.metric for limit in self.limits)]
        return tuple(dict.fromkeys(wanted + ([self.search.metric] if self.search else [])))


def _metric(name: str) -> str:
    if name not in METRICS:
        raise ValueError(f"metric {name!r} is not known{did_you_mean(name, METRICS)}; use {', '.join(METRICS)}")
    return name


def _told(check: Any, text: str) -> None:
    try:
        check(text)
    except PresetError as error:
        raise ValueError(str(error)) from None
