"""The exit codes of every command; docs/messages.md has the same table."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Result of a command for the shell."""

    DONE = 0
    REFUSED = 1  # the input is refused, or a check of it fails
    WRONG_USAGE = 2
    UNFINISHED = 3  # stopped; the same command goes on
    NOT_MADE = 4  # something that was requested was not made
    DOES_NOT_CARRY = 5  # the files are written, but the structure does not carry its loads
    BUG = 70
    INTERRUPTED = 130  # Ctrl-C
