"""Stress of a solved sheet."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats, lock, lock_floats
from dsfab.core.errors import StaticsError
from dsfab.statics.bending_moments import face_moments, hinge_energy
from dsfab.statics.elements import Elements, edge_frames, tensor_matrices, voigt
from dsfab.statics.membrane import hybrid_stress, mean_strain
from dsfab.statics.model import Law, Material, SheetModel
from dsfab.statics.solve import Equilibrium
from dsfab.surface.fields import hat_gradients, tangents
from dsfab.surface.mesh import Surface


def stress(
    surface: Surface, material: Material, u: Floats, law: Law = "plane_stress", bubbles: Floats | None = None
) -> Floats:
    """Return the mean membrane stress (m, 3, 3) of each face, Pa, tangent to the face.
    u : (n, 3) displacements of vertices, m.    bubbles : (e, 2) further displacements of edge midpoints, m."""
    return tensors_in_space(surface, mean_strain(surface, u, bubbles) @ material.membrane(law).T)


def tensors_in_space(surface: Surface, planar: Floats) -> Floats:
    """Return tensors as matrices (m, 3, 3) in global coordinates. planar : (m, 3) xx, yy, xy in each face's frame."""
    t = tangents(surface)
    return np.asarray(t.transpose(0, 2, 1) @ tensor_matrices(planar) @ t)


def von_mises(sigma: Floats) -> Floats:
    """Return the von Mises stress (m,), Pa, of stress tensors (m, 3, 3), Pa [von Mises 1913]."""
    deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    return np.asarray(np.sqrt(1.5 * np.einsum("mij,mij->m", deviator, deviator)))


def membrane_strains(surface: Surface, answer: Equilibrium) -> Floats:
    """Return the in-plane strains (xx, yy, 2 xy) at the corners of faces, (m, 3 corners, 3), in each face's frame."""
    t = tangents(surface)
    slope = np.einsum("mik,mak->mia", hat_gradients(surface), t)
    corner = answer.u[surface.F] @ t.transpose(0, 2, 1)  # (m, corner, 2): displacements in the face's frame
    strain = np.repeat(voigt(slope, corner).sum(axis=1)[:, None], 3, axis=1)
    if answer.bubbles is None:
        return strain
    moved = np.einsum("ed,edx->ex", answer.bubbles, edge_frames(surface)[:, :2])[surface.edges.of]
    bubble = moved @ t.transpose(0, 2, 1)
    # grad (4 phi_c phi_c+1) is 4 grad phi_c+1 at corner c, 4 grad phi_c at corner c + 1
    start_strain = voigt(4 * np.roll(slope, -1, axis=1), bubble)
    end_strain = voigt(4 * slope, bubble)
    return np.asarray(strain + start_strain + np.roll(end_strain, 1, axis=1))


def membrane_stresses(surface: Surface, material: Material, law: Law, elements: Elements, strain: Floats) -> Floats:
    """Return the stress (xx, yy, xy), Pa, at the corners of faces, (m, 3 corners, 3), from `membrane_strains`."""
    C = material.membrane(law)
    return hybrid_stress(surface, C, strain) if elements.membrane == "hybrid" else np.asarray(strain @ C)


SMOOTH = np.cos(np.radians(30))
"""Cosine of 30 degrees. If the normals of a face and of its neighbours differ by more, a fold separates them."""

WEIGHTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # Number of times that xx, yy, zz, yz, xz, xy occur in a tensor.
HALVES = np.array([1.0, 1.0, 2.0])[:, None]  # Squared norms of unit plane tensors xx, yy and xy.


