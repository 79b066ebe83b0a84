"""Questions about designs: parametric sweeps, and comparisons with other designs."""

from dsfab.study.sweeps import METRICS, Run, sweep

__all__ = ["METRICS", "Run", "sweep"]
