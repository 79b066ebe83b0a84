"""A solid of plane faces with a hole."""

import numpy as np

from dsfab.surface import Surface
from dsfab.thickening import Solid, thicken
from tests.shapes import grid


def plate_with_hole() -> Solid:
    """6 x 6 squares of 0.1 m without the middle four, 20 mm thick."""
    plate = grid(6, 6, 0.6, 0.6)
    inside = (np.abs(plate.centroids[:, :2] - 0.3) < 0.1).all(axis=1)
    return thicken(Surface(plate.V, plate.F[~inside]), np.tile([0, 0, 0.01], (plate.n, 1)))
