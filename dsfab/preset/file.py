"""Presets as TOML files: search, reading, overrides and writing, with a message for each mistake."""

import copyreg
import re
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomli_w
from pydantic import ValidationError

from dsfab.core.errors import PresetError, did_you_mean
from dsfab.core.materials import KEYS
from dsfab.core.toml_files import TomlError, read_toml, shipped_presets, toml_table
from dsfab.preset.checks import drop_material_values, mistakes, own_values
from dsfab.preset.model import Preset
from dsfab.preset.surface_section import FileSurface, MeshSurface, OwnSurface, SurfaceSection, missing_preset

_LIST = re.compile(r"""\[\n((?: +(?:[^\s\[\]{},"]+|"(?:[^"\\\n]|\\.)*"),\n)+) *\]""")
"""Regular expression for a TOML list of numbers and words with one item per line."""


def load_preset(
    name_or_path: str | Path, overrides: Mapping[str, Any] | None = None, mesh: str | Path | None = None
) -> Preset:
    """Return the preset in a TOML file or a folder of `dsfab build`, or the shipped preset with a name such as "dome".
    overrides : new values by dotted key, e.g. {"pattern.major.frequency": 12}.
    mesh      : mesh file that replaces the preset's surface. The supports and loads do not change.
    Raises PresetError for files that cannot be read, unknown keys, wrong types and impossible values."""
    path = _find(name_or_path)
    values = read_toml(path)
    values.setdefault("name", path.stem)
    if mesh is not None:
        _replace_surface(values, Path(mesh).absolute())
    _override_all(values, overrides or {})
    _find_files(values, path.absolute().parent)
    return preset_from(values, f"preset {path.name}")


def _find_files(values: Any, folder: Path, key: str = "") -> None:
    for below, part in values.items() if isinstance(values, dict) else ():
        for entry in part if isinstance(part, list) else [part]:
            _find_files(entry, folder, below)
    names_file = isinstance(values, dict) and (key == "surface" or values.get("pick") == "curve")
    if names_file and isinstance(values.get("file"), str):
        values["file"] = str(folder / values["file"])


def with_overrides(preset: Preset, changes: Mapping[str, Any]) -> Preset:
    """Return a preset with new values at dotted keys. Raises PresetError for mistakes, or if `preset` is no Preset."""
    if not isinstance(preset, Preset):
        raise PresetError(missing_preset(preset))
    touched = {key.partition(".")[0] for key in changes}  # other sections need no checks
    values = preset.model_dump(mode="json", exclude_none=True, include=touched)
    _override_all(values, changes)
    unchanged = {name: getattr(preset, name) for name in Preset.model_fields if name not in touched}
    return preset_from({**unchanged, **values}, f"preset {preset.name}")


def preset_from(values: Mapping[str, Any], source: str = "preset") -> Preset:
    """Return a preset from nested tables; raises PresetError that lists every mistake with its key."""
    try:
        return Preset.model_validate(dict(values))
    except ValidationError as error:
        raise PresetError(f"{source}: {mistakes(error, Preset)}") from None


def parse_override(text: str) -> tuple[str, Any]:
    """Return key and value of a text such as 'pattern.major.frequency=12'. Raises PresetError without '='."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise PresetError(f"--set {text!r} is not KEY=VALUE; write for instance --set pattern.major.frequency=12")
    try:
        return key.strip(), toml_table(f"value = {value}")["value"]
    except TomlError:
        return key.strip(), value.strip()


def require_mesh(preset: Preset) -> None:
    """Raise PresetError, with a hint for the command line, if a shipped preset needs the user's mesh."""
    if isinstance(surface := preset.surface, FileSurface) and surface.waits:
        raise PresetError(
            f"preset {preset.name} needs your mesh: add --mesh FILE, and --unit mm if the file is in millimetres"
        )


