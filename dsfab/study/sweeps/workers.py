"""Worker processes that make the runs of a sweep, on this machine or on a Dask cluster."""

import multiprocessing
import os
import signal
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

from dsfab.core.errors import DsfabError
from dsfab.core.sparse import peak_memory
from dsfab.design import Design, draft
from dsfab.design.output.files import step_options
from dsfab.preset.file import preset_from, preset_toml, with_overrides
from dsfab.preset.model import Preset
from dsfab.preset.surface_section import FileSurface
from dsfab.study.sweeps.metrics import metric_value

Drawer = Callable[[Design], bytes]
"""Type of functions that return a picture of a design as the bytes of a PNG file. `dsfab.app` provides them."""


@dataclass(frozen=True)
class Job:
    """Data that are equal for all runs of a sweep.
    preset : the preset that all runs change, as nested tables.
    metrics, keep, formats : see `Plan`.    draw : function that draws a picture of a design, or None.
    mesh   : content of the mesh file for workers on other machines, or None."""

    token: str
    preset: Mapping[str, Any]
    metrics: tuple[str, ...]
    keep: tuple[str, ...] = ()
    formats: tuple[str, ...] = ()
    draw: Drawer | None = None
    mesh: bytes | None = None


@dataclass(frozen=True)
class Outcome:
    """Result of a run: metrics by name, error message ('' for success), log, and contents of files by name.
    seconds : duration of the run.    peak : largest memory of the worker process, bytes (0 if unknown).
    killed  : True if the operating system killed the worker process at each attempt."""

    number: int
    metrics: Mapping[str, float] = field(default_factory=dict)
    error: str = ""
    log: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0
    peak: int = 0
    killed: bool = False


_run_lock = threading.Lock()  # only one run at a time: solver and graphics are not thread-safe
_thread_state = threading.local()  # stores the job and the last design of each worker thread


def execute(job: Job, number: int, changes: Mapping[str, Any]) -> Outcome:
    """Carry out run `number`. If it fails, the result has an error message, and the metrics that could be computed."""
    with _run_lock:
        return _run_job(job, number, changes)


def _run_job(job: Job, number: int, changes: Mapping[str, Any]) -> Outcome:
    start, metrics, files = time.perf_counter(), dict[str, float](), dict[str, bytes]()
    doing, wrong, log = "the design", list[str](), ""
    try:
        design = _job_design(job, changes)
        for name in job.metrics:
            doing = name
            try:
                metrics[name] = metric_value(name, design)
            except DsfabError as refusal:  # continue with the next metric
                wrong.append(str(refusal))
        doing = "its files"
        _keep(job, design, files)
    except DsfabError as refusal:
        wrong.append(str(refusal))
    except Exception as mistake:  # a bug in one run must not end the sweep
        wrong.append(f"{doing}: {type(mistake).__name__}: {mistake}")
        log = traceback.format_exc()
    error = "; ".join(dict.fromkeys(wrong))
    return Outcome(number, metrics, error, log, files, time.perf_counter() - start, peak_memory())


def _job_design(job: Job, changes: Mapping[str, Any]) -> Design:
    if getattr(_thread_state, "token", None) != job.token:
        _thread_state.token, _thread_state.base, _thread_state.last = job.token, _base(job), None
    _thread_state.last = draft(with_overrides(_thread_state.base, changes), earlier=_thread_state.last)
    return _thread_state.last  # type: ignore[no-any-return]


def _base(job: Job) -> Preset:
    values = dict(job.preset)
    if job.mesh is not None:
        from dsfab.export import temporary_folder

        _thread_state.folder = temporary_folder("dsfab-sweep")
        mesh = Path(_thread_state.folder.name) / Path(values["surface"]["file"]).name
        mesh.write_bytes(job.mesh)
        values["surface"] = {**values["surface"], "file": str(mesh)}
    return preset_from(values)


def mesh_of(preset: Preset) -> bytes | None:
    """Return the content of a preset's mesh file; None if the surface does not come from a file."""
    return preset.surface.file.read_bytes() if isinstance(preset.surface, FileSurface) else None


