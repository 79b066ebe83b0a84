"""Results of the tests: ratios to references, rates of convergence, and published values."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.core.errors import StaticsError
from dsfab.statics import PAPER, REPORTED, Elements, elements_of
from dsfab.verification.problems import Mesh, Problem, Test


@dataclass(frozen=True)
class VerificationRow:
    """Result of a test on a mesh with a choice of elements.
    ratio    : value / reference; `ratio` and `value` are None if the elements cannot clamp the edges.
    rate     : observed order of convergence on three meshes, or None.
    verdict  : `ok`: error within the test's tolerance. `off`: larger error, also on the finest mesh. `coarse`: larger
               error, but not on the finest mesh. `theory`: like `off`, but right in the thin-sheet limit. `not run`:
               the elements cannot clamp edges. `refused`: the sheet is too thin for the solver.
    target   : largest allowed relative error on this mesh, or None.
    limit    : value to which the error for `target` refers, or None."""

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
    """Return the results of a test for all refinements of a mesh pattern."""
    problems = [test.problem(cells, mesh) for cells in test.cells]
    if elements.bending == "hinge" and any(problem.needs_rotations for problem in problems):
        values: list[float | None] = [None] * len(problems)
        missing = "not run"
    else:
        values = [_value(problem, elements) for problem in problems]
        missing = "refused"
    return _rows(test, mesh, str(elements), [problem.unknowns(elements) for problem in problems], values, missing)


OUTSIDE = "solid wedges (CalculiX)"  # Name of CalculiX's elements in results.


def outside_series(test: Test, mesh: Mesh) -> list[VerificationRow]:
    """Return the results of CalculiX for all refinements of the test's mesh; empty without CalculiX."""
    results = [test.outside(cells, mesh) for cells in test.cells] if test.outside else []
    solved = [result for result in results if result is not None]
    return _rows(test, mesh, OUTSIDE, [count for count, _ in solved], [value for _, value in solved])


def _rows(
    test: Test, mesh: Mesh, elements: str, unknowns: Sequence[int], values: Sequence[float | None], missing: str = ""
) -> list[VerificationRow]:
    ratios = [None if value is None else value / test.reference for value in values]
    rows = []
    for k, (value, count) in enumerate(zip(values, unknowns, strict=True)):
        target = test.targets.get(test.cells[k]) if elements == str(elements_of("displacement")) else None
        aim = test.limit or test.reference
        met = None if target is None else value is not None and abs(value / aim - 1) <= target
        rate = observed_rate(values[k - 2 : k + 1]) if k >= 2 else None
        verdict = missing if ratios[k] is None else _verdict(test, ratios[k:])
        of_limit = None if test.limit is None or value is None else value / test.limit
        tested = test.name, mesh, elements, test.cells[k], count, value, test.reference, ratios[k], rate
        rows.append(VerificationRow(*tested, test.source, verdict, target, met, test.limit, of_limit))
    return rows


def failures(rows: Iterable[VerificationRow]) -> list[VerificationRow]:
    """Return the results with the verdict `off` or `refused`, only for elements that dsfab uses in reports."""
    gated = {str(pair) for pair in REPORTED}
    return [row for row in rows if row.elements in gated and row.verdict in ("off", "refused")]


def observed_rate(values: Sequence[float | None]) -> float | None:
    """Return the order of convergence from values on meshes of sizes 1, 1/2 and 1/4.
    Return None without three values, or if a difference between values is too small."""
    if any(value is None for value in values):
        return None
    a, b, c = (value for value in values if value is not None)
    first, second, smallest = abs(a - b), abs(b - c), 1e-8 * abs(c)
    return math.log2(first / second) if first > smallest and second > smallest else None


def pattern_spread(rows: Iterable[VerificationRow]) -> dict[tuple[str, str, int], float]:
    """Return the spread of the values over all mesh patterns, max / min - 1, by (test, elements, cells)."""
    values: dict[tuple[str, str, int], list[float]] = {}
    for row in rows:
        if row.value is not None:
            values.setdefault((row.test, row.elements, row.cells), []).append(row.value)
    return {key: max(group) / min(group) - 1 for key, group in values.items() if len(group) > 1}


def _value(problem: Problem, elements: Elements) -> float | None:
    try:
        return problem.solve(elements)
    except StaticsError:
        return None


def _verdict(test: Test, ratios: Sequence[float | None]) -> str:
    is_within = [ratio is not None and abs(ratio - 1) <= test.tolerance for ratio in ratios]
    finest, limit = ratios[-1], test.limit
    if test.beyond and limit and finest is not None and not is_within[-1]:
        return "theory" if abs(finest * test.reference / limit - 1) <= test.tolerance else "off"
    return "ok" if is_within[0] else "coarse" if is_within[-1] else "off"


