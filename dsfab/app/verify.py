"""The command `dsfab verify`: solves structures with known answers."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import Switch
from dsfab.app.terminal import Reporter, print_lines, print_result
from dsfab.core.messages import table

if TYPE_CHECKING:
    from dsfab.study.verdict.calibration import TrialRow
    from dsfab.verification import Test, VerificationRow


CALIBRATION_HEAD = (
    *("design", "width", "share", "triangles", "edges/member", "facets", "meshes"),
    *("bound", "error", "", "quick error"),
)


def calibrate(folder: Path, as_json: bool) -> int:
    """Test error bounds of `dsfab compare` on random designs; write calibration.json and .csv; return the exit code."""
    from dsfab.study.verdict.calibration import calibrate as measured
    from dsfab.study.verdict.calibration import summary, table_text

    with Reporter(quiet=as_json) as reporter:
        rows = list(measured(report=lambda kind, seed: reporter("calibration", f"{kind} {seed}")))
    folder.mkdir(parents=True, exist_ok=True)
    record = {"summary": asdict(summary(rows)), "designs": [_calibration_record(row) for row in rows]}
    text = json.dumps(record, indent=2)
    (folder / "calibration.json").write_text(text, encoding="utf-8")
    (folder / "calibration.csv").write_text(table_text(rows), encoding="utf-8")
    if as_json:
        print_result(text)
    else:
        kinds = dict.fromkeys(row.kind for row in rows)
        by_kind = [f"{kind}: {summary_text([row for row in rows if row.kind == kind])}" for kind in kinds]
        print_lines((table(CALIBRATION_HEAD, map(_calibration_cells, rows)), *by_kind, summary_text(rows)))
    return int(summary(rows).inside < 0.95)


def summary_text(rows: "Sequence[TrialRow]") -> str:
    """Return a sentence that sums up trials of the error bounds."""
    from dsfab.study.verdict.calibration import summary

    result = summary(rows)
    return (
        f"error bounds of {result.designs} random designs: the bound holds for {result.inside:.0%} of them, the "
        f"median bound is {result.median_bound:.1%}, the largest error {result.largest_error:.1%}; {result.converged} "
        f"designs converged; by one solve (quick), the median error is {result.quick_median:.1%}, and 90 % of the "
        f"errors are under {result.quick_most:.1%}"
    )


def _calibration_record(row: "TrialRow") -> dict[str, Any]:
    derived = {"value": row.estimate.value, "bound": row.estimate.bound, "levels": row.levels, "truth": row.truth}
    errors = {"inside": row.is_inside, "error": row.error, "quick_error": row.quick_error}
    return {**asdict(row), **derived, **errors}


def _calibration_cells(row: "TrialRow") -> tuple[str, ...]:
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
        "" if row.is_inside else "outside",
        f"{row.quick_error:+.1%}",
    )


TEST_HEAD = (
    *("test", "mesh", "elements", "cells", "unknowns", "value", "reference"),
    *("ratio", "of limit", "rate", "target", "verdict"),
)
"""Column names. `of limit` is the value divided by the thin-sheet limit; it is empty if `reference` is this limit."""

PAGE = Path("outputs/verification")  # Default folder of the page.


def verify(
    *tests: str,
    elements: Annotated[
        tuple[str, ...],
        Parameter(
            name=["--elements", "-e"], negative=(), help="Pair of elements to test, such as hybrid+hhj (repeatable)."
        ),
    ] = (),
    list_: Annotated[
        bool, Switch(name="--list", help="Only list the tests and the sources of their reference values.")
    ] = False,
    json_: Annotated[bool, Switch(name="--json", help="Print a JSON list instead of a table.")] = False,
    page: Annotated[bool, Switch(help="Also write a page with plots: index.html.")] = False,
    calibration: Annotated[
        bool, Switch(help="Test the error bounds of `dsfab compare` again, on random designs (15 min).")
    ] = False,
    out_: Annotated[
        Path, Parameter(name=["--out", "-o"], help="Folder for the files of --page and --calibration.")
    ] = PAGE,
) -> int:
    """Solve plates, beams, shells and vessels with published answers. Print the error of each kind of finite element.

    The exit code is 1 if elements that dsfab uses for results miss the tolerance on the finest mesh of a test.

    Parameters
    ----------
    tests
        Names, or beginnings of names, such as plate or scordelis_lo; all tests when left out."""
    from dsfab import verification
    from dsfab.statics import Elements

    if calibration:
        return calibrate(out_, json_)
    chosen = verification.choose(tests)
    if list_:
        print_result("\n".join(f"{test.name:<41} {test.source}" for test in chosen))
        return 0
    pairs = [Elements.from_name(name) for name in elements] or verification.PAIRS
    with Reporter(quiet=json_) as reporter:
        report_progress = lambda test, cells: reporter("verify", f"{test}, {cells}")  # noqa: E731
        rows = list(verification.verify(chosen, pairs, report_progress))
        if page:
            from dsfab.verification.page import write_page

            reporter("page", str(out_ / "index.html"))
            write_page(out_, chosen, rows)
    if json_:
        print_result(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        print_result(table(TEST_HEAD, map(_cells, rows)))
        print_result("\n".join(_remarks(chosen, rows)))
    return int(bool(verification.failures(rows)))


def _cells(row: "VerificationRow") -> tuple[str, ...]:
    numbers = (
        "" if row.value is None else f"{row.value:.5g}",
        f"{row.reference:.5g}",
        "" if row.ratio is None else f"{row.ratio:.4f}",
        "" if row.of_limit is None else f"{row.of_limit:.4f}",
        "" if row.rate is None else f"{row.rate:.1f}",
        "" if row.target is None else f"{100 * row.target:.2g} % {'met' if row.met else 'missed'}",
    )
    return (row.test, row.mesh, row.elements, str(row.cells), str(row.unknowns), *numbers, row.verdict)


def _remarks(tests: Sequence["Test"], rows: Sequence["VerificationRow"]) -> list[str]:
    from dsfab.statics import elements_of
    from dsfab.study.verdict.calibration import shipped_table
    from dsfab.verification import failures, pattern_spread, shortfalls, standings

    pair = str(elements_of("displacement"))
    lines = [f"{name}: {text}" for name, text in shortfalls(rows).items()]
    theory_tests = {row.test for row in rows if row.verdict == "theory"}
    lines += [f"{test.name}, verdict theory: {test.beyond}" for test in tests if test.name in theory_tests]
    failed = {f"{row.test} ({row.mesh}): {row.elements} {row.verdict}": None for row in failures(rows)}
    lines += [f"dsfab misses a tolerance in {failure}" for failure in failed] or [
        "dsfab meets all tolerances on the finest mesh of each test"
    ]
    with_target = [row for row in rows if row.met is not None]
    if with_target:
        lines.append(f"targets of {pair}: {sum(bool(row.met) for row in with_target)} of {len(with_target)} met")
    spread = {key: value for key, value in pattern_spread(rows).items() if key[1:] == (pair, 16)}
    if spread:
        widest = max(spread, key=lambda key: spread[key])
        lines.append(
            f"results on different meshes of 16 cells per side differ by up to {100 * spread[widest]:.2g} % (test "
            f"{widest[0]})"
        )
    counts = Counter(standing.outcome for standing in standings(rows, {test.name: test for test in tests}))
    if counts:
        outcomes = ", ".join(f"{name} {counts[name]}" for name in ("better", "alike", "worse") if counts[name])
        lines.append(f"{pair}, compared with {counts.total()} published values for meshes of equal size: {outcomes}")
    return [*lines, summary_text(shipped_table())]
