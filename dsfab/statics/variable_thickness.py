"""The stiffest sheet of varying thickness [Cheng, Olhoff 1981; Petersson 1999]."""

from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.statics.membrane import corner_strains
from dsfab.statics.model import SheetModel
from dsfab.statics.solve import flat_axis
from dsfab.statics.stiffness import FaceStiffness
from dsfab.statics.stress import tensors_in_space
from dsfab.surface import LoadCase

LEAST = 1e-4
"""Smallest thickness of a face in the equations, as a fraction of the sheet's thickness; 0 would give no forces."""
SETTLED, MOVE, STEPS = 0.01, 0.2, 40
"""The iteration ends when all thicknesses change by less than SETTLED, or after STEPS steps.
A step changes no thickness by more than MOVE. SETTLED and MOVE are fractions of the sheet's thickness."""


class VaryingSheet(NamedTuple):
    """A sheet whose thickness varies from face to face.
    thickness  : (m,) thickness of each face as a fraction of the given sheet's thickness, 0 to 1.
    compliance : weighted sum of the loads' compliances, joules.
    forces     : (m, 3, 3) membrane forces, N/m, for each load, symmetric and tangent to each face."""

    thickness: Floats
    compliance: float
    forces: list[Floats]


def varying_thickness(sheet: SheetModel, loads: list[LoadCase], weights: Floats, share: float) -> VaryingSheet:
    """Return the stiffest sheet with a given mean thickness. share : mean thickness / thickness of `sheet`.
    weights : (k,) factors of the loads' compliances in the sum that is minimised.
    Raises StaticsError for a sheet without sufficient supports, or a load on a vertex without faces."""
    surface = sheet.surface
    K = FaceStiffness.from_sheet(sheet, loads)
    x, factor = np.full(surface.m, share), None
    solid = np.zeros(surface.m, dtype=bool)
    for _ in range(STEPS):
        factor = K.factor(LEAST + (1 - LEAST) * x, factor)
        gain = K.energies(factor(K.force)) @ weights / surface.areas
        updated = optimality_step(x, gain, surface.areas, share * surface.area, solid, MOVE)
        step, x = float(np.abs(updated - x).max()), updated
        if step < SETTLED:
            break
    scale = LEAST + (1 - LEAST) * x
    solution = K.factor(scale, factor)(K.force)
    compliance = float(scale @ K.energies(solution) @ weights)
    forces = [scale[:, None, None] * N for N in _membrane_forces(sheet, loads, K, solution)]
    return VaryingSheet(x, compliance, forces)


def _membrane_forces(sheet: SheetModel, loads: list[LoadCase], K: FaceStiffness, solution: Floats) -> list[Floats]:
    surface, axis = sheet.surface, flat_axis(sheet.surface, *loads)
    moved = np.concatenate([solution, np.zeros((1, len(loads)))])[K.unknown]
    moving = [column for column in range(9) if axis is None or column % 3 != axis]
    strain = corner_strains(surface)[:, :, moving] @ moved[:, : len(moving)]
    planar = np.einsum("ij,mjk->kmi", sheet.material.membrane(sheet.law) * sheet.thickness, strain)
    return [tensors_in_space(surface, values) for values in planar]


def optimality_step(x: Floats, gain: Floats, areas: Floats, area: float, solid: Bools, move: float) -> Floats:
    """Return new material densities of faces (m,), 0 to 1, by the optimality criteria method [Bendsoe 1995].
    x     : (m,) old densities; a density changes by at most `move`.
    gain  : (m,) decrease of the compliance per area of added material.
    area  : required sum of new density * face area, m2.    solid : (m,) mask of faces with density 1."""
    low, high = np.maximum(x - move, 0.0), np.minimum(x + move, 1.0)
    root = x * np.sqrt(np.maximum(gain, 0.0))
    lower, upper = 0.0, 2 * float(root.max()) / max(float(x.min()), 1e-3)
    while upper - lower > 1e-6 * upper:
        middle = (lower + upper) / 2  # bisection for the densities root / middle
        thickness = np.where(solid, 1.0, np.clip(root / middle, low, high))
        if areas @ thickness > area:
            lower = middle
        else:
            upper = middle
    return np.asarray(thickness)
