"""Supports that must hold a structure down."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import force
from dsfab.preset.surface_section import SurfaceSection
from dsfab.surface import DesignFactors, lifting_rules, show_their_actions

NO_PULL = 0.01  # a support pulls the structure down if the pull is above this share of the largest vertical reaction


def hold_down_remarks(
    section: SurfaceSection, supports: Sequence[str], vertical: Mapping[str, Floats]
) -> Iterator[str]:
    """Yield a sentence if supports must pull the structure down, with the largest force (N) of each support.
    supports : (p,) support of each place.
    vertical : (p,) forces of the places on the structure, N upwards, by case.

    The forces are those of static equilibrium [EN 1990, table A1.2(A)]. Combinations of the preset count as they are
    if a case has loads of several or of unknown kinds, because such combinations may include these factors."""
    combined = [item.name for item in section.sums]
    rules = lifting_rules(section.load, section.actions, section.factors or DesignFactors())
    if combined and not show_their_actions(section.load, section.actions):
        rules = []
    worst: list[tuple[float, str]] = []
    for p in range(len(supports)):
        at_place = {case: float(forces[p]) for case, forces in vertical.items()}
        pulls = [(-at_place[name], name) for name in combined] if not rules else []
        for item in (rule.worst(at_place) for rule in rules):
            pulls.append((-sum(factor * at_place[case] for case, factor in item.factors.items()), item.formula))
        worst.append(max(pulls))
    largest = max((float(np.abs(forces).max(initial=0.0)) for forces in vertical.values()), default=0.0)
    listed = []
    for support in dict.fromkeys(supports):
        of_places = [worst[p] for p in range(len(supports)) if supports[p] == support]
        pulling = [item for item in of_places if item[0] > NO_PULL * largest]
        if pulling:
            count = f"at {len(pulling)} of {len(of_places)} places, at most " if len(of_places) > 1 else ""
            pull, words = max(pulling)
            listed.append(f"{support} {count}{force(pull)} ({words})")
    if listed:
        rule_words = "by EN 1990, table A1.2(A)" if rules else "in the worst of the preset's combinations"
        yield f"supports must hold the structure down, {rule_words}: {', '.join(listed)}"
