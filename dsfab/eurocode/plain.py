"""Stress over strength, of materials for which no standard is known here."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.eurocode.bays import MemberBays
from dsfab.eurocode.checks import CodeCheck, Found
from dsfab.eurocode.section import Rectangle

STRESS = CodeCheck("stress over strength", "no standard: sqrt(s^2 + 3 t^2), s = N/A + My/Wy + Mz/Wz")


def plain_checks(bays: MemberBays, forces: Floats, strength: float, bent: Floats) -> Found:
    """The largest von Mises stress of an elastic section over a strength, Pa; bent : (b, 5) Pa, of bending members into
    shape."""
    section = Rectangle(bays.width, np.full_like(bays.width, bays.thickness))
    N, Vy, Vz, Mt, My, Mz = np.abs(np.moveaxis(forces, -1, 0))
    axial = N / section.area + My / section.Wy + Mz / section.Wz + bent
    shear = 1.5 * np.hypot(Vy, Vz) / section.area + Mt / section.Wt
    return {STRESS: np.asarray(np.sqrt(axial**2 + 3 * shear**2) / strength)}
