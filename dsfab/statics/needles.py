"""Needles: triangles so flat that stresses on them mean little, and that a stiffness with them is hard to solve."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface

NEEDLE = 0.02
"""A triangle whose smallest height is less than this share of its longest edge is a needle: an angle of a degree."""


def _longest_edges(surface: Surface) -> Floats:
    """(m,) metres, of each triangle."""
    corners = surface.V[surface.F]
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1))


def heights(surface: Surface) -> Floats:
    """(m,) the smallest height of each triangle, metres."""
    return np.asarray(2 * surface.areas / _longest_edges(surface))


def flatness(surface: Surface) -> Floats:
    """(m,) smallest height of each triangle over its longest edge: 0.87 when equilateral, 0 when collapsed."""
    return np.asarray(2 * surface.areas / _longest_edges(surface) ** 2)


def needles_told(surface: Surface) -> str:
    """How many needles there are and where the worst is, for a sentence; empty when there are none."""
    shape = flatness(surface)
    count = int((shape < NEEDLE).sum())
    if not count:
        return ""
    where = surface.centroids[shape.argmin()].round(3).tolist()
    are = "triangle is a needle" if count == 1 else "triangles are needles"
    return (
        f"{count} of {surface.m} {are}, lower than {NEEDLE:g} of the longest edge (the worst, {shape.min():.1g}, is "
        f"around {where} m)"
    )