def preset_toml(preset: Preset, for_people: bool = False) -> str:
    """Return the complete preset with all defaults as TOML, which builds the same design again.
    A material is written as its name. The material's values are written only if the preset changes these values.
    for_people : True to write only the numbers of vertices and triangles in place of a mesh from Python."""
    values = preset.model_dump(mode="json", exclude_none=True)
    if for_people and isinstance(mesh_section := preset.surface, MeshSurface):
        values["surface"]["mesh"] = f"Python mesh: {mesh_section.mesh.n} vertices, {mesh_section.mesh.m} triangles"
    if preset.statics.elastic:
        own_keys, statics = own_values(values["statics"]), values["statics"]
        values["statics"] = {key: value for key, value in statics.items() if key not in KEYS or key in own_keys}
    surface = values["surface"]
    for key in ("support", "load"):
        surface[key] = [{k: v for k, v in entry.items() if k != "name" or v} for entry in surface[key]]
    # write the keys of the shape before supports and loads
    values["surface"] = {**{k: v for k, v in surface.items() if k not in SurfaceSection.model_fields}, **surface}
    return short_lists(tomli_w.dumps(values))


def preset_from_toml(text: str) -> Preset:
    """Return the preset from a text that `preset_toml` has written."""
    return preset_from(toml_table(text))


def _read_only(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(values)


# pickle finds neither classes that dsfab makes at import, nor the type of a read-only mapping
copyreg.pickle(Preset, lambda preset: (preset_from_toml, (preset_toml(preset),)))
copyreg.pickle(MappingProxyType, lambda mapping: (_read_only, (dict(mapping),)))


def short_lists(text: str) -> str:
    """Return a TOML text with each short list on one line."""
    return _LIST.sub(_on_one_line, text)


def _on_one_line(match: re.Match[str]) -> str:
    short = f"[{' '.join(line.strip() for line in match[1].splitlines()).rstrip(',')}]"
    return short if len(short) <= 88 else match[0]


def _find(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.is_file():
        return path
    presets = shipped_presets()
    if str(name_or_path) in presets:
        return presets[str(name_or_path)]
    if path.is_dir() and (built := path / "preset.toml").is_file():
        return built
    if path.is_dir():
        raise PresetError(f"{path} is a folder; give a preset file or one of {', '.join(presets)}")
    raise PresetError(
        f"preset {str(name_or_path)!r} not found{did_you_mean(path.stem, presets)}; "
        f"give a .toml file or one of {', '.join(presets)}"
    )


def _replace_surface(values: dict[str, Any], mesh: Path) -> None:
    old_surface = values.get("surface", {})
    section = OwnSurface if "file" in old_surface else SurfaceSection  # a shape's edge length may not fit a new mesh
    new_surface = {key: old_surface[key] for key in (*section.model_fields, "unit") if key in old_surface}
    values["surface"] = {**new_surface, "file": str(mesh)}


def _override_all(values: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Set values at dotted keys. Remove old values in conflict with new values: a new spacing removes the frequency."""
    drop_material_values(values.get("statics"), changes)
    for key, value in changes.items():
        _override(values, key, deepcopy(value))  # a later key must not change the values in `changes`
    for family in ("pattern.major", "pattern.minor"):
        for key, excluded in (("frequency", "spacing"), ("spacing", "frequency")):
            if changes.get(f"{family}.{key}") and f"{family}.{excluded}" not in changes:
                _child(values["pattern"], family.partition(".")[2], family).pop(excluded, None)


def _override(values: dict[str, Any], key: str, value: Any) -> None:
    *parents, name = key.split(".")
    where: Any = values
    for part in parents:
        where = _child(where, part, key)
    if isinstance(where, list):
        where[_index(where, name, key)] = value
    elif isinstance(where, dict):
        where[name] = value
    else:
        raise PresetError(f"--set {key}: {'.'.join(parents)} holds a value and is not a section; check the key")


def _child(where: Any, part: str, key: str) -> Any:
    if isinstance(where, list):
        return where[_index(where, part, key)]
    if isinstance(where, dict):
        return where.setdefault(part, {})
    raise PresetError(f"--set {key}: the key before {part!r} holds a value and is not a section; check the key")


def _index(where: list[Any], part: str, key: str) -> int:
    if not (part.isdigit() and int(part) < len(where)):
        raise PresetError(
            f"--set {key}: {part!r} is not the number of an entry in this list; use 0 to {len(where) - 1}"
        )
    return int(part)
