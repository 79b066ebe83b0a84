"""What the theory of thin sheets leaves out of a compliance: ribs twist as bars, and shear goes through thickness."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.errors import StaticsError
from dsfab.sparse import NotPositiveDefinite
from dsfab.statics import (
    Elements,
    Equilibrium,
    ShearRecovery,
    SheetModel,
    SheetStress,
    SpreadLoad,
    section_forces,
    solve_cases,
)
from dsfab.study.verdict.stresses import rib_width
from dsfab.surface import LoadCase, Surface

FULL = 6 / 5
"""Shear through the thickness is a parabola: its energy is so much more than that of an even one [Reissner 1945]."""


class RibSoftening(NamedTuple):
    """Shares of a thin sheet's compliance.

    torsion : by how much it grows where ribs that are twisted are bars of their own width and thickness, solved again
              (`solve_cases`); inf where that cannot be solved.
    shear   : energy of shear through the thickness, q^2 6 / (5 G h) on each square metre, q that of the thin sheet, its
              mean over half a thickness all around: a solid spreads what passes through a neck.
    bending : of moments, times the root of thickness over the mean width of ribs.
    """

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
    """Of a solved sheet that bends, for each of its cases. One more solve on its mesh."""
    surface, h, made = sheet.surface, sheet.thickness, sheet.material
    try:
        barred = [one.compliance for one in solve_cases(sheet, loads, elements, spreads, bars=True).values()]
    except (StaticsError, NotPositiveDefinite):
        barred = [np.inf] * len(loads)
    recovery, means = ShearRecovery.of(surface, linear=elements.bending == "hhj"), _means_within(surface, h / 2)
    stiff, found = made.young / (2 * (1 + made.poisson)) * h, {}
    slender = float(np.sqrt(h / rib_width(surface)))
    for name, one in zip(loads, barred, strict=True):
        c, stress = answers[name].compliance, stresses[name]
        forces = section_forces(surface, h, stress, recovery)
        q = means @ np.einsum("ma,max->mx", forces.q, forces.frame)
        sheared = FULL / stiff * float(surface.areas @ (q**2).sum(axis=1))
        bent = 2 * float(surface.areas @ stress.bending_energy) * slender
        shares = (max(float(one / c) - 1, 0.0), sheared / c, bent / c) if c > 0 else (0.0, 0.0, 0.0)
        found[name] = RibSoftening(*shares)
    return found


def _means_within(surface: Surface, reach: float) -> csr_array:
    """(m, m) means by area over faces whose middles are so near, of vectors that change sign with a face's side."""
    tree = cKDTree(surface.centroids)
    near = tree.sparse_distance_matrix(tree, min(reach, 2 * surface.mean_edge), output_type="coo_matrix")
    here, there = near.coords
    side = np.sign(np.einsum("kx,kx->k", surface.normals[here], surface.normals[there]))
    weight = surface.areas[there] / np.bincount(here, surface.areas[there], surface.m)[here]
    return csr_array((side * weight, (here, there)), shape=(surface.m, surface.m))


OVER = 1.2
"""Times torsion and shear, which follow from mechanics,"""

REST = 0.1
"""and times bending, for what is left: ribs that meet, shells that are thick for their radius. Both are chosen so that
39 random designs lie inside, solved by CalculiX as solids of quadratic wedges. 31 on other surfaces and supports do too
(`solids.csv`); 8 of them, seed 3, were drawn only when the form stood. All are softer than thin sheets."""

WORTH = 0.001
"""Less is not told."""


def theory_share(soft: RibSoftening) -> float:
    """By what share of a thin sheet's compliance that of a solid may be larger."""
    return OVER * (soft.torsion + soft.shear) + REST * soft.bending
