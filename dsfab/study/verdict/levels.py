"""Solves of a sheet on finer and finer meshes, by two pairs of elements."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats
from dsfab.core.errors import StaticsError
from dsfab.core.sparse import NotPositiveDefinite, peak_memory
from dsfab.design import sheet_supports
from dsfab.slicing import Sheet
from dsfab.statics import (
    Elements,
    Equilibrium,
    ShearRecovery,
    SheetMaterial,
    SheetModel,
    SheetStress,
    SpreadLoad,
    elements_of,
    equilibria,
    flat_axis,
    section_forces,
    sheet_stiffness,
    sheet_stress,
    solve_cases,
)
from dsfab.study.verdict.estimates import Extreme, rib_width, stress_extremes
from dsfab.surface import LoadCase, Surface


class Shares(NamedTuple):
    """Forces (N) of a load on a cut sheet, summed at vertices and faces of the uncut surface.
    vertices : (n, 3) sum of the point forces around each vertex.
    faces    : (p, 3) sum of the distributed forces in each of the first p faces."""

    vertices: Floats
    faces: Floats


def shares(sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, Shares]:
    """Return the forces of each load on a cut sheet, summed at vertices and faces of the uncut surface."""
    areas, count = sheet.surface.areas[:, None], int(sheet.parent.max()) + 1
    shares_by_load = {}
    for name, load in loads.items():
        spread = np.zeros((len(areas), 3)) if load.parts is None else load.parts.traction * areas
        on_faces: Floats = np.stack([np.bincount(sheet.parent, x, count) for x in spread.T], axis=1).astype(np.float64)
        shares_by_load[name] = Shares(np.asarray(sheet.weights.T @ load.point), on_faces)
    return shares_by_load


def on_mesh(
    surface: Surface, sheet: Sheet, uncut_loads: Mapping[str, LoadCase], forces: Mapping[str, Shares]
) -> tuple[dict[str, LoadCase], dict[str, SpreadLoad]]:
    """Return the supports and loads of a mesh of the cut sheet, by load case, and the loads as forces per area.
    uncut_loads : supports and loads on the uncut surface, by load case.
    forces      : forces of these loads on the cut sheet, from `shares`."""
    F, areas = sheet.surface.F, sheet.surface.areas
    hats = csr_array(sheet.weights[F[:, 0]] + sheet.weights[F[:, 1]] + sheet.weights[F[:, 2]])
    mass = np.asarray(hats.T @ areas)
    material = np.bincount(sheet.parent, areas)
    cases, spreads = {}, {}
    for name, load in uncut_loads.items():
        around, within = forces[name]
        density = np.divide(around, mass[:, None], out=np.zeros_like(around), where=mass[:, None] > 0)
        even = within / np.where(material > 0, material, 1.0)[:, None]
        spreads[name] = SpreadLoad.broadcast(sheet.surface, np.asarray(hats @ density) + even[sheet.parent])
        cases[name] = replace(sheet_supports(surface, sheet, load), force=spreads[name].vertex_forces(sheet.surface))
    return cases, spreads


PARABOLIC_SHEAR = 6 / 5  # energy factor of a parabola of shear stress over the thickness [Reissner 1945]


class RibSoftening(NamedTuple):
    """Three effects that make a solid softer than a thin sheet. All values are divided by the sheet's compliance.
    torsion : additional compliance if ribs twist as bars; inf if this solve fails.
    shear   : additional compliance from transverse shear strain.
    bending : compliance from bending, multiplied by the square root of (thickness / mean rib width)."""

    torsion: float
    shear: float
    bending: float


def rib_softening(
    sheet: SheetModel,
    elements: Elements,
    loads: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    answers: Mapping[str, Equilibrium],
    stresses: Mapping[str, SheetStress],
) -> dict[str, RibSoftening]:
    """Return the effects that make a solid softer than a thin sheet, by load case.
    spreads : loads as forces per area and per length.    answers, stresses : solutions of the thin sheet."""
    surface, h, material = sheet.surface, sheet.thickness, sheet.material
    try:
        barred = [answer.compliance for answer in solve_cases(sheet, loads, elements, spreads, bars=True).values()]
    except (StaticsError, NotPositiveDefinite):
        barred = [np.inf] * len(loads)
    recovery = ShearRecovery.for_surface(surface, linear=elements.bending == "hhj")
    means = _means_within(surface, h / 2)
    stiff, softening = material.young / (2 * (1 + material.poisson)) * h, {}
    slender = float(np.sqrt(h / rib_width(surface)))
    for name, answer in zip(loads, barred, strict=True):
        c, stress = answers[name].compliance, stresses[name]
        forces = section_forces(surface, h, stress, recovery)
        q = means @ np.einsum("ma,max->mx", forces.q, forces.frame)
        sheared = PARABOLIC_SHEAR / stiff * float(surface.areas @ (q**2).sum(axis=1))
        bent = 2 * float(surface.areas @ stress.bending_energy) * slender
        shares = (max(float(answer / c) - 1, 0.0), sheared / c, bent / c) if c > 0 else (0.0, 0.0, 0.0)
        softening[name] = RibSoftening(*shares)
    return softening


def _means_within(surface: Surface, reach: float) -> csr_array:
    """Return the matrix (m, m) that averages the faces' vectors over all faces within `reach` metres of each face."""
    tree = cKDTree(surface.centroids)
    pairs = tree.sparse_distance_matrix(tree, min(reach, 2 * surface.mean_edge), output_type="coo_matrix")
    face, neighbour = pairs.coords
    side = np.sign(np.einsum("kx,kx->k", surface.normals[face], surface.normals[neighbour]))
    weight = surface.areas[neighbour] / np.bincount(face, surface.areas[neighbour], surface.m)[face]
    return csr_array((side * weight, (face, neighbour)), shape=(surface.m, surface.m))


