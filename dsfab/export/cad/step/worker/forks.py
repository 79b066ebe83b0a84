"""Work that this process shares with a fork. Threads cannot share it, because OCCT holds Python's lock."""

import ctypes
import json
import os
import signal
import sys
from array import array
from collections.abc import Callable
from functools import partial
from operator import itemgetter
from typing import Any

CAN_FORK = sys.platform == "linux"
"""True if the process can be forked safely."""


class ForkedWork:
    """Work in a fork of this process; a call returns its result, which must be JSON."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self._result, write_end = os.pipe()
        self._copy = os.fork()
        if not self._copy:
            self._run(work, write_end)
        os.close(write_end)

    @staticmethod
    def _run(work: Callable[[], Any], to: int) -> None:
        try:
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: the fork ends with its parent
            with os.fdopen(to, "w") as pipe:
                json.dump(work(), pipe)
        finally:
            os._exit(0)

    def __call__(self) -> Any:
        with os.fdopen(self._result) as pipe:
            text = pipe.read()
        os.waitpid(self._copy, 0)
        return json.loads(text)

    def stop(self) -> None:
        """End the fork without its result."""
        os.close(self._result)
        os.kill(self._copy, signal.SIGKILL)
        os.waitpid(self._copy, 0)


def map_with_fork(work: Callable[[int], Any], count: int) -> list[Any]:
    """Return `work` of 0, 1 ... count - 1; this process and a fork each take the next number when free."""
    numbers, issue = os.pipe()
    os.write(issue, array("I", range(count)).tobytes())
    os.close(issue)
    share = partial(_share, work, numbers)
    copy = ForkedWork(share)
    results = share() + copy()
    os.close(numbers)
    return [result for _, result in sorted(results, key=itemgetter(0))]


def _share(work: Callable[[int], Any], numbers: int) -> list[tuple[int, Any]]:
    return [(i, work(i)) for (i,) in iter(lambda: array("I", os.read(numbers, 4)).tolist(), [])]
