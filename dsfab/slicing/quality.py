"""How well shaped the triangles of a sheet are."""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface

NEEDLE = 1.0
"""Degrees: triangles with a smaller angle are counted."""


class Quality(NamedTuple):
    """The shape of triangles.

    worst_angle : the smallest angle, degrees, at `place` (3,).    needles : the share of triangles under 1 degree.
    median      : of 4 sqrt(3) area / (sum of squared sides), 1 for an equilateral triangle [Bank, Smith 1997].
    """

    worst_angle: float
    place: Floats
    needles: float
    median: float


def quality(surface: Surface) -> Quality:
    """The shape of the triangles of a surface."""
    P = surface.V[surface.F]
    sides = np.roll(P, -1, axis=1) - P
    squares = np.einsum("mci,mci->mc", sides, sides)
    back = -np.roll(sides, 1, axis=1)
    angles = np.degrees(np.arctan2(2 * surface.areas[:, None], np.einsum("mci,mci->mc", sides, back))).min(axis=1)
    shape = 4 * np.sqrt(3) * surface.areas / squares.sum(axis=1)
    worst = int(angles.argmin())
    return Quality(
        float(angles[worst]), surface.centroids[worst], float((angles < NEEDLE).mean()), float(np.median(shape))
    )