def _keep(job: Job, design: Design, files: dict[str, bytes]) -> None:
    from dsfab.export import write

    if "preset" in job.keep:
        original = {"surface.file": job.preset["surface"]["file"]} if job.mesh is not None else {}
        preset = with_overrides(design.preset, original) if original else design.preset
        files["preset.toml"] = preset_toml(preset).encode()
    if "picture" in job.keep and job.draw is not None:
        files["picture.png"] = job.draw(design)
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        if "sheet" in job.keep:
            files["sheet.ply"] = write(design.sheet.surface, Path(folder) / "sheet.ply").read_bytes()
        if "solid" in job.keep:
            name = design.preset.name
            for suffix in job.formats:
                path = Path(folder) / f"{name}.{suffix}"
                write(design.solid, path, step=step_options(design.preset.export))
                files[f"{name}.{suffix}"] = path.read_bytes()


Changes = Mapping[str, Any]


class Workers(Protocol):
    """A set of worker processes. A worker makes one run at a time."""

    def workers(self) -> Collection[str]:
        """Return the names of the workers that are available now."""

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """Start a run on a worker. Return a future for the result; it raises an error if the worker dies."""

    def lost(self, worker: str) -> str:
        """Remove a worker that died. Return the reason of its death; '' if unknown."""

    def learn(self, outcome: Outcome) -> None:
        """Use the memory of a finished run to choose the number of workers."""

    def close(self) -> None:
        """End all worker processes immediately."""


class OneWorker:
    """A set of worker processes `crew`, reduced to its first worker."""

    def __init__(self, crew: Workers) -> None:
        self._crew = crew

    def workers(self) -> Collection[str]:
        names = list(self._crew.workers())
        for worker in names[1:]:
            self._crew.lost(worker)
        return names[:1]

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        return self._crew.submit(worker, number, changes)

    def lost(self, worker: str) -> str:
        return self._crew.lost(worker)

    def learn(self, outcome: Outcome) -> None:
        self._crew.learn(outcome)

    def close(self) -> None:
        self._crew.close()


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that limit a worker to one thread, because results may depend on the number of threads."""


class LocalWorkers:
    """Processes on this machine. job : data for all runs.    workers : number; default: as many as fit into memory."""

    def __init__(self, job: Job, workers: int | None = None) -> None:
        self._job, self._asked = job, workers
        self._free, self._peak, self._short = free_memory(), 0, memory_kills()
        self._pools: dict[str, ProcessPoolExecutor] = {}
        self.pids: dict[str, int] = {}

    def workers(self) -> Collection[str]:
        """Return the names of the workers."""
        return [f"worker {i}" for i in range(1, self._count() + 1)]

    def _count(self) -> int:
        if self._asked:
            return self._asked
        if not self._peak:
            return 1
        # the workers share 80 % of the initially free memory
        return max(1, min(cores(), int(0.8 * self._free / self._peak) if self._free else cores()))

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """Start run `number` on a worker, and return a future for the result."""
        for _ in range(2):
            if worker not in self._pools:
                self._begin(worker)
            try:
                return self._pools[worker].submit(execute, self._job, number, changes)
            except BrokenExecutor:  # the system killed an idle worker
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
            self.pids[worker] = future.result()

    def lost(self, worker: str) -> str:
        """End a worker process. Return a message if the system killed a process for lack of memory, else ''."""
        self.pids.pop(worker, None)
        pool = self._pools.pop(worker, None)
        if pool is None:
            return ""
        pool.shutdown(wait=False, cancel_futures=True)
        before, self._short = self._short, memory_kills()
        return "the system ended a process because memory was low" if self._short > before else ""

    def learn(self, outcome: Outcome) -> None:
        self._peak = max(self._peak, outcome.peak)

    def close(self) -> None:
        for pid in self.pids.values():
            with suppress(OSError):
                os.kill(pid, signal.SIGTERM)
        for worker in list(self._pools):
            self.lost(worker)


@contextmanager
def quiet_start() -> Iterator[None]:
    """Return a context manager. Processes that start in its `with` block have one thread each and ignore Ctrl-C."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    in_main_thread = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main_thread else None
    try:
        yield
    finally:
        if in_main_thread:
            signal.signal(signal.SIGINT, handler)
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


