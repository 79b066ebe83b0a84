"""Scheduler of a sweep: the only process that gives runs to workers and records their beginning and end."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.in_memory import Rows
from dsfab.study.sweeps.runs import Store
from dsfab.study.sweeps.workers import Changes, Outcome, Workers

TRIES = 2  # if this many workers die in a run, the session stops trying it; the next session makes it alone
PATIENCE = 600.0  # seconds without any worker before the scheduler gives up
Deliver = Callable[[Outcome, Changes], list[str]]  # writes the files of a run and returns their names


@dataclass
class Progress:
    """Progress of a sweep: counts of runs by state, and the start time of this session."""

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
        """Number of remaining runs."""
        return self.total - self.done - self.failed - self.killed

    @property
    def rate(self) -> float:
        """Finished runs per minute in this session."""
        return 60 * self.ended_now / max(time.monotonic() - self.begun, 1e-9)

    @property
    def seconds_left(self) -> float:
        """Seconds until the end, at the rate of this session."""
        return 60 * self.remaining / self.rate if self.ended_now else float("inf")


def conduct(
    store: Store,
    crew: Workers,
    runs: Mapping[int, Changes],
    deliver: Deliver,
    report: Callable[[Progress], None] = lambda progress: None,
    progress: Progress | None = None,
) -> None:
    """Carry out the waiting `runs` (number -> changes) of a store, until each is done, failed or killed.
    report   : receives the progress before the first run and after each run.
    progress : progress of the whole sweep; by default counted from the recorded runs.
    Raises DsfabError if nothing can be written, or if no worker appears. After an error, unfinished runs are still
    recorded as running; `Store.reset_to_waiting` resets them."""
    _Scheduler(store, crew, runs, deliver, report, progress or current_progress(store)).run()


def current_progress(store: Store, total: int | None = None) -> Progress:
    """Return the progress at the start of a session. total : number of runs; default: all recorded runs."""
    counts = store.counts()
    done, failed, killed = (counts.get(state, 0) for state in ("done", "failed", "killed"))
    return Progress(total or sum(counts.values()), done, failed, killed=killed)


class _Scheduler:
    def __init__(
        self,
        store: Store,
        crew: Workers,
        runs: Mapping[int, Changes],
        deliver: Deliver,
        report: Callable[[Progress], None],
        progress: Progress,
    ) -> None:
        self.store, self.crew, self.runs, self.deliver, self.told = store, crew, runs, deliver, report
        self.progress = progress
        self.rows = Rows(list(runs), list(runs.values()))
        self.busy: dict[Future[Outcome], tuple[str, int]] = {}
        self.known: set[str] = set()
        self.losses: Counter[int] = Counter()

    def run(self) -> None:
        self.told(self.progress)
        tick, alone_since = 0.5, time.monotonic()  # tick : seconds until the next check of the workers
        while self.rows or self.busy:
            self._hand_out()
            if self.busy:
                alone_since = time.monotonic()
                for future in wait(self.busy, tick, FIRST_COMPLETED).done:
                    self._receive(future)
            elif time.monotonic() - alone_since > PATIENCE:
                raise DsfabError(
                    f"no worker was connected for {PATIENCE:.0f} s; start workers and give the command again"
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
            except Exception as error:  # the worker was killed at its start, or no process can start now
                self._worker_died(worker, number, error)
                continue
            self.busy[future] = (worker, number)

    def _receive(self, future: Future[Outcome]) -> None:
        worker, number = self.busy.pop(future)
        try:
            outcome = future.result()
        except Exception as error:  # the worker died; an error of the run itself is part of the outcome
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
        self.told(self.progress)
