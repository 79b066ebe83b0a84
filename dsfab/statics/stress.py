"""Stress on each face from the displacements of its corners and edges."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics.material import Law, Material
from dsfab.statics.membrane import mean_strain
from dsfab.surface.hats import tangents
from dsfab.surface.mesh import Surface


def stress(
    surface: Surface, material: Material, u: Floats, law: Law = "plane_stress", bubbles: Floats | None = None
) -> Floats:
    """Membrane (Cauchy) stress (m, 3, 3), Pa, symmetric and tangent to each face, of displacements u (n, 3), metres.

    bubbles : (e, 2) metres, `Equilibrium.bubbles`: with them it is the mean on each face of the linear stress of
              `quadratic` elements; None for constant strain.
    """
    strain = mean_strain(surface, u, bubbles)
    return tensors_in_space(surface, strain @ material.membrane(law).T)


def tensors_in_space(surface: Surface, planar: Floats) -> Floats:
    """(m, 3, 3) symmetric tensors of values xx, yy, xy (m, 3) in the frame of each face (`tangents`)."""
    xx, yy, xy = planar.T
    in_frame = np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1)
    t = tangents(surface)
    return np.asarray(t.transpose(0, 2, 1) @ in_frame @ t)


def von_mises(sigma: Floats) -> Floats:
    """(m,) von Mises equivalent stress, Pa, of stress tensors (m, 3, 3) [von Mises 1913]."""
    deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    return np.asarray(np.sqrt(1.5 * np.einsum("mij,mij->m", deviator, deviator)))
