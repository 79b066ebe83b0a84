"""The runs of a sweep on disk: one SQLite file, written by one coordinator, whole after a crash or a power cut.

SQLite in WAL mode with full synchronisation: what was recorded stays recorded. Anybody may read while it is written.
"""

import json
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

from dsfab.errors import DsfabError
from dsfab.study.sweeps.sampling import digest

NAME, FORMAT = "runs.db", 1

State = Literal["waiting", "running", "done", "failed", "killed"]
"""Failed: the design refuses to be made. Killed: its worker was, from outside: nothing is known of the design."""

_KILLED_ONCE = "state = 'failed' AND error LIKE 'the worker was killed % times while it made this run%'"
"""Runs that an earlier dsfab, which knew no `killed`, took for failed."""

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
    """One run as it is recorded: tries counts how often it was begun, lost how often its worker died, ever."""

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
    """The database of a sweep folder; use as `with Store.open(folder) as store`.

    Every method raises DsfabError, in one sentence, when the disk is full or the file cannot be used.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path, self._db = path, connection

    @classmethod
    def create(cls, folder: Path) -> "Store":
        """The database of a new sweep, or the one that is there."""
        return cls._opened(folder / NAME)

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """The database of a sweep; raises DsfabError where there is none."""
        if not (folder / NAME).is_file():
            raise DsfabError(f"{folder} holds no sweep ({NAME} is missing); give a sweep's folder or a sweep file")
        return cls._opened(folder / NAME)

    @classmethod
    def _opened(cls, path: Path) -> "Store":
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
        """Make the tables where there are none, and look whether they are ours."""
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
            raise DsfabError(f"{path} was written by another version of dsfab; use that one, or another folder")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    @contextmanager
    def _change(self) -> Iterator[sqlite3.Connection]:
        """All of what is written inside, or nothing."""
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
        """A text about the sweep."""
        found = self._read("SELECT value FROM meta WHERE key = ?", (key,))
        return str(found[0][0]) if found else None

    def describe(self, texts: Mapping[str, str]) -> None:
        """Keep texts about the sweep."""
        with self._change() as db:
            db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", list(texts.items()))

    def add(self, runs: Sequence[Mapping[str, Any]], texts: Mapping[str, str]) -> int:
        """Record runs that are not there yet, waiting, and texts with them; returns how many were new."""
        with self._change() as db:
            before = db.total_changes
            number = db.execute("SELECT coalesce(max(number), 0) FROM runs").fetchone()[0]
            known = {row[0] for row in db.execute("SELECT digest FROM runs")}
            fresh = [run for run in runs if digest(run) not in known]
            db.executemany(
                "INSERT INTO runs (number, digest, changes, state) VALUES (?, ?, ?, 'waiting')",
                [(number + i, digest(run), json.dumps(run)) for i, run in enumerate(fresh, start=1)],
            )
            count = db.total_changes - before
            db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", list(texts.items()))
        return count

    def again(self, states: Sequence[State] = ("running",)) -> int:
        """Let runs in these states wait again: those in progress when a coordinator died, or all of them."""
        marks = ", ".join("?" * len(states))
        with self._change() as db:
            db.execute(f"UPDATE runs SET state = 'killed' WHERE {_KILLED_ONCE}")
            return db.execute(f"UPDATE runs SET state = 'waiting' WHERE state IN ({marks})", tuple(states)).rowcount

    def start(self, number: int, worker: str) -> None:
        """Record that a run begins."""
        with self._change() as db:
            db.execute(
                "UPDATE runs SET state = 'running', worker = ?, tries = tries + 1 WHERE number = ?", (worker, number)
            )

    def lose(self, number: int) -> None:
        """Record that the worker of a run died: it waits again."""
        with self._change() as db:
            db.execute("UPDATE runs SET state = 'waiting', lost = lost + 1 WHERE number = ?", (number,))

    def give_up(self, number: int, why: str, files: Sequence[str] = ()) -> None:
        """Record that a run is not tried again in this session, for its worker was killed each time."""
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
        """Record how a run ended: failed if there is an error, whatever was measured."""
        with self._change() as db:
            db.execute(
                "UPDATE runs SET state = ?, metrics = ?, error = ?, files = ?, seconds = ?, peak = ?, ended = ? "
                "WHERE number = ?",
                (
                    "failed" if error else "done",
                    json.dumps(metrics),
                    error,
                    json.dumps(list(files)),
                    seconds,
                    peak,
                    time.time(),
                    number,
                ),
            )

    def counts(self) -> dict[str, int]:
        """How many runs are in which state."""
        return dict(self._read("SELECT state, count(*) FROM runs GROUP BY state"))

    def rows(self, state: State | None = None) -> list[RunRow]:
        """All runs by number, or those in one state."""
        where, values = ("WHERE state = ?", (state,)) if state else ("", ())
        found = self._read(
            "SELECT number, changes, state, metrics, error, files, seconds, tries, lost FROM runs "
            f"{where} ORDER BY number",
            values,
        )
        return [
            RunRow(n, json.loads(c), s, json.loads(m), e, tuple(json.loads(f)), t, tries, lost)
            for n, c, s, m, e, f, t, tries, lost in found
        ]


def _refusal(path: Path, error: sqlite3.Error) -> DsfabError:
    text = str(error)
    if "full" in text or "disk I/O" in text:
        return DsfabError(
            f"{path} cannot be written: {text}; what was recorded is kept: free some space and give the command again"
        )
    if "readonly" in text or "unable to open" in text:
        return DsfabError(f"{path} cannot be written: {text}; choose another folder with -o")
    if "locked" in text or "busy" in text:
        return DsfabError(f"{path} is in use by another program; wait until it has ended")
    return DsfabError(f"{path} cannot be used: {text}; restore it from a copy, or begin in another folder")
