"""Load cases by name, and their combinations: the user's own, or those by the rules of EN 1990."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge
from pydantic import ConfigDict

from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.load_case import Load, LoadCase, LoadParts
from dsfab.surface.loads.pickers import STRICT, CaseName, Real
from dsfab.surface.loads.supports import Support
from dsfab.surface.mesh import Surface

LimitState = Literal["ULS", "SLS", ""]  # Ultimate and serviceability limit state.
COMBINED = "combined"  # diffusion.follow = COMBINED uses all load cases.


@dataclass(frozen=True)
class Combination:
    """A sum of cases: `[[surface.combination]]  name = "uls"  factors = { dead = 1.35, snow = 1.5 }`.
    factors     : factor on the loads of each case, by the name of the case; cases without a factor are left out.
    limit_state : ULS, for stress and buckling; SLS, for displacements; empty for both."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: CaseName
    factors: dict[CaseName, Real]
    limit_state: LimitState = ""

    @property
    def formula(self) -> str:
        """The sum as text: '1.35 dead + 1.5 snow'."""
        return " + ".join(f"{factor:.5g} {case}" for case, factor in self.factors.items())


def case_names(loads: Sequence[Load]) -> list[str]:
    """Return the names of the cases, in the order in which the loads first name them."""
    return list(dict.fromkeys(load.case for load in loads))


def load_cases(
    surface: Surface, supports: Sequence[Support], loads: Sequence[Load], weight: float = 0.0
) -> dict[str, LoadCase]:
    """Return the load cases by name; all cases have the same supports. weight : weight of the sheet, N/m2.
    In all cases, `loaded` marks the vertices under concentrated loads of any case.
    Raises SurfaceError as `LoadCase.build` does, with the name of the case if there are several."""
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


def combined_case(cases: Mapping[str, LoadCase], factors: Mapping[str, float] | None = None) -> LoadCase:
    """Return the sum of load cases, each multiplied by its factor. factors : by name of the case; by default all 1."""
    first_case = next(iter(cases.values()))
    taken = dict.fromkeys(cases, 1.0) if factors is None else factors
    force = np.sum([factor * cases[name].force for name, factor in taken.items()], axis=0)
    parts = {name: case.parts for name, case in cases.items() if case.parts is not None}
    if len(parts) < len(cases):
        return first_case.with_forces(force)
    return replace(first_case, force=force, parts=LoadParts.total(parts, taken))


CombinationRule = Literal["EN 1990 6.10", "EN 1990 6.10a/b"]
Share = Annotated[Real, Ge(0)]
Psi = tuple[Share, Share, Share]

PSI: dict[str, Psi] = {
    "imposed A": (0.7, 0.5, 0.3),  # residential areas
    "imposed B": (0.7, 0.5, 0.3),  # offices
    "imposed C": (0.7, 0.7, 0.6),  # congregation areas
    "imposed D": (0.7, 0.7, 0.6),  # shops
    "imposed E": (1.0, 0.9, 0.8),  # storage areas
    "imposed F": (0.7, 0.7, 0.6),  # vehicles up to 30 kN
    "imposed G": (0.7, 0.5, 0.3),  # vehicles up to 160 kN
    "imposed H": (0.0, 0.0, 0.0),  # roofs, for maintenance
    "snow": (0.5, 0.2, 0.0),  # up to 1000 m above the sea
    "snow high": (0.7, 0.5, 0.2),  # above 1000 m, and in the Nordic countries
    "wind": (0.6, 0.2, 0.0),
    "temperature": (0.6, 0.5, 0.0),
}
"""psi_0, psi_1, psi_2 of variable actions [EN 1990:2002, Table A1.1]."""
UNKNOWN: Psi = (1.0, 1.0, 1.0)  # psi of loads that do not show their kind of action

_Areas = Literal["imposed A", "imposed B", "imposed C", "imposed D", "imposed E", "imposed F", "imposed G", "imposed H"]
ActionKind = Literal["permanent", _Areas, "snow", "snow high", "wind", "temperature"]

