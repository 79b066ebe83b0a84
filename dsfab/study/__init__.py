"""Questions about designs: parametric sweeps, comparisons with other designs, and the verification of the elements."""

from dsfab.study.alternatives import ALTERNATIVE_WORDS, Alternative, design_alternatives, is_searched, losing_line
from dsfab.study.comparison import Comparison, compare_at
from dsfab.study.competitors import Competitor
from dsfab.study.fabrication import require_fit
from dsfab.study.judges import compare, full_at_many_shares
from dsfab.study.nonlinear import NonlinearCheck, nonlinear_check, require_ccx
from dsfab.study.processes import fitting_processes, made_in_processes
from dsfab.study.sweeps import METRICS, Run, sweep
from dsfab.study.upsampling import CutComparison, compared_cuts

__all__ = [
    "ALTERNATIVE_WORDS",
    "METRICS",
    "Alternative",
    "Comparison",
    "Competitor",
    "CutComparison",
    "NonlinearCheck",
    "Run",
    "compare",
    "compare_at",
    "compared_cuts",
    "design_alternatives",
    "fitting_processes",
    "full_at_many_shares",
    "is_searched",
    "losing_line",
    "made_in_processes",
    "nonlinear_check",
    "require_ccx",
    "require_fit",
    "sweep",
]
