"""Runs of a sweep: sampling of the varied values, a SQLite database of runs, and the search for the best run."""

import csv
import hashlib
import json
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import product
from math import isfinite, log
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError, PresetError
from dsfab.preset.file import parse_override, with_overrides
from dsfab.preset.model import Preset
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.plan import Axis, Constraint, Plan

Changes = dict[str, Any]
MOST = 1_000_000  # limit on the number of runs


def points(plan: Plan) -> list[Changes]:
    """Return the changed values of each run of a plan, without duplicates.
    `plan.sampling` is grid, csv, sobol (scrambled Sobol points) or lhs [McKay, Beckman, Conover 1979].
    Raises PresetError for more than `MOST` points, and for a CSV file that cannot be read."""
    kind, _, rest = plan.sampling.partition(":")
    if kind == "csv":
        runs: Iterator[Changes] = from_csv(Path(rest))
    elif kind == "grid":
        runs = _grid(plan.axes)
    else:
        runs = (point_on_axes(plan.axes, u) for u in _unit(kind, int(rest), len(plan.axes), plan.seed))
    return list({digest(changes): changes for changes in runs}.values())


def digest(changes: Mapping[str, Any]) -> str:
    """Return a hash of the changed values of a run; it identifies the run."""
    return hashlib.sha256(json.dumps(changes, sort_keys=True, default=str).encode()).hexdigest()[:20]


def point_on_axes(axes: list[Axis], u: Floats) -> Changes:
    """Return the changed values of the run with the positions u (k,) on k axes. A position is 0 (start) to 1 (end)."""
    changes: Changes = {}
    for axis, place in zip(axes, u, strict=True):
        changes.update(axis.changes_at(float(place)))
    return changes


def trials(plan: Plan) -> list[Changes]:
    """Return the changed values of runs that test whether a plan is valid.
    In each run, one axis of the plan is at its start, end or an inner point. All other axes are at their middle."""
    middle = np.full(len(plan.axes), 0.5)
    runs = []
    for i, axis in enumerate(plan.axes):
        for u in np.linspace(0, 1, max(len(axis.rows), 3)):
            place = middle.copy()
            place[i] = u
            runs.append(point_on_axes(plan.axes, place))
    return runs


def check_points(preset: Preset, runs: list[Changes]) -> None:
    """Raise PresetError if the changes of `runs` have invalid keys or values. Only the first 5000 runs are checked."""
    wrong: dict[str, None] = {}
    for changes in runs[:5000]:
        try:
            with_overrides(preset, changes)
        except PresetError as error:
            wrong.setdefault(str(error))
    if wrong:
        shown = list(wrong)[:3]
        remainder = f" (and {len(wrong) - len(shown)} more mistakes)" if len(wrong) > len(shown) else ""
        raise PresetError("; ".join(shown) + remainder)


def _grid(axes: list[Axis]) -> Iterator[Changes]:
    listed = [axis.grid_changes() for axis in axes]
    total = int(np.prod([float(len(values)) for values in listed]))
    if total > MOST:
        raise PresetError(f'the full grid has {total:,} runs, too many; give fewer values, or sampling = "sobol:200"')
    for chosen in product(*listed):
        yield {key: value for part in chosen for key, value in part.items()}


def _unit(kind: str, count: int, dimensions: int, seed: int) -> Floats:
    if count > MOST:
        raise PresetError(f"{kind}:{count} has too many runs; use up to {MOST:,}")
    if kind == "lhs":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(count))
    sampler = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
    return np.asarray(sampler.random_base2(max(count - 1, 0).bit_length())[:count])


