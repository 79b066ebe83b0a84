"""`layer_stress`: the stress of all layers of a sheet as one tensor, whose axes two families of ribs can follow.

A sheet that bends is stressed otherwise at every height. With z = h/2 zeta from the middle (zeta from -1 at the top to
1 at the bottom; h the thickness), membrane stress sm = n / h and bending stress sb = 6 m / h^2, a layer has

    s(zeta) = sm + zeta sb                                       n, m : forces and moments per length, N/m and N

*Sizes.* Ribs along a unit vector e take the traction s e over. The mean of its square over the thickness is

    e . S e,   S = 1/2 int s s dzeta = sm^2 + sb^2 / 3 = 1/h (n n^T / h + 12 m m^T / h^3)                           (1)

which is, but for Poisson's ratio, the energy that material along e stores: a rib pays by sqrt(e . S e), pascals.

*Axes.* (1) has the principal axes of n or of m where the other is zero, but it is blind where both principal values are
as large: in pure shear it is a multiple of the identity, for it has no sign. (On a sphere that is pressed at its poles
hoops are pulled about as much as meridians are pressed nearly everywhere; there (1) follows rounding, or what little
bending there is, by 45 degrees off what ribs could carry.) What a grid of ribs lacks is stiffness against shear between
its families, so the axes here are those with the least of it through the thickness. With the deviator of a plane stress
as a complex number, d = (sxx - syy) / 2 + i sxy, its shear between axes at the angle t is Im(d e^{-2it}), and

    1/2 int Im((dm + zeta db) e^{-2it})^2 dzeta = const - 1/2 Re(Q e^{-4it}),    Q = dm^2 + db^2 / 3                (2)

is least at t = arg(Q) / 4: a cross, up to quarter turns. For n or m alone, and where both have the same axes, these are
the principal axes of (1); but a membrane in pure shear keeps those of n.

*Signs.* Neither has one, and families named by size alone change places with every rounding. The stress of an outer
layer has a sign that changes wherever bending turns from hogging to sagging: named by it, families changed places in
the middle of a roof, which became 1.3 times as soft. So each axis is given the sign of the mean stress along it, that
of the middle surface, which is continuous over supports as well; and where the whole middle surface is next to free of
stress, as a slab's is, the sign at the bottom, where its weight pulls it. Of a membrane all of this is its own stress.
"""

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface import Surface
from dsfab.surface.hats import tangents

UNSTRESSED = 1e-3
"""A middle surface with less than this share of the stress of the sides leaves nothing to follow."""


def layer_stress(surface: Surface, membrane: Floats, bending: Floats) -> Floats:
    """(m, 3, 3) Pa, symmetric and tangent: along two axes of least shear the root mean square of the layers' stress.

    membrane : (m, 3, 3) stress of the middle surface, Pa, tangent to each face.
    bending  : (m, 3, 3) what bending adds at the bottom, the side that normals point away from, Pa.

    It turns with the surface, scales with the stress and changes sign with it. Normals that point the other way change
    nothing, but its sign where only bending has one. Faces that do not bend keep their membrane stress to the bit.
    """
    t = tangents(surface)
    flat, bent = (np.einsum("mai,mij,mbj->mab", t, sigma, t, optimize=True) for sigma in (membrane, bending))
    square = _deviator(flat) ** 2 + _deviator(bent) ** 2 / 3
    angle = np.angle(square) / 4
    cosine, sine = np.cos(angle), np.sin(angle)
    axes = np.stack([np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)], axis=1)  # (m, axis, 2)
    traction = np.einsum("mab,mkb->mka", flat, axes), np.einsum("mab,mkb->mka", bent, axes)
    size = np.sqrt((traction[0] ** 2).sum(axis=2) + (traction[1] ** 2).sum(axis=2) / 3)
    signed = traction[1] if only_bends(membrane, bending) else traction[0]
    along = np.einsum("mka,mka->mk", signed, axes)
    planar = np.einsum("mk,mka,mkb->mab", np.copysign(size, along), axes, axes)
    found = np.einsum("mai,mab,mbj->mij", t, planar, t, optimize=True)
    return np.asarray(np.where(np.asarray(bending.any(axis=(1, 2)))[:, None, None], found, membrane))


def only_bends(membrane: Floats, bending: Floats) -> bool:
    """Whether the middle surface is next to free of stress, of arrays of stresses of any shape, Pa."""
    return float(np.abs(membrane).max()) < UNSTRESSED * float(np.abs(bending).max())


def _deviator(planar: Floats) -> Floats:
    """(m,) complex: half the difference of the normal stresses, and i times the shear stress."""
    return np.asarray((planar[:, 0, 0] - planar[:, 1, 1]) / 2 + 1j * planar[:, 0, 1])
