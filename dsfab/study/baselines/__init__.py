"""Other ways to spend the same material: the competitors of a design, by name, one function each."""

from collections.abc import Iterable, Mapping

from dsfab.core.errors import DsfabError, did_you_mean
from dsfab.study.baselines.structures import (
    SAME_MASS,
    Baseline,
    ComparisonTask,
    Structure,
    Variant,
    grid,
    isotropic,
    rotated_stripes,
    thinner,
    von_mises,
)
from dsfab.study.baselines.topology_optimisation import simp

__all__ = ["BASELINES", "DEFAULT", "SAME_MASS", "Baseline", "ComparisonTask", "Structure", "Variant", "chosen"]

BASELINES: Mapping[str, Baseline] = {
    "isotropic": isotropic,
    "rotated": rotated_stripes,
    "thinner": thinner,
    "von_mises": von_mises,
    "grid": grid,
    "simp": simp,
}
"""All of the same mass, and but for `thinner` of the same thickness, with the same loads, supports and kept regions;
`simp` keeps what is drawn and discs of its own, see `dsfab.study.baselines.topology_optimisation.free_task`."""

DEFAULT = ("isotropic", "thinner")
"""Those that a comparison asks for unless it is told otherwise."""


def chosen(names: Iterable[str]) -> dict[str, Baseline]:
    """Baselines by their names, each once; raises DsfabError for a name that is none."""
    for name in (names := list(dict.fromkeys(names))):
        if name not in BASELINES:
            raise DsfabError(
                f"there is no competitor {name!r}{did_you_mean(name, BASELINES)}; there are {', '.join(BASELINES)}"
            )
    return {name: BASELINES[name] for name in names}
