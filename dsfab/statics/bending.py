"""Bending stiffness by name: the paper's hinge energy (discrete Willmore energy) here, `midedge` and `hhj` beside."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.statics.blocks import CORNERS, PairBlocks, summed_blocks, upwards, vertex_pairs
from dsfab.statics.elements import PAPER, Elements, padded
from dsfab.statics.hhj import hhj_stiffness
from dsfab.statics.hinges import angle_gradients, hinges
from dsfab.statics.material import Material
from dsfab.statics.midedge import midedge_stiffness
from dsfab.surface.mesh import Surface


def bending_stiffness(surface: Surface, material: Material, thickness: float, elements: Elements = PAPER) -> csr_array:
    """K_b, N/m, symmetric positive semidefinite, over the unknowns of `elements` ((3 n, 3 n) by default).

    Raises ValueError for elements without bending.
    """
    if elements.bending == "hinge":
        return padded(hinge_blocks(surface, material, thickness).matrix(), elements.unknowns(surface))
    if elements.bending == "midedge":
        return midedge_stiffness(surface, material.bending(thickness), elements)
    if elements.bending == "hhj":
        return hhj_stiffness(surface, material.bending(thickness), elements)
    raise ValueError(f"{elements} has no bending")


def hinge_blocks(surface: Surface, material: Material, thickness: float) -> PairBlocks:
    """K_b of the energy 1/2 sum_e D l_e^2 / (A1 + A2) (theta_e - theta_e0)^2, N/m [Wardetzky et al. 2007].

    At rest its Hessian is w g g^T with g = grad theta, hence positive semidefinite on curved sheets too. It gives good
    *directions* but does not converge to Kirchhoff's plate on general meshes: at 80 x 80 cells the centre of a clamped
    plate moves by 0.56 (one diagonal) to 1.21 (crossed) of the true value.
    """
    hinge = hinges(surface)
    gradients, weight = angle_gradients(surface, hinge)
    g = np.ascontiguousarray((gradients * np.sqrt(material.bending_stiffness(thickness) * weight)[:, None, None]).T)
    pairs = vertex_pairs(surface, hinge)
    first, second = ([pair[k] for pair in CORNERS] for k in (0, 1))
    ascending = (hinge[:, first] < hinge[:, second]).T
    u, v = (x.reshape(3, -1) for x in upwards(g[:, first], g[:, second], ascending))
    return PairBlocks.of(pairs, summed_blocks(u, v, pairs.of_hinge(surface, hinge).ravel(), len(pairs.ends)))
