"""Competitors of a design by name: structures that use the same mass in another way."""

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
"""Functions of the competitors by name. A competitor has the design's mass, loads, supports, kept regions and
thickness,
with two exceptions: `thinner` is thinner, and `simp` keeps only painted regions and its own discs (see `free_task`)."""

DEFAULT = ("isotropic", "thinner")  # names of the competitors of a comparison by default


def baselines_by_name(names: Iterable[str]) -> dict[str, Baseline]:
    """Return the functions of competitors by their names, without repetition. Raises DsfabError for an unknown name."""
    for name in (names := list(dict.fromkeys(names))):
        if name not in BASELINES:
            raise DsfabError(
                f"there is no competitor {name!r}{did_you_mean(name, BASELINES)}; there are {', '.join(BASELINES)}"
            )
    return {name: BASELINES[name] for name in names}
