"""Membrane stiffness of triangles: stiffness against deformation in the plane of each triangle."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats
from dsfab.statics.assembly import PairBlocks, ascending_pairs, hinges, vertex_pairs
from dsfab.statics.elements import INVERSE_MASS, PAPER, Elements, assemble_blocks, edge_frames, voigt, zero_padded
from dsfab.statics.model import Law, Material
from dsfab.surface.fields import hat_gradients, tangents
from dsfab.surface.mesh import Surface

MONOMIALS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # Powers of x and y in a quadratic polynomial.

AIRY: tuple[Mapping[tuple[int, int], float], ...] = (
    {(2, 0): 1}, {(1, 1): 1}, {(0, 2): 1},
    {(3, 0): 1}, {(2, 1): 1}, {(1, 2): 1}, {(0, 3): 1},
    {(4, 0): 1, (0, 4): -1}, {(3, 1): 1}, {(1, 3): 1}, {(4, 0): 1, (2, 2): -6, (0, 4): 1},
)  # fmt: skip
"""Airy stress functions: all biharmonic polynomials of degree 2 to 4. Each maps powers of x and y to a coefficient.
Nine functions are enough for an element. With all eleven, results do not depend on the order of the corners."""

SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
_NEAR, _FAR = 0.108103018168070, 0.816847572980459
POINTS = np.concatenate([np.full((3, 3), (1 - x) / 2) + (3 * x - 1) / 2 * np.eye(3) for x in (_NEAR, _FAR)])
"""Barycentric coordinates of six quadrature points, exact for degree 4 [Dunavant 1985]. `SHARES` has their weights."""


def airy_stresses(functions: Sequence[Mapping[tuple[int, int], float]]) -> Floats:
    """Return the coefficients (6 monomials, 3, k) of the stresses (phi_yy, phi_xx, -phi_xy) of k Airy functions phi."""
    coefficients = np.zeros((len(MONOMIALS), 3, len(functions)))
    for k, function in enumerate(functions):
        for (a, b), factor in function.items():
            for row, powers, derivative in (
                (0, (a, b - 2), b * (b - 1)),
                (1, (a - 2, b), a * (a - 1)),
                (2, (a - 1, b - 1), -a * b),
            ):
                if derivative:
                    coefficients[MONOMIALS.index(powers), row, k] += derivative * factor
    return coefficients


STRESSES = airy_stresses(AIRY)


def hybrid_rigidity(surface: Surface, C: Floats) -> Floats:
    """Return the stiffness (m, 9, 9) of `hybrid` elements for strains (xx, yy, 2 xy) at the three corners.
    C : (3, 3) isotropic matrix from strains to stresses, Pa, or to forces per length, N/m."""
    corners = surface.V[surface.F]
    arm = (corners - corners.mean(axis=1, keepdims=True)) @ tangents(surface).transpose(0, 2, 1)
    x, y = np.moveaxis(POINTS @ (arm / np.abs(arm).max(axis=(1, 2), keepdims=True)), -1, 0)  # (m, 6 points), scaled
    powers = np.stack([x**a * y**b for a, b in MONOMIALS], axis=1)
    shares = powers * SHARES
    linear = shares @ POINTS  # (m, monomial, corner): mean of monomial x the corner's hat function
    square = shares @ powers.transpose(0, 2, 1)
    count, _, k = STRESSES.shape
    compliance = np.einsum("aik,ij,bjl->abkl", STRESSES, np.linalg.inv(C), STRESSES).reshape(count**2, k * k)
    H = (square.reshape(-1, count**2) @ compliance).reshape(-1, k, k)
    M = (linear.transpose(0, 2, 1).reshape(-1, count) @ STRESSES.reshape(count, -1)).reshape(-1, 9, k)
    D = M @ np.linalg.solve(H, M.transpose(0, 2, 1))
    return np.asarray((D + D.transpose(0, 2, 1)) * (surface.areas / 2)[:, None, None])


def hybrid_stress(surface: Surface, C: Floats, strain: Floats) -> Floats:
    """Return the stresses (xx, yy, xy), Pa, at the corners of `hybrid` elements, (m, 3 corners, 3).
    strain : (m, 3 corners, 3) strains (xx, yy, 2 xy).    C : (3, 3) matrix from strains to stresses, Pa."""
    work = (hybrid_rigidity(surface, C) @ strain.reshape(-1, 9, 1)).reshape(-1, 3, 3)
    return np.asarray(INVERSE_MASS @ work / surface.areas[:, None, None])


def membrane_stiffness(
    surface: Surface, material: Material, thickness: float, law: Law = "plane_stress", elements: Elements = PAPER
) -> csr_array:
    """Return the membrane stiffness matrix, N/m, for the unknowns of `elements`; its default shape is (3 n, 3 n).
    `constant`: the constant-strain triangle [Turner et al. 1956].
    `quadratic`: the linear-strain triangle [Fraeijs de Veubeke 1965].
    `hybrid`: stress functions that satisfy equilibrium inside each triangle."""
    if elements.membrane == "quadratic":
        return _quadratic(surface, material.membrane(law) * thickness, elements)
    if elements.membrane == "hybrid":
        return _hybrid(surface, material.membrane(law) * thickness, elements)
    blocks = constant_blocks(surface, material.membrane(law) * thickness, elements)
    return zero_padded(blocks.matrix(), elements.unknowns(surface))


def constant_blocks(surface: Surface, C: Floats, elements: Elements) -> PairBlocks:
    """Return the stiffness of constant-strain triangles: a 3 x 3 block for each pair of vertices on an edge or hinge.
    C : (3, 3) isotropic matrix from strains to forces per length, N/m. A face adds to the block of two corners:

    A (lam g f^T + mu f g^T + mu (g . f) P),    A : area of the face, lam = C[0, 1], mu = C[2, 2]
    g, f : gradients of the corners' linear functions.    P : projector onto the face."""
    pairs = vertex_pairs(surface, hinges(surface) if elements.bending == "hinge" else None)
    lam, mu = C[0, 1], C[2, 2]
    face = surface.F.T
    across = _doubled_area_gradients(surface)
    ascending = (face < np.roll(face, -1, axis=0)).ravel()
    u, v = (x.transpose(1, 0, 2).reshape(3, -1) for x in (across, np.roll(across, -1, axis=0)))
    u, v = ascending_pairs(u, v, ascending)
    normal = np.tile(surface.normals.T, 3)
    u = u / np.tile(4 * surface.areas, 3)
    shear = mu * (u * v).sum(axis=0)
    pair = pairs.of_edge[surface.edges.of.T.ravel()]
    blocks = np.empty((9, len(pairs.ends)))
    for a in range(3):
        for b in range(3):
            value = lam * u[a] * v[b] + mu * v[a] * u[b] - shear * normal[a] * normal[b]
            blocks[3 * a + b] = np.bincount(pair, value + shear if a == b else value, len(pairs.ends))
    return PairBlocks.without_shifts(pairs, blocks)


