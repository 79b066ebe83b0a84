"""Checks of the keys and values of a preset."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from dsfab.core.errors import PresetError, did_you_mean
from dsfab.core.materials import KEYS, MATERIALS, NO_STRENGTH, material_named
from dsfab.pattern import Guide
from dsfab.surface import SHAPES, Combination, Load, PatternRegion, Picker, Support
from dsfab.surface.loads.combinations import COMBINED, LimitState, case_names
from dsfab.thickening import Extra


def _by_tag(union: Any, tag: str) -> dict[str, Any]:
    return {getattr(member, tag): member for member in get_args(get_args(union)[0])}


PICKERS = _by_tag(Picker, "pick")
KINDS = {"load": _by_tag(Load, "kind"), "extra": {extra.kind: extra for extra in get_args(Extra)}}
LISTED: dict[Any, Any] = {"support": Support, "combination": Combination, "guide": Guide, "region": PatternRegion}


def mistakes(error: ValidationError, model: type[BaseModel]) -> str:
    """Return all mistakes in a preset or a section as sentences."""
    return "; ".join(dict.fromkeys(_sentence(detail, model) for detail in error.errors()))


def _sentence(detail: ErrorDetails, model: type[BaseModel]) -> str:
    words, kind = _key(detail["loc"]), detail["type"]
    key = ".".join(words)
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        known_keys = _known_beside(detail["loc"], model)
        return f"unknown key {key}{did_you_mean(words[-1], known_keys)} (known here: {', '.join(known_keys)})"
    if kind in ("missing", "missing_argument"):
        return f"{key} is missing"
    if kind.startswith("union_tag") or kind == "model_attributes_type":
        return _unknown_kind(key, detail)
    if kind == "value_error":
        return f"{key}: {detail['ctx']['error']}" if key else str(detail["ctx"]["error"])
    hint = ""
    if kind == "literal_error":
        allowed = str(detail["ctx"]["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
        hint = did_you_mean(str(detail["input"]), allowed)
        if allowed == ["auto"]:
            hint = f" or a number{hint}"
    if kind == "string_pattern_mismatch" and ".-]" in detail["ctx"]["pattern"]:  # the value must be a name
        letters = "letters a to z, digits" if "A-Z" in detail["ctx"]["pattern"] else "letters, digits, spaces"
        return f"{key} = {_short_repr(detail['input'])}: use {letters} and the marks _ . - after a letter or digit"
    text = detail["msg"].removeprefix("Input ").replace("a valid tuple", "a list")
    return f"{key} = {_short_repr(detail['input'])}: {text[:1].lower()}{text[1:]}{hint}"


def _short_repr(value: Any) -> str:
    text = " ".join(repr(value).split())
    limit = 200
    return text if len(text) <= limit else f"{text[:limit]}..."


def _key(loc: tuple[int | str, ...]) -> list[str]:
    return [str(part) for i, part in enumerate(loc) if not _is_tag(loc, i)]


def _is_tag(loc: tuple[int | str, ...], i: int) -> bool:
    if i >= 1 and loc[i - 1] in ("mode", "phase", "min_width") and loc[i] in ("number", "auto"):
        return True
    after_kind = i >= 2 and loc[i - 2] in KINDS and isinstance(loc[i - 1], int)
    return loc[:i] == ("surface",) or after_kind or (i >= 1 and loc[i - 1] == "at")


def _unknown_kind(key: str, detail: ErrorDetails) -> str:
    table = detail["input"] if isinstance(detail["input"], dict) else {}
    if key == "surface":
        word, name, choices = table.get("shape"), "shape", [*SHAPES]
        alternative = ", or a file"
    else:
        kinds = KINDS["extra" if key.startswith("thickening.") else "load"]
        name, choices, alternative = ("pick", [*PICKERS], "") if key.endswith(".at") else ("kind", [*kinds], "")
        word = table.get(name)
    allowed = f"use one of {', '.join(choices)}{alternative}"
    if word is None:
        return f"{key} needs {name} = ...: {allowed}"
    return f"{key}.{name} = {word!r} is not known{did_you_mean(str(word), choices)}; {allowed}"


def _known_beside(loc: tuple[int | str, ...], model: Any) -> list[str]:
    for i, part in enumerate(loc[:-1]):
        if _is_tag(loc, i):
            tags = PICKERS if loc[i - 1] == "at" else _by_stated_tag(model) if i == 1 else KINDS[str(loc[i - 2])]
            model = tags[str(part)]
        elif part in LISTED:
            model = LISTED[part]
        elif isinstance(field := getattr(model, "model_fields", {}).get(part), FieldInfo):
            model = field.annotation
    if dataclasses.is_dataclass(model):
        return [field.name for field in dataclasses.fields(model)]
    return list(getattr(model, "model_fields", ()))  # a table of unknown kind has no known keys


def _by_stated_tag(union: Any) -> dict[str, Any]:
    return {get_args(member)[1].tag: get_args(member)[0] for member in get_args(union)}


def combines(loads: Sequence[Load], follow: str | None) -> bool:
    """Return True if the pattern follows the summed stresses of several cases."""
    return follow == COMBINED or (follow is None and len(case_names(loads)) > 1)


def follow_weights(
    loads: Sequence[Load], combinations: Sequence[Combination], follow: str | None, weights: Mapping[str, float]
) -> dict[str, float]:
    """Return, by name, the weight of each case or combination with a stress that the pattern follows."""
    cases = case_names(loads)
    if not combines(loads, follow):
        return dict.fromkeys([follow or cases[0]] if follow or cases else [], 1.0)
    return {name: weight for name in combined_names(cases, combinations) if (weight := weights.get(name, 1.0))}


def combined_names(cases: Sequence[str], combinations: Sequence[Combination]) -> list[str]:
    """Return the names of all cases or combinations with a stress that is added for a combined pattern."""
    strong = [combination.name for combination in combinations if combination.limit_state != "SLS"]
    return strong or [combination.name for combination in combinations] or list(cases)


def judged_names(names: Iterable[str], combinations: Sequence[Combination], state: LimitState) -> list[str]:
    """Return the names of the cases and combinations to check for a limit state."""
    state_of = {combination.name: combination.limit_state for combination in combinations}
    names = list(names)
    for limit_state in (state, ""):
        if chosen := [name for name in names if state_of.get(name, "") == limit_state]:
            return chosen
    return names


def case_mistakes(
    loads: Sequence[Load], combinations: Sequence[Combination], follow: str | None, weights: Mapping[str, float]
) -> Iterator[str]:
    """Yield an error message for each wrong name of a case or combination, and for each wrong weight."""
    cases = case_names(loads)
    if COMBINED in cases:
        yield f"surface.load.{[load.case for load in loads].index(COMBINED)}.case = '{COMBINED}': {_RESERVED}"
    yield from _combination_mistakes(cases, combinations)
    names = [*cases, *(combination.name for combination in combinations)]
    if follow is not None and follow not in (*names, COMBINED):
        yield f"diffusion.follow = {follow!r}: {_no_such('case or combination', follow, (*names, COMBINED))}"
    allowed = combined_names(cases, combinations)
    for name, weight in weights.items():
        what = "combination" if combinations else "case"
        if name not in allowed:
            yield f"diffusion.weights.{name} = {weight:g}: {_no_such(what, name, allowed)}"
        elif weight < 0:
            yield f"diffusion.weights.{name} = {weight:g}: a weight must be 0 or more"
    if weights and not combines(loads, follow):
        (
            yield f"diffusion.weights: weights have an effect only with diffusion.follow = '{COMBINED}'; set "
            f"diffusion.follow, or remove the weights"
        )
    elif allowed and not any(weights.get(name, 1.0) for name in allowed):
        yield f"diffusion.weights: all weights are 0; give a larger weight to one of {', '.join(allowed)}"


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
            yield f"{key}.factors: all factors are 0 or missing; give a factor to one of {', '.join(cases)}"


_RESERVED = "diffusion.follow uses the name 'combined' for the sum of all cases; choose another name"


def _no_such(what: str, name: str, existing: Iterable[str]) -> str:
    listed = ", ".join(existing)
    return f"no {what} has this name{did_you_mean(name, existing)} (there are: {listed})"


SOFTEST, LIGHTEST, WEAKEST = 1e6, 10.0, 1e3
"""Smallest accepted modulus (Pa), density (kg/m3) and strength (Pa) of a material."""


def with_material(values: Any) -> Any:
    """Return the table [statics]. Missing keys get the values of the material that the table names."""
    name = values.get("material") if isinstance(values, Mapping) else None
    if not isinstance(name, str):
        return values
    try:
        return {**material_named(name).values, **values}
    except PresetError:  # `known_name` reports the name with all other mistakes
        return values


def known_name(name: str | None) -> str | None:
    """Return a material's name in the usual spelling; raises ValueError for an unknown name."""
    try:
        return None if name is None else material_named(name).name
    except PresetError as error:
        raise ValueError(str(error)) from None