def from_csv(path: Path) -> Iterator[Changes]:
    """Yield the changed values in each row of a CSV file. Column names are dotted preset keys.
    If some column names begin with 'in:', only these columns are used. Raises PresetError if no row can be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PresetError(f"points {path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    names = list(rows[0]) if rows else []
    keys = {name: name.removeprefix("in:") for name in names if name and name.startswith("in:")}
    keys = keys or {name: name for name in names if name}
    if not rows or not keys:
        raise PresetError(f"{path.name} has no rows; write dotted keys in the first row, and a row for each run")
    for row in rows:
        yield {key: parse_override(f"{key}={row[name] or ''}")[1] for name, key in keys.items()}


NAME, FORMAT = "runs.db", 1
State = Literal["waiting", "running", "done", "failed", "killed"]
"""State of a run. failed: the design cannot be built. killed: the operating system ended its worker processes."""
_KILLED_ONCE = "state = 'failed' AND error LIKE 'the worker was killed % times while it made this run%'"
"""SQL condition for runs that an older dsfab recorded as failed, although they were killed."""
_SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE runs (
    number INTEGER PRIMARY KEY, digest TEXT NOT NULL UNIQUE, changes TEXT NOT NULL, state TEXT NOT NULL,
    tries INTEGER NOT NULL DEFAULT 0, lost INTEGER NOT NULL DEFAULT 0, ended REAL, seconds REAL, peak INTEGER,
    worker TEXT, metrics TEXT NOT NULL DEFAULT '{}', files TEXT NOT NULL DEFAULT '[]', error TEXT NOT NULL DEFAULT '');
CREATE INDEX by_state ON runs (state);
"""


@dataclass(frozen=True)
class RunRow:
    """A run in the database. tries : number of starts.    lost : number of workers that died during the run."""

    number: int
    changes: Mapping[str, Any]
    state: State
    metrics: Mapping[str, float] = field(default_factory=dict)
    error: str = ""
    files: tuple[str, ...] = ()
    seconds: float | None = None
    tries: int = 0
    lost: int = 0


