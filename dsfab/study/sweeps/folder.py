"""The folder of a sweep: its lock, files and tables of results."""

import csv
import json
import os
import platform
import sqlite3
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import StringIO
from math import isfinite
from pathlib import Path
from typing import Any

from dsfab.core.errors import DsfabError, ExportError
from dsfab.export import atomic_file, write_chunks
from dsfab.preset.file import preset_toml
from dsfab.preset.model import Preset
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.plan import Constraint, Plan, base_preset, load_plan, plan_toml
from dsfab.study.sweeps.runs import RunRow, State, Store, check_points, digest, points, search, trials
from dsfab.study.sweeps.scheduler import TRIES, Progress, conduct, current_progress
from dsfab.study.sweeps.workers import Changes, Drawer, Job, OneWorker, Outcome, Workers, mesh_of

NAME = "coordinator.lock"


@contextmanager
def only_coordinator(folder: Path) -> Iterator[None]:
    """Lock a sweep folder while the `with` block runs. Raises DsfabError if another process has locked the folder."""
    holder = folder / f"{NAME}.txt"
    connection = sqlite3.connect(folder / NAME, timeout=0, isolation_level=None)
    try:
        try:
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            if "locked" not in str(error):
                raise DsfabError(f"{folder} cannot be written: {error}; choose another folder with -o") from error
            raise DsfabError(f"{_held_by(holder)} is running the sweep in {folder} already; wait or stop it") from None
        with suppress(OSError):
            holder.write_text(f"process {os.getpid()} on {platform.node()}", encoding="utf-8")
        yield
        with suppress(OSError):
            holder.unlink()
    finally:
        connection.close()


def _held_by(holder: Path) -> str:
    try:
        return holder.read_text(encoding="utf-8") or "another dsfab"
    except OSError:
        return "another dsfab"


CSV, PARQUET, PICTURES = "results.csv", "results.parquet", "pictures"


def feasible(row: RunRow, limits: Iterable[Constraint]) -> bool:
    """Return True if a run has succeeded and meets all constraints."""
    return row.state == "done" and all(limit.holds(row.metrics) for limit in limits)


def best(rows: Iterable[RunRow], metric: str, limits: Sequence[Constraint] = ()) -> list[RunRow]:
    """Return the runs that meet the constraints `limits` and have a value of `metric`, the best run first."""
    sign = -1 if ABOUT[metric].better == "more" else 1
    usable = [row for row in rows if feasible(row, limits) and isfinite(row.metrics.get(metric, float("nan")))]
    return sorted(usable, key=lambda row: (sign * row.metrics[metric], row.number))


def pareto(
    rows: Iterable[RunRow], first_metric: str, second_metric: str, limits: Sequence[Constraint] = ()
) -> list[RunRow]:
    """Return the Pareto front of the runs that meet the constraints `limits`, with the best `first_metric` first."""
    front: list[RunRow] = []
    sign = -1 if ABOUT[second_metric].better == "more" else 1
    usable = [row for row in best(rows, first_metric, limits) if isfinite(row.metrics.get(second_metric, float("nan")))]
    first_sign = -1 if ABOUT[first_metric].better == "more" else 1

    def rank(row: RunRow) -> tuple[float, float, int]:
        return first_sign * row.metrics[first_metric], sign * row.metrics[second_metric], row.number

    for row in sorted(usable, key=rank):
        if not front or sign * row.metrics[second_metric] < sign * front[-1].metrics[second_metric]:
            front.append(row)
    return front


def picture_of(row: RunRow) -> str:
    """Return the path of a run's picture, relative to the sweep's folder; '' if the run has no picture."""
    return next((name for name in row.files if name.startswith(f"{PICTURES}/")), "")


def records(rows: Sequence[RunRow], metrics: Sequence[str], limits: Sequence[Constraint]) -> list[dict[str, Any]]:
    """Return a row of the results table for each run, as a dict. limits : constraints for the column `feasible`."""
    keys = list(dict.fromkeys(key for row in rows for key in row.changes))
    return [
        {
            "run": row.number,
            "state": row.state,
            **{f"in:{key}": row.changes.get(key) for key in keys},
            **{f"out:{name}": row.metrics.get(name) for name in metrics},
            "out:seconds": row.seconds,
            "feasible": feasible(row, limits),
            "error": row.error,
            "img": picture_of(row),
        }
        for row in rows
    ]


