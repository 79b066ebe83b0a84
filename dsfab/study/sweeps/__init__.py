"""Parametric sweeps: many designs of one preset, in memory (`sweep`) or in a folder that survives being stopped.

values, constraints, plan, plan_file   what a sweep is: a file, checked as strictly as a preset
sampling                               its points: a full grid, Sobol, Latin hypercube, a list from CSV
order                                  which run after which, so that stages are made once for all that share them
cut_sheet, metrics                     how the cut sheet of a design carries, and what can be asked of a design
store, results                         one database per folder; tables, the best, the Pareto front
worker, local, cluster                 who makes the runs: processes of this machine, or a Dask cluster
scheduler, folder                      the only one who writes, and what it writes
"""

from dsfab.study.sweeps.in_memory import Run, sweep
from dsfab.study.sweeps.metrics import BASIC, METRICS

__all__ = ["BASIC", "METRICS", "Run", "sweep"]
