"""The workspace of the editor: the open preset, the kept variants, and the output folder."""

import itertools
import re
import shlex
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dsfab.app.options import UNCHANGED, Source
from dsfab.core.errors import DsfabError, PresetError, SurfaceError
from dsfab.core.toml_files import TomlError, shipped_presets, toml_table
from dsfab.export import whole_or_nothing
from dsfab.preset.file import load_preset, overridden, preset_from, preset_toml
from dsfab.preset.model import Preset
from dsfab.preset.proposal import Decision, preset_name, propose
from dsfab.study.variations import spelled_value

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class Outputs:
    """Folders in `home`, one for each name; the page sends names only, so that nothing is written elsewhere.

    shown : name of `home` for the user and on a command line; '' for the session's temporary folder.
    """

    def __init__(self, home: Path, shown: str = "") -> None:
        self.home, self.shown = home, shown
        self._ours: set[Path] = set()

    def folder(self, name: str) -> Path:
        """Return the folder of a name. Raises DsfabError for an invalid name or one that leads elsewhere."""
        folder = self.home / name
        if not _PLAIN.fullmatch(name) or folder.resolve().parent != self.home.resolve():
            raise DsfabError(
                f"{name!r} is no name of a folder in {self.shown or 'the outputs'}; use letters and digits"
            )
        return folder

    def standing(self, name: str) -> int:
        """Return the number of files from an earlier run or another program in the folder of a name."""
        folder = self.folder(name)
        if folder in self._ours or not folder.exists():
            return 0
        return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 1

    def free(self, name: str) -> str:
        """Return the name, or the first of name-2, name-3 ... whose folder has no such files."""
        return next(word for word in _numbered(name) if not self.standing(word))

    def publish(self, made: Path, name: str) -> Path:
        """Move all files of a folder to that of the name, over files of the same names. Returns the folder.

        Raises DsfabError if it cannot be written.
        """
        folder = self.folder(name)
        with whole_or_nothing(folder) as partial:
            for path in made.iterdir():
                shutil.move(path, partial / path.name)
        self._ours.add(folder)
        return folder

    def keep(self, name: str, suffix: str, content: bytes) -> Path:
        """Write a file beside the folders: NAME.toml, or NAME-2.toml if another NAME.toml exists. Returns its path.

        Raises DsfabError if it cannot be written.
        """
        self.folder(name)
        paths = (self.home / f"{word}{suffix}" for word in _numbered(name))
        path = next(path for path in paths if path in self._ours or _holds(path, content))
        try:
            self.home.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        except OSError as error:
            raise DsfabError(f"cannot write {path}: {error.strerror}; free some space there") from None
        self._ours.add(path)
        return path


def _numbered(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name}-{number}" for number in itertools.count(2))


def _holds(path: Path, content: bytes) -> bool:
    """True if the file is missing or has this content."""
    return not path.exists() or (path.is_file() and path.read_bytes() == content)


MATERIAL = "statics.material"
"""Key that decides the thickness of a proposal."""


