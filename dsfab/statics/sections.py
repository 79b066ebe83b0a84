"""`SectionForces`: what engineers dimension a sheet by, normal forces n, moments m and shear forces q per length."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, lock
from dsfab.statics.layers import SheetStress, principal_values
from dsfab.statics.recovery import SMOOTH, averaged
from dsfab.surface import Surface, hat_gradients

UPRIGHT = 0.99
"""A face's normal is along global x from this cosine on (8 degrees): then its local x follows global y."""

CONVENTION = (
    "local x: global x seen along the face's normal (global y where the normal is within 8 degrees of global x); "
    "local y: normal cross local x; the normal is that of the face's corners, counter-clockwise",
    "n positive: tension. m_x bends fibres along local x; m positive: the side that the normal points away from is "
    "stretched",
    "q_x = dm_x/dx + dm_xy/dy, q_y = dm_xy/dx + dm_y/dy (thin sheets, Kirchhoff); on a section that local x points out "
    "of, positive q_x acts against the normal",
    "a free edge carries a line force as large as m_xy there besides (Kirchhoff): a sum over a section needs both",
)
"""What the numbers mean, for the head of files."""


class PrincipalForces(NamedTuple):
    """values : (m, 2), the algebraically larger first.    angle : (m,) degrees from local x to the first, towards
    local y, from -90 to 90.    direction : (m, 3) unit vectors of the first; the second is the normal cross it."""

    values: Floats
    angle: Floats
    direction: Floats


@dataclass(frozen=True, eq=False)
class SectionForces:
    """Forces and moments per length of section, one value per face, in the frame and with the signs of `CONVENTION`.

    frame : (m, 2, 3) local x and local y of each face.
    n     : (m, 3) normal forces x, y and shear in the sheet xy, N/m.
    m     : (m, 3) moments x, y and twist xy, N m/m.
    q     : (m, 2) shear forces across the sheet, on sections across local x and local y, N/m.
    corners : (m, 3, 3) n at the corners of each face, as its elements have it: it bends ribs in the sheet.
    """

    frame: Floats
    n: Floats
    m: Floats
    q: Floats
    corners: Floats

    def __post_init__(self) -> None:
        lock(self, "frame", np.float64, (None, 2, 3))
        lock(self, "corners", np.float64, (len(self.frame), 3, 3))
        for name, width in (("n", 3), ("m", 3), ("q", 2)):
            lock(self, name, np.float64, (len(self.frame), width))

    def principal(self, what: str) -> PrincipalForces:
        """Principal values and directions of `n` or of `m` [Mohr 1882]."""
        values, axes = principal_values(getattr(self, what), self.frame)
        angle = np.degrees(np.arctan2(*np.einsum("mx,max->am", axes[:, 0], self.frame)[::-1]))
        return PrincipalForces(values, angle, axes[:, 0])


def section_forces(surface: Surface, thickness: float, stress: SheetStress) -> SectionForces:
    """n, m and q of a sheet, thickness in metres, from its stress.

    n is the mean of each face, t times the stress of the middle surface: what its elements balance. m is the mean of
    moments averaged around each vertex, and q their slope: a curved sheet of flat faces bends each of them by its own
    load, which averaging takes out. q is one order less accurate than m: through the ribs of a slab, 3 or 4 faces wide,
    4 to 19 % of the shear were missing in sum, twist at their edges counted in; n balances on any mesh.
    """
    own = stress.frame
    moments = thickness**2 / 6 * averaged(surface, own, stress.bending, sided=True)
    slope = np.einsum("mck,mak->mca", hat_gradients(surface), own)
    dx, dy = np.einsum("mca,mci->ami", slope, moments)
    slopes = np.stack([dx[:, 0] + dy[:, 2], dx[:, 2] + dy[:, 1]], axis=1)
    across = _near_means(surface, np.einsum("ma,max->mx", slopes, own))
    frame = local_frames(surface)
    turn = frame @ own.transpose(0, 2, 1)
    n = _turned(thickness * stress.membrane.mean(axis=1), turn)
    corners = np.stack([_turned(thickness * stress.membrane[:, k], turn) for k in range(3)], axis=1)
    q = np.einsum("mx,max->ma", across, frame)
    return SectionForces(frame, n, _turned(moments.mean(axis=1), turn), q, corners)


def local_frames(surface: Surface) -> Floats:
    """(m, 2, 3) local x and local y of each face, unit vectors, see `CONVENTION`."""
    normal = surface.normals
    axis = np.where((np.abs(normal[:, 0]) > UPRIGHT)[:, None], np.eye(3)[1], np.eye(3)[0])
    x = axis - np.einsum("mi,mi->m", axis, normal)[:, None] * normal
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(normal, x)], axis=1)


def _near_means(surface: Surface, vectors: Floats) -> Floats:
    """(m, 3) vectors tangent to faces, sided as bending is, replaced by the mean over the faces nearby, by area.

    Slopes on needles of faces, which a cut leaves, are large and mean nothing: on a vault 174 instead of 3 kN/m. A mean
    around each vertex does not help where all faces around it are needles.
    """
    areas, normals = surface.areas, surface.normals
    reach = float(np.sqrt(areas @ areas / areas.sum()))
    tree = cKDTree(surface.centroids)
    near = tree.sparse_distance_matrix(tree, reach, output_type="coo_matrix")
    here, there = near.coords
    side = np.einsum("kx,kx->k", normals[here], normals[there])
    weight = np.where(np.abs(side) > SMOOTH, np.sign(side), 0.0) * areas[there]
    means = csr_array((weight, (here, there)), shape=(surface.m, surface.m))
    found = (means @ vectors) / np.asarray(abs(means) @ np.ones(surface.m))[:, None]
    return np.asarray(found - np.einsum("mx,mx->m", found, normals)[:, None] * normals)


def _turned(plane: Floats, turn: Floats) -> Floats:
    """(m, 3) tensors (xx, yy, xy) in a frame that is `turn` (m, 2, 2) of theirs."""
    xx, yy, xy = plane.T
    full = turn @ np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1) @ turn.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)