def vertex_averages(surface: Surface, frame: Floats, values: Floats, sided: bool) -> Floats:
    """Average tensors (xx, yy, xy), (m, 3 corners, 3), over the faces around each vertex [Hinton and Campbell 1974].
    frame  : (m, 2, 3) axes x and y of each face.    values : (m, 3 corners, 3) tensors before averaging.
    sided  : True if the values change sign when the face's normal is reversed, as bending stresses do."""
    corner = surface.F.ravel()
    face = np.repeat(np.arange(surface.m), 3)
    first_face = np.full(surface.n, -1)
    first_face[corner[::-1]] = face[::-1]
    side = np.where(np.einsum("cx,cx->c", surface.normals[face], surface.normals[first_face[corner]]) < 0, -1.0, 1.0)
    around = csr_array((np.ones(len(corner)), corner, np.arange(len(corner) + 1)), (len(corner), surface.n)).T
    area = surface.areas[face]
    mean = np.asarray(around @ (surface.normals[face] * (side * area)[:, None]))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    is_smooth = np.abs(np.einsum("cx,cx->c", surface.normals[face], mean[corner])) > SMOOTH
    signed = side if sided else np.ones_like(side)
    basis = _tensors(frame)
    tensors = (values @ basis).reshape(-1, 6) * (signed * is_smooth * area)[:, None]
    total = (around @ tensors) / np.maximum(around @ (is_smooth * area), 1e-300)[:, None]
    plane_basis = (basis * WEIGHTS / HALVES).transpose(0, 2, 1)
    plane = (total[corner] * signed[:, None]).reshape(-1, 3, 6) @ plane_basis
    return np.asarray(np.where(is_smooth.reshape(-1, 3, 1), plane, values.mean(axis=1, keepdims=True)))


def _tensors(frame: Floats) -> Floats:
    a, b = frame[:, 0], frame[:, 1]
    c, d = a[:, [1, 2, 0]], a[:, [2, 0, 1]]
    e, f = b[:, [1, 2, 0]], b[:, [2, 0, 1]]
    xx, yy = np.concatenate([a * a, c * d], axis=1), np.concatenate([b * b, e * f], axis=1)
    return np.stack([xx, yy, np.concatenate([2 * a * b, c * f + d * e], axis=1)], axis=1)


Layer = Literal["top", "middle", "bottom"]
"""Layers of a sheet. `top` is the outer surface in the direction of the faces' normals, `bottom` the opposite one."""

LAYERS: tuple[Layer, ...] = get_args(Layer)
_SIDE = {"top": -1.0, "middle": 0.0, "bottom": 1.0}


class Principal(NamedTuple):
    """Principal stresses `values` (m, 2), Pa, the larger first, and their unit vectors `directions` (m, 2, 3)."""

    values: Floats
    directions: Floats


class Peak(NamedTuple):
    """The largest von Mises stress (Pa), with the index `face` and the `layer` where it occurs."""

    stress: float
    face: int
    layer: Layer


