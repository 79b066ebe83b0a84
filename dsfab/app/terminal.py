"""Progress and results as text: a live line per stage on a terminal, plain lines in a pipe or a log."""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.status import Status


class Reporter:
    """Says on standard error what is being done, and how long it took. `quiet` says nothing."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self._console = Console(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)
        self._stage: tuple[str, str, float] | None = None
        self._status: Status | None = None

    @property
    def watched(self) -> bool:
        """Whether a person may be waiting: it speaks, and to a terminal."""
        return self._console.is_terminal and not self.quiet

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


@contextmanager
def signals_as_interrupts() -> Iterator[None]:
    """A closed terminal, or a word to end, ends it as Ctrl-C does, so that nothing is left behind."""
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    if threading.current_thread() is not threading.main_thread():
        numbers = []
    before = [(number, signal.signal(number, signal.default_int_handler)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
