"""Bending stiffness of hinges, Morley's plate, and the element of Hellan, Herrmann and Johnson."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats
from dsfab.statics.assembly import (
    CORNERS,
    PairBlocks,
    angle_gradients,
    ascending_pairs,
    hinges,
    summed_blocks,
    vertex_pairs,
)
from dsfab.statics.elements import (
    INVERSE_MASS,
    PAPER,
    Elements,
    assemble_blocks,
    edge_frames,
    half_edge_signs,
    voigt,
    zero_padded,
)
from dsfab.statics.model import Material
from dsfab.surface.fields import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def curvatures(surface: Surface) -> Floats:
    """Return the curvature (xx, yy, 2 xy) of each face, (m, 3, 12), for unit values of its 12 unknowns.
    Unknowns: displacements x, y, z of the three corners, then rotations of the three edges.
    The curvature is constant on a face [Morley 1968; Grinspun et al. 2006 for surfaces]:

        kappa = 1/A sum over half-edges j -> k of  -s l omega m m^T + (w_k - w_j) sym(t m^T)

    t : direction of the half-edge. m = t x n points out of the face. w = u . n : deflection.
    omega : rotation about the edge. s : sign of the half-edge."""
    frame = tangents(surface)
    length, t, m = half_edge_frames(surface)
    rows = np.empty((surface.m, 12, 3))
    step = voigt(t, m)
    # half-edge c begins at corner c, half-edge c - 1 ends there
    corner = np.roll(step, 1, axis=1) - step
    normal = np.cross(frame[:, 0], frame[:, 1])
    rows[:, :9] = (corner[:, :, None, :] * normal[:, None, :, None]).reshape(-1, 9, 3)
    rows[:, 9:] = -(half_edge_signs(surface) * length)[:, :, None] * voigt(m, m)
    return np.asarray((rows / surface.areas[:, None, None]).transpose(0, 2, 1))


def half_edge_frames(surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Return the lengths (m, 3) of the three sides of each face, and their directions and outward normals (m, 3, 2)."""
    frame = tangents(surface)
    P = surface.V[surface.F]
    edge = np.einsum("mck,mak->mca", np.roll(P, -1, axis=1) - P, frame)
    length = np.linalg.norm(edge, axis=2)
    t = edge / length[:, :, None]
    return length, t, np.stack([t[:, :, 1], -t[:, :, 0]], axis=2)


def midedge_stiffness(surface: Surface, D: Floats, elements: Elements) -> csr_array:
    """Return the bending stiffness, N/m, of `midedge` elements: the energy of a face is A/2 kappa : D kappa.
    A : area. kappa : curvature. D : (3, 3) matrix from curvatures to moments, N m; or (m, 3, 3) for each face."""
    B = curvatures(surface)
    blocks = B.transpose(0, 2, 1) @ (D @ B) * surface.areas[:, None, None]
    return assemble_blocks(blocks, elements.columns(surface, "rotation"), elements.unknowns(surface))


GAUSS = (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3))
"""Positions of two-point quadrature on an edge from 0 to 1, exact for cubics."""


def moment_loads(surface: Surface) -> Floats:
    """Return the work (m, 3 corners a, 3 moments, 12 unknowns) of unit moments M (xx, yy, xy) times lambda_a.
    lambda_a is linear on the face, 1 at corner a and 0 at the other two corners.
    Unknowns: deflections w of the corners; bubbles, rotations and slopes of the half-edges. The work is

        integral of lambda_a M : hess w  -  sum over half-edges of  integral of lambda_a (m M m) (dw/dm + s theta)

    m : direction out of the face. s : sign of the half-edge. theta : rotation of the edge
    [Hellan 1967; Herrmann 1967; Johnson 1973; Neunteufel and Schoeberl 2019, shells]."""
    length, _, outward = half_edge_frames(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), tangents(surface))
    across = np.einsum("mia,mca->mci", slope, outward)  # (faces, half-edge, corner): slopes normal to the half-edge
    sign = half_edge_signs(surface)
    rows = np.zeros((surface.m, 3, 3, 12))
    rows[..., 3:6] = (8 / 3 * surface.areas[:, None, None] * voigt(slope, np.roll(slope, -1, axis=1))).transpose(
        0, 2, 1
    )[:, None]
    for c in range(3):
        moment = voigt(outward[:, c], outward[:, c]) * (length[:, c] / 2)[:, None]
        for x in GAUSS:
            weights = np.zeros(3)
            weights[c], weights[(c + 1) % 3] = 1 - x, x
            turn = np.zeros((surface.m, 12))
            turn[:, :3] = across[:, c]
            turn[:, 3:6] = 4 * (weights * np.roll(across[:, c], -1, axis=1) + np.roll(weights, -1) * across[:, c])
            turn[:, 6 + c], turn[:, 9 + c] = sign[:, c], 2 * x - 1
            rows -= weights[:, None, None] * (moment[:, :, None] * turn[:, None, :])[:, None]
    return rows


