"""The filter that keeps SIMP from checkerboards and sets the size of its members."""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.surface import Surface


def face_filter(surface: Surface, radius: float) -> csr_array:
    """(m, m) weights A_f (radius - distance) of faces f within `radius` metres of each face, rows summing to 1.

    Distances are straight between centroids: of sheets that nearly touch, one hears the other. With the area of each
    face a mesh with small faces in places weighs no more there [Sigmund 2007].
    """
    pairs = cKDTree(surface.centroids).query_pairs(radius, output_type="ndarray")
    i, j = pairs.T
    near = radius - np.linalg.norm(surface.centroids[i] - surface.centroids[j], axis=1)
    own = np.arange(surface.m)
    row, column = np.concatenate([i, j, own]), np.concatenate([j, i, own])
    weight = np.concatenate([near, near, np.full(surface.m, radius)]) * surface.areas[column]
    total = np.bincount(row, weight, surface.m)
    return csr_array((weight / total[row], (row, column)), shape=(surface.m, surface.m))


def filtered_sensitivity(H: csr_array, density: Floats, sensitivity: Floats) -> Floats:
    """(m,) sum_f H_ef x_f s_f / max(x_e, 0.001): Sigmund's filter [Sigmund 1997; Andreassen et al. 2011, eq. 11].

    density, sensitivity : (m,) x and s, the latter per area of the face.
    """
    return np.asarray(H @ (density * sensitivity) / np.maximum(density, LEAST))


LEAST = 1e-3
"""Densities below this are taken for it where they divide."""
