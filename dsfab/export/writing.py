"""Functions that format numbers, and write files and folders. After a failure, the old files are unchanged."""

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

TRAILING_ZEROS = re.compile(r"(\.\d*?)0+(?=[,)])")  # useless zeros, a quarter of a STEP file


def rows(template: str, *columns: Any) -> Iterator[str]:
    """Format `template % row` for each row of the columns, and yield the text in pieces of many rows."""
    size = 10_000
    for start in range(0, len(columns[0]), size):
        sliced = [column[start : start + size] for column in columns]
        pieces = [piece.tolist() if hasattr(piece, "tolist") else piece for piece in sliced]
        yield (template * len(pieces[0])) % tuple(chain.from_iterable(zip(*pieces, strict=True)))


def comma_separated_rows(template: str, *columns: Any) -> Iterator[str]:
    """Format rows as `rows` does, but without the last comma and without trailing zeros of decimals."""
    before = ""
    for text in rows(template, *columns):
        if before:
            yield before
        before = TRAILING_ZEROS.sub(r"\1", text)
    yield before.rstrip(",\n")


def one_line(name: str) -> str:
    """Return a name on a single line, without control characters; "part" for an empty name."""
    return "".join(c if c.isprintable() else " " for c in name).strip() or "part"


PARTIAL = ".partial"
_WHOSE = re.compile(r"-([0-9a-f]{8})-(\d+)-(\d+)-[0-9a-z_]+(\..*)?")
_STATE, _TICK = 0, 19  # positions of state and start time in /proc/PID/stat


def partial_name(suffix: str = "") -> str:
    """Return a unique name for an unfinished file or folder of this process."""
    return f"{PARTIAL}-{_owner()}-{secrets.token_hex(6)}{suffix}"


def temporary_folder(word: str) -> "tempfile.TemporaryDirectory[str]":
    """Create a temporary folder with the prefix `word`. Remove the folders of ended processes with this prefix."""
    for path in abandoned_paths(Path(tempfile.gettempdir()), word):
        remove(path)
    return tempfile.TemporaryDirectory(prefix=f"{word}-{_owner()}-", ignore_cleanup_errors=True)


def is_abandoned(name: str, word: str = PARTIAL) -> bool:
    """Return True if `name` begins with `word` and belongs to an ended process of this machine."""
    match = _WHOSE.fullmatch(name.removeprefix(word)) if name.startswith(word) else None
    return match is not None and match[1] == _host() and not _alive(int(match[2]), int(match[3]))


def abandoned_paths(folder: Path, word: str = PARTIAL) -> list[Path]:
    """Return the paths in a folder that begin with `word` and belong to ended processes."""
    try:
        return sorted(path for path in folder.iterdir() if is_abandoned(path.name, word))
    except OSError:
        return []


def remove(path: Path) -> None:
    """Remove a file or a folder if possible."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


@cache
def remove_abandoned_files(folder: Path) -> None:
    """Remove temporary files of ended processes from a folder."""
    for path in abandoned_paths(folder):
        if path.is_file():
            remove(path)


def _owner() -> str:
    pid = os.getpid()
    return f"{_host()}-{pid}-{_start_tick(pid) or 0}"


@cache
def _host() -> str:
    """Return eight letters that identify this machine."""
    try:
        space = os.readlink("/proc/self/ns/pid")
    except OSError:
        space = ""
    return hashlib.sha256(f"{platform.node()} {space}".encode()).hexdigest()[:8]


def _alive(pid: int, began: int) -> bool:
    if os.name == "nt":  # on Windows a signal would end the process
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
    """Return the start time of a process in clock ticks: 0 if the process has ended, None if unknown."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        return 0 if words[_STATE] in "ZX" else int(words[_TICK])
    except (OSError, ValueError, IndexError):
        return None