def _doubled_area_gradients(surface: Surface) -> Floats:
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
    """Return the mean in-plane strain (xx, yy, 2 xy) of each face (m, 3), in the face's frame [Turner et al. 1956].
    u       : (n, 3) displacements of the vertices, metres.
    bubbles : (e, 2) further displacement of each edge's midpoint, along and across the edge, metres."""
    t = tangents(surface)
    slope, moved = hat_gradients(surface) @ t.transpose(0, 2, 1), u[surface.F] @ t.transpose(0, 2, 1)
    strain = voigt(slope[:, 0], moved[:, 0]) + voigt(slope[:, 1], moved[:, 1]) + voigt(slope[:, 2], moved[:, 2])
    if bubbles is None:
        return strain
    third = np.full(3, 1 / 3)  # gradients of bubbles are linear, so the centroid gives their mean
    rows = bubble_strains(surface, third)
    values = np.concatenate([bubbles[surface.edges.of, 0], bubbles[surface.edges.of, 1]], axis=1)
    return np.asarray(strain + np.einsum("mai,mi->ma", rows, values))


def corner_strains(surface: Surface) -> Floats:
    """Return the matrix (m, 3, 9) of each face from displacements x, y, z of its corners to strains (xx, yy, 2 xy)."""
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)  # (m, 3 corners, 2) hat gradients in the face's frame
    moved = voigt(slope[:, :, None, :], t.transpose(0, 2, 1)[:, None, :, :])  # (m, corner, xyz, strain)
    return np.ascontiguousarray(moved.reshape(-1, 9, 3).transpose(0, 2, 1))


def bubble_strains(surface: Surface, weights: Floats) -> Floats:
    """Return strains (xx, yy, 2 xy) at a point of each face per metre of displacement of edge midpoints, (m, 3, 6).
    Columns: first displacements along the three edges, then across the three edges.
    weights : (3,) barycentric coordinates of the point."""
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)
    # slopes of the bubbles 4 phi_j phi_k
    gradient = 4 * (weights[:, None] * np.roll(slope, -1, axis=1) + np.roll(weights, -1)[:, None] * slope)
    direction = np.einsum("mcdk,mak->mdca", edge_frames(surface)[surface.edges.of, :2], t)  # (m, bubble, half-edge, 2)
    return np.asarray(voigt(gradient[:, None], direction).reshape(-1, 6, 3).transpose(0, 2, 1))


def _quadratic(surface: Surface, C: Floats, elements: Elements) -> csr_array:
    # C = L L^T and R = L^T B, so B^T C B = R^T R; one product R^T R per face sums over all quadrature points
    B = _point_strains(surface, (1 - np.eye(3)) / 2)
    R = (np.linalg.cholesky(C).T @ B).reshape(-1, 9, 15)
    blocks = R.transpose(0, 2, 1) @ R
    blocks *= (surface.areas / 3)[:, None, None]
    return assemble_blocks(blocks, elements.columns(surface, "along", "across"), elements.unknowns(surface))


def _hybrid(surface: Surface, C: Floats, elements: Elements) -> csr_array:
    B = _point_strains(surface, np.eye(3)).reshape(-1, 9, 15)
    blocks = B.transpose(0, 2, 1) @ (hybrid_rigidity(surface, C) @ B)
    return assemble_blocks(blocks, elements.columns(surface, "along", "across"), elements.unknowns(surface))


def _point_strains(surface: Surface, points: Floats) -> Floats:
    B = np.empty((surface.m, 3, 3, 15))
    B[..., :9] = corner_strains(surface)[:, None]
    for k, weights in enumerate(points):
        B[:, k, :, 9:] = bubble_strains(surface, weights)
    return B
