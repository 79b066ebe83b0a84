"""What came out of a sweep: tables for other programs, the best runs, the Pareto front."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isfinite
from pathlib import Path
from typing import Any

from dsfab.export import replacing, write_chunks
from dsfab.study.sweeps.constraints import Constraint
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.store import RunRow

CSV, PARQUET = "results.csv", "results.parquet"

PICTURES = "pictures"
"""Folder of the pictures."""


def feasible(row: RunRow, limits: Iterable[Constraint]) -> bool:
    """Whether a run worked and meets every constraint."""
    return row.state == "done" and all(limit.holds(row.metrics) for limit in limits)


def best(rows: Iterable[RunRow], metric: str, limits: Sequence[Constraint] = ()) -> list[RunRow]:
    """Runs that work and meet the constraints, the best of a metric first; `ABOUT` says which direction is better."""
    sign = -1 if ABOUT[metric].better == "more" else 1
    usable = [row for row in rows if feasible(row, limits) and isfinite(row.metrics.get(metric, float("nan")))]
    return sorted(usable, key=lambda row: (sign * row.metrics[metric], row.number))


def pareto(rows: Iterable[RunRow], one: str, other: str, limits: Sequence[Constraint] = ()) -> list[RunRow]:
    """Runs that no other beats in both metrics, the best of `one` first."""
    front: list[RunRow] = []
    sign = -1 if ABOUT[other].better == "more" else 1
    usable = [row for row in best(rows, one, limits) if isfinite(row.metrics.get(other, float("nan")))]
    # of those that are equal in `one`, the better in `other` comes first
    first = -1 if ABOUT[one].better == "more" else 1
    for row in sorted(usable, key=lambda row: (first * row.metrics[one], sign * row.metrics[other], row.number)):
        if not front or sign * row.metrics[other] < sign * front[-1].metrics[other]:
            front.append(row)
    return front


def picture_of(row: RunRow) -> str:
    """The picture of a run, relative to the sweep's folder; '' if it has none."""
    return next((name for name in row.files if name.startswith(f"{PICTURES}/")), "")


def records(rows: Sequence[RunRow], metrics: Sequence[str], limits: Sequence[Constraint]) -> list[dict[str, Any]]:
    """One record for each run: `in:KEY`, `out:METRIC` and `img` are what Design Explorer reads."""
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
    """Write results.csv, and results.parquet where pyarrow is installed; raises ExportError."""
    if not table:
        return []
    text = StringIO()
    writer = csv.DictWriter(text, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    written = [folder / CSV]
    with replacing(written[0]) as temporary:
        write_chunks(temporary, [text.getvalue().encode()])
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return written
    columns = {name: [_plain(record[name]) for record in table] for name in table[0]}
    written.append(folder / PARQUET)
    with replacing(written[1]) as temporary:
        parquet.write_table(pyarrow.table({name: _column(values) for name, values in columns.items()}), temporary)
    return written


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _column(values: list[Any]) -> list[Any]:
    """One type in a column: numbers as floats where there is a fraction among them, text where there is text."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1:
        return values
    kind: type = float if kinds <= {int, float} else str
    return [None if value is None else kind(value) for value in values]
