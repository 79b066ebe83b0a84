"""What hangs is ended, by the seconds of the processor that it takes: a busy machine is no fault."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

SECONDS = 60.0
"""No file of a test takes a twentieth of it."""


@contextmanager
def ended_if_it_hangs() -> Iterator[None]:
    """End what runs inside after `SECONDS` of the processor with an AssertionError."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def end(*_: object) -> None:
        raise AssertionError(f"it hangs: it took {SECONDS:g} s of the processor")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
