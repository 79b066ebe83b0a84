"""Nearly equilateral triangles in a region of the plane that no rows or rings fit."""

from collections.abc import Callable

import numpy as np

from dsfab.arrays import Bools, Floats, Ints

GAP = 0.6
"""Least distance between lattice and rim over the edge: about the height of a triangle between them."""


def mesh_region(rim: Floats, inside: Callable[[Floats, float], Bools], edge: float) -> tuple[Floats, Ints]:
    """Vertices (n, 2) and counter-clockwise faces of a region of the plane.

    rim    : (k, 2) points along the boundary about `edge` apart; they stay where they are and come first.
    inside : says which points (q, 2) are inside by at least a distance.

    A hexagonal lattice inside and the Delaunay triangles of both. Smoothing after it was tried (5 and 40 Laplacian
    rounds with new triangles after each, nine pavilions): it made the smallest angle worse, never better.
    """
    from scipy.spatial import Delaunay  # here, because it takes a tenth of a second to import

    reach = int(np.ceil(2 * np.abs(rim).max() / edge)) + 2
    i, j = (x.ravel() for x in np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)))
    lattice = edge * np.stack([i + j / 2, j * np.sqrt(3) / 2], axis=1)
    P = np.concatenate([rim, lattice[inside(lattice, GAP * edge)]])
    F = Delaunay(P).simplices.astype(np.int64)
    u, v = P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]]
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    F = np.where((twice < 0)[:, None], F[:, ::-1], F)
    # Delaunay fills the convex hull, with slivers along straight parts of the rim
    return P, np.asarray(F[inside(P[F].mean(axis=1), 0.0) & (np.abs(twice) > 1e-3 * edge**2)])