def end_with_parent() -> None:
    """Make this worker process end when its parent process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_watch, args=(parent.sentinel,), daemon=True).start()


def _watch(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def free_memory() -> int:
    """Return the memory that is free for new processes, in bytes; 0 if unknown."""
    sizes = []
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        sizes.append(next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")))
    group = Path("/sys/fs/cgroup")
    with suppress(OSError, ValueError):
        limit, used = ((group / name).read_text(encoding="ascii") for name in ("memory.max", "memory.current"))
        sizes.append(int(limit) - int(used))
    return max(0, min(sizes)) if sizes else 0


def memory_kills() -> int:
    """Return the number of processes that the operating system has killed so far for lack of memory."""
    for path in ("/sys/fs/cgroup/memory.events", "/proc/vmstat"):
        with suppress(OSError, ValueError, IndexError, StopIteration):
            lines = Path(path).read_text(encoding="ascii").splitlines()
            return next(int(line.split()[1]) for line in lines if line.startswith("oom_kill "))
    return 0


SECONDS = 20  # time limit for the answer of a Dask scheduler


class DaskWorkers:
    """Workers of a Dask scheduler. Each worker should have one thread (`dask worker --nthreads 1`).
    Raises DsfabError if dask is not installed or the scheduler does not answer."""

    def __init__(self, job: Job, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise DsfabError("--scheduler needs the library Dask: install dsfab[cluster]") from None
        try:
            self._client: Any = Client(scheduler, timeout=SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise DsfabError(
                f"no Dask scheduler answers at {scheduler}: {error}; start one with `dask scheduler`"
            ) from None
        self._job = job
        self._executors: dict[str, Executor] = {}

    def workers(self) -> Collection[str]:
        """Return the addresses of the workers that are available now."""
        # newer versions of Dask list only five workers without n_workers=-1
        return list(self._client.scheduler_info(n_workers=-1)["workers"])

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        if worker not in self._executors:
            self._executors[worker] = self._client.get_executor(
                workers=[worker], allow_other_workers=True, pure=False, retries=0
            )
        return cast("Future[Outcome]", self._executors[worker].submit(execute, self._job, number, changes))

    def lost(self, worker: str) -> str:
        """Remove a worker that died. Return '', because the reason is unknown."""
        self._executors.pop(worker, None)
        return ""

    def learn(self, outcome: Outcome) -> None:
        """Do nothing, because Dask chooses the number of workers."""

    def close(self) -> None:
        self._client.close()


Item = TypeVar("Item")
Result = TypeVar("Result")
MEMORY = 3e9  # expected memory of one process, bytes


def fitting_processes(count: int) -> int:
    """Return the number of processes to use for `count` independent items, limited by cores and free memory."""
    free = free_memory()
    return max(1, min(count, cores(), int(free / MEMORY) if free else cores()))


def map_in_processes(
    job: Callable[[Item], Result], items: Sequence[Item], workers: int, work: Callable[[Item], float] | None = None
) -> Iterator[Result]:
    """Yield job(item) for each item, in the order of `items`. Raises DsfabError if a process dies.
    workers : number of processes; 1 to use only the current process.
    work    : function that returns the expected duration of an item, in any unit."""
    if workers == 1:
        yield from map(job, items)
        return
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
    try:
        with quiet_start():
            order = sorted(range(len(items)), key=lambda k: -work(items[k]) if work else 0.0)
            results = {k: pool.submit(job, items[k]) for k in order}
        for k in range(len(items)):
            yield results[k].result()
    except BrokenExecutor as error:
        raise DsfabError("a process ended too early, perhaps because memory was low; try --workers 1") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
