"""Forces and moments inside a sheet, per length of section."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, lock_floats, unit_vectors
from dsfab.core.sparse import Factor, factorise
from dsfab.statics.bending import half_edge_frames, moment_loads
from dsfab.statics.elements import assemble_blocks, heights, tensor_matrices
from dsfab.statics.stress import SMOOTH, SheetStress, principal_values, vertex_averages
from dsfab.surface import Surface, hat_gradients, link_components, next_half_edge

CROWDED = 0.25
"""A face is a splinter if its smallest height is less than CROWDED times the mean size of faces.
Moment gradients are meaningless in splinters. So a splinter's load is spread over points near it.
These points are up to CROWDED times the mean size away; larger distances would lose shear force in ribs."""


@dataclass(frozen=True, eq=False)
class ShearRecovery:
    """Data of a surface for computing transverse shear forces q from moments. q is the gradient of a potential M.
    columns : indices of the N unknowns of M: (m, 6) at corners and edge midpoints, or (m, 3) at corners.
    sign    : as `columns`; -1 if the face's normal is opposite to that of the unknown's first face, else 1.
    rim     : (m, 3) 1 on each face's half-edges that transfer no shear force; else 0.
    spread  : (N, N) matrix that spreads the load of unknowns at very thin faces over nearby unknowns."""

    surface: Surface
    columns: Ints
    sign: Floats
    rim: Floats
    spread: csr_array
    factor: Factor

    @classmethod
    def for_surface(cls, surface: Surface, linear: bool = True) -> Self:
        """Return the data for a surface. linear : True if moments vary linearly on each face, False if constant."""
        side_a, side_b = surface.edges.pairs.T
        lean = np.abs(np.einsum("ix,ix->i", surface.normals[side_a // 3], surface.normals[side_b // 3]))
        side_a, side_b = side_a[lean > SMOOTH], side_b[lean > SMOOTH]
        rim = np.ones(3 * surface.m)
        rim[side_a], rim[side_b] = 0.0, 0.0
        columns, sign = _shared_unknowns(surface, side_a, side_b)
        nodes = 6 if linear else 3
        columns, sign = columns[:, :nodes], sign[:, :nodes]
        size = int(columns.max()) + 1
        ends = surface.V[surface.F]
        points = np.zeros((size, 3))
        points[columns] = np.concatenate([ends, (ends + np.roll(ends, -1, axis=1)) / 2], axis=1)[:, :nodes]
        blocks = _gradient_stiffness(surface, linear) * sign[:, :, None] * sign[:, None, :]
        K = assemble_blocks(blocks, columns, size)
        K = csr_array(K + diags_array(1e-9 * K.diagonal()))  # makes K positive definite
        spread = _spread_matrix(surface, columns, sign, points)
        return cls(surface, columns, sign, rim.reshape(-1, 3), spread, factorise(K, points))

    def forces(self, moments: Floats, twist: Floats) -> Floats:
        """Return the mean transverse shear force (m, 3) of each face, N/m, as a vector in the face's plane.
        moments : (m, 3 corners, 3) moments xx, yy, xy of the elements, in `SheetStress.frame`, N.
        twist   : (m, 3 corners, 3) the same moments, averaged at vertices, N."""
        nodes = self.columns.shape[1]
        work = np.einsum("mai,maij->mj", -moments, moment_loads(self.surface)[..., :6]) + self._at_rims(twist)
        if nodes == 6:  # changes the basis from bubbles to quadratic functions with value 1 at a node
            work[:, :3] -= (work[:, 3:] + np.roll(work[:, 3:], 1, axis=1)) / 2
        load = np.bincount(self.columns.ravel(), (self.sign * work[:, :nodes]).ravel(), self.spread.shape[0])
        M = self.sign * self.factor(self.spread @ load)[self.columns]
        slope = hat_gradients(self.surface)
        mean = np.concatenate([slope / 3, -4 / 3 * np.roll(slope, -2, axis=1)], axis=1) if nodes == 6 else slope
        return np.asarray(np.einsum("mc,mcx->mx", M, mean))

    def _at_rims(self, twist: Floats) -> Floats:
        _, t, out = half_edge_frames(self.surface)
        xx, yy, xy = out[..., 0] * t[..., 0], out[..., 1] * t[..., 1], (out * t[..., ::-1]).sum(axis=2)
        begin, end = (
            self.rim * (xx * m[..., 0] + yy * m[..., 1] + xy * m[..., 2]) for m in (twist, np.roll(twist, -1, axis=1))
        )
        mean = (begin + end) / 2
        return np.concatenate([np.roll(mean, 1, axis=1) - mean, 2 / 3 * (begin - end)], axis=1)


def _shared_unknowns(surface: Surface, side_a: Ints, side_b: Ints) -> tuple[Ints, Floats]:
    begins = surface.F.ravel()
    alike = begins[side_a] == begins[side_b]  # true if both faces list the edge in the same direction
    next_one, next_other = next_half_edge(side_a), next_half_edge(side_b)
    i = np.concatenate([side_a, next_one])
    j = np.concatenate([np.where(alike, side_b, next_other), np.where(alike, next_other, side_b)])
    count, corner = link_components(3 * surface.m, i, j)
    _, middle = link_components(3 * surface.m, side_a, side_b)
    columns = np.concatenate([corner.reshape(-1, 3), count + middle.reshape(-1, 3)], axis=1)
    first_face = np.empty(int(columns.max()) + 1, dtype=np.int64)
    face = np.repeat(np.arange(surface.m), 6)
    first_face[columns.ravel()[::-1]] = face[::-1]
    side = np.einsum("hx,hx->h", surface.normals[face], surface.normals[first_face[columns.ravel()]])
    return columns, np.where(side < 0, -1.0, 1.0).reshape(-1, 6)


def _gradient_stiffness(surface: Surface, linear: bool) -> Floats:
    slope = hat_gradients(surface)
    if not linear:
        return np.asarray(np.einsum("m,mix,mjx->mij", surface.areas, slope, slope))
    after = np.roll(slope, -1, axis=1)
    blocks = np.zeros((surface.m, 6, 6))
    for c in range(3):
        weights = np.full(3, 0.5)
        weights[(c + 2) % 3] = 0.0
        middle = 4 * (weights[:, None] * after + np.roll(weights, -1)[:, None] * slope)
        G = np.concatenate([(4 * weights - 1)[:, None] * slope, middle], axis=1)
        blocks += np.einsum("mix,mjx->mij", G, G)
    return np.asarray(blocks * (surface.areas / 3)[:, None, None])


def _spread_matrix(surface: Surface, columns: Ints, sign: Floats, points: Floats) -> csr_array:
    size, nodes = len(points), columns.shape[1]
    weight = np.array([1 / 12] * 3 + [1 / 4] * 3) if nodes == 6 else np.full(3, 1 / 3)
    area = np.bincount(columns.ravel(), (surface.areas[:, None] * weight).ravel(), size)
    reach = CROWDED * float(np.sqrt(surface.areas @ surface.areas / surface.areas.sum()))
    crowded = np.zeros(size, dtype=bool)
    crowded[columns[heights(surface) < reach]] = True
    normal = np.zeros((size, 3))
    np.add.at(normal, columns, sign[:, :, None] * (surface.normals * surface.areas[:, None])[:, None])
    normal = unit_vectors(normal)
    source = np.flatnonzero(crowded)
    neighbours = cKDTree(points[source]).sparse_distance_matrix(cKDTree(points), reach, output_type="coo_matrix")
    i, j = source[neighbours.coords[0]], neighbours.coords[1]
    side = np.where(i == j, 1.0, np.einsum("kx,kx->k", normal[i], normal[j]))
    part: Floats = np.where(np.abs(side) > SMOOTH, np.sign(side), 0.0) * area[j]
    share = part / np.bincount(i, np.abs(part), size)[i]
    still = np.flatnonzero(~crowded)
    rows, columns_of_entries = np.concatenate([j, still]), np.concatenate([i, still])
    return csr_array((np.concatenate([share, np.ones(len(still))]), (rows, columns_of_entries)), shape=(size, size))


CONVENTION = (
    "local x is global x (global y if the normal is within 8 degrees of global x), projected onto the face; "
    "local y is normal cross local x; the corners of the face run counter-clockwise around the normal",
    "positive n is tension. m_x bends fibres along local x; positive m is tension on the side opposite to the normal",
    "q_x = dm_x/dx + dm_xy/dy, q_y = dm_xy/dx + dm_y/dy (thin sheets, Kirchhoff); on a section whose outward "
    "direction is local x, positive q_x acts opposite to the normal",
    "a free edge also carries a line force as large as m_xy (Kirchhoff): include this force in the sum over a section",
)
"""Definitions of axes and signs of section forces; these texts become the first lines of files."""


class PrincipalForces(NamedTuple):
    """Principal values and directions of the membrane forces or of the moments of each face.
    values    : (m, 2) principal values, the algebraically larger first.
    angle     : (m,) degrees from local x to the first direction, towards local y, from -90 to 90.
    direction : (m, 3) unit vectors of the first direction."""

    values: Floats
    angle: Floats
    direction: Floats


@dataclass(frozen=True, eq=False)
class SectionForces:
    """Forces and moments per length of section on each face. `CONVENTION` defines the signs.
    frame : (m, 2, 3) unit vectors local x and local y of each face.
    n     : (m, 3) normal forces x and y, and in-plane shear force xy, N/m.
    m     : (m, 3) bending moments x and y, and twisting moment xy, N m/m.
    q     : (m, 2) transverse shear forces on sections normal to local x and to local y, N/m.
    corners : (m, 3, 3) the components n at the three corners of each face, N/m.
    corner_moments : (m, 3, 3) the components m at the three corners, N m/m."""

    frame: Floats
    n: Floats
    m: Floats
    q: Floats
    corners: Floats
    corner_moments: Floats

    def __post_init__(self) -> None:
        lock_floats(self, frame=(None, 2, 3))
        m = len(self.frame)
        lock_floats(self, n=(m, 3), m=(m, 3), q=(m, 2), corners=(m, 3, 3), corner_moments=(m, 3, 3))

    def principal(self, name: str) -> PrincipalForces:
        """Return principal values and directions of forces or moments. name : "n" or "m" [Mohr 1882]."""
        values, axes = principal_values(getattr(self, name), self.frame)
        angle = np.degrees(np.arctan2(*np.einsum("mx,max->am", axes[:, 0], self.frame)[::-1]))
        return PrincipalForces(values, angle, axes[:, 0])


def section_forces(
    surface: Surface, thickness: float, stress: SheetStress, recovery: ShearRecovery | None = None
) -> SectionForces:
    """Return the forces and moments per length in a sheet from its stress. thickness : metres.
    recovery : data of the surface for shear forces; None to compute these data."""
    stress_frame, scale = stress.frame, thickness**2 / 6
    moments = scale * vertex_averages(surface, stress_frame, stress.bending, sided=True)
    across = np.zeros((surface.m, 3))
    if stress.bending.any():
        recovery = recovery or ShearRecovery.for_surface(surface, linear=bool(np.ptp(stress.bending, axis=1).any()))
        across = recovery.forces(scale * stress.bending, moments)
    frame = local_frames(surface)
    turn = frame @ stress_frame.transpose(0, 2, 1)
    n = _rotated_tensors(thickness * stress.membrane.mean(axis=1), turn)
    corners, face_moments = (
        np.stack([_rotated_tensors(values[:, k], turn) for k in range(3)], axis=1)
        for values in (thickness * stress.membrane, moments)
    )
    q = np.einsum("mx,max->ma", across, frame)
    return SectionForces(frame, n, face_moments.mean(axis=1), q, corners, face_moments)


def local_frames(surface: Surface) -> Floats:
    """Return two perpendicular unit vectors (m, 2, 3) in each face: local x and local y."""
    normal = surface.normals
    # local x follows global y if the normal is within 8 degrees of global x
    axis = np.where((np.abs(normal[:, 0]) > 0.99)[:, None], np.eye(3)[1], np.eye(3)[0])
    x = axis - np.einsum("mi,mi->m", axis, normal)[:, None] * normal
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(normal, x)], axis=1)


def _rotated_tensors(plane: Floats, rotation: Floats) -> Floats:
    full = rotation @ tensor_matrices(plane) @ rotation.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)