@dataclass(frozen=True)
class Opened:
    """A preset and its origin.

    words   : words between `dsfab build` and the changes; none for a preset that only the page has.
    mesh    : the user's name of a mesh from the page; its file here is a copy.
    decided : decisions of `dsfab new` for a mesh.
    """

    preset: Preset
    words: tuple[str, ...] = ()
    mesh: str = ""
    decided: tuple[Decision, ...] = ()

    def changed(self, changes: Mapping[str, Any]) -> Preset:
        """Return the preset with other values at dotted keys.

        Raises PresetError for impossible values, and for another file, because the page may name none on this machine.
        """
        preset = overridden(self.preset, changes)
        if _file(preset) != _file(self.preset):
            raise PresetError("surface.file cannot be changed from the page; drop the mesh on it, or dsfab edit MESH")
        if strange := _drawings(preset) - _drawings(self.preset):
            raise PresetError(f"{_names(strange)}: the page names no drawing; name it in a preset's file")
        return preset

    def toml(self, changes: Mapping[str, Any]) -> str:
        """Return the changed preset as a file; a mesh from the page has its original name."""
        preset = self.changed(changes)
        return preset_toml(with_file(preset, Path(self.mesh)) if self.page_mesh else preset)

    @property
    def page_mesh(self) -> Path | None:
        """The copy of a mesh from the page, which the session removes at its end."""
        return _file(self.preset) if self.mesh else None

    def command(self, changes: Mapping[str, Any]) -> tuple[str, bool]:
        """Return the command that builds it, and whether its preset has to be saved first."""
        preset = self.changed(changes)
        if self.words and self.decided and MATERIAL in changes:  # the command would choose another thickness for it
            changes = {"statics.thickness": preset.statics.thickness, **changes}
        sets = [word for key, value in changes.items() for word in ("--set", f"{key}={_spelled(value)}")]
        command = shlex.join(["dsfab", "build", *self.words, *sets])
        spelled = None not in changes.values()  # TOML has no null
        if self.words and spelled and len(command) <= 2000:
            return command, False
        return shlex.join(["dsfab", "build", f"{preset.name}.toml"]), True

    def reopened(self, text: str) -> "Opened":
        """Open a preset file from the page; its mesh can only be the open one.

        Raises PresetError as `load_preset` does, and for another mesh.
        """
        try:
            values = toml_table(text)
        except TomlError as error:
            raise PresetError(f"the preset is not valid TOML: {error}") from None
        surface, mesh = values.get("surface"), ""
        if isinstance(surface, dict) and "file" in surface:
            asked, here = str(surface["file"]), _file(self.preset)
            known = {str(here), self.mesh, here.name} if here else set()
            if asked not in known:
                raise PresetError(
                    f"the preset is for the mesh {Path(asked).name}: drop that mesh on the page first, then the preset"
                )
            surface["file"], mesh = str(here), self.mesh
        values.setdefault("name", "preset")
        preset = preset_from(values)
        if strange := _drawings(preset) - _drawings(self.preset):
            raise PresetError(f"the preset is for the drawing {_names(strange)}: open it with dsfab edit FILE.toml")
        return Opened(preset, (), mesh, self.decided if mesh else ())


def with_file(preset: Preset, file: Path) -> Preset:
    """Return the preset with its mesh in another file."""
    return preset.model_copy(update={"surface": preset.surface.model_copy(update={"file": file})})


def saved_preset(now: Opened, changes: Mapping[str, Any], outputs: Outputs) -> Path:
    """Save the changed preset among the outputs, with a mesh from the page beside it; return its path.

    Raises PresetError for impossible changes, DsfabError if it cannot be written.
    """
    preset = now.changed(changes)
    if mesh := now.page_mesh:
        beside = outputs.keep(preset.name, mesh.suffix, mesh.read_bytes())
        preset = with_file(preset, Path(beside.name))
    return outputs.keep(preset.name, ".toml", preset_toml(preset).encode())


def open_preset(target: str, source: Source = UNCHANGED) -> Opened:
    """Open a shipped preset by its name, or a preset file or a mesh file by its path, as `dsfab build` does.

    source : changes of the command line.
    Raises DsfabError for other targets, and for a preset without its mesh.
    """
    proposal = source.proposal(target)
    preset = source.read(target, proposal)
    return Opened(preset, tuple(source.words(target)), "", proposal.decisions if proposal else ())


def opened_shipped(name: str) -> Opened:
    """Open a shipped preset by its name. Raises PresetError for another name or a path."""
    if name not in shipped_presets():
        raise PresetError(f"there is no preset {name!r}; use one of {', '.join(shipped_presets())}")
    return Opened(load_preset(name), (name,))


@dataclass(frozen=True)
class MeshRequest:
    """A request to read a mesh from the page: its file here, the user's name for it, and its unit."""

    path: Path
    name: str
    unit: str | None = None


