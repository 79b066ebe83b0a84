"""Programs of ours in a process of their own: OCCT and gmsh may crash there, or not end, without harm to this one.

What they may take is seconds of the processor, where the system counts them (Linux): a busy machine then gives the same
answer as a quiet one. The clock ends only what waits for ever.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from types import TracebackType

try:
    import resource
except ImportError:  # Windows: the clock alone is left
    resource = None  # type: ignore[assignment]

LEAST = 1.0
"""Seconds that a program is given when other work took longer than it may."""

BUSY = 10.0
"""Seconds on the clock for each of the processor's that a program may take, where these are counted."""

POLL = 0.02
"""Seconds on the clock between looks for what a program writes."""

GRACE = 5
"""Seconds of the processor between the signal that ends a program and the one that nothing survives."""


class ProgramError(RuntimeError):
    """A program that ended badly or said nothing; its text is the last line of its complaint."""


class _Work:
    """Something to do once, while a program is waited for."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._work, self._done = work, False
        self._error: Exception | None = None

    def do(self) -> None:
        """Now, if it is not done; what it raises is kept, for whoever waits here did not ask for it."""
        if not self._done:
            self._done = True
            try:
                self._work()
            except Exception as error:
                self._error = error

    def end(self) -> None:
        """It is done after this; raises what it raised."""
        self.do()
        if self._error:
            raise self._error


_WAITING: ContextVar[_Work | None] = ContextVar("_WAITING", default=None)


@contextmanager
def meanwhile(work: Callable[[], None]) -> Iterator[None]:
    """`work` is done in here, once: as soon as a program is waited for, or at the end. Not after an error in here."""
    waiting = _Work(work)
    token = _WAITING.set(waiting)
    try:
        yield
    finally:
        _WAITING.reset(token)
    waiting.end()


def run_program(program: str, *arguments: str, seconds: float) -> str:
    """What the Python file `program` prints.

    Raises subprocess.TimeoutExpired after `seconds` of the processor, and ProgramError when it does not end with 0.
    """
    with _started(program, *arguments, stdin=None) as run:
        try:
            return _answer(run, seconds)
        finally:
            run.kill()


def last_line(program: str, *arguments: str, seconds: float) -> str:
    """The last line that the Python file `program` prints; raises as `run_program`, and ProgramError for silence."""
    return _last(run_program(program, *arguments, seconds=seconds))


class Ahead:
    """A program that is started before anybody knows what to ask it, so that it imports what it needs meanwhile.

    It takes its arguments as one line of JSON, a list of strings. Leaving the `with` ends it, asked or not.
    """

    def __init__(self, program: str) -> None:
        self._run = _started(program, stdin=subprocess.PIPE)

    def __enter__(self) -> "Ahead":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._run.kill()
        with self._run:  # its pipes are closed
            pass

    def ask(self, *arguments: str) -> None:
        """Give it its arguments, once; `answer` is what it says to them."""
        if self._run.stdin:
            with suppress(BrokenPipeError):  # it has ended: its complaint says more
                self._run.stdin.write(json.dumps(arguments) + "\n")
                self._run.stdin.flush()

    def answer(self, seconds: float) -> str:
        """The last line that it prints, once it was asked; raises as `last_line`."""
        return _last(_answer(self._run, seconds))

    def answer_and(self, there: Callable[[], bool], work: Callable[[], None], seconds: float) -> str:
        """`answer`; and as soon as something that it writes before is `there`, `work` is done, while it goes on."""
        with ThreadPoolExecutor(1) as reading:
            said = reading.submit(_answer, self._run, seconds)
            try:
                if waiting := _WAITING.get():
                    waiting.do()
                while not (there() or said.done()):
                    wait([said], POLL)
                if there():
                    work()
            except BaseException:  # or it would be waited for
                self._run.kill()
                raise
            return _last(said.result())

    def last_line(self, *arguments: str, seconds: float) -> str:
        """The last line that it prints when it is asked, once; raises as `last_line`."""
        self.ask(*arguments)
        return self.answer(seconds)


def _started(program: str, *arguments: str, stdin: int | None) -> "subprocess.Popen[str]":
    command = [sys.executable, "-P", program, *arguments]
    return subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _limited(run: "subprocess.Popen[str]", seconds: float) -> float:
    """End it after `seconds` of the processor from its start on; how long it may take on the clock."""
    if not hasattr(resource, "prlimit"):
        return seconds
    most = max(1, round(seconds))
    with suppress(OSError):  # it has ended, or the system does not allow it
        resource.prlimit(run.pid, resource.RLIMIT_CORE, (0, 0))  # the signal would leave its memory in a file
        _, hard = resource.prlimit(run.pid, resource.RLIMIT_CPU)
        last = most + GRACE if hard == resource.RLIM_INFINITY else min(most + GRACE, hard)
        resource.prlimit(run.pid, resource.RLIMIT_CPU, (min(most, last), last))
    return BUSY * seconds


def _answer(run: "subprocess.Popen[str]", seconds: float) -> str:
    """What it prints until it ends; other work is done first, if there is any."""
    begin, clock = time.monotonic(), _limited(run, seconds)
    if waiting := _WAITING.get():
        waiting.do()
    left = clock - (time.monotonic() - begin)
    out, complaint = run.communicate(timeout=left if left > 0 else LEAST)
    if run.returncode == -getattr(signal, "SIGXCPU", 0):
        raise subprocess.TimeoutExpired(run.args, seconds)
    if run.returncode:
        raise ProgramError((complaint.strip().splitlines() or [f"exit code {run.returncode}"])[-1])
    return out


def _last(out: str) -> str:
    lines = out.splitlines()
    if not lines:
        raise ProgramError("it said nothing")
    return lines[-1]