Seen = Literal["page", "transcript", "recalled"]


@dataclass(frozen=True)
class Publication:
    """A published document. seen : source from which the numbers were read, or "recalled" (from memory)."""

    title: str
    seen: Seen

    def __str__(self) -> str:
        return self.title + {"page": "", "transcript": " (from a transcript)", "recalled": " (recalled)"}[self.seen]


@dataclass(frozen=True)
class Published:
    """A published value for a test. ratio : the published value divided by the reference in the same source.
    cells    : number of cells of the published mesh, or of the next coarser mesh of the test; None if unknown.
    unknowns : number of unknowns of a published mesh that is not a mesh of the test, else None."""

    test: str
    element: str
    cells: int | None
    ratio: float
    source: Publication
    unknowns: int | None = None
    note: str = ""

    @property
    def constant(self) -> bool:
        """True for a membrane triangle of constant strain."""
        return self.element in CONSTANT

    @property
    def middles(self) -> bool:
        """True if the element has nodes in the middle of its sides."""
        return self.element in MIDDLES


HARDER = Publication("MacNeal and Harder 1985, Finite Elements in Analysis and Design 1, 3-20", "recalled")
STRAIGHT = Publication("Altair OptiStruct 2022 verification problem OS-V 0720", "page")
CURVED = Publication("Altair OptiStruct 2022 verification problem OS-V 0710", "page")
TWISTED = Publication("Altair OptiStruct 2025 verification problem OS-V 0700", "page")
ROOF = Publication("Altair OptiStruct 2022 verification problem OS-V 0730", "page")
CATIA = Publication("Dassault CATIA V5 R18 finite element guide, hemispherical shell", "page")
MIDAS = Publication("MIDAS/Gen verification example 24", "page")
LE1 = Publication("Abaqus 2017 Benchmarks, LE1: plane stress elements, Table 1", "page")
LE3 = Publication("Abaqus 2017 Benchmarks, LE3: hemispherical shell with point loads", "page")
KO = Publication("Ko, Lee, Lee and Bathe 2017, Computers and Structures 193, 187-206, N = 16", "transcript")
TMRFS = Publication(
    "Sangtarash, Ghohani Arab, Sohrabi and Ghasemi 2020, flat shell triangle, Table 9, in FinEtoolsFlexStructures.jl",
    "transcript",
)
SIMO = Publication(
    "Simo, Fox and Rifai 1989, Computer Methods in Applied Mechanics and Engineering 73, 53-92", "recalled"
)
DVORKIN = Publication("Dvorkin and Bathe 1984, Engineering Computations 1, 77-88", "recalled")
FELIPPA = Publication("table of Cook's panel in Felippa 2003, Computer Methods in Applied Mechanics 192", "recalled")
TWELVE_BY_TWO = 12 * 3 * 5  # Free unknowns of a twisted beam with 12 x 2 cells.
Ratios = dict[str, tuple[float, ...]]
SHAPES = ("", "_parallelograms", "_trapezoids")

STRAIGHT_BEAMS: tuple[tuple[Publication, str, tuple[float, ...], tuple[float, ...]], ...] = (
    # displacement / reference for rectangles, parallelograms, trapezoids; in-plane loads first, then normal loads
    (STRAIGHT, "OptiStruct TRI3", (0.032, 0.012, 0.019), (0.973, 0.955, 0.965)),
    (STRAIGHT, "OptiStruct QUAD4", (0.992, 0.712, 0.173), (0.981, 0.981, 0.964)),
    (STRAIGHT, "OptiStruct TRI6", (0.994, 0.962, 0.972), (1.001, 0.995, 0.999)),
    (HARDER, "NASTRAN QUAD4", (0.904, 0.080, 0.071), (0.986, 0.977, 0.968)),
    (HARDER, "NASTRAN QUAD8", (0.987, 0.995, 0.946), (0.991, 0.985, 0.998)),
)

