"""Progress line of a sweep, list of the best runs, and full build of a run."""

import time
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from rich.console import Console
from rich.status import Status

from dsfab.app.terminal import print_result
from dsfab.core.errors import DsfabError
from dsfab.core.messages import duration, table
from dsfab.report.sweep_pages import first_metric
from dsfab.study.sweeps.folder import PRESET, SweepFolder
from dsfab.study.sweeps.folder import best as best_of
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.plan import Constraint
from dsfab.study.sweeps.runs import RunRow
from dsfab.study.sweeps.scheduler import Progress
from dsfab.study.variations import short_names, spelled_value


class SweepProgress:
    """Printer of the progress of a sweep on standard error. limits : conditions that the best run must meet."""

    def __init__(self, quiet: bool, metric: str, limits: Sequence[Constraint] = ()) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True, quiet=quiet)
        self._metric, self._limits = metric, limits
        self._best: tuple[float, int] | None = None
        self._status: Status | None = None
        self._told = 0.0

    def add_run(self, number: int, metrics: Mapping[str, float]) -> None:
        """Compare a finished run with the best run so far. metrics : measured values of the run, by name."""
        value = metrics.get(self._metric, float("nan"))
        if not isfinite(value) or not all(limit.holds(metrics) for limit in self._limits):
            return
        sign = -1 if ABOUT[self._metric].better == "more" else 1
        if self._best is None or sign * value < sign * self._best[0]:
            self._best = (value, number)

    def __call__(self, progress: Progress) -> None:
        """Print the progress of the sweep, and the error of a failed run."""
        outcome = progress.last
        if outcome is not None and outcome.error:
            limit = 110  # characters of the reason that are shown; the log has the whole reason
            short = outcome.error if len(outcome.error) <= limit else outcome.error[:limit] + "..."
            ended = "was killed" if outcome.killed else "failed"
            self._console.print(f"run {outcome.number} {ended}: {short}", markup=False)
        elif outcome is not None:
            self.add_run(outcome.number, outcome.metrics)
        line = self._line(progress)
        if self._console.is_terminal:
            if self._status is None:
                self._status = self._console.status(line)
                self._status.start()
            self._status.update(line)
        elif time.monotonic() - self._told > 10 or not progress.remaining:
            self._console.print(line, markup=False)
            self._told = time.monotonic()

    def _line(self, progress: Progress) -> str:
        killed = f", {progress.killed} killed" if progress.killed else ""
        parts = [f"{progress.done} done, {progress.failed} failed{killed}, {progress.remaining} left"]
        if progress.ended_now:
            parts.append(f"{progress.rate:.3g} runs/min")
            parts += [f"{duration(progress.seconds_left)} left"] if progress.remaining else []
        if self._best is not None:
            unit = ABOUT[self._metric].unit
            parts.append(f"best {self._metric} {self._best[0]:.4g}{' ' + unit if unit else ''} (run {self._best[1]})")
        return "; ".join(parts)

    def print_line(self, text: str) -> None:
        """Print a line of text."""
        self._console.print(text, markup=False)

    def stop(self) -> None:
        """Remove the progress line from the terminal."""
        if self._status:
            self._status.stop()
            self._status = None


def list_or_build_run(path: Path, best_count: int | None, by: str | None, number: int | None, quiet: bool) -> int:
    """Build run `number` of a sweep; if `number` is None, print the best runs. Return the exit code.
    by : metric that orders the runs. Raises DsfabError for a missing sweep or run."""
    sweep = SweepFolder.from_folder(path)
    if number is None:
        print_result(_best_runs_table(sweep, best_count or 0, by))
        return 0
    from dsfab.app.build import Files, build
    from dsfab.app.build_page import Output
    from dsfab.app.options import Source

    changes = next((row.changes for row in sweep.rows() if row.number == number), None)
    if changes is None:
        raise DsfabError(f"{path} has no run {number}; give a number from 1 to {len(sweep.rows())}")
    sets = tuple(f"{key}={spelled_value(value)}" for key, value in changes.items())
    files = Files(path / "built" / f"{number:05}")
    return build(str(path / PRESET), source=Source(sets), files=files, output=Output(quiet))


def _best_runs_table(sweep: SweepFolder, count: int, by: str | None) -> str:
    plan = sweep.plan
    metric = by or first_metric(plan)
    if metric not in plan.measured_metrics:
        raise DsfabError(
            f"{sweep.path} has no values of the metric {metric!r}; use one of {', '.join(plan.measured_metrics)}"
        )
    if count < 1:
        raise DsfabError(f"--best {count} is less than 1; give 1 or more")
    best_rows = best_of(sweep.rows(), metric, plan.limits)[:count]
    if not best_rows:
        limits = f" that meets {', '.join(plan.constraints)}" if plan.constraints else ""
        raise DsfabError(f"{sweep.path} has no finished run with a value of {metric}{limits}; continue the sweep")
    keys = list(dict.fromkeys(key for row in best_rows for key in row.changes))
    short = short_names(keys)
    metrics = [metric, *(name for name in plan.measured_metrics if name != metric)]

    def line(row: RunRow) -> list[str]:
        numbers = [f"{row.metrics.get(name, float('nan')):.4g}" for name in metrics]
        return [str(row.number), *numbers, *(spelled_value(row.changes.get(key)) for key in keys)]

    return table(["run", *metrics, *(short[key] for key in keys)], [line(row) for row in best_rows])
