"""Programs of ours in a process of their own: OCCT and gmsh may crash there, or not end, without harm to this one."""

import subprocess
import sys


class ProgramError(RuntimeError):
    """A program that ended badly or said nothing; its text is the last line of its complaint."""


def run_program(program: str, *arguments: str, seconds: float) -> str:
    """What the Python file `program` prints.

    Raises subprocess.TimeoutExpired after `seconds`, and ProgramError when it does not end with 0.
    """
    command = [sys.executable, "-P", program, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    if run.returncode:
        raise ProgramError((run.stderr.strip().splitlines() or [f"exit code {run.returncode}"])[-1])
    return run.stdout


def last_line(program: str, *arguments: str, seconds: float) -> str:
    """The last line that the Python file `program` prints; raises as `run_program`, and ProgramError for silence."""
    lines = run_program(program, *arguments, seconds=seconds).splitlines()
    if not lines:
        raise ProgramError("it said nothing")
    return lines[-1]
