"""The presets that come with dsfab, and the tables of a TOML file before anything in them is checked.

To list them neither numpy nor pydantic is imported: `dsfab presets` takes a tenth of the time of a preset's own check.
"""

import tomllib
from pathlib import Path
from typing import Any

from dsfab.core.errors import PresetError

PRESETS = tuple(folder / "presets" / kind for folder in Path(__file__).resolve().parents[1:3] for kind in ("", "paper"))
"""Where the presets lie that come with dsfab: in a wheel in the package, in a checkout at the top level. Those of the
paper's figures have a folder in it; a name finds either."""

DEEPEST = 50
"""Tables and lists in each other, several times what any preset or sweep has."""


def shipped_presets() -> dict[str, Path]:
    """The presets that come with dsfab: name -> file, in alphabetical order."""
    files = [file for folder in PRESETS for file in folder.glob("*.toml")]
    return {path.stem: path for path in sorted(files, key=lambda path: path.stem)}


def headline(path: Path) -> str:
    """The first sentence of a preset's description, without checking the preset."""
    return str(read_toml(path).get("description", "")).strip().split("\n")[0]


class TomlError(ValueError):
    """What is wrong with a text that should be TOML."""


def toml_table(text: str) -> dict[str, Any]:
    """What a text in TOML says; a byte order mark, as Windows writes it, is passed over.

    Raises TomlError, also for what Python's reader gives up on: brackets in thousands of others, endless numbers.
    """
    try:
        values = tomllib.loads(text.removeprefix("\ufeff"))
        if _depth_is_over(values, DEEPEST):
            raise RecursionError
        return values
    except tomllib.TOMLDecodeError as error:
        raise TomlError(str(error)) from None
    except RecursionError:
        raise TomlError("its values lie too deep in each other") from None
    except ValueError:
        raise TomlError("a number in it has too many digits") from None


def _depth_is_over(values: dict[str, Any], most: int) -> bool:
    """Whether tables and lists lie in more than so many others; by loops, for dotted keys go as deep as one likes."""
    level: list[Any] = [values]
    for _ in range(most):
        inside = [value for one in level for value in (one.values() if isinstance(one, dict) else one)]
        level = [value for value in inside if isinstance(value, dict | list)]
    return bool(level)


def read_toml(path: Path, kind: str = "preset") -> dict[str, Any]:
    """The tables of a TOML file, not checked yet; raises PresetError, which calls the file a `kind`."""
    try:
        return toml_table(path.read_text(encoding="utf-8"))
    except TomlError as error:
        raise PresetError(f"{kind} {path.name} is not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise PresetError(f"{kind} {path.name} is not a text file; give a .toml {kind}") from None
    except OSError as error:
        raise PresetError(f"{kind} {path} cannot be read: {error.strerror}") from None
