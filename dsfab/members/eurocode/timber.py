"""Checks of timber laths: rectangular sections, with the grain along the lath [EN 1995-1-1, A1 and A2, 6.1 to 6.3]."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.members.eurocode.checks import CheckRatios, CodeCheck, MemberBays, Rectangle
from dsfab.members.eurocode.grades import Duration, Product, ServiceClass, TimberGrade, k_mod

STANDARD = "EN 1995-1-1"
GAMMA: dict[Product, float] = {"solid timber": 1.3, "glulam": 1.25, "LVL": 1.2}
"""Partial factors [EN 1995-1-1, table 2.3]."""
K_CR: dict[Product, float] = {"solid timber": 0.67, "glulam": 0.67, "LVL": 1.0}
"""Factor k_cr on the width of a section in shear, which allows for cracks [EN 1995-1-1, 6.1.7 (2)]."""
BETA: dict[Product, float] = {"solid timber": 0.2, "glulam": 0.1, "LVL": 0.1}
"""Imperfection factors beta_c of members in compression [EN 1995-1-1, (6.29)]."""
K_M = 0.7  # Factor for biaxial bending of rectangles [EN 1995-1-1, 6.1.6 (2)].
STRAIGHT = 0.3  # Largest relative slenderness without buckling [EN 1995-1-1, 6.3.2 (2)].
LVL_HEIGHT, LVL_LENGTH = 0.3, 3.0  # Height and length (m) above which the strength of LVL decreases [EN 1995-1-1, 3.4].

K_DIS = 1.4  # Factor for the distribution of stress in curved beams [EN 1995-1-1, (6.52)].
K_P = 1.5  # Stress across the grain of a curved beam is K_P M / (b h R): (6.54) and (6.56), with k_p = 0.25 h / R.
VOLUME = 0.01  # m3; in a larger volume, the strength across the grain decreases [EN 1995-1-1, (6.51)].

TENSION = CodeCheck("tension", f"{STANDARD} 6.1.2 (6.1)")
COMPRESSION = CodeCheck("compression", f"{STANDARD} 6.1.4 (6.2)")
BENDING = CodeCheck("bending", f"{STANDARD} 6.1.6 (6.11), (6.12)")
BENT_IN = CodeCheck("bending into shape alone", f"{STANDARD} 6.1.6 (6.11)")
SHEAR = CodeCheck("shear", f"{STANDARD} 6.1.7 (6.13)")
TORSION = CodeCheck("torsion", f"{STANDARD} 6.1.8 (6.14)")
WITH_TENSION = CodeCheck("bending and tension", f"{STANDARD} 6.2.3 (6.17), (6.18)")
WITH_COMPRESSION = CodeCheck("bending and compression", f"{STANDARD} 6.2.4 (6.19), (6.20)")
COLUMN = CodeCheck("stability as a column", f"{STANDARD} 6.3.2 (6.23), (6.24)")
ACROSS = CodeCheck("shear with tension across the grain", f"{STANDARD} 6.4.3 (6.53)")
BEAM = CodeCheck("stability as a beam", f"{STANDARD} 6.3.3 (6.33), (6.35)")


@dataclass(frozen=True)
class TimberFactors:
    """Factors in the checks of timber members. service_class : 1 heated, 2 under a roof, 3 in the open.
    gamma_m : partial factor; None: use table 2.3.    buckling_length : buckling length / distance between nodes.
    layer   : thickness (m) of layers that are bent into shape; 0 for members made in their final shape."""

    service_class: ServiceClass = 2
    gamma_m: float | None = None
    buckling_length: float = 1.0
    layer: float = 0.0


def timber_checks(
    bays: MemberBays, forces: Floats, grade: TimberGrade, elastic: float, duration: Duration, factors: TimberFactors
) -> CheckRatios:
    """Return force / resistance of b bays for each check. elastic : Young's modulus, Pa.
    forces : (b, 5, 6) N, Vy, Vz in N, and Mt, My, Mz in Nm, at five points of each bay."""
    section = Rectangle(bays.width, np.full_like(bays.width, bays.thickness))
    over = (factors.gamma_m or GAMMA[grade.product]) / k_mod(duration, factors.service_class)
    bent = elastic * factors.layer * np.abs(bays.curvature) / 2
    stress = stresses(section, forces, bent, grade)
    lengthy = np.maximum(bays.length[:, None] / LVL_LENGTH, 1.0) ** (grade.size / 2)
    ratios = section_checks(section, stress, over, lengthy, grade)
    ratios |= stability_checks(section.slimmest(), stress, over, bays.length[:, None] * factors.buckling_length, grade)
    if grade.ft90:
        across = across_grain(bays, forces[..., 4], over, grade)
        ratios[ACROSS] = np.where(across > 0, across + ratios[SHEAR], 0.0)
    if factors.layer:
        always = (factors.gamma_m or GAMMA[grade.product]) / k_mod("permanent", factors.service_class)
        ratios[BENT_IN] = bent * always / grade.fm_flat
    return ratios


def across_grain(bays: MemberBays, moment: Floats, over: float, grade: TimberGrade) -> Floats:
    """Return tensile stress / strength (b, 5) across the grain, at five points of each of b curved bays.
    moment : (b, 5) My, Nm. Tension across the grain needs a moment that reduces the curvature kn: My kn > 0.
    Other moments give 0. The volume of the whole bay counts as the curved volume.    over : gamma_M / k_mod.
    Source: EN 1995-1-1, 6.4.3, for beams of constant height."""
    area = bays.width * bays.thickness
    stress = K_P * np.maximum(moment * bays.curvature, 0.0) / area
    if grade.product == "solid timber":
        k_vol: Floats | float = 1.0
    else:
        k_vol = np.minimum((VOLUME / (area.mean(axis=1) * bays.length)) ** 0.2, 1.0)[:, None]
    return np.asarray(over * stress / (K_DIS * k_vol * grade.ft90))


@dataclass(frozen=True, eq=False)
class Stresses:
    """Stresses at five points of each of b bays (b, 5), Pa. axial : positive in tension.    torsion : shear stress.
    my, mz : bending stress out of the surface, and in the surface.    vy, vz : shear stress along y and z."""

    axial: Floats
    my: Floats
    mz: Floats
    vy: Floats
    vz: Floats
    torsion: Floats


def stresses(section: Rectangle, forces: Floats, bent: Floats, grade: TimberGrade) -> Stresses:
    """Return the stresses from the section forces (b, 5, 6): N, Vy, Vz in N, and Mt, My, Mz in Nm.
    bent : (b, 5) stress from the bending of layers into shape, Pa."""
    N, Vy, Vz, Mt, My, Mz = np.moveaxis(forces, -1, 0)
    shear_area = K_CR[grade.product] * section.area
    return Stresses(
        N / section.area,
        np.abs(My) / section.Wy + bent,
        np.abs(Mz) / section.Wz,
        1.5 * np.abs(Vy) / shear_area,
        1.5 * np.abs(Vz) / shear_area,
        np.abs(Mt) / section.Wt,
    )


def _bending(section: Rectangle, stress: Stresses, grade: TimberGrade) -> tuple[Floats, Floats]:
    deep = np.maximum(section.width / LVL_HEIGHT, 1.0) ** grade.size
    return stress.my / grade.fm_flat, stress.mz * deep / grade.fm


def section_checks(
    section: Rectangle, stress: Stresses, over: float, lengthy: Floats, grade: TimberGrade
) -> CheckRatios:
    """Return stress / strength at five points of each of b bays, for each check. over : gamma_M / k_mod.
    lengthy : (b, 1) factor on the tensile stress in long parts of LVL [3.4]."""
    y, z = (over * ratio for ratio in _bending(section, stress, grade))
    bent = np.maximum(y + K_M * z, K_M * y + z)
    tension = over * lengthy * np.maximum(stress.axial, 0.0) / grade.ft
    pressed = over * np.maximum(-stress.axial, 0.0) / grade.fc
    a, t = (edge(section.width, section.thickness) for edge in (np.maximum, np.minimum))
    shape = np.minimum(1 + 0.05 * a / t, 1.3)  # amendment A2:2014 has the limit 1.3
    return {
        TENSION: tension,
        COMPRESSION: pressed,
        BENDING: bent,
        SHEAR: over * np.hypot(stress.vy / grade.fv, stress.vz / grade.fv_flat),
        TORSION: over * stress.torsion / (shape * min(grade.fv, grade.fv_flat)),
        WITH_TENSION: np.where(stress.axial > 0, tension + bent, 0.0),
        WITH_COMPRESSION: np.where(stress.axial < 0, pressed**2 + bent, 0.0),
    }


def column_factor(slenderness: Floats, grade: TimberGrade) -> Floats:
    """Return the buckling factor k_c for relative slendernesses (b, k) [EN 1995-1-1, (6.25) to (6.29)]."""
    k = 0.5 * (1 + BETA[grade.product] * (slenderness - STRAIGHT) + slenderness**2)
    k_c = 1 / (k + np.sqrt(np.maximum(k**2 - slenderness**2, 0.0)))
    return np.asarray(np.where(slenderness <= STRAIGHT, 1.0, np.minimum(k_c, 1.0)))


def beam_factor(slenderness: Floats) -> Floats:
    """Return the lateral buckling factor k_crit for relative slendernesses (b, k) [EN 1995-1-1, (6.34)]."""
    line = 1.56 - 0.75 * slenderness
    return np.asarray(np.select([slenderness <= 0.75, slenderness <= 1.4], [1.0, line], 1 / slenderness**2))


def stability_checks(slim: Rectangle, stress: Stresses, over: float, length: Floats, grade: TimberGrade) -> CheckRatios:
    """Return stress / strength (b, 1) of b bays in buckling, for each check. over : gamma_M / k_mod.
    slim : narrowest section of each bay.    length : (b, 1) buckling lengths, metres."""
    pressed = over * np.maximum(-stress.axial, 0.0).max(axis=1, keepdims=True) / grade.fc
    largest = Stresses(*(np.max(value, axis=1, keepdims=True) for value in vars(stress).values()))
    y, z = (over * value for value in _bending(slim, largest, grade))
    lam = [length / i / np.pi * np.sqrt(grade.fc / grade.E05) for i in (slim.iy, slim.iz)]
    c_y, c_z = (pressed / column_factor(value, grade) for value in lam)
    stocky = (lam[0] <= STRAIGHT) & (lam[1] <= STRAIGHT)
    column = np.maximum(c_y + y + K_M * z, c_z + K_M * y + z)
    column = np.where(stocky, pressed**2 + np.maximum(y + K_M * z, K_M * y + z), column)
    lying = slim.lying > 0
    strong, weak_c = np.where(lying, z, y), np.where(lying, c_y, c_z)
    fm, W = np.where(lying, grade.fm, grade.fm_flat), np.where(lying, slim.Wz, slim.Wy)
    sideways = np.sqrt(fm * W / slim.torsional(length, grade.E05, grade.G05))
    tilted = strong / beam_factor(sideways)
    return {COLUMN: np.where(pressed > 0, column, 0.0), BEAM: np.where(pressed > 0, tilted**2 + weak_c, tilted)}
