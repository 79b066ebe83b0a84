"""Programs in separate processes, with a limit on processor time."""

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
except ImportError:  # on Windows, a program is limited only by elapsed time, not by processor time
    resource = None  # type: ignore[assignment]


class ProgramError(RuntimeError):
    """Error for a program that failed or printed nothing."""


class _Work:
    def __init__(self, work: Callable[[], None]) -> None:
        self._work, self._done = work, False
        self._error: Exception | None = None

    def do(self) -> None:
        """Call the function unless it was called before. Store an exception, so that `end` can raise it."""
        if not self._done:
            self._done = True
            try:
                self._work()
            except Exception as error:
                self._error = error

    def end(self) -> None:
        """Call the function unless it was called before. Raise its exception, if any."""
        self.do()
        if self._error:
            raise self._error


_WAITING: ContextVar[_Work | None] = ContextVar("_WAITING", default=None)


@contextmanager
def work_while_waiting(work: Callable[[], None]) -> Iterator[None]:
    """Call `work` once: while the first program in the `with` block runs, or after a block without programs."""
    waiting = _Work(work)
    token = _WAITING.set(waiting)
    try:
        yield
    finally:
        _WAITING.reset(token)
    waiting.end()


def run_program(program: str, *arguments: str, seconds: float) -> str:
    """Run the Python file `program`, and return its output.
    Raises ProgramError, or subprocess.TimeoutExpired after `seconds` of processor time."""
    with _start(program, *arguments, stdin=None) as run:
        try:
            return _answer(run, seconds)
        finally:
            run.kill()


def last_line(program: str, *arguments: str, seconds: float) -> str:
    """Run the Python file `program`, and return the last line of its output. Raises as `run_program` does."""
    return _last(run_program(program, *arguments, seconds=seconds))


class PreparedProgram:
    """A program that starts before its arguments are known. Its process ends with the `with` block."""

    def __init__(self, program: str) -> None:
        self.process = _start(program, stdin=subprocess.PIPE)

    def __enter__(self) -> "PreparedProgram":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.process.kill()
        with self.process:  # the context closes the pipes
            pass

    def send(self, *arguments: str) -> None:
        """Send the arguments to the program."""
        if self.process.stdin:
            with suppress(BrokenPipeError):  # `process` has ended; its error output contains the reason
                self.process.stdin.write(json.dumps(arguments) + "\n")
                self.process.stdin.flush()

    def answer(self, seconds: float) -> str:
        """Wait for the program, and return the last line of its output. Raises ProgramError or TimeoutExpired."""
        return _last(_answer(self.process, seconds))

    def answer_with_work(self, is_ready: Callable[[], bool], work: Callable[[], None], seconds: float) -> str:
        """Return `answer(seconds)`. Call `work` in the meantime, as soon as `is_ready()` returns True."""
        with ThreadPoolExecutor(1) as reading:
            pending = reading.submit(_answer, self.process, seconds)
            try:
                if waiting := _WAITING.get():
                    waiting.do()
                while not (is_ready() or pending.done()):
                    wait([pending], 0.02)
                if is_ready():
                    work()
            except BaseException:  # without `kill`, the pool would wait until the program ends
                self.process.kill()
                raise
            return _last(pending.result())

    def last_line(self, *arguments: str, seconds: float) -> str:
        """Send arguments to the program; return its last line of output. Raises ProgramError or TimeoutExpired."""
        self.send(*arguments)
        return self.answer(seconds)


def _start(program: str, *arguments: str, stdin: int | None) -> "subprocess.Popen[str]":
    command = [sys.executable, "-P", program, *arguments]
    return subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _limit_time(run: "subprocess.Popen[str]", seconds: float) -> float:
    """Limit the processor time of a running program to `seconds`. Return a limit for the elapsed time, seconds."""
    if not hasattr(resource, "prlimit"):
        return seconds
    soft_limit = max(1, round(seconds))
    with suppress(OSError):  # the program has ended, or the system forbids the limit
        resource.prlimit(run.pid, resource.RLIMIT_CORE, (0, 0))  # otherwise the signal writes a core dump
        _, system_limit = resource.prlimit(run.pid, resource.RLIMIT_CPU)
        grace = 5  # seconds from the first signal, which a program can handle, to the signal that ends the program
        hard_limit = soft_limit + grace
        if system_limit != resource.RLIM_INFINITY:
            hard_limit = min(hard_limit, system_limit)
        resource.prlimit(run.pid, resource.RLIMIT_CPU, (min(soft_limit, hard_limit), hard_limit))
    return 10.0 * seconds  # on a busy machine, elapsed time exceeds processor time


def _answer(run: "subprocess.Popen[str]", seconds: float) -> str:
    begin, clock = time.monotonic(), _limit_time(run, seconds)
    if waiting := _WAITING.get():
        waiting.do()
    remaining = clock - (time.monotonic() - begin)
    out, complaint = run.communicate(timeout=remaining if remaining > 0 else 1.0)
    if run.returncode == -getattr(signal, "SIGXCPU", 0):
        raise subprocess.TimeoutExpired(run.args, seconds)
    if run.returncode:
        raise ProgramError((complaint.strip().splitlines() or [f"exit code {run.returncode}"])[-1])
    return out


def _last(out: str) -> str:
    lines = out.splitlines()
    if not lines:
        raise ProgramError("the program printed nothing")
    return lines[-1]
