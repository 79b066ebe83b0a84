"""Scheduler of a sweep: it gives runs to worker processes and records the results."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.runs import Store
from dsfab.study.sweeps.workers import Changes, Outcome, Workers
from dsfab.study.variations import stage_order

TRIES = 2  # number of dead workers after which a run is recorded as killed
PATIENCE = 600.0  # seconds without workers after which the scheduler stops
Deliver = Callable[[Outcome, Changes], list[str]]  # writes a run's files and returns the file names


@dataclass
class Progress:
    """Progress of a sweep: number of runs in each state. Data of this session: number of ended runs, and start time."""

    total: int
    done: int
    failed: int
    running: int = 0
    killed: int = 0
    ended_now: int = 0
    begun: float = field(default_factory=time.monotonic)
    last: Outcome | None = None

    @property
    def remaining(self) -> int:
        return self.total - self.done - self.failed - self.killed

    @property
    def rate(self) -> float:
        """Number of finished runs per minute in this session."""
        return 60 * self.ended_now / max(time.monotonic() - self.begun, 1e-9)

    @property
    def seconds_left(self) -> float:
        """Expected time until the end of the sweep, seconds; inf if unknown."""
        return 60 * self.remaining / self.rate if self.ended_now else float("inf")


def conduct(
    store: Store,
    crew: Workers,
    runs: Mapping[int, Changes],
    deliver: Deliver,
    report: Callable[[Progress], None] = lambda progress: None,
    progress: Progress | None = None,
) -> None:
    """Carry out the runs of a sweep on the worker processes `crew`, and record the results in `store`.
    runs     : changed values of each run, by number of the run.
    deliver  : function that writes the files of a run and returns their names.
    report   : function that receives the progress. Raises DsfabError if nothing can be written or no worker appears."""
    _Scheduler(store, crew, runs, deliver, report, progress or current_progress(store)).run()


def current_progress(store: Store, total: int | None = None) -> Progress:
    """Return the progress at the start of a session. total : number of all runs; default: number of recorded runs."""
    counts = store.counts()
    done, failed, killed = (counts.get(state, 0) for state in ("done", "failed", "killed"))
    return Progress(total or sum(counts.values()), done, failed, killed=killed)


class Rows:
    """Queues of waiting runs: a queue for each worker process, and a queue of runs without a worker."""

    def __init__(self, numbers: Sequence[int], changes: Sequence[Changes]) -> None:
        self._free: list[int] = [numbers[i] for i in stage_order(changes)]
        self._rows: dict[str, list[int]] = {}

    def __len__(self) -> int:
        return len(self._free) + sum(len(row) for row in self._rows.values())

    def take(self, worker: str) -> int | None:
        """Remove the next run of a worker from the queues and return its number; None if no run is left."""
        row = self._rows.setdefault(worker, [])
        if not row:
            self._rows[worker] = row = self._take_share()
        return row.pop(0) if row else None

    def give_back(self, worker: str, number: int) -> None:
        """Remove a worker. Let other workers take its unfinished run, `number`, and then the runs in its queue."""
        self._free.insert(0, number)
        self.leave(worker)

    def leave(self, worker: str) -> None:
        """Remove a worker, and let other workers take the runs in its queue."""
        self._free.extend(self._rows.pop(worker, []))

    def _take_share(self) -> list[int]:
        if self._free:
            row, self._free = self._free, []
            return row
        longest = max(self._rows.values(), key=len, default=[])
        middle = len(longest) // 2
        taken = longest[middle:]
        del longest[middle:]
        return taken


@dataclass(eq=False)
class _Scheduler:
    store: Store
    crew: Workers
    runs: Mapping[int, Changes]
    deliver: Deliver
    report: Callable[[Progress], None]
    progress: Progress
    busy: dict[Future[Outcome], tuple[str, int]] = field(default_factory=dict)
    known: set[str] = field(default_factory=set)
    losses: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.rows = Rows(list(self.runs), list(self.runs.values()))

    def run(self) -> None:
        self.report(self.progress)
        tick, alone_since = 0.5, time.monotonic()
        while self.rows or self.busy:
            self._hand_out()
            if self.busy:
                alone_since = time.monotonic()
                for future in wait(self.busy, tick, FIRST_COMPLETED).done:
                    self._receive(future)
            elif time.monotonic() - alone_since > PATIENCE:
                raise DsfabError(
                    f"no worker was available for {PATIENCE:.0f} s; start workers of Dask and give the command again"
                )
            else:
                time.sleep(tick)

    def _hand_out(self) -> None:
        workers = list(self.crew.workers())
        for gone in self.known.difference(workers):
            self.rows.leave(gone)
        self.known = set(workers)
        occupied = {worker for worker, _ in self.busy.values()}
        for worker in workers:
            if worker in occupied or (number := self.rows.take(worker)) is None:
                continue
            self.store.start(number, worker)
            try:
                future = self.crew.submit(worker, number, self.runs[number])
            except Exception as error:  # the worker did not start
                self._worker_died(worker, number, error)
                continue
            self.busy[future] = (worker, number)

    def _receive(self, future: Future[Outcome]) -> None:
        worker, number = self.busy.pop(future)
        try:
            outcome = future.result()
        except Exception as error:  # the worker died; errors of the run itself are in its outcome
            self._worker_died(worker, number, error)
            return
        self.crew.learn(outcome)
        self._record(outcome)

    def _worker_died(self, worker: str, number: int, error: Exception) -> None:
        detail = self.crew.lost(worker)
        self.store.lose(number)
        self.losses[number] += 1
        if self.losses[number] < TRIES:
            self.rows.give_back(worker, number)
            return
        self.rows.leave(worker)
        why = f"the worker was killed {self.losses[number]} times while it made this run"
        why += f" ({detail})" if detail else ""
        self._record(Outcome(number, error=why, log=f"{type(error).__name__}: {error}", killed=True))

    def _record(self, outcome: Outcome) -> None:
        names = self.deliver(outcome, self.runs[outcome.number])
        if outcome.killed:
            self.store.give_up(outcome.number, outcome.error, names)
        else:
            self.store.finish(outcome.number, outcome.metrics, outcome.error, names, outcome.seconds, outcome.peak)
        self.progress.ended_now += 1
        self.progress.running = len(self.busy)
        self.progress.last = outcome
        if outcome.killed:
            self.progress.killed += 1
        elif outcome.error:
            self.progress.failed += 1
        else:
            self.progress.done += 1
        self.report(self.progress)