def theory_share(soft: RibSoftening) -> float:
    """Return the largest expected value of "compliance of the solid / compliance of the thin sheet - 1"."""
    return 1.2 * (soft.torsion + soft.shear) + 0.1 * soft.bending


MAIN_ELEMENTS, SPREAD_ELEMENTS = elements_of("compliance"), elements_of("spread")
"""Two pairs of membrane and bending elements. The errors of the two compliances mostly have opposite signs."""
QUICK_ELEMENTS = elements_of("compliance_once")  # elements for one quick solve
BYTES_PER_UNKNOWN = {
    "PARDISO": {"hhj": 2200.0, "midedge": 1900.0, None: 1900.0},
    "multifrontal": {"hhj": 4200.0, "midedge": 3000.0, None: 2800.0},
}
"""Memory of a solve per unknown, in bytes, by solver and bending element (measured with 0.3 to 3.3 million unknowns).
PARDISO needs less, because it stores only half of a symmetric factor."""


@dataclass(frozen=True)
class Level:
    """Results on one mesh, by load case.
    unknowns   : number of unknowns of the main elements.    compliance : compliance (J) by the main elements.
    midedge    : compliance (J) by `SPREAD_ELEMENTS`; empty if not solved.
    zz_membrane, zz_bending : energies of the estimated stress errors, divided by the compliance.
    residual   : largest relative residual of all solves, in the energy norm.
    seconds    : time of all solves.       memory   : peak memory of the process so far, bytes.
    softer     : `RibSoftening` by load case; empty if not requested, or if a flat sheet is solved in 2D."""

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
    material: SheetMaterial,
    loads: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    pairs: tuple[Elements, ...] = (MAIN_ELEMENTS, SPREAD_ELEMENTS),
    ribs: bool = False,
) -> Level:
    """Solve the sheet on one mesh, for load cases with the same supports.
    spreads : the loads as forces per area and per length.    pairs : membrane and bending elements, main pair first.
    ribs    : True to also compute the effects that make a solid softer (`RibSoftening`).
    Raises StaticsError if a solve fails."""
    start = time.perf_counter()
    plane = flat_axis(surface, *loads.values()) is not None
    answers_by_pair, model = {}, material.model_for(surface)
    for pair in pairs[:1] if plane else pairs:  # without bending, the first pair of elements is enough
        elements = pair.in_plane if plane else pair
        K = sheet_stiffness(model, elements)
        answers = equilibria(surface, K, list(loads.values()), elements, spreads=list(spreads.values()))
        answers_by_pair[pair] = dict(zip(loads, answers, strict=True))
        del K
    main, solved = pairs[0], answers_by_pair[pairs[0]]
    elements = main.in_plane if plane else main
    stress = {name: sheet_stress(model, elements, answer) for name, answer in solved.items()}
    errors = {name: recovery_errors(surface, material, stress[name], answer) for name, answer in solved.items()}
    energies = {pair: {name: x.compliance for name, x in cases.items()} for pair, cases in answers_by_pair.items()}
    softer = rib_softening(model, elements, loads, spreads, solved, stress) if ribs and not plane else {}
    return Level(
        surface.m,
        elements.unknowns(surface),
        energies[main],
        energies.get(SPREAD_ELEMENTS, {}),
        {name: error[0] for name, error in errors.items()},
        {name: error[1] for name, error in errors.items()},
        max(answer.residual for cases in answers_by_pair.values() for answer in cases.values()),
        time.perf_counter() - start,
        peak_memory(),
        {name: stress_extremes(surface, case_stress, loads[name].supported) for name, case_stress in stress.items()},
        softer,
    )


def recovery_errors(
    surface: Surface, material: SheetMaterial, sheet_stress_field: SheetStress, answer: Equilibrium
) -> tuple[float, float]:
    """Return energies of estimated membrane and bending stress errors / compliance [Zienkiewicz and Zhu 1987]."""
    if answer.compliance <= 0:
        return 0.0, 0.0
    C = np.linalg.inv(material.material.membrane(material.law)) * material.thickness
    D = np.linalg.inv(material.material.bending(material.thickness)) * (material.thickness**2 / 6) ** 2
    membrane = _energy_norm(surface, sheet_stress_field.smooth_membrane - sheet_stress_field.membrane, np.asarray(C))
    bending = _energy_norm(surface, sheet_stress_field.smooth_bending - sheet_stress_field.bending, np.asarray(D))
    return membrane / answer.compliance, bending / answer.compliance


def _energy_norm(surface: Surface, difference: Floats, matrix: Floats) -> float:
    weighted = difference @ matrix
    sums = np.einsum("mi,mi->m", difference.sum(axis=1), weighted.sum(axis=1))
    return float((np.einsum("mci,mci->m", difference, weighted) + sums) @ surface.areas / 12)


def memory_needed(unknowns: int, bending: str | None, solver: str) -> int:
    """Return the expected memory of a solve, bytes. bending : name of the bending element; None without bending."""
    return int(BYTES_PER_UNKNOWN[solver][bending] * unknowns)
