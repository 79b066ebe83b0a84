"""Bending moments on each face, for the bending elements `hinge`, `midedge` and `hhj`.

A positive moment compresses the side to which the normals point."""

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.statics.assembly import angle_gradients, hinges
from dsfab.statics.bending import GAUSS, half_edge_frames
from dsfab.statics.elements import INVERSE_MASS, Elements, edge_frames, half_edge_signs, voigt
from dsfab.statics.model import Material, SheetModel
from dsfab.statics.solve import Equilibrium
from dsfab.surface.fields import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def facet_number(surface: Surface, thickness: float) -> float:
    """Return the median, over inner edges, of edge length x fold angle / sheet thickness.
    The error of stresses due to flat faces grows with this number."""
    faces = surface.edges.pairs // 3
    if not len(faces):
        return 0.0
    n0, n1 = surface.normals[faces[:, 0]], surface.normals[faces[:, 1]]
    fold = np.arctan2(np.linalg.norm(np.cross(n0, n1), axis=1), np.abs(np.einsum("ei,ei->e", n0, n1)))
    return float(np.median(fold * surface.edge_lengths[surface.edges.count == 2]) / thickness)


def face_moments(sheet: SheetModel, elements: Elements, answer: Equilibrium) -> Floats:
    """Return moments per length (xx, yy, xy), N, at face corners, in tangent frames of the faces: (m, 3 corners, 3).
    `hinge` moments are for pictures only. A sheet that was solved in its plane has no moments."""
    surface = sheet.surface
    if elements.bending is None:
        return np.zeros((surface.m, 3, 3))
    if elements.bending == "hhj":
        return _linear_moments(surface, sheet.bending, answer)
    if elements.bending == "midedge":
        moments = _midedge_curvature(surface, answer)[:, None] @ sheet.bending
    else:
        moments = _hinge_curvature(surface, answer)[:, None] @ sheet.material.bending(sheet.thickness)
    return np.repeat(moments, 3, axis=1)


def hinge_energy(surface: Surface, material: Material, thickness: float, answer: Equilibrium) -> Floats:
    """Return the bending energy (m,) of each face, J, from the hinges at its edges."""
    hinge = hinges(surface)
    gradients, weight = angle_gradients(surface, hinge)
    turned = np.einsum("ikx,ikx->i", gradients, answer.u[hinge])
    energy = 0.5 * material.bending_stiffness(thickness) * weight * turned**2
    faces = surface.edges.pairs // 3
    return np.asarray(np.bincount(faces.ravel(), np.repeat(energy / 2, 2), minlength=surface.m))


def _deflection(surface: Surface, answer: Equilibrium) -> Floats:
    return np.asarray(np.einsum("mcx,mx->mc", answer.u[surface.F], surface.normals))


def _midedge_curvature(surface: Surface, answer: Equilibrium) -> Floats:
    length, t, out = half_edge_frames(surface)
    w, rotation = _deflection(surface, answer), answer.on_edges["rotation"][surface.edges.of]
    step = (np.roll(w, -1, axis=1) - w)[:, :, None] * voigt(t, out)
    turn = (half_edge_signs(surface) * length * rotation)[:, :, None] * voigt(out, out)
    return np.asarray((step - turn).sum(axis=1) / surface.areas[:, None])


def _hinge_curvature(surface: Surface, answer: Equilibrium) -> Floats:
    """Return the curvature (m, 3), (xx, yy, 2 xy) [Grinspun et al. 2006]."""
    length, _, out = half_edge_frames(surface)
    hinge, pairs = hinges(surface), surface.edges.pairs
    angle = np.einsum("ikx,ikx->i", angle_gradients(surface, hinge)[0], answer.u[hinge])
    half = np.zeros(3 * surface.m)
    half[pairs[:, 0]] = angle / 2
    # the fold angle changes its sign in the second face if the two faces have opposite normals
    along = half_edge_signs(surface).ravel()
    half[pairs[:, 1]] = -angle / 2 * along[pairs[:, 0]] * along[pairs[:, 1]]
    bent = (half.reshape(-1, 3) * length)[:, :, None] * voigt(out, out)
    return np.asarray(bent.sum(axis=1) / surface.areas[:, None])


def _linear_moments(surface: Surface, D: Floats, answer: Equilibrium) -> Floats:
    edge, unknowns = surface.edges.of, answer.on_edges
    length, _, outward = half_edge_frames(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), tangents(surface))
    after = np.roll(slope, -1, axis=1)
    w = _deflection(surface, answer)
    bubble = unknowns["normal"][edge] * np.einsum("mcx,mx->mc", edge_frames(surface)[edge, 2], surface.normals)
    tilt = np.einsum("mi,mia,mca->mc", w, slope, outward)  # slope of the linear deflection, normal to each half-edge
    turn = half_edge_signs(surface) * unknowns["rotation"][edge]
    ahead, behind = (np.einsum("mia,mca->mci", g, outward) for g in (after, slope))  # (m, half-edge, bubble)
    bent = (8 / 3 * surface.areas[:, None, None] * voigt(slope, after) * bubble[:, :, None]).sum(axis=1)
    work = np.repeat(bent[:, None], 3, axis=1)
    for x in GAUSS:
        for c in range(3):
            weights = np.zeros(3)
            weights[c], weights[(c + 1) % 3] = 1 - x, x
            curl = 4 * (weights * ahead[:, c] + np.roll(weights, -1) * behind[:, c])
            gap = tilt[:, c] + (curl * bubble).sum(axis=1) + turn[:, c] + (2 * x - 1) * unknowns["slope"][edge[:, c]]
            jump = (gap * length[:, c] / 2)[:, None] * voigt(outward[:, c], outward[:, c])
            work -= weights[:, None] * jump[:, None, :]
    return np.asarray(np.einsum("ab,mbi->mai", INVERSE_MASS, work @ D) / surface.areas[:, None, None])