def own_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return, by key, the values in a table [statics] that differ from the values of its material."""
    material_values = MATERIALS[values["material"]].values if values.get("material") else {}
    return {key: values[key] for key in KEYS if values[key] != material_values.get(key)}


def drop_material_values(values: Any, changes: Mapping[str, Any]) -> None:
    """Remove the old material's values from the table [statics], in place, if `changes` set another material."""
    if "statics.material" in changes and isinstance(values, dict):
        for key in KEYS:
            if f"statics.{key}" not in changes:
                values.pop(key, None)


AUTO_THICKNESS = float("inf")  # Stands for `statics.thickness = "auto"`: sizing chooses the thickness.


def thickness_or_auto(value: Any, check: Callable[[Any], float]) -> float:
    """Return a thickness (m), or `AUTO_THICKNESS` for "auto"; raises ValueError for any other text."""
    if isinstance(value, str) and value.strip().lower() == "auto":
        return AUTO_THICKNESS
    try:
        return check(value)
    except ValidationError as error:
        if isinstance(value, str):
            raise ValueError(f"{value!r} is neither a number of metres nor auto") from error
        raise


def auto_or_metres(thickness: float) -> float | str:
    """Return a thickness (m) for preset files: a number, or "auto"."""
    return "auto" if thickness == AUTO_THICKNESS else thickness


def modulus(value: float) -> float:
    """Return the modulus (Pa). Raises ValueError if the value is too small."""
    if 0 < value < 1000:
        raise ValueError(f"{value:g} Pa is too small for a stiffness; write {value:g}e9 for {value:g} GPa")
    if 0 < value < SOFTEST:
        raise ValueError(f"{value:g} Pa is too small for a stiffness; write {value:g}e6 for {value:g} MPa")
    return value


def specific_mass(value: float) -> float:
    """Return the density (kg/m3), 0 for no weight. Raises ValueError if the value is too small."""
    if 0 < value < LIGHTEST:
        raise ValueError(
            f"{value:g} kg/m3 is too little for a solid; write {1000 * value:g} if you mean {value:g} t/m3"
        )
    return value


def resistance(value: float) -> float:
    """Return the strength (Pa), 0 if unknown. Raises ValueError if the value is too small."""
    if 0 < value < WEAKEST:
        raise ValueError(f"{value:g} Pa is too small for a strength; write {value:g}e6 for {value:g} MPa")
    return value


def require_strength(material: str | None, strength: float) -> None:
    """Raise PresetError if there is neither a material nor a strength."""
    if not material and not strength:
        raise PresetError(NO_STRENGTH)
