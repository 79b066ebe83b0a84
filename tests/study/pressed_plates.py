"""A plate under pressure and its verdict."""

import numpy as np

from dsfab.statics import Material, SheetMaterial
from dsfab.study.verdict import LoadedSurface
from dsfab.surface import LoadCase
from tests.shapes import grid, jittered

STEEL = Material(210e9, 0.3, 7850.0)


def pressed_plate(cells=10, pressure=1e3, thickness=0.01):
    """A square plate of 1 m on simple supports under pressure."""
    surface = jittered(grid(cells, cells, 1.0, 1.0))
    edge = np.zeros(surface.n, dtype=bool)
    edge[surface.edges.ends[surface.edges.boundary]] = True
    force = np.outer(surface.vertex_areas, [0.0, 0.0, -pressure])
    load = LoadCase(np.repeat(edge[:, None], 3, axis=1), force, np.zeros(surface.n, dtype=bool))
    return LoadedSurface(surface, SheetMaterial(STEEL, thickness), {"load": load})
