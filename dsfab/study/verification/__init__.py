"""Are the elements right? Structures with known answers, element pairs side by side, three refinements each.

One file per family of tests; a test is a mesh, a load and one number with its reference (`Test`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from dsfab.errors import StaticsError
from dsfab.statics import PAPER, VERDICT, Elements
from dsfab.study.verification import plates, shells
from dsfab.study.verification.problem import Mesh, Problem, Test

__all__ = ["PAIRS", "TESTS", "Mesh", "Problem", "Row", "Test", "choose", "series", "verify"]

TESTS: dict[str, Test] = {test.name: test for test in [*plates.TESTS, *shells.TESTS]}
"""Every test by its name."""

PAIRS = (PAPER, Elements("quadratic", "midedge"), VERDICT)
"""The pairs that are run unless others are asked for."""


@dataclass(frozen=True)
class Row:
    """One mesh of one test with one pair of elements.

    ratio   : value over reference; None (like `value`) where the elements cannot hold what the test holds.
    rate    : observed order of convergence of the value, from this mesh and the two before, without the reference;
              None on the first two and where the value does not change any more. Jittered meshes are not nested and
              make it rough; so does a value that swings about its limit.
    verdict : `ok` within the test's tolerance; `coarse` not, but a finer mesh of the series is; `off` not, and the
              finest is not either; `not run`: the test clamps edges and hinges have no rotations.
    """

    test: str
    mesh: str
    elements: str
    cells: int
    value: float | None
    reference: float
    ratio: float | None
    rate: float | None
    source: str
    verdict: str


def choose(names: Sequence[str]) -> list[Test]:
    """Tests by name or by the beginning of names; all for none. Raises StaticsError for a name that is none."""
    if not names:
        return list(TESTS.values())
    chosen: dict[str, Test] = {}
    for name in names:
        found = {key: test for key, test in TESTS.items() if key.startswith(name)}
        if not found:
            raise StaticsError(f"there is no verification test {name!r}; the tests are {', '.join(TESTS)}")
        chosen |= {name: TESTS[name]} if name in TESTS else found
    return list(chosen.values())


def verify(
    tests: Sequence[Test],
    pairs: Sequence[Elements] = PAIRS,
    progress: Callable[[str, str], None] | None = None,
) -> Iterator[Row]:
    """The rows of all tests, patterns and pairs, series by series as they are solved."""
    for test in tests:
        if progress:
            progress(test.name, ", ".join(str(cells) for cells in test.cells) + " cells")
        for mesh in test.meshes:
            for elements in pairs:
                yield from series(test, mesh, elements)


def series(test: Test, mesh: Mesh, elements: Elements) -> list[Row]:
    """All refinements of one test on one pattern with one pair of elements."""
    problems = [test.problem(cells, mesh) for cells in test.cells]
    if elements.bending == "hinge" and any(problem.needs_rotations for problem in problems):
        return [
            Row(test.name, mesh, str(elements), cells, None, test.reference, None, None, test.source, "not run")
            for cells in test.cells
        ]
    values = [problem.solve(elements) for problem in problems]
    ratios = [value / test.reference for value in values]
    return [
        Row(
            test.name,
            mesh,
            str(elements),
            cells,
            values[k],
            test.reference,
            ratios[k],
            observed_rate(values[k - 2 : k + 1]) if k >= 2 else None,
            test.source,
            _verdict(test, ratios[k], ratios[-1]),
        )
        for k, cells in enumerate(test.cells)
    ]


def observed_rate(values: Sequence[float]) -> float | None:
    """log2 of the ratio of the last two steps of three values on meshes of 1, 1/2, 1/4 the size; None at round-off."""
    first, second = abs(values[0] - values[1]), abs(values[1] - values[2])
    smallest = 1e-8 * abs(values[2])
    return math.log2(first / second) if first > smallest and second > smallest else None


def _verdict(test: Test, ratio: float, finest: float) -> str:
    if abs(ratio - 1) <= test.tolerance:
        return "ok"
    return "coarse" if abs(finest - 1) <= test.tolerance else "off"
