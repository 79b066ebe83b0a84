"""`Outputs`: the folder that everything from the page goes into, and what in it is not of this run."""

import itertools
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from dsfab.errors import DsfabError
from dsfab.export import whole_or_nothing

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
