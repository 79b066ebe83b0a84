"""Linear hat functions: gradients, frames, mass, assembly."""

from weakref import WeakKeyDictionary

import igl
import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface


def hat_gradients(surface: Surface) -> Floats:
    """Gradients of the three hat functions on each face, (m, 3 corners, 3 xyz), per metre.

    grad phi_i = n x (p_k - p_j) / (2 A), with i, j, k counter-clockwise about the normal n.
    """
    P = surface.V[surface.F]
    opposite = np.roll(P, -2, axis=1) - np.roll(P, -1, axis=1)
    gradients: Floats = np.cross(surface.normals[:, None, :], opposite) / (2 * surface.areas)[:, None, None]
    return gradients


def tangents(surface: Surface) -> Floats:
    """(m, 2, 3) an orthonormal frame of each face's plane: the first edge's direction, and normal x that direction."""
    edge = surface.V[surface.F[:, 1]] - surface.V[surface.F[:, 0]]
    t1 = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.stack([t1, np.cross(surface.normals, t1)], axis=1)


_MASSES: WeakKeyDictionary[Surface, Floats] = WeakKeyDictionary()


def voronoi_mass(surface: Surface) -> Floats:
    """(n,) Voronoi areas of the vertices, square metres; they sum to the area [Meyer et al. 2003, mixed areas].

    Computed once for a surface that lives.
    """
    if surface not in _MASSES:
        diagonal: Floats = igl.massmatrix(surface.V, surface.F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
        diagonal.flags.writeable = False
        _MASSES[surface] = diagonal
    return _MASSES[surface]


def assemble(surface: Surface, blocks: Floats) -> csr_array:
    """(n, n) sparse sum of the (m, 3, 3) face blocks, row and column i of a block belonging to corner i."""
    rows = np.repeat(surface.F, 3, axis=1).ravel()
    columns = np.tile(surface.F, (1, 3)).ravel()
    return coo_array((blocks.ravel(), (rows, columns)), shape=(surface.n, surface.n)).tocsr()
