"""Diffusion tensors and the diffusion operator, from the stress of a sheet."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, lock, lock_floats
from dsfab.surface import Surface
from dsfab.surface.fields import assemble, hat_gradients, tangents


def layer_stress(surface: Surface, membrane: Floats, bending: Floats) -> Floats:
    """Return a stress that represents all layers of a sheet: (m, 3, 3), Pa, symmetric, tangent to the faces.
    membrane : (m, 3, 3) stress of the middle surface, Pa.
    bending  : (m, 3, 3) stress that bending adds at the side opposite to the normal, Pa."""
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
    stress = np.einsum("mai,mab,mbj->mij", t, planar, t, optimize=True)
    return np.asarray(np.where(np.asarray(bending.any(axis=(1, 2)))[:, None, None], stress, membrane))


def only_bends(membrane: Floats, bending: Floats) -> bool:
    """Return True if the stress (..., 3) of the middle surface is much smaller than the bending stress."""
    return float(np.abs(membrane).max()) < 1e-3 * float(np.abs(bending).max())


def _deviator(planar: Floats) -> Floats:
    return np.asarray((planar[:, 0, 0] - planar[:, 1, 1]) / 2 + 1j * planar[:, 0, 1])


Labelling = Literal["signed", "magnitude"]
ISOTROPY = 0.02  # Largest difference of an isotropic face's principal stresses, divided by their RMS.


@dataclass(frozen=True, eq=False)
class DiffusionTensors:
    """Two symmetric tensors for each face, which act on gradients in the face's plane.
    major     : (m, 3, 3) tensors of the major stripes.    minor : (m, 3, 3) tensors of the minor stripes.
    isotropic : (m,) mask of faces without a clear stress direction.
    principal : (m, 2) first and second principal stress, Pa, times the factor gamma of the preset."""

    major: Floats
    minor: Floats
    isotropic: Bools
    principal: Floats

    def __post_init__(self) -> None:
        lock_floats(self, major=(None, 3, 3), minor=(len(self.major), 3, 3))
        lock(self, "isotropic", np.bool_, (len(self.major),))
        lock(self, "principal", np.float64, (len(self.major), 2))


def diffusion_tensors(
    surface: Surface,
    sigma: Floats,
    r: float = 100.0,
    gamma: float = 1.0,
    labelling: Labelling = "signed",
    isotropy: float = ISOTROPY,
) -> DiffusionTensors:
    """Return tensors with the principal directions of the stress and eigenvalues r and 1 (Madan et al., section 3.3).
    sigma     : (m, 3, 3) stress, Pa, tangent to the faces.    gamma : factor on the stress.
    r         : anisotropy, >= 1; 1 gives the Laplacian.
    labelling : order of the principal stresses: the larger value first (`signed`), or the larger absolute value.
    isotropy  : relative difference of principal stresses below which a face counts as isotropic."""
    stress, direction = principal_stresses(surface, sigma)
    if labelling == "magnitude":
        swap = np.abs(stress[:, 1]) > np.abs(stress[:, 0])
        stress[swap] = stress[swap, ::-1]
        direction[swap] = direction[swap, ::-1]
    reference = float(np.sqrt((surface.areas @ (stress**2).sum(axis=1)) / (2 * surface.area)))
    isotropic = _is_isotropic(gamma * stress, labelling, isotropy, reference)
    weight = np.where(isotropic, 1.0, r)
    along = np.einsum("mai,maj->maij", direction, direction)  # (m, 2, 3, 3) projections on both directions
    tangent = along.sum(axis=1)
    excess = (weight - 1)[:, None, None]
    return DiffusionTensors(tangent + excess * along[:, 0], tangent + excess * along[:, 1], isotropic, gamma * stress)


def combined_stress(surface: Surface, stresses: Sequence[Floats], weights: Sequence[float]) -> Floats:
    """Combine the stresses of load cases to a single tensor (m, 3, 3), Pa, from absolute principal stresses.
    stresses : (m, 3, 3) of each case, Pa, tangent to the faces.    weights : weight of each case, at least 0."""
    total = np.zeros((surface.m, 3, 3))
    for sigma, weight in zip(stresses, weights, strict=True):
        stress, direction = principal_stresses(surface, sigma)
        total += np.einsum("ma,mai,maj->mij", weight * np.abs(stress), direction, direction)
    return total


def principal_stresses(surface: Surface, sigma: Floats) -> tuple[Floats, Floats]:
    """Return principal stresses (m, 2) of the faces, the larger first, and their directions (m, 2, 3) [Mohr 1882]."""
    t = tangents(surface)
    planar = np.einsum("mai,mij,mbj->mab", t, sigma, t, optimize=True)
    xx, yy, xy = planar[:, 0, 0], planar[:, 1, 1], planar[:, 0, 1]
    centre, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    angle = np.arctan2(2 * xy, xx - yy) / 2
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    direction = np.stack([cosine * t[:, 0] + sine * t[:, 1], cosine * t[:, 1] - sine * t[:, 0]], axis=1)
    return np.stack([centre + radius, centre - radius], axis=1), direction


def _is_isotropic(stress: Floats, labelling: Labelling, tolerance: float, reference: float) -> Bools:
    primary, secondary = stress.T
    if labelling == "signed":
        return np.asarray(primary - secondary <= tolerance * reference)
    eps = tolerance * reference
    return np.asarray(np.abs(primary) + eps <= (1 + tolerance) * (np.abs(secondary) + eps))


def diffusion_operator(surface: Surface, D: Floats) -> csr_array:
    """Return the weak form of -div(D grad), paper eq. 5, for linear elements [Andreux et al. 2014].
    D : (m, 3, 3) tensors, symmetric, positive definite in the plane of each face, dimensionless.
    Returns L : (n, n) symmetric positive semidefinite."""
    g, A = hat_gradients(surface), surface.areas  # (m, 3 corners, 3 xyz) per metre; (m,) square metres
    return assemble(surface, np.einsum("mia,mab,mjb,m->mij", g, D, g, A, optimize=True))
