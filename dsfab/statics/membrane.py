"""Membrane stiffness: constant strain on each triangle, in the triangle's own plane."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.statics.material import Law, Material
from dsfab.surface.hats import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def strain_operator(surface: Surface) -> csr_array:
    """B, (3 m, 3 n): displacements (x, y, z of vertex 0, of vertex 1, ...) to in-plane strains (xx, yy, 2 xy per face).

    The paper's F = (x1 x2 x3) phi + n n_bar^T, linearised at rest: the normal's change cancels the transverse shear, so
    the strain is that of the constant-strain triangle in the face's tangent frame [Turner et al. 1956].
    """
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)  # (m, 3 corners, 2) hat gradients in the frame
    rows = np.empty((surface.m, 3, 3, 3))  # face, strain, corner, xyz
    rows[:, 0] = slope[:, :, 0, None] * t[:, None, 0]
    rows[:, 1] = slope[:, :, 1, None] * t[:, None, 1]
    rows[:, 2] = slope[:, :, 0, None] * t[:, None, 1] + slope[:, :, 1, None] * t[:, None, 0]
    freedoms = 3 * surface.F[:, :, None] + np.arange(3)
    columns = np.repeat(freedoms.reshape(surface.m, 1, 9), 3, axis=1)
    return csr_array(
        (rows.ravel(), columns.ravel(), 9 * np.arange(3 * surface.m + 1)), shape=(3 * surface.m, 3 * surface.n)
    )


def membrane_stiffness(surface: Surface, material: Material, thickness: float, law: Law = "plane_stress") -> csr_array:
    """K_m = B^T (A h C) B, (3 n, 3 n), N/m, symmetric positive semidefinite.

    Formed as R^T R with R = chol(A h C) B: one sparse product instead of 9 x 9 blocks, a quarter of the time.
    """
    root = np.linalg.cholesky(material.membrane(law)).T
    B = strain_operator(surface)
    weighted = (
        np.einsum("ab,mbi->mai", root, B.data.reshape(-1, 3, 9)) * np.sqrt(thickness * surface.areas)[:, None, None]
    )
    R = csr_array((weighted.ravel(), B.indices, B.indptr), shape=B.shape)
    return csr_array(R.T @ R)