def write_tables(folder: Path, table: Sequence[Mapping[str, Any]]) -> list[Path]:
    """Write the rows `table` to results.csv and, if possible, results.parquet. Return the paths. Raises ExportError."""
    if not table:
        return []
    text = StringIO()
    writer = csv.DictWriter(text, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    written = [folder / CSV]
    with atomic_file(written[0]) as temporary:
        write_chunks(temporary, [text.getvalue().encode()])
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return written
    columns = {name: [_plain(record[name]) for record in table] for name in table[0]}
    written.append(folder / PARQUET)
    with atomic_file(written[1]) as temporary:
        parquet.write_table(pyarrow.table({name: _column(values) for name, values in columns.items()}), temporary)
    return written


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _column(values: list[Any]) -> list[Any]:
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1:
        return values
    kind: type = float if kinds <= {int, float} else str
    return [None if value is None else kind(value) for value in values]


SWEEP, PRESET = "sweep.toml", "preset.toml"
DESIGNS, LOGS = "designs", "logs"
HARMLESS = {"constraints"}  # keys of a plan that may always change, because no run depends on these keys
RENEWING = {"metrics", "keep", "formats", "size", "view"}  # a change of these keys (--extend) repeats all runs
TRIED_AGAIN: tuple[State, ...] = ("killed",)  # states of runs that a new session repeats by default


@dataclass(frozen=True)
class SweepFolder:
    """An existing sweep: its folder, its plan, and the preset that all runs change."""

    path: Path
    plan: Plan
    preset: Preset

    @classmethod
    def from_folder(cls, path: Path) -> "SweepFolder":
        """Return the sweep in a folder. Raises DsfabError if the folder contains no valid sweep."""
        if not (path / SWEEP).is_file():
            raise DsfabError(f"{path} holds no sweep ({SWEEP} is missing); give the folder or the file of a sweep")
        plan = load_plan(path / SWEEP)
        return cls(path, plan, base_preset(plan))

    def job(self, draw: Drawer | None = None, ship_mesh: bool = False) -> Job:
        """Return the data that worker processes need for all runs. draw : function that draws a picture of a design.
        ship_mesh : True to include the content of the mesh file, for workers on other machines."""
        values = self.preset.model_dump(mode="json", exclude_none=True)
        mesh = mesh_of(self.preset) if ship_mesh else None
        plan = self.plan
        token = f"{self.path.absolute()} {plan_toml(plan)}"
        return Job(token, values, plan.measured_metrics, plan.keep, plan.formats, draw, mesh)

    def rows(self) -> list[RunRow]:
        with Store.open(self.path) as store:
            return store.rows()

    def run(
        self,
        crew: Workers,
        report: Callable[[Progress], None] = lambda progress: None,
        retry: Collection[State] = TRIED_AGAIN,
    ) -> None:
        """Carry out the waiting and interrupted runs, and the runs in the states `retry`, on the workers `crew`."""
        with Store.open(self.path) as store:
            store.reset_to_waiting(("running", *retry))
            try:
                if self.plan.search is None:
                    self._make(store, crew, report, current_progress(store))
                else:
                    self._search(store, crew, report, self.plan.search.evaluations)
            finally:
                with suppress(DsfabError):
                    store.reset_to_waiting()
                with suppress(DsfabError):
                    self.write_tables()

    def _make(self, store: Store, crew: Workers, report: Callable[[Progress], None], progress: Progress) -> None:
        waiting = store.rows("waiting")
        together = {row.number: row.changes for row in waiting if row.lost < TRIES}
        conduct(store, crew, together, self.deliver, report, progress)
        if careful := {row.number: row.changes for row in waiting if row.lost >= TRIES}:
            conduct(store, OneWorker(crew), careful, self.deliver, report, progress)

    def _search(self, store: Store, crew: Workers, report: Callable[[Progress], None], total: int) -> None:
        progress = current_progress(store, max(total, sum(store.counts().values())))

        def make(proposed: Sequence[Changes]) -> dict[str, RunRow]:
            store.add(proposed, {})
            if store.rows("waiting"):
                self._make(store, crew, report, progress)
            return {digest(row.changes): row for row in store.rows()}

        search(self.plan, make)

    def write_tables(self) -> list[Path]:
        """Write tables of the results that are available so far. Return the paths."""
        return write_tables(self.path, records(self.rows(), self.plan.measured_metrics, self.plan.limits))

    def deliver(self, outcome: Outcome, changes: Changes) -> list[str]:
        """Write the files of a run, and a log if it failed. Return the names of the files. Raises ExportError."""
        names = []
        for name, content in outcome.files.items():
            place = f"{PICTURES}/{outcome.number:05}.png" if name == "picture.png" else None
            names.append(place or f"{DESIGNS}/{outcome.number:05}/{name}")
            _write(self.path / names[-1], content)
        if outcome.error:
            _write(self.path / LOGS / f"{outcome.number:05}.txt", self._log(outcome, changes).encode())
        return names

    def _log(self, outcome: Outcome, changes: Changes) -> str:
        values = "\n".join(f"  {key} = {value!r}" for key, value in changes.items())
        measured = "\n".join(f"  {name} = {value!r}" for name, value in outcome.metrics.items()) or "  nothing"
        ended = "was killed" if outcome.killed else f"failed after {outcome.seconds:.2f} s"
        return (
            f"run {outcome.number} of {self.preset.name} {ended}\n\n{outcome.error}\n\n"
            f"changed values:\n{values}\n\nmetrics before the end:\n{measured}\n"
            + (f"\n{outcome.log}" if outcome.log else "")
        )


def checked_plan(plan: Plan) -> tuple[Preset, list[dict[str, Any]]]:
    """Return the base preset of a plan, and the changed values of each run (none for a search). Raises PresetError."""
    preset, runs = base_preset(plan), points(plan) if plan.search is None else []
    check_points(preset, runs or trials(plan))
    return preset, runs


def prepare(
    plan: Plan, folder: Path, extend: bool = False, checked: tuple[Preset, list[dict[str, Any]]] | None = None
) -> SweepFolder:
    """Create or update the folder of a sweep and record its runs. Call this function inside `only_coordinator`.
    checked : result of `checked_plan`, if known.    extend : True to accept a changed plan, which may add runs.
    Raises DsfabError for a changed plan without `extend`, and PresetError for invalid keys and values."""
    preset, runs = checked_plan(plan) if checked is None else checked
    settled = _portable_plan(plan, runs)
    texts = {"plan": plan_toml(settled), "preset": preset_toml(preset)}
    with Store.create(folder) as store:
        recorded_plan, old_preset = store.meta("plan"), store.meta("preset")
        if recorded_plan is not None:
            was, now = tomllib.loads(recorded_plan), tomllib.loads(texts["plan"])
            changed = {key for key in {*was, *now} if json.dumps(was.get(key)) != json.dumps(now.get(key))} - HARMLESS
            if old_preset != texts["preset"]:
                raise DsfabError(f"{folder} holds a sweep of another preset; choose another folder with -o")
            if changed and not extend:
                raise DsfabError(
                    f"{folder} holds another sweep (different settings: {', '.join(sorted(changed))}); use --extend to "
                    "add the new runs, or choose another folder with -o"
                )
            if changed & RENEWING:
                store.reset_to_waiting(("done", "failed", "killed"))
        store.add(runs, texts)
    _write(folder / PRESET, texts["preset"].encode())
    _write(folder / SWEEP, texts["plan"].encode())
    return SweepFolder(folder, settled.model_copy(update={"preset": str(folder.absolute() / PRESET)}), preset)


def sweep_folder(folder: Path) -> Path:
    """Create a folder, unless it exists, and return its path. Raises ExportError if this fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write to {folder}: {error.strerror}; choose another folder with -o") from None
    return folder


def _portable_plan(plan: Plan, runs: list[dict[str, Any]]) -> Plan:
    update: dict[str, Any] = {"preset": PRESET, "set": {}, "mesh": None}
    if plan.sampling.startswith("csv:"):
        columns = {key: tuple(changes[key] for changes in runs) for key in runs[0]}
        update.update(sampling="grid", linked=(columns,))
    return plan.model_copy(update=update)


def _write(path: Path, content: bytes) -> None:
    sweep_folder(path.parent)
    with atomic_file(path) as temporary:
        write_chunks(temporary, [content])
