"""Progress and results as text: a live line per stage on a terminal, plain lines in a pipe or a log."""

import sys
import time
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.status import Status


class Reporter:
    """Says on standard error what is being done, and how long it took. `quiet` says nothing."""

    def __init__(self, quiet: bool = False) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)
        self._stage: tuple[str, str, float] | None = None
        self._status: Status | None = None

    def __call__(self, stage: str, doing: str) -> None:
        """A stage begins, and with it the one before ends."""
        self.done()
        self._stage = (stage, doing, time.perf_counter())
        if self._console.is_terminal:
            self._status = self._console.status(f"[bold]{stage:<11}[/bold] {doing}")
            self._status.start()

    def done(self) -> None:
        """The last stage has ended."""
        self.stop()
        if self._stage:
            stage, doing, start = self._stage
            self._console.print(f"{stage:<11} {doing:<52} {time.perf_counter() - start:7.2f} s", markup=False)
            self._stage = None

    def stop(self) -> None:
        """Take the live line away (also when something went wrong)."""
        if self._status:
            self._status.stop()
            self._status = None

    def say(self, text: str) -> None:
        """A line of its own."""
        self._console.print(text, markup=False)


def out(text: str = "") -> None:
    """A line of result, on standard output."""
    sys.stdout.write(text + "\n")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Columns in plain text, the first flush left, the others flush right."""
    lines = [list(head), *(list(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def size(count: float) -> str:
    """Bytes for people: '4.2 MB'."""
    for unit in ("B", "KB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


def mass(kilograms: float) -> str:
    """'830 g', '12.4 kg', '3.1 t'."""
    if kilograms < 1:
        return f"{1000 * kilograms:.3g} g"
    return f"{kilograms:.3g} kg" if kilograms < 1000 else f"{kilograms / 1000:.3g} t"


def length(metres: float) -> str:
    """'0.31 mm', '2.4 m'."""
    return f"{1000 * metres:.3g} mm" if abs(metres) < 1 else f"{metres:.3g} m"
