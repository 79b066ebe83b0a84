"""Membrane stiffness, in each triangle's own plane: constant strain, or quadratic displacements by edge bubbles."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.statics.elements import PAPER, Elements, assembled, edge_frames, padded, voigt
from dsfab.statics.material import Law, Material
from dsfab.surface.hats import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def strain_operator(surface: Surface) -> csr_array:
    """B, (3 m, 3 n): displacements (x, y, z of vertex 0, of vertex 1, ...) to in-plane strains (xx, yy, 2 xy per face).

    The paper's F = (x1 x2 x3) phi + n n_bar^T, linearised at rest: the normal's change cancels the transverse shear, so
    the strain is that of the constant-strain triangle in the face's tangent frame [Turner et al. 1956].
    """
    rows = corner_strains(surface)
    freedoms = 3 * surface.F[:, :, None] + np.arange(3)
    columns = np.repeat(freedoms.reshape(surface.m, 1, 9), 3, axis=1)
    return csr_array(
        (rows.ravel(), columns.ravel(), 9 * np.arange(3 * surface.m + 1)), shape=(3 * surface.m, 3 * surface.n)
    )


def membrane_stiffness(
    surface: Surface, material: Material, thickness: float, law: Law = "plane_stress", elements: Elements = PAPER
) -> csr_array:
    """K_m, N/m, symmetric positive semidefinite, over the unknowns of `elements` ((3 n, 3 n) by default).

    `constant`: B^T (A h C) B, formed as R^T R with R = chol(A h C) B: one sparse product instead of 9 x 9 blocks.
    `quadratic`: the linear-strain triangle [Fraeijs de Veubeke 1965], three-point quadrature (exact); its edge bubbles
    move within the sheet only, so flat triangles that meet at an angle stay closed without drilling unknowns.
    """
    if elements.membrane == "quadratic":
        return _quadratic(surface, material.membrane(law) * thickness, elements)
    root = np.linalg.cholesky(material.membrane(law)).T
    B = strain_operator(surface)
    weighted = (
        np.einsum("ab,mbi->mai", root, B.data.reshape(-1, 3, 9)) * np.sqrt(thickness * surface.areas)[:, None, None]
    )
    R = csr_array((weighted.ravel(), B.indices, B.indptr), shape=B.shape)
    return padded(csr_array(R.T @ R), elements.unknowns(surface))


def mean_strain(surface: Surface, u: Floats, bubbles: Floats | None = None) -> Floats:
    """(m, 3) mean in-plane strain (xx, yy, 2 xy) of each face in its tangent frame.

    u : (n, 3) displacements, metres.  bubbles : (e, 2) edge bubbles along t and m, metres, of `quadratic`.
    """
    strain = np.asarray(strain_operator(surface) @ u.ravel()).reshape(-1, 3)
    if bubbles is None:
        return strain
    third = np.full(3, 1 / 3)  # the bubbles' gradients are linear: their mean is the value at the centroid
    rows = bubble_strains(surface, third)
    values = np.concatenate([bubbles[surface.edges.of, 0], bubbles[surface.edges.of, 1]], axis=1)
    return np.asarray(strain + np.einsum("mai,mi->ma", rows, values))


def corner_strains(surface: Surface) -> Floats:
    """(m, 3, 9) strain of each face for unit displacements x, y, z of its corners, dimensionless per metre."""
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)  # (m, 3 corners, 2) hat gradients in the frame
    moved = voigt(slope[:, :, None, :], t.transpose(0, 2, 1)[:, None, :, :])  # (m, corner, xyz, strain)
    return np.ascontiguousarray(moved.reshape(-1, 9, 3).transpose(0, 2, 1))


def bubble_strains(surface: Surface, at: Floats) -> Floats:
    """(m, 3, 6) strain at the point with barycentric coordinates `at` (3,), for unit bubbles along t on the three
    half-edges, then along m; per metre."""
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)
    gradient = 4 * (at[:, None] * np.roll(slope, -1, axis=1) + np.roll(at, -1)[:, None] * slope)  # of 4 phi_j phi_k
    direction = np.einsum("mcdk,mak->mdca", edge_frames(surface)[surface.edges.of, :2], t)  # (m, t | m, half-edge, 2)
    return np.asarray(voigt(gradient[:, None], direction).reshape(-1, 6, 3).transpose(0, 2, 1))


def _quadratic(surface: Surface, C: Floats, elements: Elements) -> csr_array:
    # all three quadrature points below each other, B^T C B as R^T R: one product of 9 x 15 a face
    B = np.empty((surface.m, 3, 3, 15))
    B[..., :9] = corner_strains(surface)[:, None]
    for opposite in range(3):
        B[:, opposite, :, 9:] = bubble_strains(surface, np.where(np.arange(3) == opposite, 0.0, 0.5))
    R = (np.linalg.cholesky(C).T @ B).reshape(-1, 9, 15)
    blocks = R.transpose(0, 2, 1) @ R
    blocks *= (surface.areas / 3)[:, None, None]
    return assembled(blocks, elements.columns(surface, "along", "across"), elements.unknowns(surface))
