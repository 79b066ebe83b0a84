"""Workers of a Dask cluster: the same runs, anywhere. No common file system is needed, results travel as data."""

from collections.abc import Collection
from concurrent.futures import Executor, Future
from typing import Any, cast

from dsfab.errors import DsfabError
from dsfab.study.sweeps.worker import Job, Outcome, execute
from dsfab.study.sweeps.workers import Changes

SECONDS = 20
"""A scheduler that has not answered by then is not there."""


class DaskWorkers:
    """The workers of a scheduler, those that join later too; when one dies, Dask gives its run to another.

    Each worker makes one run at a time, so give it one thread (`dask worker --nthreads 1`), and one worker to a core.
    Raises DsfabError where dask is not installed or nobody answers.
    """

    def __init__(self, job: Job, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise DsfabError("--scheduler needs Dask: install dsfab[cluster]") from None
        try:
            self._client: Any = Client(scheduler, timeout=SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise DsfabError(
                f"no Dask scheduler answers at {scheduler}: {error}; start one with `dask scheduler`"
            ) from (None)
        self._job = job
        self._executors: dict[str, Executor] = {}

    def workers(self) -> Collection[str]:
        # n_workers=-1: newer versions list five workers only when nothing is said
        """Addresses of the workers that the cluster has now."""
        found = self._client.scheduler_info(n_workers=-1)["workers"]
        return list(found)

    def submit(self, worker: str, number: int, changes: Changes) -> "Future[Outcome]":
        """The outcome to come of a run on that worker."""
        if worker not in self._executors:
            self._executors[worker] = self._client.get_executor(
                workers=[worker], allow_other_workers=True, pure=False, retries=0
            )
        return cast("Future[Outcome]", self._executors[worker].submit(execute, self._job, number, changes))

    def lost(self, worker: str) -> str:
        """Forget a worker that is gone; why, nobody here knows."""
        self._executors.pop(worker, None)
        return ""

    def learn(self, outcome: Outcome) -> None:
        """Nothing to learn: who starts the workers knows their memory."""

    def close(self) -> None:
        """Leave the cluster."""
        self._client.close()
