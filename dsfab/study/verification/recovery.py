"""Stress at the corners of faces, where the quadratic field has its extremes."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics import Equilibrium, Material
from dsfab.statics.membrane import bubble_strains, corner_strains
from dsfab.surface import Surface
from dsfab.surface.hats import tangents


def corner_stress(surface: Surface, material: Material, answer: Equilibrium) -> Floats:
    """(m, 3 corners, 3, 3) membrane stress in plane stress, Pa, tangent to each face.

    `quadratic` membranes strain linearly on a face: the strain of the corners' displacements plus that of the edges'
    bubbles at the corner. With constant strain all three corners have the face's one.
    """
    strain = np.einsum("mac,mc->ma", corner_strains(surface), answer.u[surface.F].reshape(-1, 9))[:, None]
    strain = np.repeat(strain, 3, axis=1)
    if answer.bubbles is not None:
        moves = np.concatenate([answer.bubbles[surface.edges.of, 0], answer.bubbles[surface.edges.of, 1]], axis=1)
        for corner, at in enumerate(np.eye(3)):
            strain[:, corner] += np.einsum("mai,mi->ma", bubble_strains(surface, at), moves)
    xx, yy, xy = np.moveaxis(strain @ material.membrane("plane_stress").T, -1, 0)
    planar = np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-1)
    t = tangents(surface)
    return np.asarray(np.einsum("mai,mcab,mbj->mcij", t, planar, t))


def vertex_stress(surface: Surface, material: Material, answer: Equilibrium, vertex: int) -> Floats:
    """(3, 3) mean of the corner stresses that meet at a vertex, Pa."""
    return np.asarray(corner_stress(surface, material, answer)[vertex == surface.F].mean(axis=0))
