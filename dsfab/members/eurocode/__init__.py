"""Check of members by the Eurocodes.

grades   characteristic strengths by material, durations of loads, k_mod
checks   bays with sections and forces, checks with clauses, utilisation
steel    EN 1993-1-1 for flats
timber   EN 1995-1-1 for laths
rules    the check of a whole structure"""

from dsfab.members.eurocode.checks import MemberBays, Utilisation
from dsfab.members.eurocode.grades import STEEL, TIMBER, Duration, shortest
from dsfab.members.eurocode.rules import Rules, utilisation
from dsfab.members.eurocode.steel import SteelFactors
from dsfab.members.eurocode.timber import TimberFactors

__all__ = [
    "STEEL", "TIMBER", "Duration", "MemberBays", "Rules", "SteelFactors", "TimberFactors", "Utilisation", "shortest",
    "utilisation",
]  # fmt: skip
