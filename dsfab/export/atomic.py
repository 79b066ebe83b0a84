"""Whole files or none: written under a temporary name beside the target, which it replaces at the end."""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.export.partial import partial_name, remove_abandoned_files

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
