"""`Workers`: who makes the runs, as the scheduler sees them: workers by name, whose answers are futures."""

from collections.abc import Collection, Mapping
from concurrent.futures import Future
from typing import Any, Protocol

from dsfab.study.sweeps.worker import Outcome

Changes = Mapping[str, Any]


class Workers(Protocol):
    """Workers. A worker makes one run at a time, and remembers the stages of the last."""

    def workers(self) -> Collection[str]:
        """Names of those that may be given a run; those that left are no longer among them."""

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """Let a worker make a run. The future raises when the worker dies."""

    def lost(self, worker: str) -> str:
        """A worker died with a run, or is to go; returns what is known of the reason, or ''."""

    def learn(self, outcome: Outcome) -> None:
        """A run has ended: its memory tells how many workers there may be."""

    def close(self) -> None:
        """End all workers at once, whatever they do."""


class OneWorker:
    """Of others one alone, which then has all of the memory: the rest are let go."""

    def __init__(self, crew: Workers) -> None:
        self._crew = crew

    def workers(self) -> Collection[str]:
        """The first of those that are there."""
        there = list(self._crew.workers())
        for other in there[1:]:
            self._crew.lost(other)
        return there[:1]

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """Let it make a run."""
        return self._crew.submit(worker, number, changes)

    def lost(self, worker: str) -> str:
        """It died with a run."""
        return self._crew.lost(worker)

    def learn(self, outcome: Outcome) -> None:
        """A run has ended."""
        self._crew.learn(outcome)

    def close(self) -> None:
        """End all workers."""
        self._crew.close()
