"""Checks of flat bars (rectangular sections) of structural steel [EN 1993-1-1:2005, 6.2 and 6.3]."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.members.eurocode.checks import CheckRatios, CodeCheck, MemberBays, Rectangle, moment_factor
from dsfab.members.eurocode.grades import SteelGrade

STANDARD = "EN 1993-1-1"
Curve = Literal["a0", "a", "b", "c", "d"]
ALPHA: dict[Curve, float] = {"a0": 0.13, "a": 0.21, "b": 0.34, "c": 0.49, "d": 0.76}
"""Imperfection factors of buckling curves [EN 1993-1-1, table 6.1]."""
SIDEWAYS: Curve = "d"
"""Buckling curve for lateral torsional buckling of sections that are not I-shaped [EN 1993-1-1, table 6.4]."""

TENSION = CodeCheck("tension", f"{STANDARD} 6.2.3 (6.5)")
COMPRESSION = CodeCheck("compression", f"{STANDARD} 6.2.4 (6.9)")
SHEAR = CodeCheck("shear and torsion", f"{STANDARD} 6.2.6 (6.19), 6.2.7")
BENDING = CodeCheck("bending and axial force", f"{STANDARD} 6.2.9.1 (6.32), (6.41)")
OUT_OF_SURFACE = CodeCheck("buckling out of the surface", f"{STANDARD} 6.3.1.1 (6.46)")
IN_SURFACE = CodeCheck("buckling in the surface", f"{STANDARD} 6.3.1.1 (6.46)")
TORSIONAL = CodeCheck("lateral torsional buckling", f"{STANDARD} 6.3.2.1 (6.54)")
BOTH = CodeCheck("buckling and bending", f"{STANDARD} 6.3.3 (6.61), (6.62)")


@dataclass(frozen=True)
class SteelFactors:
    """Factors in the checks of steel members. curve : curve for flexural buckling [EN 1993-1-1, table 6.2].
    gamma_m0 : partial factor for sections.    gamma_m1 : partial factor for members that may buckle [6.1].
    buckling_length : buckling length / distance between nodes."""

    curve: Curve = "c"
    gamma_m0: float = 1.0
    gamma_m1: float = 1.0
    buckling_length: float = 1.0


def steel_checks(
    bays: MemberBays, forces: Floats, grade: SteelGrade, elastic: tuple[float, float], factors: SteelFactors
) -> CheckRatios:
    """Return force / resistance of b bays for each check. elastic : Young's modulus and shear modulus, Pa.
    forces : (b, 5, 6) N, Vy, Vz in N, and Mt, My, Mz in Nm, at five points of each bay."""
    section = Rectangle(bays.width, np.full_like(bays.width, bays.thickness))
    fy = grade.fy(bays.thickness)
    ratios = section_checks(section, forces, fy / factors.gamma_m0)
    length = bays.length[:, None] * factors.buckling_length
    return ratios | member_checks(section, forces, length, (fy, *elastic), factors)


def section_checks(section: Rectangle, forces: Floats, fd: float) -> CheckRatios:
    """Return force / resistance of sections (b, 5), for each check [EN 1993-1-1, 6.2.8, 6.2.10, (6.32), (6.41)].
    forces : (b, 5, 6) N, Vy, Vz in N, and Mt, My, Mz in Nm.    fd : design yield strength f_y / gamma_M0, Pa."""
    N, Vy, Vz, Mt, My, Mz = np.moveaxis(forces, -1, 0)
    V, torsion = np.hypot(Vy, Vz) / section.area, np.abs(Mt) / section.Wt
    tau = fd / np.sqrt(3)
    nearly = 0.95  # `plastic` and `rho` limit V / shear resistance to this; above, the shear check governs
    plastic = V / tau / np.maximum(1 - torsion / tau, V / tau / nearly + 1e-12)
    rho = np.where(plastic > 0.5, (2 * np.minimum(plastic, nearly) - 1) ** 2, 0.0)
    n, strength_share = N / (section.area * fd), 1 - rho
    bent = np.abs(My) / (1.5 * section.Wy * fd) + np.abs(Mz) / (1.5 * section.Wz * fd)
    return {
        TENSION: np.maximum(n, 0.0),
        COMPRESSION: np.maximum(-n, 0.0),
        SHEAR: (1.5 * V + torsion) / tau,
        BENDING: np.asarray((n / strength_share) ** 2 + bent / strength_share),
    }


def reduction(slenderness: Floats, curve: Curve) -> Floats:
    """Return the buckling factor chi for slendernesses (b, k) [EN 1993-1-1, (6.49)]."""
    phi = 0.5 * (1 + ALPHA[curve] * (slenderness - 0.2) + slenderness**2)
    chi = 1 / (phi + np.sqrt(np.maximum(phi**2 - slenderness**2, 0.0)))
    return np.asarray(np.where(slenderness <= 0.2, 1.0, np.minimum(chi, 1.0)))


def member_checks(
    section: Rectangle, forces: Floats, length: Floats, material: tuple[float, float, float], factors: SteelFactors
) -> CheckRatios:
    """Return force / resistance (b, 1) of b bays in buckling, for each check. length : (b, 1) buckling lengths, m.
    forces : (b, 5, 6) N, Vy, Vz in N, and Mt, My, Mz in Nm.    material : f_y, Young's and shear modulus, Pa."""
    fy, young, shear = material
    slim = section.slimmest()
    N = np.maximum(-forces[:, :, 0], 0.0).max(axis=1, keepdims=True)
    by_axis = [length / i / np.pi * np.sqrt(fy / young) for i in (slim.iy, slim.iz)]
    n = [N * factors.gamma_m1 / (reduction(lam, factors.curve) * slim.area * fy) for lam in by_axis]
    M = [np.abs(forces[:, :, k]).max(axis=1, keepdims=True) for k in (4, 5)]
    m = [moment * factors.gamma_m1 / (W * fy) for moment, W in zip(M, (slim.Wy, slim.Wz), strict=True)]
    C = [moment_factor(forces[:, :, k]) for k in (4, 5)]
    strong, weak = ([_by(slim.lying, *pair[::step]) for pair in (by_axis, n, m, C)] for step in (-1, 1))
    W = _by(slim.lying, slim.Wz, slim.Wy)
    sideways = np.sqrt(W * fy / slim.torsional(length, young, shear))
    tilted = strong[2] / reduction(sideways, SIDEWAYS)
    combined = _interaction(strong, weak, tilted)
    return {OUT_OF_SURFACE: n[0], IN_SURFACE: n[1], TORSIONAL: tilted, BOTH: np.where(N > 0, combined, 0.0)}


def _by(lying: Floats, if_lying: Floats, if_upright: Floats) -> Floats:
    return np.asarray(np.where(lying > 0, if_lying, if_upright))


def _interaction(strong: list[Floats], weak: list[Floats], tilted: Floats) -> Floats:
    (lam_s, n_s, _, C_s), (lam_w, n_w, m_w, C_w) = strong, weak
    k_ss = C_s * (1 + 0.6 * np.minimum(lam_s, 1) * n_s)
    k_ww = C_w * (1 + 0.6 * np.minimum(lam_w, 1) * n_w)
    k_ws = np.maximum(1 - 0.05 * np.minimum(lam_w, 1) / (C_s - 0.25) * n_w, 0.0)
    about_strong = n_s + k_ss * tilted + k_ww * m_w
    about_weak = n_w + k_ws * tilted + k_ww * m_w
    return np.maximum(about_strong, about_weak)
