"""Parameter sweeps: many designs of one preset, in memory (`sweep`) or in a folder that survives interruptions.

plan        sweep files: values, constraints, and their strict checks
metrics     quantities that a sweep can measure
runs        points, one database per folder, and the optimiser
in_memory   order of runs that shares stages; `sweep`
workers     processes of this machine, or a Dask cluster
scheduler   gives runs to workers
folder      writes all results"""

from dsfab.study.sweeps.in_memory import Run, sweep
from dsfab.study.sweeps.metrics import BASIC, METRICS

__all__ = ["BASIC", "METRICS", "Run", "sweep"]
