"""Membrane strain and stress at the corners of each face, where linear fields have their extremes."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.statics.elements import Elements, edge_frames, voigt
from dsfab.statics.hybrid import hybrid_stress
from dsfab.statics.material import Law, Material
from dsfab.statics.solve import Equilibrium
from dsfab.surface.hats import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def membrane_strains(surface: Surface, answer: Equilibrium) -> Floats:
    """(m, 3 corners, 3) in-plane strains (xx, yy, 2 xy) of the middle surface in each face's frame.

    With edge bubbles they are those of the quadratic triangle, which `hybrid` elements do the same work on.
    """
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)
    corner = answer.u[surface.F] @ t.transpose(0, 2, 1)  # (m, corner, 2): displacements in the frame
    strain = np.repeat(voigt(slope, corner).sum(axis=1)[:, None], 3, axis=1)
    if answer.bubbles is None:
        return strain
    moved = np.einsum("ed,edx->ex", answer.bubbles, edge_frames(surface)[:, :2])[surface.edges.of]
    bubble = moved @ t.transpose(0, 2, 1)
    # 4 phi_c phi_c+1 has the gradient 4 grad phi_c+1 at corner c, 4 grad phi_c at corner c + 1, none at the third
    here = voigt(4 * np.roll(slope, -1, axis=1), bubble)
    there = voigt(4 * slope, bubble)
    return np.asarray(strain + here + np.roll(there, 1, axis=1))


def membrane_stresses(surface: Surface, material: Material, law: Law, elements: Elements, strain: Floats) -> Floats:
    """(m, 3 corners, 3) stress (xx, yy, xy), Pa, linear on each face, from `membrane_strains`."""
    C = material.membrane(law)
    return hybrid_stress(surface, C, strain) if elements.membrane == "hybrid" else np.asarray(strain @ C)
