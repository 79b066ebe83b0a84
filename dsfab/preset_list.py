"""The presets that come with dsfab, and the tables of a TOML file before anything in them is checked.

To list them neither numpy nor pydantic is imported: `dsfab presets` takes a tenth of the time of a preset's own check.
"""

import tomllib
from pathlib import Path
from typing import Any

from dsfab.errors import PresetError

PRESETS = tuple(folder / "presets" for folder in Path(__file__).resolve().parents[:2])
"""Where the presets lie that come with dsfab: in a wheel in the package, in a checkout at the top level."""


def shipped_presets() -> dict[str, Path]:
    """The presets that come with dsfab: name -> file, in alphabetical order."""
    files = [file for folder in PRESETS for file in folder.glob("*.toml")]
    return {path.stem: path for path in sorted(files, key=lambda path: path.stem)}


def headline(path: Path) -> str:
    """The first sentence of a preset's description, without checking the preset."""
    return str(read_toml(path).get("description", "")).strip().split("\n")[0]


def read_toml(path: Path, kind: str = "preset") -> dict[str, Any]:
    """The tables of a TOML file, not checked yet; raises PresetError, which calls the file a `kind`."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise PresetError(f"{kind} {path.name} is not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise PresetError(f"{kind} {path.name} is not a text file; give a .toml {kind}") from None
    except OSError as error:
        raise PresetError(f"{kind} {path} cannot be read: {error.strerror}") from None
