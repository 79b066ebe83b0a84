"""Workers of this machine: processes, as many as there are cores and as fit into memory."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Collection, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from pathlib import Path

from dsfab.study.sweeps.worker import Job, Outcome, execute
from dsfab.study.sweeps.workers import Changes

MEMORY_SHARE = 0.8
"""Share of the memory that was free at the beginning that workers may fill together."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Libraries read these when they are loaded. Every worker has one thread: results do not depend on their number."""


class LocalWorkers:
    """Processes. One pool of one process for each worker: when one is killed, the others and their memories stay.

    workers : their number; left out, the first run tells how much memory one needs, and as many follow as fit.
    """

    def __init__(self, job: Job, workers: int | None = None) -> None:
        self._job, self._asked = job, workers
        self._free, self._peak, self._short = free_memory(), 0, memory_kills()
        self._pools: dict[str, ProcessPoolExecutor] = {}
        self._pids: dict[str, int] = {}

    def workers(self) -> Collection[str]:
        """Names of as many workers as there is memory for."""
        return [f"worker {i}" for i in range(1, self._count() + 1)]

    def _count(self) -> int:
        if self._asked:
            return self._asked
        if not self._peak:
            return 1
        return max(1, min(cores(), int(MEMORY_SHARE * self._free / self._peak) if self._free else cores()))

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """The outcome to come of a run on that worker, which is started when it is not there."""
        for _ in range(2):
            if worker not in self._pools:
                self._begin(worker)
            try:
                return self._pools[worker].submit(execute, self._job, number, changes)
            except BrokenExecutor:  # killed while it had nothing to do
                self.lost(worker)
        raise BrokenExecutor(f"{worker} cannot be started")

    def _begin(self, worker: str) -> None:
        with quiet_start():
            context = multiprocessing.get_context("spawn")
            pool = ProcessPoolExecutor(1, mp_context=context, initializer=end_with_parent)
            self._pools[worker] = pool
            pool.submit(os.getpid).add_done_callback(lambda future: self._introduce(worker, future))

    def _introduce(self, worker: str, future: "Future[int]") -> None:
        with suppress(Exception):
            self._pids[worker] = future.result()

    def lost(self, worker: str) -> str:
        """End a worker, if it is still there; whether the system has ended a process for want of memory meanwhile."""
        self._pids.pop(worker, None)
        pool = self._pools.pop(worker, None)
        if pool is None:
            return ""
        pool.shutdown(wait=False, cancel_futures=True)
        before, self._short = self._short, memory_kills()
        return "the system ended a process for want of memory" if self._short > before else ""

    def learn(self, outcome: Outcome) -> None:
        """Remember the largest memory that a run took."""
        self._peak = max(self._peak, outcome.peak)

    def close(self) -> None:
        """End all workers."""
        for pid in self._pids.values():
            with suppress(OSError):
                os.kill(pid, signal.SIGTERM)
        for worker in list(self._pools):
            self.lost(worker)


@contextmanager
def quiet_start() -> Iterator[None]:
    """Processes that begin here compute in one thread, and leave Ctrl-C to the coordinator."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    mine = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if mine else None
    try:
        yield
    finally:
        if mine:
            signal.signal(signal.SIGINT, handler)
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


def end_with_parent() -> None:
    """Begins in each worker: when the coordinator is killed, nobody else would end its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_watch, args=(parent.sentinel,), daemon=True).start()


def _watch(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def free_memory() -> int:
    """Memory that is free on this machine or in this container, bytes; 0 where the system does not say."""
    found = []
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        found.append(next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")))
    group = Path("/sys/fs/cgroup")
    with suppress(OSError, ValueError):
        limit, used = ((group / name).read_text(encoding="ascii") for name in ("memory.max", "memory.current"))
        found.append(int(limit) - int(used))
    return max(0, min(found)) if found else 0


def memory_kills() -> int:
    """How many processes the system has ended for want of memory so far, in this container or on this machine; 0 where
    it does not say."""
    for path in ("/sys/fs/cgroup/memory.events", "/proc/vmstat"):
        with suppress(OSError, ValueError, IndexError, StopIteration):
            lines = Path(path).read_text(encoding="ascii").splitlines()
            return next(int(line.split()[1]) for line in lines if line.startswith("oom_kill "))
    return 0
