"""How a sweep is going: one live line on a terminal, a plain line now and then in a pipe."""

import time
from collections.abc import Mapping, Sequence
from math import isfinite

from rich.console import Console
from rich.status import Status

from dsfab.study.sweeps.constraints import Constraint
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.scheduler import Progress
from dsfab.wording import duration

EVERY = 10.0
"""Seconds between two lines in a pipe."""

LONGEST = 110
"""Characters of a failure's reason that are shown; its log has all of it."""


class SweepProgress:
    """Says on standard error where a sweep stands. `metric`: of which the best so far is told."""

    def __init__(self, quiet: bool, metric: str, limits: Sequence[Constraint] = ()) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)
        self._metric, self._limits = metric, limits
        self._best: tuple[float, int] | None = None
        self._status: Status | None = None
        self._told = 0.0

    def knows(self, number: int, metrics: Mapping[str, float]) -> None:
        """A run that worked: of now, or of an earlier session."""
        value = metrics.get(self._metric, float("nan"))
        if not isfinite(value) or not all(limit.holds(metrics) for limit in self._limits):
            return
        sign = -1 if ABOUT[self._metric].better == "more" else 1
        if self._best is None or sign * value < sign * self._best[0]:
            self._best = (value, number)

    def __call__(self, progress: Progress) -> None:
        """A run has ended (or the first is about to begin)."""
        outcome = progress.last
        if outcome is not None and outcome.error:
            short = outcome.error if len(outcome.error) <= LONGEST else outcome.error[:LONGEST] + "..."
            ended = "was killed" if outcome.killed else "failed"
            self._console.print(f"run {outcome.number} {ended}: {short}", markup=False)
        elif outcome is not None:
            self.knows(outcome.number, outcome.metrics)
        line = self._line(progress)
        if self._console.is_terminal:
            self._status = self._status or self._begun(line)
            self._status.update(line)
        elif time.monotonic() - self._told > EVERY or not progress.left:
            self._console.print(line, markup=False)
            self._told = time.monotonic()

    def _begun(self, line: str) -> Status:
        status = self._console.status(line)
        status.start()
        return status

    def _line(self, progress: Progress) -> str:
        killed = f", {progress.killed} killed" if progress.killed else ""
        parts = [f"{progress.done} done, {progress.failed} failed{killed}, {progress.left} left"]
        if progress.ended_now:
            parts.append(f"{progress.rate:.3g} runs/min")
            parts += [f"{duration(progress.seconds_left)} left"] if progress.left else []
        if self._best is not None:
            unit = ABOUT[self._metric].unit
            parts.append(f"best {self._metric} {self._best[0]:.4g}{' ' + unit if unit else ''} (run {self._best[1]})")
        return "; ".join(parts)

    def say(self, text: str) -> None:
        """A line of its own."""
        self._console.print(text, markup=False)

    def stop(self) -> None:
        """Take the live line away."""
        if self._status:
            self._status.stop()
            self._status = None