ACTION_OF_LOAD: dict[str, ActionKind] = {
    "self_weight": "permanent",
    "cladding": "permanent",
    "snow": "snow",
    "wind": "wind",
}
"""Kind of action for each kind of load; for a load of any further kind, the preset must state the kind of action."""

ONE_AT_A_TIME = ("snow", "snow high", "wind", "temperature")  # Two cases of one of these kinds never act together.


@dataclass(frozen=True)
class DesignFactors:
    """Factors gamma, xi and psi of a national annex: `[surface.factors]  variable = 1.6`.

    permanent  : gamma_G of unfavourable permanent loads.
    favourable : gamma_G of favourable permanent loads, such as weight against wind.
    variable   : gamma_Q of variable loads.
    reduction  : xi, the factor on permanent loads in equation 6.10b.
    psi        : psi_0, psi_1 and psi_2 of kinds of actions, `{ wind = [0.6, 0.2, 0] }`; by default Table A1.1."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    permanent: Share = 1.35
    favourable: Share = 1.0
    variable: Share = 1.5
    reduction: Share = 0.85
    psi: dict[ActionKind, Psi] = field(default_factory=dict)


@dataclass(frozen=True)
class VariableCase:
    """A load case of a variable action, with its psi_0, psi_1 and psi_2."""

    case: str
    kind: str
    psi: Psi


def action_mistakes(
    loads: Sequence[Load], actions: Mapping[str, ActionKind], rule: CombinationRule | None
) -> Iterator[str]:
    """Yield a message for each case with a wrong or missing kind of action, and for too many combinations."""
    cases = case_names(loads)
    for case in actions:
        if case not in cases:
            yield f"surface.actions.{case}: no load has this case; use one of: {', '.join(cases)}"
    if rule is None:
        return
    for case in cases:
        action_kinds = _action_kinds(loads, actions, case)
        if None in action_kinds or len(action_kinds) > 1:
            why, remedy = "are of several kinds; give each kind its own case", ""
            if None in action_kinds:
                why = "do not show their kind of action; give each its own case"
                remedy = f', or write [surface.actions] {case} = "..." ({", ".join(["permanent", *PSI])})'
            kinds = {load.kind for load in loads if load.case == case}
            yield (
                f"surface.combinations = {rule!r}: the loads of case {case} ({', '.join(sorted(kinds))}) {why}{remedy}"
            )
    if all(case in actions or ACTION_OF_LOAD.get(_kind(loads, case)) for case in cases):
        count = len(en1990_combinations(loads, actions, rule, DesignFactors()))
        limit = 200
        if count > limit:
            yield (
                f"surface.combinations = {rule!r}: {len(cases)} cases give {count} combinations, over {limit}; put "
                "loads that act together into one case, or write [[surface.combination]]"
            )


def en1990_combinations(
    loads: Sequence[Load], actions: Mapping[str, ActionKind], rule: CombinationRule, factors: DesignFactors
) -> list[Combination]:
    """Return all combinations of the load cases by EN 1990; ultimate limit states come first.
    Each selection of variable cases is combined with the permanent loads, and each selected case is the leading action
    once. Cases of one kind in `ONE_AT_A_TIME` never act together. Permanent loads may be favourable only with wind."""
    permanent, groups = permanent_and_groups(loads, actions, factors.psi)
    combinations: dict[tuple[str, tuple[tuple[str, float], ...]], Combination] = {}
    for chosen in product(*groups):
        acting = [item for item in chosen if item is not None]
        for k in range(max(len(acting), 1)):
            order = acting[k : k + 1] + acting[:k] + acting[k + 1 :]
            for item in _ordered_combinations(permanent, order, rule, factors):
                combinations.setdefault((item.limit_state, tuple(sorted(item.factors.items()))), item)
    return sorted(combinations.values(), key=lambda item: item.limit_state != "ULS")


def loads_by_action(loads: Sequence[Load], actions: Mapping[str, ActionKind]) -> list[Load]:
    """Return the loads with a case for each kind of action. The loads of a case with one kind keep their case; other
    loads get a case such as 'gust: wind', or 'gust: variable' for loads that do not show their kind.
    actions : kinds of cases; self-weight and cladding stay permanent."""
    kinds = [action_kind(load, actions) or "variable" for load in loads]
    by_case: dict[str, set[str]] = {}
    for load, kind in zip(loads, kinds, strict=True):
        by_case.setdefault(load.case, set()).add(kind)
    return [
        replace(load, case=f"{load.case}: {kind}") if len(by_case[load.case]) > 1 else load
        for load, kind in zip(loads, kinds, strict=True)
    ]


def action_kind(load: Load, actions: Mapping[str, ActionKind]) -> ActionKind | None:
    """Return the kind of action of a load, None if unknown. Self-weight and cladding are permanent in any case."""
    own_kind = ACTION_OF_LOAD.get(load.kind)
    return own_kind if own_kind == "permanent" else actions.get(load.case) or own_kind


def _ordered_combinations(
    permanent: Sequence[str], order: Sequence[VariableCase], rule: CombinationRule, factors: DesignFactors
) -> Iterator[Combination]:
    gamma = factors.variable
    lead = [gamma * (1.0 if not k else action.psi[0]) for k, action in enumerate(order)]
    behind = [gamma * action.psi[0] for action in order]
    if rule == "EN 1990 6.10":
        uls = {"ULS": (factors.permanent, lead)}
    else:
        uls = {"ULS-a": (factors.permanent, behind), "ULS-b": (factors.reduction * factors.permanent, lead)}
    if any(action.kind == "wind" for action in order):
        uls["ULS-light"] = (factors.favourable, lead)
    sls = {
        "SLS": [1.0 if not k else action.psi[0] for k, action in enumerate(order)],
        "SLS-frequent": [action.psi[1 if not k else 2] for k, action in enumerate(order)],
        "SLS-quasi": [action.psi[2] for action in order],
    }
    for name, (weight, variable) in (uls | {name: (1.0, shares) for name, shares in sls.items()}).items():
        if variable and not variable[0]:  # a leading action with factor 0 adds no new combination
            continue
        acting = {action.case: factor for action, factor in zip(order, variable, strict=True) if factor}
        taken = dict.fromkeys(permanent, weight) | acting
        taken = {case: round(factor, 6) for case, factor in taken.items() if factor}
        if taken:
            cases_text = "-".join(acting) or "permanent"
            yield Combination(f"{name}-{cases_text}", taken, "ULS" if name.startswith("ULS") else "SLS")


def permanent_and_groups(
    loads: Sequence[Load], actions: Mapping[str, ActionKind], psi: Mapping[ActionKind, Psi]
) -> tuple[list[str], list[list[VariableCase | None]]]:
    """Return the permanent cases, and groups of variable cases of which at most one acts; None stands for no case.
    psi : values that replace those of the table, by kind of action."""
    permanent: list[str] = []
    groups: dict[str, list[VariableCase | None]] = {}
    for case in case_names(loads):
        kind = actions.get(case) or ACTION_OF_LOAD.get(_kind(loads, case))
        if kind == "permanent":
            permanent.append(case)
            continue
        if kind is None:
            groups[case] = [None, VariableCase(case, "", UNKNOWN)]
            continue
        group = kind.removesuffix(" high") if kind in ONE_AT_A_TIME else f"{kind} {case}"
        groups.setdefault(group, [None]).append(VariableCase(case, kind, psi.get(kind, PSI[kind])))
    return permanent, list(groups.values())


def _action_kinds(loads: Sequence[Load], actions: Mapping[str, ActionKind], case: str) -> set[ActionKind | None]:
    """Return the kinds of action of a case; None for a load that does not show its kind."""
    return {action_kind(load, actions) for load in loads if load.case == case}


def _kind(loads: Sequence[Load], case: str) -> str:
    return next(load.kind for load in loads if load.case == case)
