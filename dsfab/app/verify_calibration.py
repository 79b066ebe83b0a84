"""`dsfab verify --calibration`: are the bounds of verdicts true?"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsfab.app.terminal import Reporter, out
from dsfab.wording import table

if TYPE_CHECKING:
    from dsfab.study.verdict.calibration import TrialRow

HEAD = (
    "design",
    "width",
    "share",
    "triangles",
    "edges/member",
    "facets",
    "meshes",
    "bound",
    "error",
    "",
    "quick error",
)


def calibrate(folder: Path, as_json: bool) -> int:
    """Measure the table anew, print it, and write it into the folder as calibration.json and calibration.csv.

    Exit code 1 when less than 95 % of the designs lie inside their bound.
    """
    from dsfab.study.verdict.calibration import summary, table_text
    from dsfab.study.verdict.trials import calibrate as measured

    reporter = Reporter(quiet=as_json)
    try:
        rows = list(measured(told=lambda kind, seed: reporter("calibration", f"{kind} {seed}")))
    finally:
        reporter.stop()
    reporter.done()
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"summary": asdict(summary(rows)), "designs": [_record(row) for row in rows]}, indent=2)
    (folder / "calibration.json").write_text(text, encoding="utf-8")
    (folder / "calibration.csv").write_text(table_text(rows), encoding="utf-8")
    out(text if as_json else "\n".join((table(HEAD, map(_cells, rows)), *_by_kind(rows), summary_text(rows))))
    return int(summary(rows).inside < 0.95)


def summary_text(rows: "Sequence[TrialRow]") -> str:
    """One sentence about a table."""
    from dsfab.study.verdict.calibration import summary

    told = summary(rows)
    return (
        f"verdicts on {told.designs} random designs: {told.inside:.0%} inside their bound, median bound "
        f"{told.median_bound:.1%}, largest error {told.largest_error:.1%}, {told.converged} converged; quick level: "
        f"median error {told.quick_median:.1%}, nine in ten within {told.quick_most:.1%}"
    )


def _by_kind(rows: "Sequence[TrialRow]") -> Iterator[str]:
    for kind in dict.fromkeys(row.kind for row in rows):
        yield f"{kind}: {summary_text([row for row in rows if row.kind == kind])}"


def _record(row: "TrialRow") -> dict[str, Any]:
    found = row.estimate
    told = {"value": found.value, "bound": found.bound, "levels": row.levels, "truth": row.truth, "inside": row.inside}
    return {**asdict(row), **told, "error": row.error, "quick_error": row.quick_error}


def _cells(row: "TrialRow") -> tuple[str, ...]:
    return (
        f"{row.kind} {row.seed}",
        row.width,
        f"{row.share:.2f}",
        str(row.triangles),
        f"{row.per_member:.1f}",
        f"{row.facets:.2f}",
        str(row.levels),
        f"{row.estimate.bound:.1%}",
        f"{row.error:+.2%}",
        "" if row.inside else "outside",
        f"{row.quick_error:+.1%}",
    )
