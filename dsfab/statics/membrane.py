"""Membrane stiffness, in each triangle's own plane: constant strain, or edges that bend by bubbles."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.statics.blocks import PairBlocks, upwards, vertex_pairs
from dsfab.statics.elements import PAPER, Elements, assembled, edge_frames, padded, voigt
from dsfab.statics.hinges import hinges
from dsfab.statics.hybrid import hybrid_rigidity
from dsfab.statics.material import Law, Material
from dsfab.surface.hats import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def membrane_stiffness(
    surface: Surface, material: Material, thickness: float, law: Law = "plane_stress", elements: Elements = PAPER
) -> csr_array:
    """K_m, N/m, symmetric positive semidefinite, over the unknowns of `elements` ((3 n, 3 n) by default).

    `constant`: the constant-strain triangle [Turner et al. 1956], block by block (`VertexPairs`).
    `quadratic`: the linear-strain triangle [Fraeijs de Veubeke 1965], three-point quadrature (exact); its edge bubbles
    move within the sheet only, so flat triangles that meet at an angle stay closed without drilling unknowns.
    `hybrid`: the same on the edges, with stresses in equilibrium inside (`dsfab.statics.hybrid`); never stiffer.
    """
    if elements.membrane == "quadratic":
        return _quadratic(surface, material.membrane(law) * thickness, elements)
    if elements.membrane == "hybrid":
        return _hybrid(surface, material.membrane(law) * thickness, elements)
    blocks = constant_blocks(surface, material.membrane(law) * thickness, elements)
    return padded(blocks.matrix(), elements.unknowns(surface))


def constant_blocks(surface: Surface, C: Floats, elements: Elements) -> PairBlocks:
    """The constant-strain triangles, C (3, 3) N/m, on the pairs of vertices that bending by hinges couples, where
    `elements` have it, else on the edges.

    Between corners with hat gradients g and f, and the projector P onto the face, the block of an isotropic C is

    A (lam g f^T + mu f g^T + mu (g . f) P)
    """
    pairs = vertex_pairs(surface, hinges(surface) if elements.bending == "hinge" else None)
    lam, mu = C[0, 1], C[2, 2]
    face = surface.F.T
    across = _across(surface)  # gradients times 2 A
    ascending = (face < np.roll(face, -1, axis=0)).ravel()
    u, v = (x.transpose(1, 0, 2).reshape(3, -1) for x in (across, np.roll(across, -1, axis=0)))
    u, v = upwards(u, v, ascending)
    normal = np.tile(surface.normals.T, 3)
    u = u / np.tile(4 * surface.areas, 3)
    shear = mu * (u * v).sum(axis=0)
    at = pairs.of_edge[surface.edges.of.T.ravel()]
    blocks = np.empty((9, len(pairs.ends)))
    for a in range(3):
        for b in range(3):
            value = lam * u[a] * v[b] + mu * v[a] * u[b] - shear * normal[a] * normal[b]
            blocks[3 * a + b] = np.bincount(at, value + shear if a == b else value, len(pairs.ends))
    return PairBlocks.of(pairs, blocks)


def _across(surface: Surface) -> Floats:
    """(3 corners, 3, m) normal x opposite edge of each corner: its hat gradient times twice the area, metres."""
    P = surface.V[surface.F].transpose(1, 2, 0)
    edge = np.roll(P, -2, axis=0) - np.roll(P, -1, axis=0)
    n = surface.normals.T
    return np.stack(
        [
            n[1] * edge[:, 2] - n[2] * edge[:, 1],
            n[2] * edge[:, 0] - n[0] * edge[:, 2],
            n[0] * edge[:, 1] - n[1] * edge[:, 0],
        ],
        axis=1,
    )


def mean_strain(surface: Surface, u: Floats, bubbles: Floats | None = None) -> Floats:
    """(m, 3) mean in-plane strain (xx, yy, 2 xy) of each face in its tangent frame.

    The paper's F = (x1 x2 x3) phi + n n_bar^T, linearised at rest: the normal's change cancels the transverse shear, so
    the strain is that of the constant-strain triangle in the face's tangent frame [Turner et al. 1956].

    u : (n, 3) displacements, metres.  bubbles : (e, 2) edge bubbles along t and m, metres, of `quadratic`.
    """
    t = tangents(surface)
    slope, moved = hat_gradients(surface) @ t.transpose(0, 2, 1), u[surface.F] @ t.transpose(0, 2, 1)
    strain = voigt(slope[:, 0], moved[:, 0]) + voigt(slope[:, 1], moved[:, 1]) + voigt(slope[:, 2], moved[:, 2])
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
    B = _strains_at(surface, (1 - np.eye(3)) / 2)
    R = (np.linalg.cholesky(C).T @ B).reshape(-1, 9, 15)
    blocks = R.transpose(0, 2, 1) @ R
    blocks *= (surface.areas / 3)[:, None, None]
    return assembled(blocks, elements.columns(surface, "along", "across"), elements.unknowns(surface))


def _hybrid(surface: Surface, C: Floats, elements: Elements) -> csr_array:
    B = _strains_at(surface, np.eye(3)).reshape(-1, 9, 15)
    blocks = B.transpose(0, 2, 1) @ (hybrid_rigidity(surface, C) @ B)
    return assembled(blocks, elements.columns(surface, "along", "across"), elements.unknowns(surface))


def _strains_at(surface: Surface, points: Floats) -> Floats:
    """(m, 3 points, 3, 15) strains at three points with barycentric coordinates (3, 3), of corners, then of bubbles."""
    B = np.empty((surface.m, 3, 3, 15))
    B[..., :9] = corner_strains(surface)[:, None]
    for k, at in enumerate(points):
        B[:, k, :, 9:] = bubble_strains(surface, at)
    return B
