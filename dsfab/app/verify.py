"""`dsfab verify`: the elements against structures with known answers."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.terminal import Reporter, out
from dsfab.app.verify_calibration import summary_text
from dsfab.wording import table

if TYPE_CHECKING:
    from dsfab.study.verification import Test, VerificationRow

HEAD = ("test", "mesh", "elements", "cells", "unknowns", "value", "reference", "ratio", "of limit", "rate", "target",
        "verdict")  # fmt: skip
"""`of limit`: the value over what thin sheets converge to, where the usual reference is not that."""

PAGE = Path("outputs/verification")
"""Where the page goes unless a folder is named."""


def verify(
    *tests: str,
    elements: Annotated[
        tuple[str, ...],
        Parameter(name=["--elements", "-e"], negative=(), help="Pair such as hybrid+hhj (repeatable)."),
    ] = (),
    list_: Annotated[bool, Parameter(name="--list", negative=(), help="List tests and sources only.")] = False,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print a JSON list instead of a table.")] = False,
    page: Annotated[bool, Parameter(negative=(), help="Write a page of plots as well: index.html.")] = False,
    calibration: Annotated[
        bool, Parameter(negative=(), help="Measure the bounds of verdicts on random designs anew (15 min).")
    ] = False,
    out_: Annotated[Path, Parameter(name=["--out", "-o"], help="Folder of the page and the calibration.")] = PAGE,
) -> int:
    """Solve plates, beams, shells and vessels with known answers, and say how near each pair of elements comes.

    Exit code 1 when a pair that something is reported from (README, "Can I trust it?") is off on a test's finest mesh.

    Parameters
    ----------
    tests
        Names, or beginnings of names, such as plate or scordelis_lo; all tests when left out.
    """
    from dsfab.statics import Elements
    from dsfab.study import verification

    if calibration:
        from dsfab.app.verify_calibration import calibrate

        return calibrate(out_, json_)
    chosen = verification.choose(tests)
    if list_:
        out("\n".join(f"{test.name:<41} {test.source}" for test in chosen))
        return 0
    pairs = [Elements.named(name) for name in elements] or verification.PAIRS
    reporter = Reporter(quiet=json_)
    try:
        told = lambda test, cells: reporter("verify", f"{test}, {cells}")  # noqa: E731
        rows = list(verification.verify(chosen, pairs, told))
        if page:
            from dsfab.report.verification_page import write_page

            reporter("page", str(out_ / "index.html"))
            write_page(out_, chosen, rows)
    finally:
        reporter.stop()
    reporter.done()
    if json_:
        out(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        out(table(HEAD, map(_cells, rows)))
        out("\n".join(_remarks(chosen, rows)))
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
    """Below the table: known shortfalls, targets, the spread between patterns, and the standing against others."""
    from dsfab.statics import elements_of
    from dsfab.study.verdict.calibration import shipped_table
    from dsfab.study.verification import failures, pattern_spread, shortfalls, standings

    pair = str(elements_of("displacement"))
    lines = [f"{name}: {text}" for name, text in shortfalls(rows).items()]
    beyond = {row.test for row in rows if row.verdict == "theory"}
    lines += [f"{test.name}, verdict theory: {test.beyond}" for test in tests if test.name in beyond]
    failed = {f"{row.test} ({row.mesh}): {row.elements} {row.verdict}": None for row in failures(rows)}
    lines.append(f"pairs that are reported from: {', '.join(failed) or 'none is off on a finest mesh'}")
    aimed = [row for row in rows if row.met is not None]
    if aimed:
        lines.append(f"targets of {pair}: {sum(bool(row.met) for row in aimed)} of {len(aimed)} met")
    spread = {key: value for key, value in pattern_spread(rows).items() if key[1:] == (pair, 16)}
    if spread:
        widest = max(spread, key=lambda key: spread[key])
        lines.append(f"widest spread between mesh patterns at 16 cells: {100 * spread[widest]:.2g} % ({widest[0]})")
    counts = Counter(standing.outcome for standing in standings(rows, {test.name: test for test in tests}))
    if counts:
        told = ", ".join(f"{outcome} {counts[outcome]}" for outcome in ("better", "alike", "worse") if counts[outcome])
        lines.append(f"{pair} against {counts.total()} published values, at equal unknowns or cells: {told}")
    return [*lines, summary_text(shipped_table())]
