"""Cases of loads that may lift a structure off its supports [EN 1990:2002, 6.4.3 and table A1.2(A)]."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dsfab.surface.loads.combinations import (
    ActionKind,
    DesignFactors,
    VariableCase,
    action_kind,
    case_names,
    loads_by_action,
    permanent_and_groups,
)
from dsfab.surface.loads.load_case import Load

LIGHT, HEAVY = 0.9, 1.1
"""Factors in static equilibrium of permanent loads that hold the structure down, and of those that lift it
[EN 1990:2002, table A1.2(A)]. National factors of a preset do not change them."""
COMMON = "(permanent loads)"  # case of the permanent loads that all cases repeat; no preset can have this name


@dataclass(frozen=True)
class LiftingRule:
    """Load cases that can act together.
    permanent : cases of permanent loads.    optional : permanent loads that some cases lack; they act where they lift.
    groups    : variable cases; at most one case of each group acts.
    loads     : loads of the cases above that the preset does not have.
    sums      : for cases of the kind 'case minus permanent loads', the factors of these two cases, by name."""

    permanent: tuple[str, ...]
    optional: tuple[str, ...]
    groups: tuple[tuple[VariableCase, ...], ...]
    factors: DesignFactors
    loads: Mapping[str, Sequence[Load]]
    sums: Mapping[str, Mapping[str, float]]

    @classmethod
    def for_loads(
        cls, loads: Sequence[Load], actions: Mapping[str, ActionKind], factors: DesignFactors
    ) -> "LiftingRule":
        """Return the rule for the loads of a preset. Loads that do not show their kind count one by one as leading
        variable loads: they may lift, and never hold down. Permanent loads that cases repeat count once."""
        pairs = _separate_loads(loads, actions)
        sets = _permanent_sets(pairs, actions)
        regroup = any(load.case != origin.case for load, origin in pairs) or len(sets) > 1
        common = _common_loads(sets) if regroup else []
        acting: list[Load] = [replace(load, case=COMMON) for load in common]
        kinds: dict[str, ActionKind] = {COMMON: "permanent"}
        optional = dict[str, None]()
        for load, origin in pairs:
            kind = action_kind(origin, actions)
            if not (regroup and kind == "permanent"):
                acting.append(load)
                kinds |= {load.case: kind} if kind else {}
            elif _bare(origin) not in common:
                optional[f"{origin.case}: permanent"] = None
                acting.append(replace(origin, case=f"{origin.case}: permanent"))
        cases = [load for load in acting if load.case not in optional]
        permanent, groups = permanent_and_groups(cases, kinds, factors.psi)
        variable = tuple(tuple(item for item in group if item is not None) for group in groups)
        sums = _differences(pairs, actions, common)
        new_cases = set(case_names(acting)) - set(case_names(loads)) - set(sums)
        solved = {name: [load for load in acting if load.case == name] for name in sorted(new_cases)}
        return cls(tuple(permanent), tuple(optional), variable, factors, solved, sums)

    def worst(self, vertical: Mapping[str, float]) -> dict[str, float]:
        """Return the factors of the cases with the largest pull, by name.
        vertical : reactions (N) by case; negative reactions pull."""
        pulling = [min(group, key=lambda action: vertical[action.case]) for group in self.groups]
        pulling = [action for action in pulling if vertical[action.case] < 0]
        leading = min(pulling, key=lambda action: (1 - action.psi[0]) * vertical[action.case], default=None)
        factors = {case: LIGHT if vertical[case] > 0 else HEAVY for case in self.permanent}
        factors |= {case: HEAVY for case in self.optional if vertical[case] < 0}
        for action in pulling:
            factors[action.case] = self.factors.variable * (1.0 if action is leading else action.psi[0])
        return {case: factor for case, factor in factors.items() if factor}


def _bare(load: Load) -> Load:
    return replace(load, case=COMMON, name="")


def _separate_loads(loads: Sequence[Load], actions: Mapping[str, ActionKind]) -> list[tuple[Load, Load]]:
    """Return each load with the name of its separate case, and as it is in the preset."""
    pairs = list(zip(loads_by_action(loads, actions), loads, strict=True))
    names = [load.case for load in loads]
    return [
        (replace(load, case=f"{origin.case}: {origin.kind} {k}"), origin)
        if action_kind(origin, actions) is None and names.count(origin.case) > 1
        else (load, origin)
        for k, (load, origin) in enumerate(pairs)
    ]


def _permanent_sets(pairs: Sequence[tuple[Load, Load]], actions: Mapping[str, ActionKind]) -> list[list[Load]]:
    """Return sets of permanent loads that act together: those of each case that also has variable loads, and those of
    all other cases together. A case of permanent loads that repeats a load of another case is a set of its own."""
    by_case: dict[str, list[Load]] = {}
    for _, origin in pairs:
        if action_kind(origin, actions) == "permanent":
            by_case.setdefault(origin.case, []).append(_bare(origin))
    alone = {
        case: loads
        for case, loads in by_case.items()
        if all(load.case == origin.case for load, origin in pairs if origin.case == case)
        and not any(load in rest for name, rest in by_case.items() if name != case for load in loads)
    }
    added = [load for loads in alone.values() for load in loads]
    sets = [loads for case, loads in by_case.items() if case not in alone]
    return sets or ([added] if added else [])


def _common_loads(sets: Sequence[list[Load]]) -> list[Load]:
    """Return the loads that are in each set, as often as in the set with the fewest of them."""
    smallest = min(sets, key=len, default=[])
    return [
        load
        for k, load in enumerate(smallest)
        if all(smallest[: k + 1].count(load) <= loads.count(load) for loads in sets)
    ]


def _differences(
    pairs: Sequence[tuple[Load, Load]], actions: Mapping[str, ActionKind], common: Sequence[Load]
) -> dict[str, dict[str, float]]:
    """Return the cases that are a case of the preset minus the common loads, as factors by name of the case."""
    differences = {}
    for case in case_names([origin for load, origin in pairs if load.case != origin.case]):
        of_case = [(load, origin) for load, origin in pairs if origin.case == case]
        weights = [_bare(origin) for _, origin in of_case if action_kind(origin, actions) == "permanent"]
        variable = {load.case for load, origin in of_case if action_kind(origin, actions) != "permanent"}
        if len(variable) == 1 and len(weights) == len(common) and all(load in common for load in weights):
            differences[variable.pop()] = {case: 1.0, COMMON: -1.0}
    return differences
