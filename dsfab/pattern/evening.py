"""`evened`: stripes wider where their material works more than elsewhere, narrower where it works less.

Of all sheets with the same area the stiffest has the same energy density along every edge that may move: a part of the
edge with more would gain more than one with less would lose. Stripes of which each part works alike come near to that
[Prager, Taylor 1968, for one load]; the steps towards it are the resizing of fully stressed design [Gallagher 1973].
"""

import numpy as np

from dsfab.arrays import Floats
from dsfab.pattern.width import spread_means
from dsfab.surface.mesh import Surface

REACH = 0.4
"""Energies are averaged over this share of the distance of stripes: of one stripe, not of its neighbours."""

RATE = 0.5
"""Widths grow with this power of the energy density. In a member that carries a given force it falls with the square
of the width, so that 1/2 hits at once; forces that go another way then are what takes several steps."""

MOST = 2.0
"""A step widens at most so many times."""

EMPTY = 1e-9
"""Where material is a smaller share of the surface than this, there is nothing to judge by."""


def evened(surface: Surface, grading: Floats, work: Floats, material: Floats, spacing: float) -> Floats:
    """(n, k) relative half-widths for the next step, from those of k families, (n, k), that were cut and solved.

    work     : (m, k) energy, joules, in what each family has of each face.    material : (m, k) its area, m2.
    spacing  : metres from stripe to stripe.

    Widths stay as they are where there is no material. The geometric mean of the densities stays, so that a sheet which
    is evenly stressed is not changed.
    """
    both = np.concatenate([work, material], axis=1) / surface.areas[:, None]
    near, share = np.split(spread_means(surface, both, REACH * spacing), 2, axis=1)
    known = (share > EMPTY) & (near > 0)
    if not known.any():
        return grading
    density = near[known] / share[known]
    grown = np.ones_like(grading)
    grown[known] = np.clip((density / np.exp(np.log(density).mean())) ** RATE, 1 / MOST, MOST)
    return np.asarray(grading * grown)
