"""The workspace of the editor: the open preset, the variants set aside, and the output folder."""

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
    """One folder for each name in `home`; the page says names alone, so nothing is written elsewhere.

    shown : what `home` is called for the person and on a command line; '' where it goes with the session.
    """

    def __init__(self, home: Path, shown: str = "") -> None:
        self.home, self.shown = home, shown
        self._ours: set[Path] = set()

    def folder(self, name: str) -> Path:
        """Where what is called so goes. Raises DsfabError for a name that is none, or that leads elsewhere."""
        folder = self.home / name
        if not _PLAIN.fullmatch(name) or folder.resolve().parent != self.home.resolve():
            raise DsfabError(
                f"{name!r} is no name of a folder in {self.shown or 'the outputs'}; use letters and digits"
            )
        return folder

    def standing(self, name: str) -> int:
        """How many files of others (an earlier run, another program) the folder of that name holds."""
        folder = self.folder(name)
        if folder in self._ours or not folder.exists():
            return 0
        return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 1

    def free(self, name: str) -> str:
        """The name, or the first of name-2, name-3 ... whose folder holds nothing of others."""
        return next(word for word in _numbered(name) if not self.standing(word))

    def publish(self, made: Path, name: str) -> Path:
        """Move all files of a folder to that of the name; those of the same names are replaced. Returns the folder.

        Raises DsfabError where it cannot be written.
        """
        folder = self.folder(name)
        with whole_or_nothing(folder) as partial:
            for path in made.iterdir():
                shutil.move(path, partial / path.name)
        self._ours.add(folder)
        return folder

    def keep(self, name: str, suffix: str, content: bytes) -> Path:
        """Write a file beside the folders: NAME.toml, or NAME-2.toml where another one stands there. Returns its path.

        Raises DsfabError where it cannot be written.
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
    """Whether a file may become this one: it is not there, or is this one."""
    return not path.exists() or (path.is_file() and path.read_bytes() == content)


WORDY = 2000
"""A command longer than this is no use to anybody: the preset is to be saved instead."""
MATERIAL = "statics.material"
"""What a proposal's thickness goes by."""


