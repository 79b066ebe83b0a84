"""A folder of results: all of its files, or none; a kill at any moment leaves the old ones or the new ones.

The files are written into a folder beside it, and the two change places in one step of the system (Linux, renameat2).
Where that cannot be, for the folder holds other folders, is a mount or where somebody stands, or the system has no such
step, they are written into a folder inside of it, which then holds a journal: what is to be moved and removed. Whoever
opens the folder next completes what a dead process began (`complete`).

What a folder holds besides is the user's own and stays. Of an earlier design that is what its manifest does not name,
or what has changed since: the rest of it goes as a new one comes.
"""

import ctypes
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.export.partial import abandoned_in, partial_name, remove

DESIGN = "design.json"
"""The file that holds the manifest of a design's folder, under `MANIFEST`; it comes last, and is not in it."""

MANIFEST = "manifest"
JOURNAL = ".journal.json"

_HERE, _EXCHANGE = -100, 2
"""AT_FDCWD and RENAME_EXCHANGE of renameat2(2)."""


Outdated = Callable[[Path, Path], set[str]]
"""(an old folder, what comes in its place) -> names of files of the old one that go with it."""


@contextmanager
def whole_or_nothing(folder: Path, outdated: Outdated | None = None) -> Iterator[Path]:
    """A folder to write in whose files become those of `folder` at the end; if anything fails, that is as it was.

    outdated : which files of before go; left out, those that the manifest of a design names, where a new one comes.
    Raises ExportError where it cannot be written.
    """
    target = Path(os.path.realpath(folder))  # a link stays a link
    missing = [parent for parent in (target, *target.parents) if not parent.exists()]
    try:
        complete(target)
        partial = _partial_of(target)
    except OSError as error:
        raise ExportError(f"cannot write to {folder}: {error.strerror}; choose another folder with -o") from None
    try:
        try:
            yield partial
        except ExportError as error:  # name the place that the user gave
            raise ExportError(str(error).replace(str(partial), str(folder))) from None
        _put_in_place(partial, target, outdated or _outdated)
        missing = []
    except OSError as error:
        raise ExportError(
            f"writing to {folder} failed: {error.strerror}; free some space or choose another with -o"
        ) from None
    finally:
        if not (partial / JOURNAL).is_file():  # what is half in place, the next run completes
            remove(partial)
        for parent in missing:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()


class _TriedError(Exception):
    """Leaves a folder as it was."""


def require_writable(folder: Path) -> None:
    """Raise ExportError where a folder cannot be written, before minutes of work; it stays as it is."""
    with suppress(_TriedError), whole_or_nothing(folder):
        raise _TriedError


def manifest(folder: Path) -> dict[str, dict[str, int | str]]:
    """Bytes and SHA-256 of every file of a folder by name, but for the one that holds the manifest."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != DESIGN)
    return {path.name: {"bytes": path.stat().st_size, "sha256": _sha256(path)} for path in files}


def complete(folder: Path) -> None:
    """Finish what dead processes had begun to put into a folder, and remove what they left in it and beside it."""
    for partial in abandoned_in(folder):
        if (partial / JOURNAL).is_file():
            _follow_journal(partial, folder)
    for path in (*abandoned_in(folder), *abandoned_in(folder.parent)):
        remove(path)


def _partial_of(target: Path) -> Path:
    """A new folder to write in: beside the target where the two can change places, else inside."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        if not target.is_dir():
            raise NotADirectoryError(0, "a file has that name")
        if not os.access(target, os.W_OK):
            raise PermissionError(0, "there is no permission to write there")
    beside = not target.exists() or (_exchangeable(target) and os.access(target.parent, os.W_OK))
    partial = (target.parent if beside else target) / partial_name()
    partial.mkdir()
    return partial


