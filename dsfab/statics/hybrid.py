"""The `hybrid` membrane: stress in equilibrium inside each triangle, displacements on its edges alone.

The edges move as those of the quadratic triangle (`quadratic`), so the unknowns, the loads and the supports are the
same; but nothing is assumed about displacements inside. There the stress is a polynomial that satisfies equilibrium
and compatibility, and its parameters are eliminated on the face [Pian 1964; Jirousek 1978, hybrid Trefftz elements].

Each such stress does the same work on every displacement with the given edges. So that work may be written with the
linear strains e (three at each corner) of the quadratic triangle, and all of the element is one matrix D per face:

    e . D e  is twice its energy,  D = M H^-1 M^T,  H = integral of P^T C^-1 P,  M_i = integral of hat_i P

with the stresses P, 3 x 11. With all nine linear stresses for P instead, D is that of the quadratic triangle. Energy
found from part of all stresses in equilibrium is never more than that of the exact inside, and energy from assumed
displacements never less: the element is never stiffer than `quadratic`.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface.hats import tangents
from dsfab.surface.mesh import Surface

MONOMIALS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Powers of x and y in a quadratic polynomial."""

AIRY: tuple[Mapping[tuple[int, int], float], ...] = (
    {(2, 0): 1}, {(1, 1): 1}, {(0, 2): 1},
    {(3, 0): 1}, {(2, 1): 1}, {(1, 2): 1}, {(0, 3): 1},
    {(4, 0): 1, (0, 4): -1}, {(3, 1): 1}, {(1, 3): 1}, {(4, 0): 1, (2, 2): -6, (0, 4): 1},
)  # fmt: skip
"""Airy's functions of the stresses, by powers of x and y: all biharmonic polynomials of degree 2 to 4.

They look alike from every direction, so the element does not depend on how its corners are numbered. Nine stresses are
needed (twelve edge displacements less three rigid motions); those of degree 2 and 3 are seven. Of the four of degree 4
two would do, but one such pair, r^2 (x^2 - y^2) and r^2 x y, lets a right isosceles triangle collapse; with the other
the weakest strain of that triangle keeps 0.19 of its energy in the quadratic one, with all four 0.22. Without
compatibility there would be one more, r^4, which changes nothing that a table shows."""

SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
_NEAR, _FAR = 0.108103018168070, 0.816847572980459
POINTS = np.concatenate([np.full((3, 3), (1 - x) / 2) + (3 * x - 1) / 2 * np.eye(3) for x in (_NEAR, _FAR)])
"""Barycentric coordinates of six points, and `SHARES` of the area: exact for degree 4 [Dunavant 1985]."""

UNMIXED = 12 * (np.eye(3) - 0.25)
"""Inverse of the integrals of products of two hats over a triangle of area 1."""


def _stresses(functions: Sequence[Mapping[tuple[int, int], float]]) -> Floats:
    """(6 monomials, 3, k) coefficients of the stresses (xx, yy, xy) = (phi_yy, phi_xx, -phi_xy) [Airy 1863]."""
    found = np.zeros((len(MONOMIALS), 3, len(functions)))
    for k, function in enumerate(functions):
        for (a, b), factor in function.items():
            for row, down, times in (
                (0, (a, b - 2), b * (b - 1)),
                (1, (a - 2, b), a * (a - 1)),
                (2, (a - 1, b - 1), -a * b),
            ):
                if times:
                    found[MONOMIALS.index(down), row, k] += times * factor
    return found


STRESSES = _stresses(AIRY)


def hybrid_rigidity(surface: Surface, C: Floats) -> Floats:
    """(m, 9, 9) D of each face, for strains (xx, yy, 2 xy) at its first, second and third corner, in its tangent frame.

    C : (3, 3) stress, or force per length, from strain: plane stress or plane strain of an isotropic material.
    """
    corners = surface.V[surface.F]
    arm = (corners - corners.mean(axis=1, keepdims=True)) @ tangents(surface).transpose(0, 2, 1)
    x, y = np.moveaxis(POINTS @ (arm / np.abs(arm).max(axis=(1, 2), keepdims=True)), -1, 0)  # (m, 6) without a unit
    powers = np.stack([x**a * y**b for a, b in MONOMIALS], axis=1)
    shares = powers * SHARES
    linear = shares @ POINTS  # (m, monomial, hat) means
    square = shares @ powers.transpose(0, 2, 1)
    count, _, k = STRESSES.shape
    compliance = np.einsum("aik,ij,bjl->abkl", STRESSES, np.linalg.inv(C), STRESSES).reshape(count**2, k * k)
    H = (square.reshape(-1, count**2) @ compliance).reshape(-1, k, k)
    M = (linear.transpose(0, 2, 1).reshape(-1, count) @ STRESSES.reshape(count, -1)).reshape(-1, 9, k)
    D = M @ np.linalg.solve(H, M.transpose(0, 2, 1))
    return np.asarray((D + D.transpose(0, 2, 1)) * (surface.areas / 2)[:, None, None])


def hybrid_stress(surface: Surface, C: Floats, strain: Floats) -> Floats:
    """(m, 3 corners, 3) stress (xx, yy, xy) of each face: the linear part of the quadratic stress (its projection).

    strain : (m, 3 corners, 3) of the quadratic triangle. Mean stress, and energy as half of the mean product of the two
             linear fields, are those of the element without any loss; on the edge of a hole the linear part is nearer
             than the quadratic stress itself.
    """
    work = (hybrid_rigidity(surface, C) @ strain.reshape(-1, 9, 1)).reshape(-1, 3, 3)
    return np.asarray(UNMIXED @ work / surface.areas[:, None, None])
