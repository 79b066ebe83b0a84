"""Checks of members by the Eurocodes.

grades   characteristic strengths of materials, load durations, k_mod
checks   bays (parts between nodes) with sections and forces, names of checks, utilisation
steel    checks of steel flats by EN 1993-1-1
timber   checks of timber laths by EN 1995-1-1
rules    check of a whole structure"""

from dsfab.members.eurocode.checks import MemberBays, Utilisation
from dsfab.members.eurocode.grades import STEEL, TIMBER, Duration, shortest
from dsfab.members.eurocode.rules import Rules, utilisation
from dsfab.members.eurocode.steel import SteelFactors
from dsfab.members.eurocode.timber import TimberFactors

__all__ = [
    "STEEL", "TIMBER", "Duration", "MemberBays", "Rules", "SteelFactors", "TimberFactors", "Utilisation", "shortest",
    "utilisation",
]  # fmt: skip
