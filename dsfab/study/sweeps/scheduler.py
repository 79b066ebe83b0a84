"""`conduct`: hands runs to workers and records each before it begins and when it ends. The only one who writes."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.in_memory import Rows
from dsfab.study.sweeps.runs import Store
from dsfab.study.sweeps.workers import Changes, Outcome, Workers

TRIES = 2
"""A run whose worker was killed as often as this in one session is left for the next one: it may be the reason. Whose
worker was killed as often as this in all is then made alone."""

TICK = 0.5
"""Seconds between looks at who has joined or left."""

PATIENCE = 600.0
"""Seconds without any worker after which it is given up."""

Deliver = Callable[[Outcome, Changes], list[str]]
"""Writes the files of a run, and returns their names."""


@dataclass
class Progress:
    """Where a sweep stands: runs by what became of them, and seconds since this session began."""

    total: int
    done: int
    failed: int
    running: int = 0
    killed: int = 0
    ended_now: int = 0
    begun: float = field(default_factory=time.monotonic)
    last: Outcome | None = None

    @property
    def left(self) -> int:
        """How many runs are still to come."""
        return self.total - self.done - self.failed - self.killed

    @property
    def rate(self) -> float:
        """Runs per minute in this session."""
        return 60 * self.ended_now / max(time.monotonic() - self.begun, 1e-9)

    @property
    def seconds_left(self) -> float:
        """Seconds until all have ended, at the rate so far."""
        return 60 * self.left / self.rate if self.ended_now else float("inf")


def conduct(
    store: Store,
    crew: Workers,
    runs: Mapping[int, Changes],
    deliver: Deliver,
    told: Callable[[Progress], None] = lambda progress: None,
    progress: Progress | None = None,
) -> None:
    """Make `runs` (number -> changes), which wait in the store; returns when each of them is done, failed or killed.

    told     : called before the first run and after each.
    progress : where the sweep stands, when these runs are not all that it will have.

    Raises DsfabError when nothing can be written, or when there are no workers. Whatever it ends with, runs in
    progress are then still recorded as running: `Store.again` lets them wait again.
    """
    _Scheduler(store, crew, runs, deliver, told, progress or standing(store)).run()


def standing(store: Store, total: int | None = None) -> Progress:
    """Where a sweep stands as a session begins; `total` runs are expected, or those that are recorded."""
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
        told: Callable[[Progress], None],
        progress: Progress,
    ) -> None:
        self.store, self.crew, self.runs, self.deliver, self.told = store, crew, runs, deliver, told
        self.progress = progress
        self.rows = Rows(list(runs), list(runs.values()))
        self.busy: dict[Future[Outcome], tuple[str, int]] = {}
        self.known: set[str] = set()
        self.losses: Counter[int] = Counter()

    def run(self) -> None:
        self.told(self.progress)
        alone_since = time.monotonic()
        while self.rows or self.busy:
            self._hand_out()
            if self.busy:
                alone_since = time.monotonic()
                for future in wait(self.busy, TICK, FIRST_COMPLETED).done:
                    self._receive(future)
            elif time.monotonic() - alone_since > PATIENCE:
                raise DsfabError(
                    f"no worker has been there for {PATIENCE:.0f} s; start some and give the command again"
                )
            else:
                time.sleep(TICK)

    def _hand_out(self) -> None:
        """A run for each worker that has none."""
        there = list(self.crew.workers())
        for gone in self.known.difference(there):
            self.rows.leave(gone)
        self.known = set(there)
        occupied = {worker for worker, _ in self.busy.values()}
        for worker in there:
            if worker in occupied or (number := self.rows.take(worker)) is None:
                continue
            self.store.start(number, worker)
            try:
                future = self.crew.submit(worker, number, self.runs[number])
            except Exception as error:  # it was killed as it began, or no process can begin now
                self._worker_died(worker, number, error)
                continue
            self.busy[future] = (worker, number)

    def _receive(self, future: Future[Outcome]) -> None:
        worker, number = self.busy.pop(future)
        try:
            outcome = future.result()
        except Exception as error:  # not of the run, which returns its refusals: of what carries it
            self._worker_died(worker, number, error)
            return
        self.crew.learn(outcome)
        self._record(outcome)

    def _worker_died(self, worker: str, number: int, error: Exception) -> None:
        known = self.crew.lost(worker)
        self.store.lose(number)
        self.losses[number] += 1
        if self.losses[number] < TRIES:
            self.rows.give_back(worker, number)
            return
        self.rows.leave(worker)
        why = f"the worker was killed {self.losses[number]} times while it made this run"
        why += f" ({known})" if known else ""
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
