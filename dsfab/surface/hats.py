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
    u, v, w = (P[:, (2, 0, 1)] - P[:, (1, 2, 0)]).transpose(2, 0, 1)  # the opposite edges
    x, y, z = surface.normals.T[:, :, None]
    gradients = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=2)
    gradients /= (2 * surface.areas)[:, None, None]
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


def assemble(surface: Surface, blocks: Floats, diagonal: Floats | None = None) -> csr_array:
    """(n, n) sparse sum of the (m, 3, 3) face blocks, row and column i of a block belonging to corner i.

    diagonal : (n,) added to it. All matrices with one have the same pattern: what is 0 stays an entry.
    """
    rows = np.repeat(surface.F, 3, axis=1).ravel()
    columns = np.tile(surface.F, (1, 3)).ravel()
    values = blocks.ravel()
    if diagonal is not None:
        every = np.arange(surface.n)
        rows, columns = np.concatenate([rows, every]), np.concatenate([columns, every])
        values = np.concatenate([values, diagonal])
    return coo_array((values, (rows, columns)), shape=(surface.n, surface.n)).tocsr()
