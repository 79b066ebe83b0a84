"""Anisotropic diffusion operators on linear hats."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.surface.hats import assemble, hat_gradients
from dsfab.surface.mesh import Surface


def diffusion_operator(surface: Surface, D: Floats) -> csr_array:
    """Weak form of -div(D grad), paper eq. 5, on linear hats with one tensor per face [Andreux et al. 2014].

    D : (m, 3, 3) symmetric, positive on each face's plane, dimensionless; it acts on gradients.
    Returns L : (n, n) symmetric positive semidefinite, rows sum to zero; for D = I the cotangent Laplacian.
    """
    g, A = hat_gradients(surface), surface.areas  # (m, 3 corners, 3 xyz) per metre; (m,) square metres
    return assemble(surface, np.einsum("mia,mab,mjb,m->mij", g, D, g, A, optimize=True))