REFINED: tuple[tuple[str, Publication, tuple[int, ...], Ratios], ...] = (
    ("plate_supported", HARDER, (4, 8, 12, 16), {"NASTRAN QUAD4": (0.981, 1.004, 1.003, 1.002)}),
    ("plate_supported", KO, (32,), {"MITC4": (0.9998,), "MITC3": (1.001,)}),
    ("plate_clamped", KO, (32,), {"MITC4": (0.9980,), "MITC3": (0.9943,)}),
    ("curved_beam_in_plane", CURVED, (1,), {"OptiStruct TRI3": (0.025,), "OptiStruct QUAD4": (0.952,)}),
    ("curved_beam_in_plane", CURVED, (1,), {"OptiStruct TRI6": (1.005,)}),
    ("curved_beam_in_plane", HARDER, (1,), {"NASTRAN QUAD4": (0.833,), "NASTRAN QUAD8": (1.007,)}),
    ("cook", FELIPPA, (2, 4, 8), {"constant strain triangle": (11.99 / 23.96, 18.28 / 23.96, 22.02 / 23.96)}),
    ("cook", FELIPPA, (2, 4, 8), {"bilinear Q4": (11.85 / 23.96, 18.30 / 23.96, 22.08 / 23.96)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct TRI3": (1.169, 0.753, 0.829, 0.886, 0.920)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct QUAD4": (1.487, 1.082, 1.035, 1.020, 1.013)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct TRI6": (1.326, 1.107, 1.077, 1.063, 1.055)}),
    ("scordelis_lo", HARDER, (4, 8, 12, 16, 20), {"NASTRAN QUAD4": (1.376, 1.050, 1.018, 1.008, 1.004)}),
    ("scordelis_lo", DVORKIN, (8, 16), {"MITC4": (0.94, 0.97)}),
    ("scordelis_lo", KO, (32,), {"MITC4": (0.9886,), "MITC4+": (0.9973,), "MITC3": (0.9550,)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Allman triangle": (1.004, 0.987, 0.987, 0.988)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Cook triangle": (0.907, 0.929, 0.950, 0.981)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Providas-Kattis triangle": (0.734, 0.815, 0.873, 0.967)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"TMRFS triangle": (0.924, 0.963, 0.974, 0.998)}),
    ("scordelis_lo", TMRFS, (8, 16, 32), {"Shin-Lee triangle": (1.379, 1.023, 1.004)}),
    ("scordelis_lo", TMRFS, (8, 32, 64), {"MITC3+": (0.669, 0.857, 0.955)}),
    ("pinched_cylinder", SIMO, (4, 8, 16), {"MITC4": (0.370, 0.740, 0.930), "Simo mixed": (0.399, 0.763, 0.935)}),
    ("pinched_cylinder", KO, (16,), {"MITC4": (0.9286,), "MITC4+": (0.9313,)}),
    ("holed_hemisphere", CATIA, (2, 4, 6, 8, 10, 12), {"CATIA TR3": (1.127, 1.043, 1.019, 1.009, 1.010, 0.993)}),
    ("holed_hemisphere", CATIA, (2, 4, 6, 8, 10, 12), {"CATIA QD4": (0.757, 1.022, 1.026, 1.016, 1.009, 0.999)}),
    ("holed_hemisphere", HARDER, (2, 4, 6, 8, 10, 12), {"NASTRAN QUAD4": (0.972, 1.024, 1.013, 1.005, 1.001, 0.998)}),
    ("holed_hemisphere", MIDAS, (8,), {"MIDAS plate": (0.0948 / 0.0940,), "SAP2000 shell": (0.0937 / 0.0940,)}),
)

TWISTED_BEAMS: tuple[tuple[Publication, Ratios, str], ...] = (
    # value / reference for a load along the beam's width, then for a load normal to the width
    (TWISTED, {"OptiStruct TRI3": (0.984, 0.839), "OptiStruct QUAD4": (0.992, 0.988)}, "12 x 2, assumed"),
    (HARDER, {"NASTRAN QUAD4": (0.993, 0.985)}, "12 x 2"),
)

NAFEMS: tuple[tuple[str, Publication, float, Ratios], ...] = (
    ("elliptic_membrane", LE1, 92.7, {"Abaqus CPS3": (51.04, 71.26), "Abaqus CPS4": (66.73, 84.54)}),
    ("elliptic_membrane", LE1, 92.7, {"Abaqus CPS6": (89.10, 94.01), "Abaqus CPS8R": (85.80, 90.07)}),
    ("closed_hemisphere", LE3, 0.185, {"Abaqus S3R": (0.080, 0.161), "Abaqus S4R": (0.180, 0.180)}),
    ("closed_hemisphere", LE3, 0.185, {"Abaqus S8R5": (0.179, 0.185), "Abaqus S4": (0.083, 0.175)}),
)
"""Published stress (MPa) or displacement (m) on the coarse and on the fine mesh that NAFEMS defines for the test."""

CONSTANT = ("OptiStruct TRI3", "CATIA TR3", "Abaqus CPS3", "Abaqus S3R", "constant strain triangle")
MIDDLES = ("OptiStruct TRI6", "NASTRAN QUAD8", "Abaqus CPS6", "Abaqus CPS8R", "Abaqus S8R5")


def _published_values() -> Iterator[Published]:
    for source, element, in_plane, out_of_plane in STRAIGHT_BEAMS:
        for suffix, in_plane_ratio, out_of_plane_ratio in zip(SHAPES, in_plane, out_of_plane, strict=True):
            yield Published(f"straight_beam_in_plane{suffix}", element, 1, in_plane_ratio, source)
            yield Published(f"straight_beam_out_of_plane{suffix}", element, 1, out_of_plane_ratio, source)
    for source, elements, note in TWISTED_BEAMS:
        for element, pair in elements.items():
            for name, ratio in zip(("in_plane", "out_of_plane"), pair, strict=True):
                yield Published(f"twisted_beam_{name}", element, 1, ratio, source, TWELVE_BY_TWO, note)
    for test, source, cells, elements in REFINED:
        for element, ratios in elements.items():
            for count, ratio in zip(cells, ratios, strict=True):
                yield Published(test, element, count, ratio, source)
    for test, source, reference, elements in NAFEMS:
        for element, pair in elements.items():
            for note, value in zip(("coarse mesh", "fine mesh"), pair, strict=True):
                yield Published(test, element, None, value / reference, source, None, note)


PUBLISHED = tuple(_published_values())
Outcome = Literal["better", "alike", "worse", "unknown"]


@dataclass(frozen=True)
class Standing:
    """Comparison of a published value with dsfab's elements.
    unknowns : number of unknowns of the published mesh, or None.
    ours     : largest relative error of dsfab's elements on comparable meshes, or None.
    basis    : "unknowns" or "cells", the number by which meshes are compared.
    outcome  : "better" if dsfab's error is smaller, "alike", "worse", or "unknown"."""

    published: Published
    unknowns: int | None
    ours: float | None
    basis: Literal["unknowns", "cells", ""]
    outcome: Outcome


def standings(rows: Sequence[VerificationRow], tests: Mapping[str, Test]) -> list[Standing]:
    """Compare each published value with the results in `rows`."""
    compared = []
    for published in PUBLISHED:
        test_rows = [row for row in rows if row.test == published.test and row.mesh != "jittered"]
        ours = [row for row in test_rows if row.elements == str(elements_of("displacement"))]
        if ours:
            compared.append(_standing(published, worst_by_cells(ours), tests[published.test]))
    return compared


def worst_by_cells(rows: Sequence[VerificationRow]) -> dict[int, tuple[int, float]]:
    """Return, for each number of cells, the largest number of unknowns and the largest relative error of `rows`."""
    worst: dict[int, tuple[int, float]] = {}
    for cells in sorted({row.cells for row in rows}):
        cell_rows = [row for row in rows if row.cells == cells]
        errors = [abs(row.ratio - 1) for row in cell_rows if row.ratio is not None]
        if len(errors) == len(cell_rows):
            worst[cells] = max(row.unknowns for row in cell_rows), max(errors)
    return worst


def shortfalls(rows: Sequence[VerificationRow]) -> dict[str, str]:
    """Return, by name of a test, a sentence on each test in which the error of the elements `PAPER` is too large."""
    lines = {}
    for name in dict.fromkeys(row.test for row in rows):
        ours = [row for row in rows if row.test == name and row.elements == str(PAPER) and row.ratio is not None]
        ours = [row for row in ours if row.mesh == ours[0].mesh]
        if ours and ours[-1].verdict == "off":
            lines[name] = f"{PAPER} falls short: {_ratios_text([(row.ratio or 0, row.cells) for row in ours])}"
            published_values: dict[str, list[tuple[float, object]]] = {}
            for published in PUBLISHED:
                if published.test == name and published.constant:
                    label = f"{published.element} [{published.source}]"
                    published_values.setdefault(label, []).append((published.ratio, published.cells or published.note))
            for label, values in published_values.items():
                lines[name] += f"; published for constant strain: {_ratios_text(values)}, {label}"
    return lines


def _ratios_text(values: Sequence[tuple[float, object]]) -> str:
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
    # take the largest error on this and finer meshes: a value may pass through the reference before it converges
    errors = np.maximum.accumulate(errors[::-1])[::-1]
    theirs = abs(published.ratio - 1)
    if unknowns >= 0.8 * sizes[0]:  # the published mesh may have a fifth fewer unknowns than dsfab's coarsest mesh
        error = float(np.exp(np.interp(np.log(unknowns), np.log(sizes), np.log(np.maximum(errors, 1e-9)))))
        return Standing(published, unknowns, error, "unknowns", _outcome(error, theirs))
    if published.cells is not None and published.cells in ours:
        error = float(errors[list(ours).index(published.cells)])
        return Standing(published, unknowns, error, "cells", _outcome(error, theirs))
    return Standing(published, unknowns, None, "", "unknown")


def _outcome(ours: float, theirs: float) -> Outcome:
    if abs(ours - theirs) <= 0.005:  # references in different sources differ by up to half a percent
        return "alike"
    return "better" if ours < theirs else "worse"
