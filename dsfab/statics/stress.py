"""Stress on each face from the displacements of its corners."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics.material import Law, Material
from dsfab.statics.membrane import strain_operator
from dsfab.surface.hats import tangents
from dsfab.surface.mesh import Surface


def stress(surface: Surface, material: Material, u: Floats, law: Law = "plane_stress") -> Floats:
    """Membrane (Cauchy) stress (m, 3, 3), Pa, symmetric and tangent to each face, of displacements u (n, 3), metres."""
    strain = (strain_operator(surface) @ u.ravel()).reshape(-1, 3)
    xx, yy, xy = (strain @ material.membrane(law).T).T
    planar = np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1)
    t = tangents(surface)
    return np.asarray(np.einsum("mai,mab,mbj->mij", t, planar, t))


def von_mises(sigma: Floats) -> Floats:
    """(m,) von Mises equivalent stress, Pa, of stress tensors (m, 3, 3) [von Mises 1913]."""
    deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    return np.asarray(np.sqrt(1.5 * np.einsum("mij,mij->m", deviator, deviator)))
