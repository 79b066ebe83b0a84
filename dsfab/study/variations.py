"""Values of the command line option `--vary`, and order of the runs with these values."""

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import isfinite, prod
from typing import Any

from dsfab.core.errors import DsfabError
from dsfab.preset.file import parse_override
from dsfab.preset.model import STAGES

Values = Mapping[str, Sequence[Any]]


def parse_variations(texts: Sequence[str]) -> Values:
    """Return the list of values for each key from texts `KEY=LOW:HIGH:COUNT` or `KEY=ONE,TWO,...`.
    A range includes LOW and HIGH. Raises DsfabError for other texts, empty ranges, and repeated values or keys."""
    variations = dict[str, list[Any]]()
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        if not (key and equals and values):
            raise DsfabError(
                f"--vary {text!r} is not KEY=VALUES; write a range (from, to, count) such as "
                "pattern.major.frequency=4:24:6, or a list such as diffusion.r=1,10,100"
            )
        if key in variations:
            raise DsfabError(f"--vary {key} appears twice; give all values of the key at once")
        variations[key] = _range(text, values) if ":" in values else _parsed_list(text, key, values)
    return variations


def _range(text: str, values: str) -> list[Any]:
    try:
        low, high, count = values.split(":")
        start, end, steps = float(low), float(high), int(count)
    except ValueError:
        raise DsfabError(f"--vary {text!r} is not a range; write KEY=LOW:HIGH:COUNT (diffusion.r=10:100:4)") from None
    if not (isfinite(start) and isfinite(end)):
        raise DsfabError(f"--vary {text!r} needs two finite numbers as its limits; write for instance 4:24:6")
    if steps < 1:
        raise DsfabError(f"--vary {text!r} has {steps} values; give a count (the last number) of 1 or more")
    if steps > 1 and start == end:
        raise DsfabError(f"--vary {text!r} gives the same value {steps} times; write another range, or only {low}")
    places = [start + (end - start) * i / max(steps - 1, 1) for i in range(steps)]
    rounded = [float(f"{place:.4g}") for place in places]
    is_whole = "." not in low + high and "e" not in (low + high).lower()
    return [int(x) if is_whole and x.is_integer() else x for x in rounded]


def _parsed_list(text: str, key: str, values: str) -> list[Any]:
    words = [word.strip() for word in values.split(",")]
    if not all(words):
        raise DsfabError(f"--vary {text!r} has an empty value; write for instance diffusion.r=1,10,100")
    parsed = [parse_override(f"{key}={word}")[1] for word in words]
    if len({str(value) for value in parsed}) < len(parsed):
        raise DsfabError(f"--vary {text!r} lists a value twice; give each value once")
    return parsed


def count(values: Values) -> int:
    return prod(len(listed) for listed in values.values())


def combinations(values: Values) -> Iterator[dict[str, Any]]:
    """Yield every combination of the values, as a dict from keys to values. The last key changes fastest."""
    return (dict(zip(values, chosen, strict=True)) for chosen in product(*values.values()))


def stage_of(key: str) -> int:
    """Return the index of the design stage that uses a preset key; the number of stages for a key without a stage."""
    section = key.split(".")[0]
    return STAGES.index(section) if section in STAGES else len(STAGES)


def signature(changes: Mapping[str, Any]) -> tuple[str, ...]:
    """Return, for each stage of a design, a text with this stage's values in `changes` (dotted preset keys)."""
    by_stage: dict[str, dict[str, Any]] = {stage: {} for stage in STAGES}
    for key, value in changes.items():
        section = key.split(".")[0]
        if section in by_stage:
            by_stage[section][key] = value
    return tuple(json.dumps(values, sort_keys=True, default=str) for values in by_stage.values())


def stage_order(runs: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return the indices of the runs, sorted so that a run can reuse the first stages of the run before it.
    runs : changed values of the preset, by dotted key."""
    signatures = [signature(changes) for changes in runs]
    places: list[dict[str, int]] = [{} for _ in STAGES]
    for texts in signatures:
        for place, text in zip(places, texts, strict=True):
            place.setdefault(text, len(place))
    ranks = [[place[text] for place, text in zip(places, texts, strict=True)] for texts in signatures]
    return sorted(range(len(runs)), key=ranks.__getitem__)


def expected_seconds(values: Values, stages: Mapping[str, float], picture: float) -> float:
    """Return the expected time (s) to compute and draw all combinations of the values.
    values : list of values for each key.    stages : time of each stage of a design, s.    picture : drawing time."""
    total = picture * count(values)
    for stage, seconds in stages.items():
        # a stage runs once for each combination of the values of all keys up to this stage
        total += seconds * prod(len(v) for key, v in values.items() if stage_of(key) <= STAGES.index(stage))
    return total


def spelled_value(value: Any) -> str:
    """Return a preset value as a text for the command line."""
    if isinstance(value, str) and value.replace("_", "").isalpha() and value not in ("true", "false", "inf", "nan"):
        return value
    return json.dumps(value)


def short_names(keys: Sequence[str]) -> dict[str, str]:
    """Return a short name for each dotted key: the shortest ending that no other key has, such as major.frequency."""
    names = {}
    for key in keys:
        words = key.split(".")
        endings = (".".join(words[i:]) for i in reversed(range(len(words))))
        others = [f".{other}" for other in keys if other != key]
        names[key] = next(
            end for end in endings if not any(other.endswith(f".{end}") for other in others) or end == key
        )
    return names
