"""TOML files as tables, and the presets that come with dsfab.

This module imports neither numpy nor pydantic: `dsfab presets` must start fast."""

import tomllib
from pathlib import Path
from typing import Any

from dsfab.core.errors import PresetError

PRESETS = tuple(folder / "presets" / kind for folder in Path(__file__).resolve().parents[1:3] for kind in ("", "paper"))
"""Folders of the presets that come with dsfab: inside the package in a wheel, at the top level in a checkout.
Presets for the figures of the paper "Diffusion Structures" (2020) have their own folder."""


def shipped_presets() -> dict[str, Path]:
    """Return the files of the presets that come with dsfab, by name in alphabetical order."""
    files = [file for folder in PRESETS for file in folder.glob("*.toml")]
    return {path.stem: path for path in sorted(files, key=lambda path: path.stem)}


def preset_headline(path: Path) -> str:
    """Return the first line of a preset's description."""
    return str(read_toml(path).get("description", "")).strip().split("\n")[0]


class TomlError(ValueError):
    """Error in a TOML text."""


def toml_table(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text. Raises TomlError."""
    try:
        values = tomllib.loads(text.removeprefix("\ufeff"))
        if _depth_is_over(values, 50):
            raise RecursionError
        return values
    except tomllib.TOMLDecodeError as error:
        raise TomlError(str(error)) from None
    except RecursionError:
        raise TomlError("the tables are nested too deeply") from None
    except ValueError:
        raise TomlError("a number has too many digits") from None


def _depth_is_over(values: dict[str, Any], limit: int) -> bool:
    level: list[Any] = [values]  # a loop instead of recursion, because dotted keys may be very deep
    for _ in range(limit):
        inside = [value for item in level for value in (item.values() if isinstance(item, dict) else item)]
        level = [value for value in inside if isinstance(value, dict | list)]
    return bool(level)


def read_toml(path: Path, kind: str = "preset") -> dict[str, Any]:
    """Return the tables of a TOML file. Raises PresetError. kind : word for the file in error messages."""
    try:
        return toml_table(path.read_text(encoding="utf-8"))
    except TomlError as error:
        raise PresetError(f"{kind} {path.name} is not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise PresetError(f"{kind} {path.name} is not a text file; give a .toml {kind}") from None
    except OSError as error:
        raise PresetError(f"{kind} {path} cannot be read: {error.strerror}") from None
