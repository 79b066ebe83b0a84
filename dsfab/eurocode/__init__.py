"""Members against the Eurocodes: what each bears over what it can bear, with the clause at every number.

grades      characteristic strengths by the names of materials     durations   of loads, and k_mod
bays        members from node to node, with sections and forces    checks      names and clauses; what is found
steel       EN 1993-1-1 of flats                                   timber      EN 1995-1-1 of laths
plain       stress over strength, where no standard is known       rules       all of it together
"""

from dsfab.eurocode.bays import MemberBays
from dsfab.eurocode.checks import CodeCheck, Utilisation
from dsfab.eurocode.durations import DURATIONS, Duration, shortest
from dsfab.eurocode.grades import STEEL, TIMBER, SteelGrade, TimberGrade
from dsfab.eurocode.rules import Rules, utilisation
from dsfab.eurocode.steel import SteelFactors, steel_checks
from dsfab.eurocode.timber import TimberFactors, timber_checks

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
