"""Bending after Hellan, Herrmann and Johnson: quadratic deflection, linear moments, linear rotations on edges."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.statics.elements import Elements, assembled, edge_frames, half_edge_signs, voigt
from dsfab.statics.midedge import half_edge_frames
from dsfab.surface.hats import hat_gradients, tangents
from dsfab.surface.mesh import Surface

GAUSS = (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3))
"""Two-point quadrature on an edge from 0 to 1: exact for the cubics met here."""

CONDENSED = 12 * (np.eye(3) - 0.25)
"""A times the inverse mass matrix of the linear hats on a triangle of area A."""


def moment_loads(surface: Surface) -> Floats:
    """(m, 3 hats, 3, 12): the moment equation of each face, for unit moments (xx, yy, xy) on each hat function.

    Columns: deflections w of the corners, bubbles of the half-edges, rotations and slopes of the half-edges. A row is

        integral of lambda_a M : hess w  -  sum over half-edges of  integral of lambda_a (m M m) (dw/dm + s theta)

    with m pointing out of the face [Hellan 1967; Herrmann 1967; Johnson 1973; Neunteufel and Schoeberl 2019, shells].
    The rotation counts with the half-edge's sign s; the slope, odd along the edge as well, counts without.
    """
    length, _, out = half_edge_frames(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), tangents(surface))
    across = np.einsum("mia,mca->mci", slope, out)  # (m, half-edge, corner) hat slopes along m
    sign = half_edge_signs(surface)
    rows = np.zeros((surface.m, 3, 3, 12))
    rows[..., 3:6] = (8 / 3 * surface.areas[:, None, None] * voigt(slope, np.roll(slope, -1, axis=1))).transpose(
        0, 2, 1
    )[:, None]
    for c in range(3):
        moment = voigt(out[:, c], out[:, c]) * (length[:, c] / 2)[:, None]
        for x in GAUSS:
            at = np.zeros(3)
            at[c], at[(c + 1) % 3] = 1 - x, x
            turn = np.zeros((surface.m, 12))
            turn[:, :3] = across[:, c]
            turn[:, 3:6] = 4 * (at * np.roll(across[:, c], -1, axis=1) + np.roll(at, -1) * across[:, c])
            turn[:, 6 + c], turn[:, 9 + c] = sign[:, c], 2 * x - 1
            rows -= at[:, None, None] * (moment[:, :, None] * turn[:, None, :])[:, None]
    return rows


def hhj_stiffness(surface: Surface, D: Floats, elements: Elements) -> csr_array:
    """K_b over the unknowns of `elements`, N/m; the moments are eliminated on each face.

    D : (3, 3) moments from curvatures, N m, or (m, 3, 3) of each face. The *decoupled* form: the bubble along an edge's
    mean normal bends the faces, those along and across the edge stretch them; coupling all three locks on coarse thin
    curved meshes.
    """
    rows = moment_loads(surface)
    normal, of = surface.normals, surface.edges.of
    lean = np.einsum("mcx,mx->mc", edge_frames(surface)[of, 2], normal)
    B = np.concatenate(
        [
            (rows[..., :3, None] * normal[:, None, None, None, :]).reshape(surface.m, 3, 3, 9),
            rows[..., 3:6] * lean[:, None, None, :],
            rows[..., 6:],
        ],
        axis=3,
    ).reshape(surface.m, 9, 18)
    if D.ndim == 2:
        blocks = B.transpose(0, 2, 1) @ (np.kron(CONDENSED, D) @ B) / surface.areas[:, None, None]
    else:
        each = np.einsum("ab,mij->maibj", CONDENSED, D).reshape(-1, 9, 9) / surface.areas[:, None, None]
        blocks = B.transpose(0, 2, 1) @ (each @ B)
    return assembled(blocks, elements.columns(surface, "normal", "rotation", "slope"), elements.unknowns(surface))
