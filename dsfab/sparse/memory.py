"""How much memory a factor may take, and how what is no longer needed is given back."""

import ctypes
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any, Self

from dsfab.errors import DsfabError

MEMINFO = Path("/proc/meminfo")


class FactorMemoryError(DsfabError, MemoryError):
    """A factor would not fit into the memory of the machine."""

    @classmethod
    def of(cls, needed: int | None, free: int | None = None) -> Self:
        """needed, free : bytes, where they are known."""
        need = "more memory than there is" if needed is None else f"{needed / 2**30:.1f} GiB"
        there = "" if free is None else f", {free / 2**30:.1f} GiB are free"
        return cls(
            f"factorising the stiffness needs {need}{there}; use a coarser mesh or simpler elements, close other "
            "programs, or install dsfab[amg], which needs a tenth (constant+hinge elements only)"
        )


def free_memory() -> int | None:
    """Bytes that can still be had without swapping; None where the system does not say."""
    if MEMINFO.exists():
        for line in MEMINFO.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def peak_memory() -> int:
    """Bytes, the largest that this process has held; 0 on Windows, which does not say."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)


def require_memory(needed: int) -> None:
    """Raise FactorMemoryError when `needed` bytes are more than what is free."""
    free = free_memory()
    if free is not None and needed > free:
        raise FactorMemoryError.of(needed, free)


LITTLE = 20e6
"""Bytes that are not worth being given back: looking for them takes up to 20 ms in a process that has run for long,
which is as long as all the rest of a factor of a thousand unknowns."""


def give_back(held: float) -> None:
    """Hand memory that was freed to the system: glibc keeps what small blocks above it hold, 60 MB after a factor of
    90,000 unknowns was prepared and 170 MB after it was freed. Does nothing elsewhere; takes 10 ms for 100 MB.

    held : about how many bytes were freed; nothing is done for `LITTLE` or less.
    """
    if held > LITTLE and (trim := _malloc_trim()):
        trim(0)


@cache
def _malloc_trim() -> Any:
    return getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform.startswith("linux") else None
