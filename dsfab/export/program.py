"""Programs of ours in a process of their own: OCCT and gmsh may crash there, or not end, without harm to this one."""

import json
import subprocess
import sys
from types import TracebackType


class ProgramError(RuntimeError):
    """A program that ended badly or said nothing; its text is the last line of its complaint."""


def run_program(program: str, *arguments: str, seconds: float) -> str:
    """What the Python file `program` prints.

    Raises subprocess.TimeoutExpired after `seconds`, and ProgramError when it does not end with 0.
    """
    command = [sys.executable, "-P", program, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    return _said(run.returncode, run.stdout, run.stderr)


def last_line(program: str, *arguments: str, seconds: float) -> str:
    """The last line that the Python file `program` prints; raises as `run_program`, and ProgramError for silence."""
    return _last(run_program(program, *arguments, seconds=seconds))


class Ahead:
    """A program that is started before anybody knows what to ask it, so that it imports what it needs meanwhile.

    It takes its arguments as one line of JSON, a list of strings. Leaving the `with` ends it, asked or not.
    """

    def __init__(self, program: str) -> None:
        self._run = subprocess.Popen(
            [sys.executable, "-P", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> "Ahead":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._run.kill()
        with self._run:  # its pipes are closed
            pass

    def last_line(self, *arguments: str, seconds: float) -> str:
        """The last line that it prints when it is asked, once; raises as `last_line`."""
        out, complaint = self._run.communicate(json.dumps(arguments) + "\n", timeout=seconds)
        return _last(_said(self._run.returncode, out, complaint))


def _said(code: int, out: str, complaint: str) -> str:
    if code:
        raise ProgramError((complaint.strip().splitlines() or [f"exit code {code}"])[-1])
    return out


def _last(out: str) -> str:
    lines = out.splitlines()
    if not lines:
        raise ProgramError("it said nothing")
    return lines[-1]