_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space or choose another folder",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another folder",
    errno.EFBIG: "the file is too large for the file system of this disk; choose another folder",
    errno.ENOENT: "the folder does not exist; create it first",
    errno.ENOTDIR: "a file already has the name of this folder; choose another folder",
    errno.EACCES: "there is no permission to write in this folder; choose another folder",
    errno.EPERM: "there is no permission to write in this folder; choose another folder",
    errno.EROFS: "the disk is read-only; choose another folder",
    errno.EISDIR: "a folder already has this name; choose another name",
    errno.ENAMETOOLONG: "the file name is too long; choose a shorter name",
}


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path for a file. At the end of the `with` block, this file replaces `path`.
    After a failure, an older file at `path` is unchanged. Raises ExportError."""
    target = Path(os.path.realpath(path))  # a link stays a link; its target is replaced
    temporary = target.with_name(partial_name(target.suffix))
    remove_abandoned_files(target.parent)
    try:
        _try_file(target, temporary)
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise _refusal(path, error) from error
    finally:
        with suppress(OSError):  # the file does not exist, or the system forbids its removal
            temporary.unlink()


def require_writable_file(path: Path) -> None:
    """Raise ExportError if a file cannot be written."""
    target = Path(os.path.realpath(path))
    existing = next(folder for folder in target.parents if os.path.lexists(folder))
    try:
        _try_file(target, existing / partial_name(target.suffix))
    except OSError as error:
        raise _refusal(path, error) from error


def _refusal(path: Path, error: OSError) -> ExportError:
    reason = _ADVICE.get(error.errno or 0, f"{error.strerror or error}; choose another folder or name")
    return ExportError(f"{path} could not be written: {reason}")


def _try_file(target: Path, temporary: Path) -> None:
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    with open(temporary, "xb"):
        pass
    temporary.unlink()


def write_chunks(path: Path, chunks: Iterable[bytes]) -> None:
    """Write a new file from pieces of its bytes."""
    with open(path, "xb") as file:
        for chunk in chunks:
            file.write(chunk)
        file.flush()
        os.fsync(file.fileno())


DESIGN = "design.json"  # manifest of a design's folder, written last; it does not list itself

MANIFEST = "manifest"
JOURNAL = ".journal.json"

_HERE, _EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of renameat2(2)
Outdated = Callable[[Path, Path], set[str]]  # function of the old and the new folder; returns the old files to remove


@contextmanager
def atomic_folder(folder: Path, outdated: Outdated | None = None) -> Iterator[Path]:
    """Yield a temporary folder. Its files move into `folder` at the end; a failure does not change `folder`.
    outdated : function of the old and the new folder; returns the names of old files to remove.
    Raises ExportError if the folder cannot be written."""
    target = Path(os.path.realpath(folder))  # a link stays a link; its target changes
    missing = [parent for parent in (target, *target.parents) if not parent.exists()]
    try:
        complete_folder(target)
        partial = _partial_of(target)
    except OSError as error:
        raise ExportError(f"cannot write to {folder}: {error.strerror}; choose another folder with -o") from None
    try:
        try:
            yield partial
        except ExportError as error:  # the message must name the user's folder, not the temporary folder
            raise ExportError(str(error).replace(str(partial), str(folder))) from None
        _put_in_place(partial, target, outdated or _outdated_files)
        missing = []
    except OSError as error:
        raise ExportError(
            f"writing to {folder} failed: {error.strerror}; free some space, or choose another folder with -o"
        ) from None
    finally:
        if not (partial / JOURNAL).is_file():  # a journal lists files that the next run still has to move
            remove(partial)
        for parent in missing:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()


class _TriedError(Exception): ...


def require_writable(folder: Path) -> None:
    """Raise ExportError if a folder cannot be written."""
    with suppress(_TriedError), atomic_folder(folder):
        raise _TriedError


def manifest(folder: Path) -> dict[str, dict[str, int | str]]:
    """Return, by name, the size and SHA-256 hash of each file in a folder, without the manifest."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != DESIGN)
    return {path.name: {"bytes": path.stat().st_size, "sha256": _sha256(path)} for path in files}


