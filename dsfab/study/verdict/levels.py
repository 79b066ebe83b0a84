"""One level of a verdict: the sheet solved on one mesh by two pairs of elements, with what each says of its errors."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Floats
from dsfab.sparse import peak_memory
from dsfab.statics import (
    Elements,
    Equilibrium,
    SheetMaterial,
    SheetStress,
    SpreadLoad,
    elements_of,
    equilibria,
    flat_axis,
    sheet_stiffness,
    sheet_stress,
)
from dsfab.study.verdict.stresses import Extreme, stress_extremes
from dsfab.study.verdict.theory import RibSoftening, rib_softening
from dsfab.surface import LoadCase, Surface

MAIN, BESIDE = elements_of("compliance"), elements_of("spread")
"""The pair that a verdict is made with, and the one that it is compared to: they err to opposite sides mostly."""

ONCE = elements_of("compliance_once")
"""The pair of the quick level, which has no other mesh to tell it what is left."""

BYTES = {
    "PARDISO": {"hhj": 2200.0, "midedge": 1900.0, None: 1900.0},
    "multifrontal": {"hhj": 4200.0, "midedge": 3000.0, None: 2800.0},
}
"""Memory of a solve for each unknown, by solver and by bending: measured at 0.3 to 3.3 million. PARDISO keeps half of a
symmetric factor, and what it was made from is given back before: 2.7 GB for 1.2 million instead of 4.9."""


@dataclass(frozen=True)
class Level:
    """One mesh of a verdict.

    triangles  : of the mesh.              unknowns : of the main pair (without bending in the plane).
    compliance : J, by the main pair, for each case: `MAIN`, or `ONCE` of the quick level.
    midedge    : J, by `BESIDE`; empty where not run.
    zz_membrane, zz_bending : for each case the squared error that the recovered stress shows, as a share of the
                 compliance [Zienkiewicz and Zhu 1987], of the main pair.
    residual   : the largest of all cases and pairs, relative, in the norm of the energy (see `Equilibrium`).
    seconds    : of both pairs.
    memory     : bytes, the most that the process has held up to then.
    stresses   : of the main pair, for each case, see `stress_extremes`.
    softer     : of the main pair, for each case, see `RibSoftening`; empty where not asked for, or in the plane.
    """

    triangles: int
    unknowns: int
    compliance: Mapping[str, float]
    midedge: Mapping[str, float]
    zz_membrane: Mapping[str, float]
    zz_bending: Mapping[str, float]
    residual: float
    seconds: float
    memory: int
    stresses: Mapping[str, Mapping[str, Extreme]] = field(default_factory=dict)
    softer: Mapping[str, RibSoftening] = field(default_factory=dict)


def level(
    surface: Surface,
    made: SheetMaterial,
    loads: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    pairs: tuple[Elements, ...] = (MAIN, BESIDE),
    ribs: bool = False,
) -> Level:
    """The sheet on one mesh, under loads on the same supports.

    ribs : whether it is solved once more with ribs that twist as bars, see `RibSoftening`.

    Raises StaticsError as `equilibria` does.
    """
    start = time.perf_counter()
    plane = flat_axis(surface, *loads.values()) is not None
    found = {}
    # in the plane there is no bending, and the two pairs are one
    for pair in pairs[:1] if plane else pairs:
        elements = pair.in_plane if plane else pair
        K = sheet_stiffness(made.on(surface), elements)
        answers = equilibria(surface, K, list(loads.values()), elements, spreads=list(spreads.values()))
        found[pair] = dict(zip(loads, answers, strict=True))
        del K
    main = pairs[0]
    elements = main.in_plane if plane else main
    stress = {name: sheet_stress(made.on(surface), elements, answer) for name, answer in found[main].items()}
    errors = {name: recovery_errors(surface, made, stress[name], answer) for name, answer in found[main].items()}
    energies = {pair: {name: answer.compliance for name, answer in of.items()} for pair, of in found.items()}
    return Level(
        surface.m,
        elements.unknowns(surface),
        energies[main],
        energies.get(BESIDE, {}),
        {name: error[0] for name, error in errors.items()},
        {name: error[1] for name, error in errors.items()},
        max(answer.residual for of in found.values() for answer in of.values()),
        time.perf_counter() - start,
        peak_memory(),
        {name: stress_extremes(surface, one, loads[name].held) for name, one in stress.items()},
        rib_softening(made.on(surface), elements, loads, spreads, found[main], stress) if ribs and not plane else {},
    )


def recovery_errors(
    surface: Surface, made: SheetMaterial, found: SheetStress, answer: Equilibrium
) -> tuple[float, float]:
    """Squared errors in the norm of the energy over the compliance, of membrane and of bending: how far the stress is
    from the same averaged around each vertex [Zienkiewicz and Zhu 1987]. 0 for stress that is constant on each face."""
    if answer.compliance <= 0:
        return 0.0, 0.0
    C = np.linalg.inv(made.material.membrane(made.law)) * made.thickness
    D = np.linalg.inv(made.material.bending(made.thickness)) * (made.thickness**2 / 6) ** 2
    membrane = _squared(surface, found.smooth_membrane - found.membrane, np.asarray(C))
    bending = _squared(surface, found.smooth_bending - found.bending, np.asarray(D))
    return membrane / answer.compliance, bending / answer.compliance


def _squared(surface: Surface, off: Floats, by: Floats) -> float:
    """The integral of off . by off, `off` (m, 3 corners, 3) linear on each face."""
    there = off @ by
    total = np.einsum("mci,mci->m", off, there) + np.einsum("mi,mi->m", off.sum(axis=1), there.sum(axis=1))
    return float(total @ surface.areas / 12)


def memory_needed(unknowns: int, bending: str | None, solver: str) -> int:
    """Bytes that a solve of so many unknowns takes, about, with the one of `dsfab.sparse.solver_name`, or the other
    one; what the process holds besides is not counted."""
    return int(BYTES[solver][bending] * unknowns)