def hhj_stiffness(surface: Surface, D: Floats, elements: Elements) -> csr_array:
    """Return the bending stiffness, N/m, of `hhj` elements (Hellan, Herrmann and Johnson).
    D : (3, 3) matrix from curvatures to moments, N m; or (m, 3, 3), one for each face."""
    rows = moment_loads(surface)
    normal, edge = surface.normals, surface.edges.of
    normal_share = np.einsum("mcx,mx->mc", edge_frames(surface)[edge, 2], normal)
    B = np.concatenate(
        [
            (rows[..., :3, None] * normal[:, None, None, None, :]).reshape(surface.m, 3, 3, 9),
            rows[..., 3:6] * normal_share[:, None, None, :],
            rows[..., 6:],
        ],
        axis=3,
    ).reshape(surface.m, 9, 18)
    if D.ndim == 2:
        blocks = B.transpose(0, 2, 1) @ (np.kron(INVERSE_MASS, D) @ B) / surface.areas[:, None, None]
    else:
        rigidity = np.einsum("ab,mij->maibj", INVERSE_MASS, D).reshape(-1, 9, 9) / surface.areas[:, None, None]
        blocks = B.transpose(0, 2, 1) @ (rigidity @ B)
    return assemble_blocks(blocks, elements.columns(surface, "normal", "rotation", "slope"), elements.unknowns(surface))


def bending_stiffness(
    surface: Surface, material: Material, thickness: float, elements: Elements = PAPER, rigidity: Floats | None = None
) -> csr_array:
    """Return the bending stiffness, N/m, over the unknowns of `elements`; by default (3 n, 3 n).
    rigidity : see `SheetModel`.    Raises ValueError for elements without bending."""
    D = material.bending(thickness) if rigidity is None else rigidity
    if elements.bending == "hinge":
        return zero_padded(hinge_blocks(surface, material, thickness).matrix(), elements.unknowns(surface))
    if elements.bending == "midedge":
        return midedge_stiffness(surface, D, elements)
    if elements.bending == "hhj":
        return hhj_stiffness(surface, D, elements)
    raise ValueError(f"{elements} has no bending")


def hinge_blocks(surface: Surface, material: Material, thickness: float) -> PairBlocks:
    """Return the bending stiffness, N/m, of hinges: edges between two faces that resist a change of their fold angle.
    The energy of a hinge is 1/2 D l^2 / (A1 + A2) (change of the angle)^2 [Wardetzky et al. 2007].
    D : bending stiffness of the sheet. l : length of the edge. A1, A2 : areas of both faces."""
    h = hinges(surface)
    gradients, weight = angle_gradients(surface, h)
    g = np.ascontiguousarray((gradients * np.sqrt(material.bending_stiffness(thickness) * weight)[:, None, None]).T)
    pairs = vertex_pairs(surface, h)
    lower, upper = ([pair[k] for pair in CORNERS] for k in (0, 1))
    ascending = (h[:, lower] < h[:, upper]).T
    u, v = (x.reshape(3, -1) for x in ascending_pairs(g[:, lower], g[:, upper], ascending))
    return PairBlocks.without_shifts(pairs, summed_blocks(u, v, pairs.of_hinge(surface, h).ravel(), len(pairs.ends)))
