"""Supports that must hold a structure down."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import force
from dsfab.surface import Combination, LiftingRule

NO_PULL = 0.01  # a support pulls the structure down if the pull is above this share of the largest vertical reaction


def hold_down_remarks(
    rule: LiftingRule, combinations: Sequence[str], supports: Sequence[str], vertical: Mapping[str, Floats]
) -> Iterator[str]:
    """Yield a sentence if supports must pull the structure down, with the forces (N) of each support.
    combinations : names of the combinations of the preset.    supports : (p,) support of each place.
    vertical     : (p,) forces of the places on the structure, N upwards, by combination, and by case of the rule.

    The forces are the largest in static equilibrium [EN 1990, table A1.2(A)] and in the combinations of the preset."""
    pulls = np.zeros(len(supports))
    words = [""] * len(supports)
    for p in range(len(supports)):
        at_place = {case: float(forces[p]) for case, forces in vertical.items()}
        factors = rule.worst(at_place)
        pulls[p] = -sum(factor * at_place[case] for case, factor in factors.items())
        words[p] = Combination("lifting", factors).formula
        for name in combinations:
            if -at_place[name] > pulls[p]:
                pulls[p], words[p] = -at_place[name], name
    largest = max((float(np.abs(forces).max(initial=0.0)) for forces in vertical.values()), default=0.0)
    listed, least = [], 1e-6 * largest  # smaller forces are rounding
    for support in dict.fromkeys(supports):
        indices = [p for p, name in enumerate(supports) if name == support]
        down = [p for p in indices if pulls[p] > least]
        worst = max(indices, key=lambda p: pulls[p])
        if sum(pulls[down]) > NO_PULL * largest:
            places = (
                f" at {len(down)} of {len(indices)} places, at most {force(pulls[worst])}" if len(indices) > 1 else ""
            )
            listed.append(f"{support} {force(sum(pulls[down]))}{places} ({words[worst]})")
    if listed:
        yield f"supports must hold the structure down, by EN 1990, table A1.2(A): {', '.join(listed)}"
