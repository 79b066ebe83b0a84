"""Tests solved: one row for each mesh and pair of elements, with its ratio, its rate and its verdict."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from dsfab.errors import StaticsError
from dsfab.statics import REPORTED, Elements, elements_of
from dsfab.study.verification.meshes import Mesh
from dsfab.study.verification.problem import Problem, Test


@dataclass(frozen=True)
class VerificationRow:
    """One mesh of one test with one pair of elements.

    unknowns : size of the system that is solved, supports taken off.
    ratio    : value over reference; None (like `value`) where the elements cannot hold what the test holds.
    rate     : observed order of convergence of the value, from this mesh and the two before, without the reference;
               None on the first two and where the value does not change any more. Jittered meshes are not nested and
               make it rough; so does a value that swings about its limit.
    verdict  : `ok` within the test's tolerance; `coarse` not, but a finer mesh of the series is; `off` not, and the
               finest is not either; `theory`: the finest is off, but within the tolerance of the test's limit: no thin
               sheet has what is missing (`Test.beyond`); `not run`: the test clamps edges and hinges have no rotations;
               `refused`: the solver did not trust its own answer (a sheet too thin for sixteen digits).
    target   : relative error that the pair for displacements is meant to stay below on this mesh, if there is one.
    met      : whether it does.
    limit    : what the target is about where it is not the reference, see `Test.limit`.
    of_limit : value over limit.
    """

    test: str
    mesh: str
    elements: str
    cells: int
    unknowns: int
    value: float | None
    reference: float
    ratio: float | None
    rate: float | None
    source: str
    verdict: str
    target: float | None = None
    met: bool | None = None
    limit: float | None = None
    of_limit: float | None = None


def series(test: Test, mesh: Mesh, elements: Elements) -> list[VerificationRow]:
    """All refinements of one test on one pattern with one pair of elements."""
    problems = [test.problem(cells, mesh) for cells in test.cells]
    if elements.bending == "hinge" and any(problem.needs_rotations for problem in problems):
        values: list[float | None] = [None] * len(problems)
        missing = "not run"
    else:
        values = [_value(problem, elements) for problem in problems]
        missing = "refused"
    ratios = [None if value is None else value / test.reference for value in values]
    rows = []
    for k, cells in enumerate(test.cells):
        verdict = missing if ratios[k] is None else _verdict(test, ratios[k:])
        target = test.targets.get(cells) if elements == elements_of("displacement") else None
        value = values[k]
        rows.append(
            VerificationRow(
                test.name,
                mesh,
                str(elements),
                cells,
                problems[k].unknowns(elements),
                value,
                test.reference,
                ratios[k],
                observed_rate(values[k - 2 : k + 1]) if k >= 2 else None,
                test.source,
                verdict,
                target,
                None if target is None else _met(test, value, target),
                test.limit,
                None if test.limit is None or value is None else value / test.limit,
            )
        )
    return rows


OUTSIDE = "solid wedges (CalculiX)"
"""In place of a pair of elements, in rows of a program that is not ours."""


def outside_series(test: Test, mesh: Mesh) -> list[VerificationRow]:
    """The same by the test's program that is not ours; nothing where there is none, or it is not installed."""
    found = [test.outside(cells, mesh) for cells in test.cells] if test.outside else []
    values = [one[1] for one in found if one is not None]
    if not values:
        return []
    ratios = [value / test.reference for value in values]
    return [
        VerificationRow(
            test.name,
            mesh,
            OUTSIDE,
            test.cells[k],
            one[0],
            one[1],
            test.reference,
            ratios[k],
            observed_rate(values[k - 2 : k + 1]) if k >= 2 else None,
            test.source,
            _verdict(test, ratios[k:]),
        )
        for k, one in enumerate(found)
        if one is not None
    ]


def failures(rows: Iterable[VerificationRow]) -> list[VerificationRow]:
    """Those of the pairs that something is reported from which are off on the finest mesh, or refused."""
    gated = {str(pair) for pair in REPORTED}
    return [row for row in rows if row.elements in gated and row.verdict in ("off", "refused")]


def observed_rate(values: Sequence[float | None]) -> float | None:
    """log2 of the ratio of the last two steps of three values on meshes of 1, 1/2, 1/4 the size; None at round-off."""
    if any(value is None for value in values):
        return None
    a, b, c = (value for value in values if value is not None)
    first, second, smallest = abs(a - b), abs(b - c), 1e-8 * abs(c)
    return math.log2(first / second) if first > smallest and second > smallest else None


def pattern_spread(rows: Iterable[VerificationRow]) -> dict[tuple[str, str, int], float]:
    """Largest over smallest value, less 1, among the patterns of each (test, elements, cells) run on several."""
    values: dict[tuple[str, str, int], list[float]] = {}
    for row in rows:
        if row.value is not None:
            values.setdefault((row.test, row.elements, row.cells), []).append(row.value)
    return {key: max(found) / min(found) - 1 for key, found in values.items() if len(found) > 1}


def _value(problem: Problem, elements: Elements) -> float | None:
    try:
        return problem.solve(elements)
    except StaticsError:
        return None


def _verdict(test: Test, ratios: Sequence[float | None]) -> str:
    """Of the first of some ratios, on meshes from this one to the finest."""
    near = [ratio is not None and abs(ratio - 1) <= test.tolerance for ratio in ratios]
    last, limit = ratios[-1], test.limit
    if test.beyond and limit and last is not None and not near[-1]:
        within = abs(last * test.reference / limit - 1) <= test.tolerance
        return "theory" if within else "off"
    return "ok" if near[0] else "coarse" if near[-1] else "off"


def _met(test: Test, value: float | None, target: float) -> bool:
    aim = test.reference if test.limit is None else test.limit
    return value is not None and abs(value / aim - 1) <= target
