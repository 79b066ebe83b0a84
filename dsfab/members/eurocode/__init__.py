"""Members against the Eurocodes: what each bears over what it can bear, with the clause at every number.

grades      characteristic strengths by the names of materials     durations   of loads, and k_mod
bays        members from node to node, with sections and forces    checks      names and clauses; what is found
steel       EN 1993-1-1 of flats                                   timber      EN 1995-1-1 of laths
plain       stress over strength, where no standard is known       rules       all of it together
"""

from dsfab.members.eurocode.checks import CodeCheck, MemberBays, Utilisation
from dsfab.members.eurocode.grades import DURATIONS, STEEL, TIMBER, Duration, SteelGrade, TimberGrade, shortest
from dsfab.members.eurocode.rules import Rules, utilisation
from dsfab.members.eurocode.steel import SteelFactors, steel_checks
from dsfab.members.eurocode.timber import TimberFactors, timber_checks

__all__ = [
    "DURATIONS",
    "STEEL",
    "TIMBER",
    "CodeCheck",
    "Duration",
    "MemberBays",
    "Rules",
    "SteelFactors",
    "SteelGrade",
    "TimberFactors",
    "TimberGrade",
    "Utilisation",
    "shortest",
    "steel_checks",
    "timber_checks",
    "utilisation",
]
