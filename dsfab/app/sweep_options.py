"""Options of `dsfab sweep` as tables of a sweep file."""

from collections.abc import Sequence
from typing import Any

from dsfab.app.options import UNCHANGED, Source
from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.plan import number
from dsfab.study.variations import parse_variations

Tables = dict[str, Any]


def vary_tables(texts: Sequence[str]) -> tuple[Tables, list[Tables]]:
    """Return the tables [vary] and [[linked]] of a sweep file for texts of --vary. Raises DsfabError for a wrong form.

    KEY=LOW:HIGH:COUNT    COUNT evenly spaced values     KEY=LOW:HIGH:COUNT:log   values with equal ratios
    KEY=LOW:HIGH          a range for --sample; with :log at the end, a logarithmic range
    KEY=ONE,TWO,...       these values                   KEY,KEY=ONE,TWO,...;ONE,TWO,...   linked keys"""
    vary: Tables = {}
    linked: list[Tables] = []
    for text in texts:
        keys = [key.strip() for key in text.partition("=")[0].split(",")]
        values = text.partition("=")[2]
        if len(keys) > 1:
            linked.append(_linked_tables(text, keys, values))
            continue
        if keys[0] in vary:
            raise DsfabError(f"--vary {keys[0]} appears twice; give all values of the key at once")
        vary[keys[0]] = _span_table(text, values) if _is_span(values) else parse_variations([text])[keys[0]]
    return vary, linked


def _is_span(values: str) -> bool:
    return ":" in values and "," not in values and not values.lstrip().startswith(("{", "[", '"'))


def _span_table(text: str, values: str) -> Tables:
    words = [word.strip() for word in values.split(":")]
    log = words[-1] == "log"
    words = words[:-1] if log else words
    try:
        start, end = number(words[0]), number(words[1])
        count = {"count": int(words[2])} if len(words) == 3 else {}
        if len(words) > 3:
            raise ValueError(values)
    except (ValueError, IndexError):
        raise DsfabError(
            f"--vary {text!r} is not a range; write KEY=LOW:HIGH:COUNT such as 4:24:6, or KEY=LOW:HIGH with --sample; "
            "add :log at the end for values that grow by a constant ratio"
        ) from None
    return {"from": start, "to": end, **count, **({"log": True} if log else {})}


def _linked_tables(text: str, keys: list[str], values: str) -> Tables:
    rows = [parse_variations([f"{key}={listed}"])[key] for key, listed in zip(keys, values.split(";"), strict=False)]
    if len(values.split(";")) != len(keys):
        raise DsfabError(
            f"--vary {text!r} links {len(keys)} keys, so one list of values is needed for each key; write for instance "
            "pattern.major.mode,pattern.minor.mode=1,2;5,3"
        )
    return dict(zip(keys, rows, strict=True))


def listed_words(texts: Sequence[str]) -> list[str]:
    """Return all words of texts that are separated by commas: ('a,b', 'c') gives a, b, c."""
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def with_options(
    values: Tables, source: Source = UNCHANGED, vary: Sequence[str] = (), plan_table: Tables | None = None
) -> Tables:
    """Return the tables `values` of a sweep file, with changes by the options of the command line.
    vary : texts of --vary.    plan_table : result of `PlanOptions.tables`."""
    result = dict(values)
    vary_table, linked = vary_tables(vary)
    if vary_table:
        result["vary"] = {**result.get("vary", {}), **vary_table}
    if linked:
        result["linked"] = [*result.get("linked", []), *linked]
    if changes := source.overrides():
        result["set"] = {**result.get("set", {}), **changes}
    if source.mesh is not None:
        result["mesh"] = str(source.mesh)
    result.update({key: value for key, value in (plan_table or {}).items() if value not in (None, [])})
    return result
