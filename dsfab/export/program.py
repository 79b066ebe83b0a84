"""Programs of ours in a process of their own: OCCT may crash there, or not end, without harm to this one."""

import subprocess
import sys


class ProgramError(RuntimeError):
    """A program that ended badly or said nothing; its text is the last line of its complaint."""


def last_line(program: str, *arguments: str, seconds: float) -> str:
    """The last line that the Python file `program` prints.

    Raises subprocess.TimeoutExpired after `seconds`, and ProgramError.
    """
    command = [sys.executable, "-P", program, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    lines = run.stdout.splitlines()
    if run.returncode or not lines:
        raise ProgramError((run.stderr.strip().splitlines() or [f"exit code {run.returncode}"])[-1])
    return lines[-1]
