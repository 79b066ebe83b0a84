"""The editor's open preset, variants and output folder."""

import itertools
import json
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
from dsfab.export import atomic_folder
from dsfab.preset.file import load_preset, preset_from, preset_toml, with_overrides
from dsfab.preset.model import Preset
from dsfab.preset.proposal import Decision, preset_name, propose
from dsfab.study.sizing import guessed_preset
from dsfab.study.variations import spelled_value

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class Outputs:
    """The folder `home`, with a subfolder for each build. label : name of `home` in messages; '' if temporary."""

    def __init__(self, home: Path, shown: str = "") -> None:
        self.home, self.label = home, shown
        self._ours: set[Path] = set()

    def folder(self, name: str) -> Path:
        """Return the path of the subfolder `name`. Raises DsfabError for an invalid name."""
        folder = self.home / name
        if not _PLAIN.fullmatch(name) or folder.resolve().parent != self.home.resolve():
            raise DsfabError(
                f"{name!r} is not a valid name of a folder in {self.label or 'the outputs'}; use letters and digits"
            )
        return folder

    def foreign_files(self, name: str) -> int:
        """Return the number of files in subfolder `name`; 0 if this session has written the subfolder."""
        folder = self.folder(name)
        if folder in self._ours or not folder.exists():
            return 0
        return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 1

    def free_name(self, name: str) -> str:
        """Return the first of NAME, NAME-2, NAME-3 ... whose subfolder has no `foreign_files`."""
        return next(word for word in _numbered_names(name) if not self.foreign_files(word))

    def publish(self, files: Path, name: str) -> Path:
        """Move all files in the folder `files` to the subfolder `name`; return the subfolder. Raises DsfabError."""
        folder = self.folder(name)
        with atomic_folder(folder) as partial:
            for path in files.iterdir():
                shutil.move(path, partial / path.name)
        self._ours.add(folder)
        return folder

    def write_file(self, name: str, suffix: str, content: bytes) -> Path:
        """Write a file into `home` and return the path. Raises DsfabError.
        An older file of another session with different content stays; the new file is then NAME-2, NAME-3 ..."""
        self.folder(name)
        paths = (self.home / f"{word}{suffix}" for word in _numbered_names(name))
        path = next(path for path in paths if path in self._ours or _may_write(path, content))
        try:
            self.home.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        except OSError as error:
            raise DsfabError(f"cannot write {path}: {error.strerror}; free some space on that disk") from None
        self._ours.add(path)
        return path


def _numbered_names(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name}-{number}" for number in itertools.count(2))


def _may_write(path: Path, content: bytes) -> bool:
    return not path.exists() or (path.is_file() and path.read_bytes() == content)


MATERIAL = "statics.material"  # Key whose value decides the thickness in a proposal.


