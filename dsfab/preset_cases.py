"""Which load cases a pattern follows, and what is wrong with the names of cases and combinations in a preset."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from dsfab.errors import did_you_mean
from dsfab.surface import Combination, Load
from dsfab.surface.cases import COMBINED, LimitState, case_names


def combines(loads: Sequence[Load], follow: str | None) -> bool:
    """Whether the pattern follows a sum of stress magnitudes rather than the stress of one case or combination."""
    return follow == COMBINED or (follow is None and len(case_names(loads)) > 1)


def follow_weights(
    loads: Sequence[Load], combinations: Sequence[Combination], follow: str | None, weights: Mapping[str, float]
) -> dict[str, float]:
    """What the pattern follows, as name -> weight: one name, or what is combined.

    Combined are the combinations, or the cases of a preset without combinations, each with its weight (1 when left
    out; those of weight 0 are left out).
    """
    cases = case_names(loads)
    if not combines(loads, follow):
        return dict.fromkeys([follow or cases[0]] if follow or cases else [], 1.0)
    return {name: weight for name in members(cases, combinations) if (weight := weights.get(name, 1.0))}


def members(cases: Sequence[str], combinations: Sequence[Combination]) -> list[str]:
    """The names that a combined pattern follows: the combinations, but those that are judged by their displacements
    alone where there are others; or the cases when there are none."""
    strong = [one.name for one in combinations if one.limit_state != "SLS"]
    return strong or [one.name for one in combinations] or list(cases)


def judged_names(names: Iterable[str], combinations: Sequence[Combination], state: LimitState) -> list[str]:
    """Those of the cases and combinations that are judged in a limit state: of it where there is any combination of
    it, else those of none, else all."""
    of = {one.name: one.limit_state for one in combinations}
    names = list(names)
    for wanted in (state, ""):
        if found := [name for name in names if of.get(name, "") == wanted]:
            return found
    return names


def case_mistakes(
    loads: Sequence[Load], combinations: Sequence[Combination], follow: str | None, weights: Mapping[str, float]
) -> Iterator[str]:
    """Every mistake in the names of cases, as 'key = value: what is allowed'."""
    cases = case_names(loads)
    if COMBINED in cases:
        yield f"surface.load.{[load.case for load in loads].index(COMBINED)}.case = '{COMBINED}': {_RESERVED}"
    yield from _combination_mistakes(cases, combinations)
    names = [*cases, *(combination.name for combination in combinations)]
    if follow is not None and follow not in (*names, COMBINED):
        yield f"diffusion.follow = {follow!r}: {_no_such('case or combination', follow, (*names, COMBINED))}"
    allowed = members(cases, combinations)
    for name, weight in weights.items():
        what = "combination" if combinations else "case"
        if name not in allowed:
            yield f"diffusion.weights.{name} = {weight:g}: {_no_such(what, name, allowed)}"
        elif weight < 0:
            yield f"diffusion.weights.{name} = {weight:g}: a weight must be 0 or more"
    if weights and not combines(loads, follow):
        yield f"diffusion.weights: they count only with diffusion.follow = '{COMBINED}'; set it or leave weights out"
    elif allowed and not any(weights.get(name, 1.0) for name in allowed):
        yield f"diffusion.weights: all are 0, so there is nothing to follow; give one of {', '.join(allowed)} a weight"


def _combination_mistakes(cases: Sequence[str], combinations: Sequence[Combination]) -> Iterator[str]:
    taken = set(cases)
    for i, combination in enumerate(combinations):
        key, name = f"surface.combination.{i}", combination.name
        if name == COMBINED:
            yield f"{key}.name = '{COMBINED}': {_RESERVED}"
        elif name in taken:
            yield f"{key}.name = {name!r}: a case or combination has this name already; choose another"
        taken.add(name)
        for case, factor in combination.factors.items():
            if case not in cases:
                yield f"{key}.factors.{case} = {factor:g}: {_no_such('case', case, cases)}"
        if not any(combination.factors.values()):
            yield f"{key}.factors: all are 0 or missing; give a factor to one of {', '.join(cases)}"


_RESERVED = "this name stands for all cases at once in diffusion.follow; choose another"


def _no_such(what: str, name: str, known: Iterable[str]) -> str:
    listed = ", ".join(known)
    return f"no {what} has this name{did_you_mean(name, known)} (there are: {listed})"
