"""How a compliance follows from those on two or three meshes, and how far off it may be: calibrated, not proven.

The numbers were fitted on the random designs of `dsfab.study.verdict.calibration`, whose table ships with dsfab.
"""

from collections.abc import Sequence
from dataclasses import dataclass

STEP = 2.0
"""Each refinement takes the error to 1 / (1 + STEP) of what it was: the value is c1 + (c1 - c0) / STEP."""

OF_STEP = 0.6
"""The bound is at least this share of the last step |c1 - c0|."""

OF_SPREAD = 0.4
"""And at least this share of what is left of the spread against quadratic + midedge."""

OF_RECOVERY = 0.3
"""And at least this share of the recovery error, membrane and bending together."""

FLOOR = 0.003
"""And never less than this: the truth in the table is itself known to 0.1 or 0.2 % only."""

ONE_MESH = 1.7
"""Where one mesh alone was solved, the bound is at least this multiple of its recovery error. It is told (19 of 20
designs keep it), but a compliance is never called converged by one mesh."""

QUICK = (0.02, 0.05)
"""Error of the quick level (hybrid + hhj, as cut): the median, and what nine in ten designs keep."""

MEMBER = 4.0
"""Fewer edges of the uncut mesh across a member are told."""


@dataclass(frozen=True)
class ComplianceEstimate:
    """value : compliance, J.  bound : half width of its interval, over the value."""

    value: float
    bound: float


def estimate(values: Sequence[float], spread: float, recovery: float) -> ComplianceEstimate:
    """From compliances by quadratic + hhj on one or more meshes, each of four times the triangles, coarse to fine.

    spread   : against quadratic + midedge on the first mesh; about half of it is left on each further one, where it is
               not measured: it would cost half as much again.
    recovery : ZZ on the finest mesh.
    """
    if len(values) < 2:
        return ComplianceEstimate(values[0], max(ONE_MESH * recovery, OF_SPREAD * abs(spread), FLOOR))
    step = values[-1] - values[-2]
    value = values[-1] + step / STEP
    left = abs(spread) / 2 ** (len(values) - 1)
    off = max(OF_STEP * abs(step) / value, OF_SPREAD * left, OF_RECOVERY * recovery, FLOOR)
    return ComplianceEstimate(value, off)
