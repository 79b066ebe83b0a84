"""Tests of the finite elements against known solutions, on several meshes."""

from collections.abc import Callable, Iterator, Sequence

from dsfab.core.errors import StaticsError
from dsfab.statics import REPORTED, Elements, elements_of
from dsfab.verification import beams, cut_sheets, plane, plates, shells, vibrations
from dsfab.verification.problems import Problem, Test
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
    "PAIRS", "TESTS", "Problem", "Standing", "Test", "VerificationRow", "choose", "failures", "pattern_spread",
    "series", "shortfalls", "standings", "verify",
]  # fmt: skip

FAMILIES = (plates, beams, plane, shells, vibrations, cut_sheets)
TESTS: dict[str, Test] = {test.name: test for family in FAMILIES for test in family.TESTS}  # All tests by name.
PAIRS = (elements_of("directions"), elements_of("spread"), *REPORTED)
"""Default pairs of membrane and bending elements. The first two pairs are only for comparison."""


def choose(names: Sequence[str]) -> list[Test]:
    """Return tests whose names begin with a text of `names`, by default all. Raises StaticsError for unknown names."""
    if not names:
        return list(TESTS.values())
    chosen: dict[str, Test] = {}
    for name in names:
        matches = {key: test for key, test in TESTS.items() if key.startswith(name)}
        if not matches:
            raise StaticsError(f"there is no verification test {name!r}; the tests are {', '.join(TESTS)}")
        chosen |= {name: TESTS[name]} if name in TESTS else matches
    return list(chosen.values())


def verify(
    tests: Sequence[Test], pairs: Sequence[Elements] = PAIRS, progress: Callable[[str, str], None] | None = None
) -> Iterator[VerificationRow]:
    """Yield the results of each test on each mesh pattern: with each pair of elements, then with CalculiX."""
    for test in tests:
        if progress:
            progress(test.name, ", ".join(str(cells) for cells in test.cells) + " cells")
        for mesh in test.meshes:
            for elements in pairs:
                yield from series(test, mesh, elements)
            yield from outside_series(test, mesh)
