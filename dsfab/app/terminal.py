"""Progress and results of commands as text."""

import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Self

from rich.console import Console
from rich.status import Status


class ExitCode(IntEnum):
    """Exit codes of all commands."""

    DONE = 0
    REFUSED = 1  # the input is refused, or a check fails
    WRONG_USAGE = 2
    UNFINISHED = 3  # runs of a sweep are missing; the same command tries them again
    NOT_MADE = 4  # a requested file or figure was not made
    DOES_NOT_CARRY = 5  # the files are written, but the structure does not carry its loads
    BUG = 70
    INTERRUPTED = 130  # Ctrl-C


class Reporter:
    """Printer of a command's stages on standard error.
    quiet : True to print nothing.    steps : False to show a stage only while it runs."""

    def __init__(self, quiet: bool = False, steps: bool = True) -> None:
        self.quiet, self.steps = quiet, steps
        self._console = Console(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)
        self._stage: tuple[str, str, float] | None = None
        self._status: Status | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: object, *_: object) -> None:
        self.stop() if error else self.done()

    @property
    def is_watched(self) -> bool:
        """True if the output goes to a terminal and is not quiet."""
        return self._console.is_terminal and not self.quiet

    def __call__(self, stage: str, doing: str) -> None:
        """End the last stage and begin `stage`. doing : text for the printed line."""
        self.done()
        self._stage = (stage, doing, time.perf_counter())
        if self._console.is_terminal:
            self._status = self._console.status(f"[bold]{stage:<11}[/bold] {doing}")
            self._status.start()

    def done(self) -> None:
        """End the last stage and print its seconds."""
        self.stop()
        if self._stage:
            stage, doing, start = self._stage
            if self.steps:
                self._console.print(f"{stage:<11} {doing:<52} {time.perf_counter() - start:7.2f} s", markup=False)
            self._stage = None

    def stop(self) -> None:
        """Remove the line of the current stage."""
        if self._status:
            self._status.stop()
            self._status = None

    def print_line(self, text: str) -> None:
        self._console.print(text, markup=False)


def print_result(text: str = "") -> None:
    """Print results on standard output."""
    sys.stdout.write(text + "\n")


def print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        print_result(line)


@contextmanager
def signals_as_interrupts() -> Iterator[None]:
    """Treat SIGTERM and SIGHUP (closed terminal) like Ctrl-C in the `with` block."""
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    if threading.current_thread() is not threading.main_thread():
        numbers = []
    before = [(number, signal.signal(number, signal.default_int_handler)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