def _put_in_place(partial: Path, target: Path, outdated: Outdated) -> None:
    """Make what was written the content of the target."""
    if partial.parent != target:
        try:
            if not target.exists():
                os.rename(partial, target)
                return
        except OSError:
            if not target.exists():  # else somebody made it in this moment
                raise
        if _exchangeable(target) and _swap(partial, target, outdated(target, partial)):
            return
        inside = target / partial.name
        os.rename(partial, inside)
        partial = inside
    names = sorted((path.name for path in partial.iterdir()), key=lambda name: (name == DESIGN, name))
    journal = {"move": names, "remove": sorted(outdated(target, partial) - set(names))}
    written = partial / f"{JOURNAL}.new"
    written.write_bytes(json.dumps(journal).encode())
    os.replace(written, partial / JOURNAL)
    _follow_journal(partial, target)
    remove(partial)


def _follow_journal(partial: Path, target: Path) -> None:
    """Do what of a journal is still to do, from the beginning or from anywhere."""
    journal = json.loads((partial / JOURNAL).read_bytes())
    for name in journal["move"]:
        with suppress(FileNotFoundError):  # it was moved before
            os.replace(partial / name, target / name)
    for name in journal["remove"]:
        (target / name).unlink(missing_ok=True)
    (partial / JOURNAL).unlink()


def _exchangeable(target: Path) -> bool:
    """Whether a folder may become another one: nobody stands in it, and it holds files of ours or the user's alone."""
    if not hasattr(os, "geteuid") or os.path.ismount(target) or target.stat().st_uid != os.geteuid():
        return False
    with suppress(OSError):
        if Path.cwd().is_relative_to(target):
            return False
    with os.scandir(target) as entries:
        return all(entry.is_file(follow_symlinks=False) for entry in entries)


def _swap(partial: Path, target: Path, outdated: set[str]) -> bool:
    """Whether the two have changed places, in one step; the user's own files are then in both."""
    fresh = {path.name for path in partial.iterdir()}
    known = {path.name for path in target.iterdir()}
    own = known - fresh - outdated
    if not (_link(target, partial, own) and _exchange(partial, target)):
        for name in own:
            (partial / name).unlink(missing_ok=True)
        return False
    _rescue(partial, target, own, known)
    return True


def _link(target: Path, partial: Path, own: set[str]) -> bool:
    """Whether the user's files are in both folders now; there are disks that know no links."""
    try:
        for name in own:
            os.link(target / name, partial / name)
        shutil.copymode(target, partial)
    except OSError:
        return False
    return True


def _rescue(old: Path, target: Path, own: set[str], known: set[str]) -> None:
    """Take over what the user saved in the moment of the exchange."""
    for path in old.iterdir():
        there = target / path.name
        replaced = path.name in own and there.exists() and not path.samefile(there)
        if replaced or path.name not in known:
            os.replace(path, there)


def _exchange(one: Path, other: Path) -> bool:
    """Let two folders change places; whether the system and the disk can."""
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    done: int = call(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE)
    return done == 0


def _outdated(target: Path, partial: Path) -> set[str]:
    """Files of the target that its manifest names, as they were then, and that a new design does not have."""
    if not (partial / DESIGN).is_file():
        return set()
    fresh, before = {path.name for path in partial.iterdir()}, _manifest_of(target)
    return {name for name, known in before.items() if name not in fresh and _unchanged(target / name, known)}


def _manifest_of(folder: Path) -> Mapping[str, Mapping[str, int | str]]:
    """What the manifest of a folder names, or nothing; names that lead elsewhere are none."""
    try:
        told = json.loads((folder / DESIGN).read_text(encoding="utf-8"))
        return {name: dict(known) for name, known in told[MANIFEST].items() if name == Path(name).name}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _unchanged(path: Path, known: Mapping[str, int | str]) -> bool:
    """Whether a file is as a manifest says."""
    try:
        return path.stat().st_size == known.get("bytes") and _sha256(path) == known.get("sha256")
    except OSError:
        return False


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
