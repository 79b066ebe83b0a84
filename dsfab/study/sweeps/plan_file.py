"""Sweep files: reading, writing, and one sentence for everything that is wrong."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from dsfab.errors import PresetError, did_you_mean
from dsfab.preset import Preset
from dsfab.preset_file import load_preset, require_mesh
from dsfab.preset_list import read_toml
from dsfab.study.sweeps.plan import Plan, Search
from dsfab.study.sweeps.values import Range


def load_plan(path: Path) -> Plan:
    """The plan of a sweep file, its paths starting at its folder; raises PresetError that lists every mistake."""
    return plan_from(read_plan(path), f"sweep {path.name}")


def read_plan(path: Path) -> dict[str, Any]:
    """The tables of a sweep file, its paths starting at its folder, not checked yet; raises PresetError."""
    return _from_folder(read_toml(path, "sweep"), path.absolute().parent)


def plan_from(values: Mapping[str, Any], source: str = "sweep") -> Plan:
    """A plan of nested tables; raises PresetError that lists every mistake with its key."""
    try:
        return Plan.model_validate(dict(values))
    except ValidationError as error:
        told = dict.fromkeys(_sentence(detail) for detail in error.errors())
        raise PresetError(f"{source}: {'; '.join(told)}") from None


def plan_toml(plan: Plan) -> str:
    """The complete plan, defaults included, as TOML.

    What is varied stays in its order, on which samples and numbers depend. The writer of TOML puts tables behind lists,
    so ranges are written in one line each.
    """
    values = plan.model_dump(mode="json", exclude_none=True, by_alias=True)
    vary = values.pop("vary")
    lines = [_line(key, value) for key, value in vary.items()]
    return "\n".join([tomli_w.dumps(values).rstrip(), "", "[vary]", *lines, ""])


def _line(key: str, value: Any) -> str:
    if isinstance(value, dict):
        inner = ", ".join(tomli_w.dumps({name: part}).strip() for name, part in value.items())
        return f"{tomli_w.dumps({key: 0}).partition(' = ')[0]} = {{ {inner} }}"
    return tomli_w.dumps({key: value}).rstrip()


def base_preset(plan: Plan) -> Preset:
    """What all runs of a plan start from; raises PresetError."""
    given = load_preset(plan.preset, plan.set, plan.mesh)
    if plan.mesh is None:
        require_mesh(given)
    return given


def _from_folder(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Relative files beside the sweep file, as paths that hold from anywhere."""
    for key in ("preset", "mesh"):
        given = values.get(key)
        if isinstance(given, str) and (folder / given).is_file():
            values[key] = str(folder / given)
    sampling = values.get("sampling")
    if isinstance(sampling, str) and sampling.startswith("csv:"):
        values["sampling"] = f"csv:{folder / sampling.removeprefix('csv:')}"
    return values


def _sentence(detail: ErrorDetails) -> str:
    """One mistake as 'key = value: what is allowed'."""
    words = [str(part) for part in detail["loc"] if part not in ("range", "list")]
    key, kind = ".".join(words) or "sweep", detail["type"]
    if kind == "extra_forbidden":
        models: dict[str, Any] = {"search": Search, "vary": Range}
        fields = models.get(words[0], Plan).model_fields if len(words) > 1 else Plan.model_fields
        known = [field.alias or name for name, field in fields.items()]
        return f"unknown key {key}{did_you_mean(words[-1], known)} (known here: {', '.join(known)})"
    if kind == "missing":
        return f"{key} is missing"
    if kind == "value_error":
        return f"{key}: {detail['ctx']['error']}" if words else str(detail["ctx"]["error"])
    if key == "sampling":
        return f"sampling = {detail['input']!r}: use grid, sobol:200, lhs:200 or csv:points.csv"
    if kind == "too_short":
        return f"{key} has no values; give at least one"
    text = detail["msg"].removeprefix("Input ")
    return f"{key} = {detail['input']!r}: {text[:1].lower()}{text[1:]}"