@dataclass(frozen=True, eq=False)
class SheetStress:
    """Stress in a thin sheet.
    frame           : (m, 2, 3) unit vectors x and y in each face's plane; stress components refer to them.
    membrane        : (m, 3 corners, 3) stress (xx, yy, xy) of the middle surface, Pa.
    bending         : (m, 3 corners, 3) bending stress 6 M / h^2 at the bottom, Pa; the top has the opposite sign.
    smooth_membrane, smooth_bending : stresses averaged around vertices, if they vary linearly on each face.
    membrane_energy, bending_energy : (m,) mean strain energy per area of each face, J/m2."""

    frame: Floats
    membrane: Floats
    bending: Floats
    smooth_membrane: Floats
    smooth_bending: Floats
    membrane_energy: Floats
    bending_energy: Floats

    def __post_init__(self) -> None:
        lock_floats(self, frame=(None, 2, 3))
        m = len(self.frame)
        for name in ("membrane", "bending"):
            values, smooth = getattr(self, name), f"smooth_{name}"
            lock(self, name, np.float64, (m, 3, 3))
            if getattr(self, smooth) is values:  # the same array is stored once
                object.__setattr__(self, smooth, getattr(self, name))
            else:
                lock(self, smooth, np.float64, (m, 3, 3))
        lock_floats(self, membrane_energy=(m,), bending_energy=(m,))

    def at_corners(self, layer: Layer) -> Floats:
        """Return the stress (xx, yy, xy) at the corners of faces, (m, 3 corners, 3), Pa, averaged around vertices."""
        return np.asarray(self.smooth_membrane + _SIDE[layer] * self.smooth_bending)

    def _mean(self, layer: Layer) -> Floats:
        return np.asarray((self.membrane + _SIDE[layer] * self.bending).mean(axis=1))

    def tensor(self, layer: Layer) -> Floats:
        """Return the mean stress (m, 3, 3) of each face, Pa, tangent to the face."""
        return np.asarray(self.frame.transpose(0, 2, 1) @ tensor_matrices(self._mean(layer)) @ self.frame)

    def principal(self, layer: Layer) -> Principal:
        """Return principal values and directions of the mean stress of each face in `layer` [Mohr 1882]."""
        return principal_values(self._mean(layer), self.frame)

    @cached_property
    def von_mises(self) -> Floats:
        """Von Mises stress (m, 3 layers) of each face, Pa, at the corner where it is largest."""
        return np.stack([plane_von_mises(self.at_corners(layer)).max(axis=1) for layer in LAYERS], axis=1)

    @cached_property
    def largest(self) -> Floats:
        """Largest von Mises stress (m,) of each face, Pa, in any layer."""
        return np.asarray(self.von_mises.max(axis=1))

    @property
    def energy(self) -> Floats:
        """Strain energy per area (m,), J/m2."""
        return self.membrane_energy + self.bending_energy

    @cached_property
    def peak(self) -> Peak:
        """Largest von Mises stress (Pa) of the sheet, with its face and layer."""
        face = int(self.largest.argmax())
        row = self.von_mises[face]
        layer = LAYERS[int(row.argmax())] if row.max() > row[LAYERS.index("middle")] else "middle"
        return Peak(float(self.largest[face]), face, layer)

    def utilisation(self, strength: float) -> Floats:
        """Return the largest von Mises stress of each face (m,), divided by the strength (Pa).
        Raises StaticsError for a strength that is not positive."""
        if not (strength > 0 and np.isfinite(strength)):
            raise StaticsError(f"strength = {strength} Pa must be positive (steel 235e6, plywood about 30e6)")
        return np.asarray(self.largest / strength)


def principal_values(plane: Floats, frame: Floats) -> Principal:
    """Return principal values and directions of tensors (xx, yy, xy), (m, 3), in frames (m, 2, 3) [Mohr 1882]."""
    xx, yy, xy = plane.T
    centre, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    turn = np.arctan2(xy, (xx - yy) / 2) / 2
    c, s = np.cos(turn), np.sin(turn)
    axes = np.stack([np.stack([c, s], axis=1), np.stack([-s, c], axis=1)], axis=1)
    return Principal(np.stack([centre + radius, centre - radius], axis=1), axes @ frame)


def plane_von_mises(stress: Floats) -> Floats:
    """Return the von Mises stress (...), Pa, of plane stresses (..., 3), given as (xx, yy, xy) [von Mises 1913]."""
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    return np.asarray(np.sqrt(xx * xx - xx * yy + yy * yy + 3 * xy * xy))


def sheet_stress(sheet: SheetModel, elements: Elements, answer: Equilibrium) -> SheetStress:
    """Return the stress and the strain energy of a sheet. answer : solution for the sheet, computed with `elements`."""
    surface, material, thickness, law = sheet.surface, sheet.material, sheet.thickness, sheet.law
    strain = membrane_strains(surface, answer)
    membrane = membrane_stresses(surface, material, law, elements, strain)
    moments = face_moments(sheet, elements, answer)
    stretched = 0.5 * thickness * _mean_product(membrane, strain)
    if elements.bending == "hinge":
        bent = hinge_energy(surface, material, thickness, answer) / surface.areas
    else:
        bent = 0.5 * _mean_product(moments, moments @ np.linalg.inv(sheet.bending))
    frame, bending = tangents(surface), 6 / thickness**2 * moments
    linear, curved = elements.membrane != "constant", elements.bending == "hhj"
    smooth_membrane = vertex_averages(surface, frame, membrane, sided=False) if linear else membrane
    smooth_bending = vertex_averages(surface, frame, bending, sided=True) if curved else bending
    return SheetStress(frame, membrane, bending, smooth_membrane, smooth_bending, stretched, bent)


def _mean_product(a: Floats, b: Floats) -> Floats:
    return np.asarray((np.einsum("mci,mci->m", a, b) + np.einsum("mi,mi->m", a.sum(axis=1), b.sum(axis=1))) / 12)
