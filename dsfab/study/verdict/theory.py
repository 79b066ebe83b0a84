"""What the theory of thin sheets leaves out of a compliance: ribs that twist, and shear through the thickness."""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics import Equilibrium, SheetMaterial, SheetStress
from dsfab.surface import Surface


class BendingShares(NamedTuple):
    """Shares of the strain energy.

    bending  : of all moments.
    twisting : of bending, what is there because the two principal moments have opposite signs, as in a rib that is
               twisted: 12 / (E h^3) (1 + nu) (-m1 m2) on each square metre.
    """

    bending: float
    twisting: float


def bending_shares(surface: Surface, made: SheetMaterial, found: SheetStress, answer: Equilibrium) -> BendingShares:
    """Those of a solved sheet; 0 where nothing bends. It is independent of the local axes of each face."""
    if answer.compliance <= 0:
        return BendingShares(0.0, 0.0)
    # at the middles of the edges, whose mean is the integral of what is quadratic on a face
    middle = (found.bending + np.roll(found.bending, -1, axis=1)) / 2
    xx, yy, xy = np.moveaxis(middle * made.thickness**2 / 6, -1, 0)  # (m, edges) moments, N
    nu, soft = made.material.poisson, 12 / (made.material.young * made.thickness**3)
    product = xx * yy - xy**2
    bending: Floats = soft / 2 * ((xx + yy) ** 2 - 2 * (1 + nu) * product)
    twisting: Floats = soft * (1 + nu) * np.maximum(-product, 0.0)
    twice = [2 * float(surface.areas @ energy.mean(axis=1)) for energy in (bending, twisting)]
    return BendingShares(twice[0] / answer.compliance, twice[1] / answer.compliance)


OF_BENDING = 1 / 3
"""Of bending that is no twist, what counts as much as twist."""

NARROW = 1.35
"""Of thickness over width, times the share of twisting and `OF_BENDING` of that of bending: what random designs need
that were solved as solids of quadratic wedges by CalculiX (`solids.csv`), and a tenth more. They are softer than thin
sheets without an exception. Twist explains a third to a half of it: a rib that is twisted is softer by .63 of thickness
over width [Saint-Venant 1855]; the rest is shear through the thickness, and nodes."""

WORTH = 0.001
"""Less is not told."""


def theory_share(bent: BendingShares, ratio: float) -> float:
    """By what share of a thin sheet's compliance that of a solid may be larger.

    ratio : width of the ribs over the thickness; inf for a closed sheet without openings.
    """
    return NARROW * (bent.twisting + OF_BENDING * bent.bending) / ratio
