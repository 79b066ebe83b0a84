"""Solved sheets and their stresses."""

import numpy as np

from dsfab.statics import Material, SheetModel, SpreadLoad, elements_of, equilibrium, sheet_stiffness, sheet_stress
from dsfab.surface import LoadCase

BEST = elements_of("displacement")

STEEL, H = Material(210e9, 0.3, 7850.0), 0.01


def solved(surface, fixed, elements, face=(0.0, 0.0, 0.0), edge=0.0, clamped=None, thickness=H, material=STEEL):
    """Equilibrium and stress under forces per area on all faces (Pa) and per length on the edges (N/m)."""
    spread = SpreadLoad.broadcast(surface, face, edge)
    load = LoadCase(fixed, spread.vertex_forces(surface), np.zeros(surface.n, dtype=bool))
    sheet = SheetModel(surface, material, thickness, clamped=clamped)
    answer = equilibrium(surface, sheet_stiffness(sheet, elements), sheet.with_clamped_edges(load), elements, spread)
    return answer, sheet_stress(sheet, elements, answer)
