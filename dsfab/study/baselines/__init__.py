"""Structures to compare with a design, by name. Their mass is that of the design."""

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

__all__ = [
    "BASELINES", "DEFAULT", "SAME_MASS", "Baseline", "ComparisonTask", "Structure", "Variant", "baselines_by_name",
]  # fmt: skip

BASELINES: Mapping[str, Baseline] = {
    "isotropic": isotropic,
    "rotated": rotated_stripes,
    "thinner": thinner,
    "von_mises": von_mises,
    "grid": grid,
    "simp": simp,
}
"""Functions that make structures to compare with a design, by name. Mass, loads, supports, kept regions and thickness
are those of the design. But `thinner` is less thick, and `simp` has no rim, and kept discs of a different radius."""
DEFAULT = ("isotropic", "thinner")  # default competitors of a comparison


def baselines_by_name(names: Iterable[str]) -> dict[str, Baseline]:
    """Return the entries of `BASELINES` with these names. Raises DsfabError for an unknown name."""
    for name in (names := list(dict.fromkeys(names))):
        if name not in BASELINES:
            raise DsfabError(
                f"there is no competitor {name!r}{did_you_mean(name, BASELINES)}; choose from {', '.join(BASELINES)}"
            )
    return {name: BASELINES[name] for name in names}
