"""Parameter sweeps, comparisons with other structures, and checks of a design."""

from dsfab.study.alternatives import (
    ALTERNATIVE_WORDS,
    Alternative,
    Competitor,
    design_alternatives,
    is_searched,
    losing_line,
)
from dsfab.study.calculix import require_ccx
from dsfab.study.comparison import Comparison, compare, compare_at, full_at_many_shares
from dsfab.study.fabrication import require_fit
from dsfab.study.nonlinear import NonlinearCheck, nonlinear_check
from dsfab.study.sizing import guessed_preset, run_sized, sized_design, sized_preset, sizing_result
from dsfab.study.sweeps import METRICS, Run, sweep
from dsfab.study.sweeps.workers import fitting_processes, map_in_processes

__all__ = [
    "ALTERNATIVE_WORDS", "METRICS", "Alternative", "Comparison", "Competitor", "NonlinearCheck", "Run", "compare",
    "compare_at", "design_alternatives", "fitting_processes", "full_at_many_shares", "guessed_preset", "is_searched",
    "losing_line", "map_in_processes", "nonlinear_check", "require_ccx", "require_fit", "run_sized", "sized_design",
    "sized_preset", "sizing_result", "sweep",
]  # fmt: skip
