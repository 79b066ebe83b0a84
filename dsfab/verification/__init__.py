"""Are the elements right? Structures with known answers, element pairs side by side, three refinements each.

One file per family of tests; a test is a mesh, a load and one number with its reference (`Test`).
"""

from collections.abc import Callable, Iterator, Sequence

from dsfab.core.errors import StaticsError
from dsfab.statics import REPORTED, Elements, elements_of
from dsfab.verification import beams, cut_sheets, plane, plates, shells, stability, vessels, vibrations
from dsfab.verification.problems import Mesh, Problem, Test
from dsfab.verification.results import (
    Standing,
    VerificationRow,
    failures,
    outside_series,
    pattern_spread,
    series,
    shortfalls,
    standings,
)

__all__ = [
    "PAIRS",
    "TESTS",
    "Mesh",
    "Problem",
    "Standing",
    "Test",
    "VerificationRow",
    "choose",
    "failures",
    "pattern_spread",
    "series",
    "shortfalls",
    "standings",
    "verify",
]

FAMILIES = (plates, beams, plane, shells, vessels, vibrations, stability, cut_sheets)

TESTS: dict[str, Test] = {test.name: test for family in FAMILIES for test in family.TESTS}
"""Every test by its name."""

PAIRS = (elements_of("directions"), elements_of("spread"), *REPORTED)
"""The pairs that are run unless others are asked for: those that something is reported from, and two beside them."""


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
) -> Iterator[VerificationRow]:
    """The rows of all tests, patterns and pairs, and of programs that are not ours, series by series as solved."""
    for test in tests:
        if progress:
            progress(test.name, ", ".join(str(cells) for cells in test.cells) + " cells")
        for mesh in test.meshes:
            for elements in pairs:
                yield from series(test, mesh, elements)
            yield from outside_series(test, mesh)
