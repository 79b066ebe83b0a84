"""Writing of numbers as text, and of files and folders atomically: all of the new content, or the old content."""

import ctypes
import errno
import hashlib
import json
import os
import platform
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

from dsfab.core.errors import ExportError

TRAILING_ZEROS = re.compile(r"(\.\d*?)0+(?=[,)])")
"""At the end of decimals: a quarter of a STEP file."""

_ROWS = 10_000
"""Rows per piece of text: enough to be quick, few enough to need no memory."""


def rows(template: str, *columns: Any) -> Iterator[str]:
    """`template % row` for every row of the columns (equally long sequences), in pieces of many rows."""
    for start in range(0, len(columns[0]), _ROWS):
        sliced = [column[start : start + _ROWS] for column in columns]
        pieces = [piece.tolist() if hasattr(piece, "tolist") else piece for piece in sliced]  # all at once is gigabytes
        yield (template * len(pieces[0])) % tuple(chain.from_iterable(zip(*pieces, strict=True)))


def listed_rows(template: str, *columns: Any) -> Iterator[str]:
    """As `rows`, for a list of numbers inside brackets: without the comma at its end, and no zeros after decimals."""
    before = ""
    for text in rows(template, *columns):
        if before:
            yield before
        before = TRAILING_ZEROS.sub(r"\1", text)
    yield before.rstrip(",\n")


def one_line(name: str) -> str:
    """A name without line breaks and other control characters."""
    return "".join(c if c.isprintable() else " " for c in name).strip() or "part"


PARTIAL = ".partial"
_WHOSE = re.compile(r"-([0-9a-f]{8})-(\d+)-(\d+)-[0-9a-z_]+(\..*)?")
_STATE, _TICK = 0, 19
"""Words of /proc/PID/stat behind the name of the program: its state, and its first tick."""


def partial_name(suffix: str = "") -> str:
    """A new name for a file or a folder that this process is going to make whole."""
    return f"{PARTIAL}-{_owner()}-{secrets.token_hex(6)}{suffix}"


def temporary_folder(word: str) -> "tempfile.TemporaryDirectory[str]":
    """A folder of this process among the system's temporary files; those of dead ones with that word are removed."""
    for path in abandoned_in(Path(tempfile.gettempdir()), word):
        remove(path)
    return tempfile.TemporaryDirectory(prefix=f"{word}-{_owner()}-", ignore_cleanup_errors=True)


def abandoned(name: str, word: str = PARTIAL) -> bool:
    """Whether a name is of ours, and its process has ended on this machine; of other machines nobody here knows."""
    found = _WHOSE.fullmatch(name.removeprefix(word)) if name.startswith(word) else None
    return found is not None and found[1] == _host() and not _alive(int(found[2]), int(found[3]))


def abandoned_in(folder: Path, word: str = PARTIAL) -> list[Path]:
    """What dead processes left in a folder, if there is one."""
    try:
        return sorted(path for path in folder.iterdir() if abandoned(path.name, word))
    except OSError:
        return []


def remove(path: Path) -> None:
    """Remove a file or a folder, as far as it can be."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


@cache
def remove_abandoned_files(folder: Path) -> None:
    """Remove files that dead processes left in a folder: once for each folder, for it may hold thousands."""
    for path in abandoned_in(folder):
        if path.is_file():
            remove(path)


def _owner() -> str:
    """This process."""
    pid = os.getpid()
    return f"{_host()}-{pid}-{_start_tick(pid) or 0}"


@cache
def _host() -> str:
    """Eight letters for this machine and its numbering of processes."""
    try:
        space = os.readlink("/proc/self/ns/pid")
    except OSError:
        space = ""
    return hashlib.sha256(f"{platform.node()} {space}".encode()).hexdigest()[:8]


def _alive(pid: int, began: int) -> bool:
    """Whether that process is there; where the system does not say, it counts as alive."""
    if os.name == "nt":  # a signal would end it there
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    now = _start_tick(pid)
    return now is None or now == began


def _start_tick(pid: int) -> int | None:
    """The tick in which a process began, 0 for one that has ended and waits for its parent; None if nobody says."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        return 0 if words[_STATE] in "ZX" else int(words[_TICK])
    except (OSError, ValueError, IndexError):
        return None


_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space or choose another folder",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another folder",
    errno.EFBIG: "the file is too large for this disk; choose another folder",
    errno.ENOENT: "the folder does not exist; make it first",
    errno.ENOTDIR: "the folder does not exist, a file has its name; choose another folder",
    errno.EACCES: "there is no permission to write there; choose another folder",
    errno.EPERM: "there is no permission to write there; choose another folder",
    errno.EROFS: "the disk is read-only; choose another folder",
    errno.EISDIR: "a folder has that name; choose another name",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name in the folder of `path`, with its suffix; what is written there replaces `path` at the end.

    On any failure, an interrupt included, the temporary file is removed and an older `path` stays as it was.
    Raises ExportError in place of OSError.
    """
    target = Path(os.path.realpath(path))  # a link stays a link: the file it points to is replaced
    temporary = target.with_name(partial_name(target.suffix))
    remove_abandoned_files(target.parent)
    try:
        _ask(target, temporary)
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise _refusal(path, error) from error
    finally:
        with suppress(OSError):  # nothing was written, or nothing can be done
            temporary.unlink()


def require_writable_file(path: Path) -> None:
    """Raise ExportError where a file cannot be written, before minutes of work; nothing is changed by asking.

    Of a folder that is still to be made, the nearest one above it that is there is asked.
    """
    target = Path(os.path.realpath(path))
    there = next(folder for folder in target.parents if os.path.lexists(folder))
    try:
        _ask(target, there / partial_name(target.suffix))
    except OSError as error:
        raise _refusal(path, error) from error


def _refusal(path: Path, error: OSError) -> ExportError:
    reason = _ADVICE.get(error.errno or 0, f"{error.strerror or error}; choose another folder or name")
    return ExportError(f"{path} could not be written: {reason}")


def _ask(target: Path, temporary: Path) -> None:
    """Raise OSError where no file can be made, or none of that name: before the work, not after it."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    with open(temporary, "xb"):
        pass
    temporary.unlink()


def write_chunks(path: Path, chunks: Iterable[bytes]) -> None:
    """Write a new file from pieces of bytes, down to the disk, so that a full disk is noticed here."""
    with open(path, "xb") as file:
        for chunk in chunks:
            file.write(chunk)
        file.flush()
        os.fsync(file.fileno())


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