@dataclass(frozen=True)
class OpenedPreset:
    """A preset and its origin. decided : decisions of dsfab when it proposed the preset for a mesh.
    words : arguments of `dsfab build` for this preset; empty for a preset from the browser.
    mesh  : name of the mesh file that the user dropped on the page; '' without a file."""

    preset: Preset
    words: tuple[str, ...] = ()
    mesh: str = ""
    decided: tuple[Decision, ...] = ()

    def preset_with(self, changes: Mapping[str, Any]) -> Preset:
        """Return the preset with new values, by dotted key. Raises PresetError for an invalid change."""
        preset = with_overrides(self.preset, changes)
        if _mesh_file(preset) != _mesh_file(self.preset):  # the page must not choose files on this machine
            raise PresetError(
                "the page cannot change surface.file; drop the mesh file on the page, or run dsfab edit MESH"
            )
        if unknown_drawings := _drawing_files(preset) - _drawing_files(self.preset):
            raise PresetError(
                f"the page cannot add the drawing {_file_names(unknown_drawings)}; name the drawing in a preset file"
            )
        return preset

    def toml(self, changes: Mapping[str, Any]) -> str:
        """Return the changed preset as TOML."""
        preset = self.preset_with(changes)
        return preset_toml(with_file(preset, Path(self.mesh)) if self.page_mesh else preset)

    @property
    def page_mesh(self) -> Path | None:
        """The session's copy of a mesh file that the user dropped on the page, or None."""
        return _mesh_file(self.preset) if self.mesh else None

    def command(self, changes: Mapping[str, Any]) -> tuple[str, bool]:
        """Return a command line that builds the changed preset, and True if the command needs the file NAME.toml."""
        preset = self.preset_with(changes)
        if self.words and self.decided and MATERIAL in changes:  # otherwise `dsfab build` would propose a new thickness
            changes = {"statics.thickness": preset.statics.thickness, **changes}
        sets = [word for key, value in changes.items() for word in ("--set", f"{key}={_value_text(value)}")]
        command = shlex.join(["dsfab", "build", *self.words, *sets])
        has_values = None not in changes.values()  # TOML has no null
        if self.words and has_values and len(command) <= 2000:
            return command, False
        return shlex.join(["dsfab", "build", f"{preset.name}.toml"]), True

    def open_toml(self, text: str) -> "OpenedPreset":
        """Open a preset from the text of a TOML file. Raises PresetError for an invalid text."""
        try:
            values = toml_table(text)
        except TomlError as error:
            raise PresetError(f"the preset is not valid TOML: {error}") from None
        surface, mesh = values.get("surface"), ""
        if isinstance(surface, dict) and "file" in surface:
            file_named, open_mesh = str(surface["file"]), _mesh_file(self.preset)
            known_names = {str(open_mesh), self.mesh, open_mesh.name} if open_mesh else set()
            if file_named not in known_names:
                raise PresetError(
                    f"the preset needs the mesh file {Path(file_named).name}; drop it on the page, then the preset"
                )
            surface["file"], mesh = str(open_mesh), self.mesh
        values.setdefault("name", "preset")
        preset = guessed_preset(preset_from(values))
        if unknown_drawings := _drawing_files(preset) - _drawing_files(self.preset):
            raise PresetError(
                f"the preset needs the drawing {_file_names(unknown_drawings)}; open the preset by dsfab edit FILE.toml"
            )
        return OpenedPreset(preset, (), mesh, self.decided if mesh else ())


def with_file(preset: Preset, file: Path) -> Preset:
    """Return the preset with the path of another mesh file."""
    return preset.model_copy(update={"surface": preset.surface.model_copy(update={"file": file})})


def saved_preset(opened: OpenedPreset, changes: Mapping[str, Any], outputs: Outputs) -> Path:
    """Save the changed preset with its mesh file; return the preset's path. Raises DsfabError."""
    preset = opened.preset_with(changes)
    if mesh := opened.page_mesh:
        preset = with_file(preset, Path(outputs.write_file(preset.name, mesh.suffix, mesh.read_bytes()).name))
    return outputs.write_file(preset.name, ".toml", preset_toml(preset).encode())


def open_preset(target: str, source: Source = UNCHANGED) -> OpenedPreset:
    """Open a shipped preset, a preset file or a mesh file. Raises DsfabError if this fails. target : name or path.
    source : changes from the command line."""
    proposal = source.proposal(target)
    preset = source.read_preset(target, proposal, "guessed")
    return OpenedPreset(preset, tuple(source.command_words(target)), "", proposal.decisions if proposal else ())


def opened_shipped(name: str) -> OpenedPreset:
    """Open a shipped preset by its name. Raises PresetError."""
    if name not in shipped_presets():
        raise PresetError(f"there is no preset {name!r}; use one of {', '.join(shipped_presets())}")
    return OpenedPreset(load_preset(name), (name,))


@dataclass(frozen=True)
class MeshRequest:
    """A request to open the mesh `path`. name : file name in messages.    unit : unit of the file; None if unknown."""

    path: Path
    name: str
    unit: str | None = None


