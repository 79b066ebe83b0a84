"""A sheet with round holes and its solid."""

import numpy as np

from dsfab.slicing import cut
from dsfab.surface import Surface
from dsfab.thickening import Solid, thicken
from tests.shapes import grid

THICKNESS = 0.02


def thickened(surface: Surface) -> Solid:
    return thicken(surface, THICKNESS / 2 * surface.vertex_normals)


def holed_sheet(cells: int = 24) -> Surface:
    """A plate of 0.6 x 0.3 m with three round holes, cut along linear fields: their edges are polylines."""
    surface = grid(2 * cells, cells, 0.6, 0.3)
    centres, radii = np.array([[0.12, 0.15], [0.3, 0.14], [0.48, 0.16]]), np.array([0.06, 0.08, 0.05])
    distance = np.linalg.norm(surface.V[:, None, :2] - centres, axis=2) - radii
    return cut(surface, [distance.min(axis=1)], [np.array([0.0])]).subset().surface