def complete_folder(folder: Path) -> None:
    """Complete an interrupted change of a folder, and remove temporary files of ended processes."""
    for partial in abandoned_paths(folder):
        if (partial / JOURNAL).is_file():
            _follow_journal(partial, folder)
    for path in (*abandoned_paths(folder), *abandoned_paths(folder.parent)):
        remove(path)


def _partial_of(target: Path) -> Path:
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        if not target.is_dir():
            raise NotADirectoryError(0, "a file has that name")
        if not os.access(target, os.W_OK):
            raise PermissionError(0, "there is no permission to write in that folder")
    is_sibling = not target.exists() or (_exchangeable(target) and os.access(target.parent, os.W_OK))
    partial = (target.parent if is_sibling else target) / partial_name()
    partial.mkdir()
    return partial


def _put_in_place(partial: Path, target: Path, outdated: Outdated) -> None:
    if partial.parent != target:
        try:
            if not target.exists():
                os.rename(partial, target)
                return
        except OSError:
            if not target.exists():  # another process may have created the folder
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
    journal = json.loads((partial / JOURNAL).read_bytes())
    for name in journal["move"]:
        with suppress(FileNotFoundError):  # an earlier run moved the file
            os.replace(partial / name, target / name)
    for name in journal["remove"]:
        (target / name).unlink(missing_ok=True)
    (partial / JOURNAL).unlink()


def _exchangeable(target: Path) -> bool:
    if not hasattr(os, "geteuid") or os.path.ismount(target) or target.stat().st_uid != os.geteuid():
        return False
    with suppress(OSError):
        if Path.cwd().is_relative_to(target):
            return False
    with os.scandir(target) as entries:
        return all(entry.is_file(follow_symlinks=False) for entry in entries)


def _swap(partial: Path, target: Path, outdated: set[str]) -> bool:
    fresh = {path.name for path in partial.iterdir()}
    old_names = {path.name for path in target.iterdir()}
    user_names = old_names - fresh - outdated
    if not (link_files(target, partial, user_names) and exchange_folders(partial, target)):
        for name in user_names:
            (partial / name).unlink(missing_ok=True)
        return False
    _rescue(partial, target, user_names, old_names)
    return True


def link_files(target: Path, partial: Path, user_names: set[str]) -> bool:
    """Create hard links in `partial` to the user's files in `target`. Return False if a link is impossible."""
    try:
        for name in user_names:
            os.link(target / name, partial / name)
        shutil.copymode(target, partial)
    except OSError:
        return False
    return True


def _rescue(old_folder: Path, target: Path, user_names: set[str], old_names: set[str]) -> None:
    """Move files that the user saved during the exchange of folders from the old folder to the new folder."""
    for path in old_folder.iterdir():
        new_path = target / path.name
        replaced = path.name in user_names and new_path.exists() and not path.samefile(new_path)
        if replaced or path.name not in old_names:
            os.replace(path, new_path)


def exchange_folders(folder_a: Path, folder_b: Path) -> bool:
    """Exchange the names of two folders; return False if the system cannot do so."""
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    status: int = call(_HERE, os.fsencode(folder_a), _HERE, os.fsencode(folder_b), _EXCHANGE)
    return status == 0


def _outdated_files(target: Path, partial: Path) -> set[str]:
    if not (partial / DESIGN).is_file():
        return set()
    fresh, before = {path.name for path in partial.iterdir()}, _manifest_of(target)
    return {name for name, entry in before.items() if name not in fresh and _is_unchanged(target / name, entry)}


def _manifest_of(folder: Path) -> Mapping[str, Mapping[str, int | str]]:
    try:
        content = json.loads((folder / DESIGN).read_text(encoding="utf-8"))
        return {name: dict(entry) for name, entry in content[MANIFEST].items() if name == Path(name).name}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _is_unchanged(path: Path, entry: Mapping[str, int | str]) -> bool:
    try:
        return path.stat().st_size == entry.get("bytes") and _sha256(path) == entry.get("sha256")
    except OSError:
        return False


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
