"""`Rectangle`: sections of members in numbers, and the moments along bays."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Floats
from dsfab.frame import torsion_constant


@dataclass(frozen=True, eq=False)
class Rectangle:
    """Sections as wide as `width` along y and as thick as `thickness` along z, metres: (b, k) both, k along b bays."""

    width: Floats
    thickness: Floats

    @cached_property
    def area(self) -> Floats:
        """(b, k) m2."""
        return np.asarray(self.width * self.thickness)

    @cached_property
    def Wy(self) -> Floats:  # noqa: N802 - its name in the field
        """(b, k) elastic modulus for My, m3."""
        return np.asarray(self.width * self.thickness**2 / 6)

    @cached_property
    def Wz(self) -> Floats:  # noqa: N802
        """(b, k) elastic modulus for Mz, m3."""
        return np.asarray(self.thickness * self.width**2 / 6)

    @cached_property
    def iy(self) -> Floats:
        """(b, k) radius of gyration of what bends with the surface, metres."""
        return np.asarray(self.thickness / np.sqrt(12))

    @cached_property
    def iz(self) -> Floats:
        """(b, k) radius of gyration of what bends in the surface, metres."""
        return np.asarray(self.width / np.sqrt(12))

    @cached_property
    def lying(self) -> Floats:
        """(b, k) 1 where the strong axis is z: where the section is wider than thick; else 0."""
        return np.asarray((self.width >= self.thickness).astype(np.float64))

    @cached_property
    def weak(self) -> Floats:
        """(b, k) second moment about the weak axis, m4."""
        a, t = np.maximum(self.width, self.thickness), np.minimum(self.width, self.thickness)
        return np.asarray(a * t**3 / 12)

    @cached_property
    def It(self) -> Floats:  # noqa: N802
        """(b, k) St. Venant's torsion constant, m4."""
        return torsion_constant(self.width, self.thickness)

    @cached_property
    def Wt(self) -> Floats:  # noqa: N802
        """(b, k) torque over the largest shear stress, m3 [Roark, table 10.1, case 4]."""
        a = np.maximum(self.width, self.thickness) / 2
        r = np.minimum(self.width, self.thickness) / 2 / a
        return np.asarray(8 * a**3 * r**2 / (3 * (1 + 0.6095 * r + 0.8865 * r**2 - 1.8023 * r**3 + 0.91 * r**4)))

    def slimmest(self) -> "Rectangle":
        """(b, 1) the narrowest within each bay; its ends are at joints, where other members are material too."""
        inner = slice(1, -1) if self.width.shape[1] > 2 else slice(None)
        narrow = (side[:, inner].min(axis=1, keepdims=True) for side in (self.width, self.thickness))
        return Rectangle(*narrow)

    def torsional(self, length: Floats, young: float, shear: float) -> Floats:
        """(b, k) the moment about the strong axis, Nm, at which a bay of a length in metres buckles sideways, under one
        that is alike along it [Timoshenko, Gere 1961, 6.1]: pi / L sqrt(E I G It)."""
        return np.asarray(np.pi / length * np.sqrt(young * self.weak * shear * self.It))


def moment_factor(moment: Floats) -> Floats:
    """(b, 1) C_m of moments (b, 5) along bays [EN 1993-1-1, table B.3, uniform loading; one that varies in a straight
    line has 0.6 + 0.4 psi]: the end with the larger moment, the other over it, and the middle."""
    ends = moment[:, [0, -1]]
    first = np.abs(ends[:, 0]) >= np.abs(ends[:, 1])
    large, small = np.where(first, ends[:, 0], ends[:, 1]), np.where(first, ends[:, 1], ends[:, 0])
    middle = moment[:, moment.shape[1] // 2]
    tiny = np.finfo(float).tiny
    psi = np.divide(small, large, out=np.zeros_like(large), where=np.abs(large) > tiny)
    span = np.abs(middle) > np.abs(large)
    alpha_s = np.divide(middle, large, out=np.ones_like(large), where=~span & (np.abs(large) > tiny))
    alpha_h = np.divide(large, middle, out=np.zeros_like(large), where=span)
    hogging = np.where(psi < 0, 0.1 * (1 - psi), 0.1) - 0.8 * alpha_s
    by_ends = np.maximum(np.where(alpha_s >= 0, 0.2 + 0.8 * alpha_s, hogging), 0.4)
    by_span = 0.95 + 0.05 * alpha_h * np.where((alpha_h < 0) & (psi < 0), 1 + 2 * psi, 1.0)
    return np.asarray(np.where(span, by_span, by_ends)[:, None])
