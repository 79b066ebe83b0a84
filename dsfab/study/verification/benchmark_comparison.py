"""Against the field: the pair for displacements beside published values, at equal unknowns where that is possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.statics import PAPER, elements_of
from dsfab.study.verification.problem import Test
from dsfab.study.verification.published import PUBLISHED, Published
from dsfab.study.verification.rows import VerificationRow

SAME = 0.005
"""Errors closer than this count as alike: references themselves differ by as much."""

SLACK = 0.8
"""A published mesh with up to a fifth fewer unknowns than the coarsest mesh here still counts as equal."""

Outcome = Literal["better", "alike", "worse", "unknown"]


@dataclass(frozen=True)
class Standing:
    """One published value, and what the pair for displacements does beside it.

    unknowns : of the published mesh, None where the source does not tell.
    ours     : relative error of that pair, on the worst of its regular patterns (published meshes are
               regular too) and, so that luck does not count, not less than on any finer mesh; None: nothing compares.
    basis    : `unknowns`: ours is interpolated (on logarithms) to as many unknowns, or taken from our finest mesh where
               that has fewer; `cells`: all meshes here have more unknowns, so it is taken on the same cells.
    outcome  : of ours against theirs.
    """

    published: Published
    unknowns: int | None
    ours: float | None
    basis: Literal["unknowns", "cells", ""]
    outcome: Outcome


def standings(rows: Sequence[VerificationRow], tests: Mapping[str, Test]) -> list[Standing]:
    """Every published value of the tests that `rows` has with the pair for displacements."""
    found = []
    for published in PUBLISHED:
        here = [row for row in rows if row.test == published.test and row.mesh != "jittered"]
        ours = [row for row in here if row.elements == str(elements_of("displacement"))]
        if ours:
            found.append(_standing(published, worst_by_cells(ours), tests[published.test]))
    return found


def worst_by_cells(rows: Sequence[VerificationRow]) -> dict[int, tuple[int, float]]:
    """Unknowns and the largest error over the patterns, for each number of cells that no pattern failed on."""
    found: dict[int, tuple[int, float]] = {}
    for cells in sorted({row.cells for row in rows}):
        here = [row for row in rows if row.cells == cells]
        errors = [abs(row.ratio - 1) for row in here if row.ratio is not None]
        if len(errors) == len(here):
            found[cells] = max(row.unknowns for row in here), max(errors)
    return found


def shortfalls(rows: Sequence[VerificationRow]) -> dict[str, str]:
    """By test, a line where the paper's elements are off, with published values of triangles of constant strain."""
    lines = {}
    for name in dict.fromkeys(row.test for row in rows):
        ours = [row for row in rows if row.test == name and row.elements == str(PAPER) and row.ratio is not None]
        ours = [row for row in ours if row.mesh == ours[0].mesh]
        if ours and ours[-1].verdict == "off":
            lines[name] = f"{PAPER} falls short: {_listed([(row.ratio or 0, row.cells) for row in ours])}"
            others: dict[str, list[tuple[float, object]]] = {}
            for published in PUBLISHED:
                if published.test == name and published.constant:
                    label = f"{published.element} [{published.source}]"
                    others.setdefault(label, []).append((published.ratio, published.cells or published.note))
            for label, values in others.items():
                lines[name] += f"; published for constant strain: {_listed(values)}, {label}"
    return lines


def _listed(values: Sequence[tuple[float, object]]) -> str:
    ratios, places = zip(*values, strict=True)
    return f"{', '.join(f'{ratio:.3f}' for ratio in ratios)} at {', '.join(map(str, places))}"


def _standing(published: Published, ours: Mapping[int, tuple[int, float]], test: Test) -> Standing:
    unknowns = published.unknowns
    if unknowns is None and published.cells is not None:
        nodes_along = 2 * published.cells if published.middles else published.cells
        unknowns = test.problem(nodes_along, "diagonal").nodal_unknowns()
    if unknowns is None or not ours:
        return Standing(published, unknowns, None, "", "unknown")
    sizes, errors = np.array(list(ours.values())).T
    # a value that passes through the reference on its way is not yet near it: what follows counts
    errors = np.maximum.accumulate(errors[::-1])[::-1]
    theirs = abs(published.ratio - 1)
    if unknowns >= SLACK * sizes[0]:
        error = float(np.exp(np.interp(np.log(unknowns), np.log(sizes), np.log(np.maximum(errors, 1e-9)))))
        return Standing(published, unknowns, error, "unknowns", _outcome(error, theirs))
    if published.cells is not None and published.cells in ours:
        error = float(errors[list(ours).index(published.cells)])
        return Standing(published, unknowns, error, "cells", _outcome(error, theirs))
    return Standing(published, unknowns, None, "", "unknown")


def _outcome(ours: float, theirs: float) -> Outcome:
    if abs(ours - theirs) <= SAME:
        return "alike"
    return "better" if ours < theirs else "worse"
