"""What acts on a sheet: each load case, each combination, and all cases together."""

from collections.abc import Mapping
from dataclasses import dataclass

from dsfab.pipeline.regions import acting_on
from dsfab.preset import Preset
from dsfab.statics import SpreadLoad, spread_load
from dsfab.surface import LoadCase, Surface, load_cases, together


@dataclass(frozen=True, eq=False)
class Loading:
    """A load that the sheet answers to.

    name    : of the case or the combination; empty for all cases together.
    factors : what the cases are multiplied with; None for a case itself, which is solved; all others are sums.
    """

    name: str
    load: LoadCase
    spread: SpreadLoad
    factors: Mapping[str, float] | None = None


def loadings(preset: Preset, surface: Surface) -> list[Loading]:
    """The cases of a preset, then its combinations, and last, if there are several cases, all of them together.

    Raises SurfaceError for supports and loads that act on nothing.
    """
    given, weight = preset.surface, preset.statics.weight
    on = acting_on(preset, surface)
    loads = load_cases(surface, on.support, on.load, weight)
    parts = {name: spread_load(surface, [ld for ld in on.load if ld.case == name], weight) for name in loads}
    cases = [Loading(name, load, parts[name]) for name, load in loads.items()]
    sums = [(combination.name, dict(combination.factors)) for combination in given.sums]
    if len(loads) > 1:
        sums.append(("", dict.fromkeys(loads, 1.0)))
    return cases + [
        Loading(name, together(loads, factors), SpreadLoad.total(parts, factors), factors) for name, factors in sums
    ]