@dataclass(frozen=True)
class Opened:
    """A preset and where it comes from.

    words   : what stands between `dsfab build` and the changes; none for what only the page has.
    mesh    : the name that a mesh from the page has for the person: its file here is a copy.
    decided : what was decided for a mesh, as `dsfab new` tells it.
    """

    preset: Preset
    words: tuple[str, ...] = ()
    mesh: str = ""
    decided: tuple[Decision, ...] = ()

    def changed(self, changes: Mapping[str, Any]) -> Preset:
        """The preset with other values at dotted keys.

        Raises PresetError for what no preset holds, and for another file: the page names none on this machine.
        """
        preset = overridden(self.preset, changes)
        if _file(preset) != _file(self.preset):
            raise PresetError("surface.file cannot be changed from the page; drop the mesh on it, or dsfab edit MESH")
        if strange := _drawings(preset) - _drawings(self.preset):
            raise PresetError(f"{_names(strange)}: the page names no drawing; name it in a preset's file")
        return preset

    def toml(self, changes: Mapping[str, Any]) -> str:
        """The changed preset as a file; a mesh that came from the page is named as it was there."""
        preset = self.changed(changes)
        return preset_toml(with_file(preset, Path(self.mesh)) if self.page_mesh else preset)

    @property
    def page_mesh(self) -> Path | None:
        """The copy of a mesh that came from the page: it goes with the session."""
        return _file(self.preset) if self.mesh else None

    def command(self, changes: Mapping[str, Any]) -> tuple[str, bool]:
        """The command that builds it, and whether its preset has to be saved first."""
        preset = self.changed(changes)
        if self.words and self.decided and MATERIAL in changes:  # that command decides the thickness anew by it
            changes = {"statics.thickness": preset.statics.thickness, **changes}
        sets = [word for key, value in changes.items() for word in ("--set", f"{key}={_spelled(value)}")]
        command = shlex.join(["dsfab", "build", *self.words, *sets])
        spelled = None not in changes.values()  # TOML has no word for nothing
        if self.words and spelled and len(command) <= WORDY:
            return command, False
        return shlex.join(["dsfab", "build", f"{preset.name}.toml"]), True

    def reopened(self, text: str) -> "Opened":
        """A preset file from the page; its mesh can only be the one that is open already.

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
    """The preset with its mesh in another file."""
    return preset.model_copy(update={"surface": preset.surface.model_copy(update={"file": file})})


def saved_preset(now: Opened, changes: Mapping[str, Any], outputs: Outputs) -> Path:
    """Save the changed preset among the outputs, with a mesh that came from the page beside it; the preset's path.

    Raises PresetError for changes that no preset holds, DsfabError where nothing can be written.
    """
    preset = now.changed(changes)
    if mesh := now.page_mesh:
        beside = outputs.keep(preset.name, mesh.suffix, mesh.read_bytes())
        preset = with_file(preset, Path(beside.name))
    return outputs.keep(preset.name, ".toml", preset_toml(preset).encode())


def open_preset(target: str, source: Source = UNCHANGED) -> Opened:
    """A shipped preset by its name, a preset file or a mesh file by its path, as `dsfab build` takes it.

    source : what the command line changes of it.
    Raises DsfabError for anything else, and for a preset that waits for a mesh where none is given.
    """
    proposal = source.proposal(target)
    preset = source.read(target, proposal)
    return Opened(preset, tuple(source.words(target)), "", proposal.decisions if proposal else ())


def opened_shipped(name: str) -> Opened:
    """A preset that comes with dsfab, by its name and never by a path. Raises PresetError for another name."""
    if name not in shipped_presets():
        raise PresetError(f"there is no preset {name!r}; use one of {', '.join(shipped_presets())}")
    return Opened(load_preset(name), (name,))


@dataclass(frozen=True)
class MeshRequest:
    """A mesh that the page sent, to be read: its file here, what it is called where it comes from, and its unit."""

    path: Path
    name: str
    unit: str | None = None


def opened_mesh(request: MeshRequest) -> Opened:
    """A mesh with the preset that `dsfab new` proposes for it, to begin with.

    Raises SurfaceError for a file that cannot be read; it names the file as the person knows it.
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
    """A value as TOML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_inline(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    import json

    return json.dumps(value)


def _drawings(preset: Preset) -> set[Path]:
    """Files of curves that pickers of the preset name."""
    listed = (*preset.surface.support, *preset.surface.load, *preset.pattern.guide, *preset.pattern.region)
    pickers = (getattr(thing, "at", None) for thing in (*listed, *preset.thickening.extra))
    return {file for at in pickers if (file := getattr(at, "file", None)) is not None}


def _names(files: set[Path]) -> str:
    return ", ".join(sorted(path.name for path in files))


def _file(preset: Preset) -> Path | None:
    return getattr(preset.surface, "file", None)


MOST = 48
"""Variants of one session."""

LARGEST = 2 * 2**20
"""Characters of a picture."""

FIGURES = ("share", "area", "mass", "pieces", "narrowest", "compliance")
"""What is kept of what was measured (see `figures.figures`)."""


@dataclass(frozen=True)
class KeptVariant:
    """What was open, what the person had changed, and how it looked. figures: by name, None where not measured."""

    name: str
    opened: Opened
    changes: Mapping[str, Any]
    picture: str = ""
    figures: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def preset(self) -> Preset:
        """What the variant is."""
        return self.opened.changed(self.changes)


class VariantTray:
    """Variants by their numbers, in the order in which they were kept; they go with the session."""

    def __init__(self) -> None:
        self._all: dict[int, KeptVariant] = {}
        self._numbers = itertools.count(1)

    def __getitem__(self, number: int) -> KeptVariant:
        """Raises DsfabError for one that is not there."""
        if number not in self._all:
            raise DsfabError("that variant is not kept any more")
        return self._all[number]

    def listed(self) -> list[dict[str, Any]]:
        """All of them for the page."""
        return [
            {"number": number, "name": one.name, "picture": one.picture, "figures": dict(one.figures)}
            for number, one in self._all.items()
        ]

    def keep(self, variant: KeptVariant) -> None:
        """One more; without a name it gets its number. Raises DsfabError for what is none, and where there are many."""
        _ = variant.preset
        if len(self._all) >= MOST:
            raise DsfabError(f"{MOST} variants are kept already; remove one first")
        if variant.picture and not (variant.picture.startswith("data:image/") and len(variant.picture) <= LARGEST):
            raise DsfabError("the picture of the variant did not arrive whole; keep it again")
        number = next(self._numbers)
        figures = {name: variant.figures.get(name) for name in FIGURES}
        self._all[number] = replace(variant, name=_short(variant.name) or f"Variant {number}", figures=figures)

    def rename(self, number: int, name: str) -> None:
        """Another name, if it is one. Raises DsfabError for a variant that is not there."""
        old = self[number]
        self._all[number] = replace(old, name=_short(name) or old.name)

    def drop(self, number: int) -> None:
        """Keep it no longer. Raises DsfabError for a variant that is not there."""
        _ = self[number]
        del self._all[number]


def differences(one: Preset, other: Preset) -> list[tuple[str, Any, Any]]:
    """Dotted keys whose values differ, and both values; a name makes no difference. Lists are compared as a whole."""
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
