"""One sentence for every mistake in a preset: its key as in the file, the value, what is allowed, the nearest name."""

import dataclasses
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from dsfab.errors import did_you_mean
from dsfab.pattern import Guide
from dsfab.surface import SHAPES, Combination, Load, PatternRegion, Picker, Support
from dsfab.thickening import Extra


def _by_tag(union: Any, tag: str) -> dict[str, Any]:
    """The members of a discriminated union by the default of their tag field."""
    return {getattr(member, tag): member for member in get_args(get_args(union)[0])}


PICKERS = _by_tag(Picker, "pick")
KINDS = {"load": _by_tag(Load, "kind"), "extra": {extra.kind: extra for extra in get_args(Extra)}}
LISTED: dict[Any, Any] = {"support": Support, "combination": Combination, "guide": Guide, "region": PatternRegion}
LONGEST = 200
"""Characters of a value that are shown: lists and arrays go on and on."""


def mistakes(error: ValidationError, model: type[BaseModel]) -> str:
    """All mistakes that pydantic found in the values of a preset, or of one of its sections, each once."""
    return "; ".join(dict.fromkeys(_sentence(detail, model) for detail in error.errors()))


def _sentence(detail: ErrorDetails, model: type[BaseModel]) -> str:
    """One mistake as 'key = value: what is allowed'."""
    words, kind = _key(detail["loc"]), detail["type"]
    key = ".".join(words)
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        known = _known_beside(detail["loc"], model)
        return f"unknown key {key}{did_you_mean(words[-1], known)} (known here: {', '.join(known)})"
    if kind in ("missing", "missing_argument"):
        return f"{key} is missing"
    if kind.startswith("union_tag") or kind == "model_attributes_type":
        return _unknown_kind(key, detail)
    if kind == "value_error":  # keys that do not go together
        return f"{key}: {detail['ctx']['error']}" if key else str(detail["ctx"]["error"])
    hint = ""
    if kind == "literal_error":
        allowed = str(detail["ctx"]["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
        hint = did_you_mean(str(detail["input"]), allowed)
        if allowed == ["auto"]:
            hint = f" or a number{hint}"
    text = detail["msg"].removeprefix("Input ").replace("a valid tuple", "a list")
    return f"{key} = {_shown(detail['input'])}: {text[:1].lower()}{text[1:]}{hint}"


def _shown(value: Any) -> str:
    """A value on one line, as Python writes it."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _key(loc: tuple[int | str, ...]) -> list[str]:
    """The dotted key as it stands in the file: pydantic adds the tag of each choice (shape, kind of load, picker)."""
    return [str(part) for i, part in enumerate(loc) if not _is_tag(loc, i)]


def _is_tag(loc: tuple[int | str, ...], i: int) -> bool:
    if i >= 1 and loc[i - 1] in ("mode", "phase", "min_width") and loc[i] in ("number", "auto"):
        return True
    after_kind = i >= 2 and loc[i - 2] in KINDS and isinstance(loc[i - 1], int)
    return loc[:i] == ("surface",) or after_kind or (i >= 1 and loc[i - 1] == "at")


def _unknown_kind(key: str, detail: ErrorDetails) -> str:
    """A choice that does not exist: of shape, of picker, or of load."""
    given = detail["input"] if isinstance(detail["input"], dict) else {}
    if key == "surface":
        word, name, choices = given.get("shape"), "shape", [*SHAPES]
        other = ", or a file"
    else:
        kinds = KINDS["extra" if key.startswith("thickening.") else "load"]
        name, choices, other = ("pick", [*PICKERS], "") if key.endswith(".at") else ("kind", [*kinds], "")
        word = given.get(name)
    allowed = f"use one of {', '.join(choices)}{other}"
    if word is None:
        return f"{key} needs {name} = ...: {allowed}"
    return f"{key}.{name} = {word!r} is not known{did_you_mean(str(word), choices)}; {allowed}"


def _known_beside(loc: tuple[int | str, ...], model: Any) -> list[str]:
    """Keys that the section around an unknown key does know."""
    for i, part in enumerate(loc[:-1]):
        if _is_tag(loc, i):
            tags = PICKERS if loc[i - 1] == "at" else _tagged(model) if i == 1 else KINDS[str(loc[i - 2])]
            model = tags[str(part)]
        elif part in LISTED:
            model = LISTED[part]
        elif isinstance(field := getattr(model, "model_fields", {}).get(part), FieldInfo):
            model = field.annotation
    fields: Any = getattr(model, "model_fields", None) or [field.name for field in dataclasses.fields(model)]
    return list(fields)


def _tagged(union: Any) -> dict[str, Any]:
    """The members of a discriminated union by the tags that stand beside them."""
    return {get_args(member)[1].tag: get_args(member)[0] for member in get_args(union)}
