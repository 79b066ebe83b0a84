"""TOML files as tables, and the list of the presets that come with dsfab.

The list imports neither numpy nor pydantic: `dsfab presets` takes a tenth of the time of checking one preset.
"""

import tomllib
from pathlib import Path
from typing import Any

from dsfab.core.errors import PresetError

PRESETS = tuple(folder / "presets" / kind for folder in Path(__file__).resolve().parents[1:3] for kind in ("", "paper"))
"""Folders of the shipped presets: in a wheel inside the package, in a checkout at the top level.

The presets of the paper's figures have their own folder. dsfab finds a preset by name in both folders.
"""


def shipped_presets() -> dict[str, Path]:
    """Return the files of the presets that come with dsfab, by name in alphabetical order."""
    files = [file for folder in PRESETS for file in folder.glob("*.toml")]
    return {path.stem: path for path in sorted(files, key=lambda path: path.stem)}


def preset_headline(path: Path) -> str:
    """Return the first line of a preset's description, without checking the preset."""
    return str(read_toml(path).get("description", "")).strip().split("\n")[0]


class TomlError(ValueError):
    """Error in a text that should be TOML."""


def toml_table(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text; the function ignores a byte order mark.
    Raises TomlError for invalid text, and for tables nested deeper than 50 levels, several times any preset's depth. It
    also does if Python's reader fails (thousands of brackets, endless numbers)."""
    try:
        values = tomllib.loads(text.removeprefix("\ufeff"))
        if _depth_is_over(values, 50):
            raise RecursionError
        return values
    except tomllib.TOMLDecodeError as error:
        raise TomlError(str(error)) from None
    except RecursionError:
        raise TomlError("its values lie too deep in each other") from None
    except ValueError:
        raise TomlError("a number in it has too many digits") from None


def _depth_is_over(values: dict[str, Any], limit: int) -> bool:
    """Return whether tables and lists are nested deeper than the limit. Loops do this, because dotted keys have no
    limit.
    """
    level: list[Any] = [values]
    for _ in range(limit):
        inside = [value for item in level for value in (item.values() if isinstance(item, dict) else item)]
        level = [value for value in inside if isinstance(value, dict | list)]
    return bool(level)


def read_toml(path: Path, kind: str = "preset") -> dict[str, Any]:
    """Return the unchecked tables of a TOML file; raises PresetError, whose message calls the file a `kind`."""
    try:
        return toml_table(path.read_text(encoding="utf-8"))
    except TomlError as error:
        raise PresetError(f"{kind} {path.name} is not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise PresetError(f"{kind} {path.name} is not a text file; give a .toml {kind}") from None
    except OSError as error:
        raise PresetError(f"{kind} {path} cannot be read: {error.strerror}") from None