def opened_mesh(request: MeshRequest) -> Opened:
    """Open a mesh with the preset that `dsfab new` proposes for it.

    Raises SurfaceError for an unreadable file, with the user's name for it.
    """
    try:
        proposal = propose(request.path, request.unit)
    except DsfabError as error:
        raise SurfaceError(str(error).replace(str(request.path), request.name)) from None
    preset = proposal.preset.model_copy(update={"name": preset_name(request.name)})
    return Opened(preset, (), request.name, proposal.decisions)


def _spelled(value: Any) -> str:
    return spelled_value(value) if not isinstance(value, dict | list) else _inline(value)


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_inline(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    import json

    return json.dumps(value)


def _drawings(preset: Preset) -> set[Path]:
    listed = (*preset.surface.support, *preset.surface.load, *preset.pattern.guide, *preset.pattern.region)
    pickers = (getattr(thing, "at", None) for thing in (*listed, *preset.thickening.extra))
    return {file for at in pickers if (file := getattr(at, "file", None)) is not None}


def _names(files: set[Path]) -> str:
    return ", ".join(sorted(path.name for path in files))


def _file(preset: Preset) -> Path | None:
    return getattr(preset.surface, "file", None)


MOST = 48
"""Variants of one session, at most."""

LARGEST = 2 * 2**20
"""Characters of a picture, at most."""

FIGURES = ("share", "area", "mass", "pieces", "narrowest", "compliance")
"""Measures that a variant keeps (see `drafts.sheet_figures`)."""


@dataclass(frozen=True)
class KeptVariant:
    """An open preset, the user's changes, its picture, and its figures by name, None if not measured."""

    name: str
    opened: Opened
    changes: Mapping[str, Any]
    picture: str = ""
    figures: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def preset(self) -> Preset:
        """The changed preset of the variant."""
        return self.opened.changed(self.changes)


class VariantTray:
    """Variants by number, oldest first; the session drops them at its end."""

    def __init__(self) -> None:
        self._all: dict[int, KeptVariant] = {}
        self._numbers = itertools.count(1)

    def __getitem__(self, number: int) -> KeptVariant:
        """Raise DsfabError for an unknown number."""
        if number not in self._all:
            raise DsfabError("that variant is not kept any more")
        return self._all[number]

    def listed(self) -> list[dict[str, Any]]:
        """Return all variants for the page."""
        return [
            {"number": number, "name": one.name, "picture": one.picture, "figures": dict(one.figures)}
            for number, one in self._all.items()
        ]

    def keep(self, variant: KeptVariant) -> None:
        """Add a variant; its number becomes its name if it has none. Raises DsfabError for invalid or too many
        variants.
        """
        _ = variant.preset
        if len(self._all) >= MOST:
            raise DsfabError(f"{MOST} variants are kept already; remove one first")
        if variant.picture and not (variant.picture.startswith("data:image/") and len(variant.picture) <= LARGEST):
            raise DsfabError("the picture of the variant did not arrive whole; keep it again")
        number = next(self._numbers)
        figures = {name: variant.figures.get(name) for name in FIGURES}
        self._all[number] = replace(variant, name=_short(variant.name) or f"Variant {number}", figures=figures)

    def rename(self, number: int, name: str) -> None:
        """Change the name of a variant, unless the new one is empty. Raises DsfabError for an unknown number."""
        old = self[number]
        self._all[number] = replace(old, name=_short(name) or old.name)

    def drop(self, number: int) -> None:
        """Remove a variant. Raises DsfabError for an unknown number."""
        _ = self[number]
        del self._all[number]


def differences(one: Preset, other: Preset) -> list[tuple[str, Any, Any]]:
    """Return dotted keys with different values, and both values; ignores the name. Lists count as a whole."""
    a, b = (dict(_leaves(preset.model_dump(mode="json", exclude={"name", "description"}))) for preset in (one, other))
    return [(key, a.get(key), b.get(key)) for key in {**a, **b} if a.get(key) != b.get(key)]


def _leaves(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield above + key, value


def _short(name: str) -> str:
    return " ".join(name.split())[:60]