def opened_mesh(request: MeshRequest) -> OpenedPreset:
    """Open a mesh with the preset that `dsfab new` proposes. Raises SurfaceError."""
    try:
        proposal = propose(request.path, request.unit)
    except DsfabError as error:
        raise SurfaceError(str(error).replace(str(request.path), request.name)) from None
    preset = guessed_preset(proposal.preset).model_copy(update={"name": preset_name(request.name)})
    return OpenedPreset(preset, (), request.name, proposal.decisions)


def _value_text(value: Any) -> str:
    return spelled_value(value) if not isinstance(value, dict | list) else _inline_toml(value)


def _inline_toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_inline_toml(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline_toml, value)) + "]"
    return json.dumps(value)


def _drawing_files(preset: Preset) -> set[Path]:
    listed = (*preset.surface.support, *preset.surface.load, *preset.pattern.guide, *preset.pattern.region)
    pickers = (getattr(thing, "at", None) for thing in (*listed, *preset.thickening.extra))
    return {file for picker in pickers if (file := getattr(picker, "file", None)) is not None}


def _file_names(files: set[Path]) -> str:
    return ", ".join(sorted(path.name for path in files))


def _mesh_file(preset: Preset) -> Path | None:
    return getattr(preset.surface, "file", None)


MAX_VARIANTS = 48  # Largest number of variants in a session.
LARGEST = 2 * 2**20  # Largest number of characters in the data URL of a picture.
FIGURES = ("share", "area", "mass", "pieces", "narrowest", "compliance")  # Measures of a variant.


@dataclass(frozen=True)
class KeptVariant:
    """A variant: a preset, changes by dotted key, a picture (data URL), and measures by name (None if unknown)."""

    name: str
    opened: OpenedPreset
    changes: Mapping[str, Any]
    picture: str = ""
    figures: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def preset(self) -> Preset:
        """The changed preset of the variant."""
        return self.opened.preset_with(self.changes)


class VariantTray:
    """The variants that the user keeps, by number."""

    def __init__(self) -> None:
        self._all: dict[int, KeptVariant] = {}
        self._numbers = itertools.count(1)

    def __getitem__(self, number: int) -> KeptVariant:
        if number not in self._all:
            raise DsfabError(f"variant {number} does not exist any more; reload the page")
        return self._all[number]

    def records(self) -> list[dict[str, Any]]:
        """Return number, name, picture and measures of each variant."""
        return [
            {"number": number, "name": variant.name, "picture": variant.picture, "figures": dict(variant.figures)}
            for number, variant in self._all.items()
        ]

    def keep(self, variant: KeptVariant) -> None:
        """Add a variant. Raises DsfabError for too many variants, an invalid picture or invalid changes."""
        _ = variant.preset
        if len(self._all) >= MAX_VARIANTS:
            raise DsfabError(f"the editor already holds {MAX_VARIANTS} variants; remove a variant first")
        if variant.picture and not (variant.picture.startswith("data:image/") and len(variant.picture) <= LARGEST):
            raise DsfabError("the picture of the variant did not arrive completely; keep the variant again")
        number = next(self._numbers)
        figures = {name: variant.figures.get(name) for name in FIGURES}
        self._all[number] = replace(variant, name=_short_name(variant.name) or f"Variant {number}", figures=figures)

    def rename(self, number: int, name: str) -> None:
        """Change the name of variant `number`. Raises DsfabError for an unknown number."""
        variant = self[number]
        self._all[number] = replace(variant, name=_short_name(name) or variant.name)

    def drop(self, number: int) -> None:
        """Remove variant `number`. Raises DsfabError for an unknown number."""
        _ = self[number]
        del self._all[number]


def differences(before: Preset, after: Preset) -> list[tuple[str, Any, Any]]:
    """Return (dotted key, value before, value after) for each changed key."""
    hidden = {"name", "description"}
    a, b = (dict(_leaves(preset.model_dump(mode="json", exclude=hidden))) for preset in (before, after))
    return [(key, a.get(key), b.get(key)) for key in {**a, **b} if a.get(key) != b.get(key)]


def _leaves(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield above + key, value


def _short_name(name: str) -> str:
    return " ".join(name.split())[:60]
