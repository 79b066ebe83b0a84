"""CalculiX in a process of its own: its files are read while it runs, and it ends with what started it."""

import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import StaticsError
from dsfab.study.verification.solids import CCX

PAUSE = 0.2
"""Seconds between two looks at its files."""

ATTEMPT = re.compile(r"^ *\d+ +\d+ +\d+(U?) +\d+ +(\S+) +\S+ +(\S+) *$", re.MULTILINE)
"""A line of the .sta file: U where no equilibrium was found, the time so far, and the step of time that was tried."""
TABLE = re.compile(r"^ displacements .* time +(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class CcxFiles:
    """What CalculiX has written so far: what it says, its results (.dat) and its attempts (.sta).

    ended : whether it came to an end of its own.
    """

    said: str
    results: str
    attempts: str
    ended: bool

    def tables(self) -> list[tuple[float, Floats]]:
        """The time of each table of displacements, and (k, 4) numbers of nodes with their displacements."""
        data = self.results[: self.results.rfind("\n") + 1]  # a line may be half written
        heads = list(TABLE.finditer(data))
        found = []
        for head, following in zip(heads, [*heads, None][1:], strict=True):
            lines = data[head.end() : following.start() if following else None].strip().splitlines()
            table = [line.split() for line in lines]
            numbers = [[float(word) for word in words] for words in table if len(words) == 4 and words[0].isdigit()]
            found.append((float(head[1]), np.array(numbers).reshape(-1, 4)))
        return found

    def failures(self) -> list[tuple[float, float]]:
        """The time that was reached before each attempt that failed, and the step of time that it tried."""
        return [(float(at), float(step)) for failed, at, step in ATTEMPT.findall(self.attempts) if failed]


def require_ccx() -> str:
    """The path of CalculiX. Raises StaticsError where it is not installed."""
    found = shutil.which(CCX)
    if found is None:
        raise StaticsError(
            "the nonlinear check is done by CalculiX, and its program ccx is not on the path; install it (Debian and "
            "Ubuntu: apt install calculix-ccx), or leave out --nonlinear"
        )
    return found


def run_ccx(text: list[str], seconds: float, enough: Callable[[CcxFiles], bool] = lambda files: False) -> CcxFiles:
    """What CalculiX writes of an .inp file: until it ends, until `enough` says so, or until the seconds are over.

    It is ended with its files whatever ends this, an exception of a signal too.
    """
    with tempfile.TemporaryDirectory(prefix="dsfab-") as name:
        folder = Path(name)
        (folder / "solid.inp").write_text("".join(text), encoding="ascii")
        with (folder / "said").open("wb") as said:
            process = subprocess.Popen(
                [require_ccx(), "solid"],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
            )
            try:
                _watched(process, folder, seconds, enough)
                return _files(folder, process.poll() is not None)
            finally:
                process.kill()
                process.wait()


def _watched(
    process: "subprocess.Popen[bytes]", folder: Path, seconds: float, enough: Callable[[CcxFiles], bool]
) -> None:
    """Wait for its end. `enough` is asked after each attempt."""
    over, seen, attempts = time.monotonic() + seconds, 0, folder / "solid.sta"
    while process.poll() is None and (left := over - time.monotonic()) > 0:
        try:
            process.wait(min(PAUSE, left))
        except subprocess.TimeoutExpired:
            size = attempts.stat().st_size if attempts.exists() else 0
            if size > seen and enough(_files(folder, False)):
                return
            seen = size


def _files(folder: Path, ended: bool) -> CcxFiles:
    def text(name: str) -> str:
        path = folder / name
        return path.read_text(encoding="ascii", errors="replace") if path.exists() else ""

    return CcxFiles(text("said"), text("solid.dat"), text("solid.sta"), ended)
