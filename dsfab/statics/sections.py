"""`SectionForces`: what engineers dimension a sheet by, normal forces n, moments m and shear forces q per length."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, lock
from dsfab.statics.layers import SheetStress, principal_values
from dsfab.statics.recovery import averaged
from dsfab.statics.shear import ShearRecovery
from dsfab.surface import Surface

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
    corner_moments : (m, 3, 3) m there; on a free edge its twist is the line force that q is balanced with.
    """

    frame: Floats
    n: Floats
    m: Floats
    q: Floats
    corners: Floats
    corner_moments: Floats

    def __post_init__(self) -> None:
        lock(self, "frame", np.float64, (None, 2, 3))
        for name in ("corners", "corner_moments"):
            lock(self, name, np.float64, (len(self.frame), 3, 3))
        for name, width in (("n", 3), ("m", 3), ("q", 2)):
            lock(self, name, np.float64, (len(self.frame), width))

    def principal(self, what: str) -> PrincipalForces:
        """Principal values and directions of `n` or of `m` [Mohr 1882]."""
        values, axes = principal_values(getattr(self, what), self.frame)
        angle = np.degrees(np.arctan2(*np.einsum("mx,max->am", axes[:, 0], self.frame)[::-1]))
        return PrincipalForces(values, angle, axes[:, 0])


def section_forces(
    surface: Surface, thickness: float, stress: SheetStress, recovery: ShearRecovery | None = None
) -> SectionForces:
    """n, m and q of a sheet, thickness in metres, from its stress.

    recovery : of the same surface, for the same kind of bending; made once for many cases.

    n is the mean of each face, t times the stress of the middle surface: what its elements balance. m is the mean of
    moments averaged around each vertex: a curved sheet of flat faces bends each of them by its own load, which
    averaging takes out. q balances moments (`dsfab.statics.shear`): errors of Navier's plate fall as h^1.5, .3 % of
    all shear at 32 cells, where slopes of moments had 1.7 %; what passes sections of cut sheets is all there to .1 %,
    on a slab whose ribs are thinner than a face to 2.5 %.
    """
    own, scale = stress.frame, thickness**2 / 6
    moments = scale * averaged(surface, own, stress.bending, sided=True)
    across = np.zeros((surface.m, 3))
    if stress.bending.any():
        recovery = recovery or ShearRecovery.of(surface, linear=bool(np.ptp(stress.bending, axis=1).any()))
        across = recovery.forces(scale * stress.bending, moments)
    frame = local_frames(surface)
    turn = frame @ own.transpose(0, 2, 1)
    n = _turned(thickness * stress.membrane.mean(axis=1), turn)
    corners, bent = (
        np.stack([_turned(values[:, k], turn) for k in range(3)], axis=1)
        for values in (thickness * stress.membrane, moments)
    )
    q = np.einsum("mx,max->ma", across, frame)
    return SectionForces(frame, n, bent.mean(axis=1), q, corners, bent)


def local_frames(surface: Surface) -> Floats:
    """(m, 2, 3) local x and local y of each face, unit vectors, see `CONVENTION`."""
    normal = surface.normals
    axis = np.where((np.abs(normal[:, 0]) > UPRIGHT)[:, None], np.eye(3)[1], np.eye(3)[0])
    x = axis - np.einsum("mi,mi->m", axis, normal)[:, None] * normal
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(normal, x)], axis=1)


def _turned(plane: Floats, turn: Floats) -> Floats:
    """(m, 3) tensors (xx, yy, xy) in a frame that is `turn` (m, 2, 2) of theirs."""
    xx, yy, xy = plane.T
    full = turn @ np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1) @ turn.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)
