"""Names of what is not whole yet, which tell whose it is, so that the next run may remove what a dead process left.

    .partial-HOST-PID-START-RANDOM     HOST: the machine and, in a container, its numbering of processes
                                       START: when that process began, for numbers of processes are given again

Folders for temporary files are called so too, with a word of their own in the first place.
"""

import hashlib
import os
import platform
import re
import secrets
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

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
