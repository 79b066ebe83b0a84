"""Stress at the corners of faces, where the quadratic field has its extremes."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics import Equilibrium, Material, membrane_strains, membrane_stresses
from dsfab.surface import Surface
from dsfab.surface.hats import tangents


def corner_stress(surface: Surface, material: Material, answer: Equilibrium) -> Floats:
    """(m, 3 corners, 3, 3) membrane stress in plane stress, Pa, tangent to each face: linear on each face as
    `quadratic` and `hybrid` membranes have it. With constant strain all three corners have the face's one."""
    strain = membrane_strains(surface, answer)
    stress = membrane_stresses(surface, material, "plane_stress", answer.elements, strain)
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    planar = np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-1)
    t = tangents(surface)
    return np.asarray(np.einsum("mai,mcab,mbj->mcij", t, planar, t))


def vertex_stress(surface: Surface, material: Material, answer: Equilibrium, vertex: int) -> Floats:
    """(3, 3) mean of the corner stresses that meet at a vertex, Pa."""
    return np.asarray(corner_stress(surface, material, answer)[vertex == surface.F].mean(axis=0))
