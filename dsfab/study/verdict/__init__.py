"""The verdict on a cut sheet: its compliance, with a calibrated error bound.

check ─► attached_material                     supported pieces and their loads (verdict.py)
      ─► Refinement ─► on_mesh ─► level          mesh after mesh (verdict.py, levels.py)
                    ─► estimate                  value and bound (estimates.py)
                    ─► theory_share              extra compliance of a solid, divided by a thin sheet's (levels.py)
      ─► Verdict                                 status and reason (verdict.py)
mode_intervals ─► mode_level, mesh after mesh ─► mode_estimate      buckling and frequency (modes.py)"""

from dsfab.study.verdict.levels import Level
from dsfab.study.verdict.modes import ModeIntervals, ModeLevel, mode_intervals
from dsfab.study.verdict.verdict import BUDGET, CaseVerdict, Depth, Dropped, LoadedSurface, Verdict, check, whole_sheet

__all__ = [
    "BUDGET", "CaseVerdict", "Depth", "Dropped", "Level", "LoadedSurface", "ModeIntervals", "ModeLevel", "Verdict",
    "check", "mode_intervals", "whole_sheet",
]  # fmt: skip
