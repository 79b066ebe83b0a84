"""Load cases by name, and combinations of them: a load belongs to the case that it names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import ConfigDict

from dsfab.errors import SurfaceError
from dsfab.surface.load_parts import LoadParts
from dsfab.surface.loads import Load, LoadCase
from dsfab.surface.mesh import Surface
from dsfab.surface.pickers import STRICT, CaseName, Real
from dsfab.surface.supports import Support

LimitState = Literal["ULS", "SLS", ""]
"""Ultimate and serviceability limit state."""

COMBINED = "combined"
"""What [diffusion] follow says for all cases at once; no case and no combination may have this name."""


@dataclass(frozen=True)
class Combination:
    """A sum of cases: `[[surface.combination]]  name = "uls"  factors = { dead = 1.35, snow = 1.5 }`.

    factors     : case -> what its loads are multiplied with; cases that are not named take no part.
    limit_state : ULS, what stress and buckling are judged in; SLS, displacements; empty: both.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: CaseName
    factors: dict[CaseName, Real]
    limit_state: LimitState = ""

    @property
    def formula(self) -> str:
        """The sum in words: '1.35 dead + 1.5 snow'."""
        return " + ".join(f"{factor:.5g} {case}" for case, factor in self.factors.items())


def case_names(loads: Sequence[Load]) -> list[str]:
    """Names of the cases, in the order in which the loads first name them."""
    return list(dict.fromkeys(load.case for load in loads))


def load_cases(
    surface: Surface, supports: Sequence[Support], loads: Sequence[Load], weight: float = 0.0
) -> dict[str, LoadCase]:
    """The `LoadCase.build` of each case. All have the same supports and the same `loaded`: the vertices under a
    concentrated load of any case, since the pattern has to carry them all.

    Raises SurfaceError as `LoadCase.build` does, and names the case when there are several.
    """
    names = case_names(loads)
    if len(names) < 2:
        return {name: LoadCase.build(surface, supports, loads, weight) for name in names or ["load"]}
    cases = {}
    for name in names:
        try:
            cases[name] = LoadCase.build(surface, supports, [load for load in loads if load.case == name], weight)
        except SurfaceError as error:
            raise SurfaceError(f"case {name}: {error}") from None
    loaded = np.logical_or.reduce([case.loaded for case in cases.values()])
    return {name: replace(case, loaded=loaded) for name, case in cases.items()}


def together(cases: Mapping[str, LoadCase], factors: Mapping[str, float] | None = None) -> LoadCase:
    """Cases that act at the same time, each multiplied with its factor: all of them once when left out."""
    first = next(iter(cases.values()))
    taken = dict.fromkeys(cases, 1.0) if factors is None else factors
    force = np.sum([factor * cases[name].force for name, factor in taken.items()], axis=0)
    parts = {name: case.parts for name, case in cases.items() if case.parts is not None}
    if len(parts) < len(cases):
        return first.loading(force)
    return replace(first, force=force, parts=LoadParts.total(parts, taken))
