"""`dsfab verify`: the elements against structures with known answers."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.report import Reporter, out, table

if TYPE_CHECKING:
    from dsfab.study.verification import Row

HEAD = ("test", "mesh", "elements", "cells", "value", "reference", "ratio", "rate", "verdict")


def verify(
    *tests: str,
    elements: Annotated[
        tuple[str, ...],
        Parameter(name=["--elements", "-e"], negative=(), help="Pair such as quadratic+hhj (repeatable)."),
    ] = (),
    list_: Annotated[bool, Parameter(name="--list", negative=(), help="List tests and sources only.")] = False,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print a JSON list instead of a table.")] = False,
) -> int:
    """Solve plates, beams, shells and vessels with known answers, and say how near each pair of elements comes.

    Exit code 1 when quadratic+hhj, the pair for verdicts, is off on the finest mesh of a test.

    Parameters
    ----------
    tests
        Names, or beginnings of names, such as plate or scordelis_lo; all tests when left out.
    """
    from dsfab.statics import VERDICT, Elements
    from dsfab.study import verification

    chosen = verification.choose(tests)
    if list_:
        out("\n".join(f"{test.name:<27} {test.source}" for test in chosen))
        return 0
    pairs = [Elements.named(name) for name in elements] or verification.PAIRS
    reporter = Reporter(quiet=json_)
    try:
        told = lambda test, cells: reporter("verify", f"{test}, {cells}")  # noqa: E731
        rows = list(verification.verify(chosen, pairs, told))
    finally:
        reporter.stop()
    reporter.done()
    out(json.dumps([asdict(row) for row in rows], indent=2) if json_ else table(HEAD, map(_cells, rows)))
    return int(any(row.elements == str(VERDICT) and row.verdict == "off" for row in rows))


def _cells(row: "Row") -> tuple[str, ...]:
    numbers = (
        "" if row.value is None else f"{row.value:.5g}",
        f"{row.reference:.5g}",
        "" if row.ratio is None else f"{row.ratio:.4f}",
        "" if row.rate is None else f"{row.rate:.1f}",
    )
    return (row.test, row.mesh, row.elements, str(row.cells), *numbers, row.verdict)