class Store:
    """The database of a sweep folder. Use it as `with Store.open(folder) as store`.
    Methods raise DsfabError if the disk is full or the file cannot be used."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path, self._db = path, connection

    @classmethod
    def create(cls, folder: Path) -> "Store":
        """Open or create the database of a sweep."""
        return cls._connect(folder / NAME)

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """Open the database of a sweep. Raises DsfabError if the database is missing."""
        if not (folder / NAME).is_file():
            raise DsfabError(f"{folder} holds no sweep ({NAME} is missing); give the folder or the file of a sweep")
        return cls._connect(folder / NAME)

    @classmethod
    def _connect(cls, path: Path) -> "Store":
        try:
            connection = sqlite3.connect(path, timeout=30, isolation_level=None)
        except sqlite3.Error as error:
            raise _refusal(path, error) from error
        store = cls(path, connection)
        try:
            store._begin()
        except BaseException:
            connection.close()
            raise
        return store

    def _begin(self) -> None:
        path, connection = self._path, self._db
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
            if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone():
                with self._change() as db:
                    for statement in _SCHEMA.split(";"):
                        db.execute(statement)
                    db.execute("INSERT INTO meta VALUES ('format', ?)", (str(FORMAT),))
        except sqlite3.Error as error:
            raise _refusal(path, error) from error
        if self.meta("format") != str(FORMAT):
            raise DsfabError(f"{path} was written by another version of dsfab; use that version, or another folder")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    @contextmanager
    def _change(self) -> Iterator[sqlite3.Connection]:
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield self._db
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise _refusal(self._path, error) from error

    def _read(self, query: str, values: Sequence[Any] = ()) -> list[Any]:
        try:
            return self._db.execute(query, values).fetchall()
        except sqlite3.Error as error:
            raise _refusal(self._path, error) from error

    def meta(self, key: str) -> str | None:
        """Return the text that is recorded under a key, such as 'plan'; None if there is none."""
        rows = self._read("SELECT value FROM meta WHERE key = ?", (key,))
        return str(rows[0][0]) if rows else None

    def describe(self, texts: Mapping[str, str]) -> None:
        """Record texts about the sweep, each under its key, such as 'plan'."""
        with self._change() as db:
            db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", list(texts.items()))

    def add(self, runs: Sequence[Mapping[str, Any]], texts: Mapping[str, str]) -> int:
        """Record the new runs among `runs` as waiting, and `texts` under their keys. Return the number of new runs."""
        with self._change() as db:
            before = db.total_changes
            number = db.execute("SELECT coalesce(max(number), 0) FROM runs").fetchone()[0]
            digests = {row[0] for row in db.execute("SELECT digest FROM runs")}
            fresh = [run for run in runs if digest(run) not in digests]
            db.executemany(
                "INSERT INTO runs (number, digest, changes, state) VALUES (?, ?, ?, 'waiting')",
                [(number + i, digest(run), json.dumps(run)) for i, run in enumerate(fresh, start=1)],
            )
            count = db.total_changes - before
            db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", list(texts.items()))
        return count

    def reset_to_waiting(self, states: Sequence[State] = ("running",)) -> int:
        """Set all runs in `states` to the state "waiting", and return the number of these runs."""
        marks = ", ".join("?" * len(states))
        with self._change() as db:
            db.execute(f"UPDATE runs SET state = 'killed' WHERE {_KILLED_ONCE}")
            return db.execute(f"UPDATE runs SET state = 'waiting' WHERE state IN ({marks})", tuple(states)).rowcount

    def start(self, number: int, worker: str) -> None:
        """Record that a run begins. number : number of the run.    worker : name of its worker process."""
        with self._change() as db:
            db.execute(
                "UPDATE runs SET state = 'running', worker = ?, tries = tries + 1 WHERE number = ?", (worker, number)
            )

    def lose(self, number: int) -> None:
        """Record that the worker process of a run died. The run waits again. number : number of the run."""
        with self._change() as db:
            db.execute("UPDATE runs SET state = 'waiting', lost = lost + 1 WHERE number = ?", (number,))

    def give_up(self, number: int, why: str, files: Sequence[str] = ()) -> None:
        """Record a run in the state "killed". number : number of the run.    why : error message."""
        with self._change() as db:
            db.execute(
                "UPDATE runs SET state = 'killed', error = ?, files = ?, ended = ? WHERE number = ?",
                (why, json.dumps(list(files)), time.time(), number),
            )

    def finish(
        self,
        number: int,
        metrics: Mapping[str, float],
        error: str = "",
        files: Sequence[str] = (),
        seconds: float = 0.0,
        peak: int = 0,
    ) -> None:
        """Record the results of a run: "failed" if `error` is not empty, else "done". peak : largest memory, bytes."""
        state, texts = "failed" if error else "done", (json.dumps(metrics), error, json.dumps(list(files)))
        with self._change() as db:
            db.execute(
                "UPDATE runs SET state = ?, metrics = ?, error = ?, files = ?, seconds = ?, peak = ?, ended = ? "
                "WHERE number = ?",
                (state, *texts, seconds, peak, time.time(), number),
            )

    def counts(self) -> dict[str, int]:
        """Return the number of runs in each state."""
        return dict(self._read("SELECT state, count(*) FROM runs GROUP BY state"))

    def rows(self, state: State | None = None) -> list[RunRow]:
        """Return all runs, or the runs in the given state, in the order of their numbers."""
        where, values = ("WHERE state = ?", (state,)) if state else ("", ())
        columns = "number, changes, state, metrics, error, files, seconds, tries, lost"
        records = self._read(f"SELECT {columns} FROM runs {where} ORDER BY number", values)
        return [
            RunRow(n, json.loads(c), s, json.loads(m), e, tuple(json.loads(f)), t, tries, lost)
            for n, c, s, m, e, f, t, tries, lost in records
        ]


def _refusal(path: Path, error: sqlite3.Error) -> DsfabError:
    text = str(error)
    if "full" in text or "disk I/O" in text:
        return DsfabError(
            f"{path} cannot be written: {text}; recorded runs are kept: free disk space and give the command again"
        )
    if "readonly" in text or "unable to open" in text:
        return DsfabError(f"{path} cannot be written: {text}; choose another folder with -o")
    if "locked" in text or "busy" in text:
        return DsfabError(f"{path} is in use by another program; wait until it has ended")
    return DsfabError(f"{path} cannot be used: {text}; restore the file from a copy, or begin in another folder")


FEWEST, PER_AXIS = 12, 4
"""Number of runs in a generation of a search: PER_AXIS for each axis, but at least FEWEST.
It does not depend on the number of evaluations, so that a longer search begins like a shorter search."""
MISSED, FAILED, NOT_MADE = 1e3, 1e6, 1e9
"""Costs in a search [Deb 2000]. MISSED: smallest cost of a run that does not meet all constraints.
FAILED: cost of a failed run. NOT_MADE: cost of a run that was not made."""
Make = Callable[[Sequence[Mapping[str, Any]]], Mapping[str, RunRow]]
"""Function that carries out those proposed runs that have no result yet, and returns all recorded runs by `digest`."""


def search(plan: Plan, make: Make) -> None:
    """Search for the run with the best `plan.search.metric` under the constraints. make : carries out proposed runs."""
    _Search(plan, make).run()


def cost(row: RunRow | None, metric: str, limits: Sequence[Constraint]) -> float:
    """Return the cost of a run for the search. Better runs have smaller costs.
    A run that failed or does not meet all constraints `limits` costs at least `MISSED`."""
    if row is None:
        return NOT_MADE
    value = row.metrics.get(metric, float("nan"))
    if row.state != "done" or not isfinite(value):
        return FAILED
    missed = sum(limit.missed_by(row.metrics) for limit in limits)
    if not all(limit.holds(row.metrics) for limit in limits):
        return MISSED + min(missed, MISSED)
    sign = -1.0 if ABOUT[metric].better == "more" else 1.0
    return sign * (log(value) if value > 0 else value - MISSED / 2)


class _Search:
    def __init__(self, plan: Plan, make: Make) -> None:
        assert plan.search is not None
        self.ask, self.axes, self.limits, self.seed = plan.search, plan.axes, plan.limits, plan.seed
        self.make = make
        self.made: set[str] = set()

    def run(self) -> None:
        count = max(FEWEST, PER_AXIS * len(self.axes))
        evolve: Any = differential_evolution  # Any, because SciPy's type stubs lack some of the options
        steps = {"strategy": "best1bin", "mutation": (0.4, 0.9), "recombination": 0.8, "polish": False}
        end = {"maxiter": 100 * self.ask.evaluations, "tol": 0, "atol": 1e-9, "callback": self._enough}
        whole_generations = {"vectorized": True, "updating": "deferred"}
        first = _unit("sobol", count, len(self.axes), self.seed)
        options = {**steps, **end, **whole_generations, "init": first, "rng": np.random.default_rng(self.seed)}
        evolve(self._costs, [(0.0, 1.0)] * len(self.axes), **options)

    def _costs(self, u: Floats) -> Floats:
        proposed = [point_on_axes(self.axes, np.clip(column, 0.0, 1.0)) for column in u.T]
        names = [digest(changes) for changes in proposed]
        fresh = list(dict.fromkeys(name for name in names if name not in self.made))
        allowed = set(fresh[: self.ask.evaluations - len(self.made)]) | self.made
        selected = {name: changes for name, changes in zip(names, proposed, strict=True) if name in allowed}
        rows = self.make(list(selected.values()))
        self.made.update(selected)
        results = [rows.get(name) if name in selected else None for name in names]
        return np.array([cost(row, self.ask.metric, self.limits) for row in results])

    def _enough(self, *_: Any, **__: Any) -> bool:
        return len(self.made) >= self.ask.evaluations
