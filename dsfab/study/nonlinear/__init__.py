"""How much load a design bears before it snaps or buckles, with large displacements, by CalculiX: a check by an outside
program.

solid     a cut sheet as wedges, with supports and loads       calculix  the files for the program, and what it finds
running   the program itself, watched and ended
limit     linear buckling, its shape as an imperfection, the path of loads: `nonlinear_check`
"""

from dsfab.study.nonlinear.limit import NonlinearCheck, limit_of, nonlinear_check, solid_check
from dsfab.study.nonlinear.running import require_ccx
from dsfab.study.nonlinear.solid import WedgeModel, solid_model

__all__ = [
    "NonlinearCheck",
    "WedgeModel",
    "limit_of",
    "nonlinear_check",
    "require_ccx",
    "solid_check",
    "solid_model",
]
