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

    def lost(self, worker: str) -> None:
        """A worker died with a run."""

    def learn(self, outcome: Outcome) -> None:
        """A run has ended: its memory tells how many workers there may be."""

    def close(self) -> None:
        """End all workers at once, whatever they do."""
