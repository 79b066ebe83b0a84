"""Values moved onto levels before a cut: onto levels only, never across one, so that no chords cross."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.cells import Cells

SNAP_FLOOR = 1e-9
"""Least snap fraction, applied also at snap = 0: lines nearer to a vertex go through it."""
ROUNDING = 8
"""Values within this many units in the last place of the largest value are on a level, however flat the field."""
TIP = 1e-3
"""Where both edges of a stripe of varying width come closer than this share of a side, they meet (or than the snap
fraction, if that is less)."""


def nearest(x: Floats, levels: Floats) -> Floats:
    """(n,) the level nearest to each value x (n,); levels (k,) ascend."""
    at = np.searchsorted(levels, x)
    below, above = levels[np.maximum(at - 1, 0)], levels[np.minimum(at, len(levels) - 1)]
    closest: Floats = np.where(np.abs(x - below) < np.abs(above - x), below, above)
    return closest


def snapped(
    x: Floats, levels: Floats, sides: tuple[Ints, Ints], difference: Floats, fraction: float, free: Bools
) -> Floats:
    """A copy of x (n,) with free values (n,) within `fraction` of their edges' largest range of a level (k,) moved
    onto it.

    sides : the values at both ends of each edge.    difference : the range of each edge.
    """
    level = nearest(x, levels)
    gap = np.abs(x - level)
    maybe = gap <= fraction * difference.max(initial=0.0) + _rounding(x)  # most are not, and need no closer look
    on = np.flatnonzero(maybe[sides[0]] | maybe[sides[1]])
    reach = ranges(len(x), (sides[0][on], sides[1][on]), difference[on])
    near = maybe & free & (gap <= fraction * reach + _rounding(x))
    moved: Floats = np.where(near, level, x)
    return moved


def snapped_together(x: Floats, levels: Floats, reach: Floats, fraction: float) -> Floats:
    """A copy of x (n, 2), two fields on the same levels: the value relatively nearer to a level moves onto it.

    reach : (n, 2) the largest range of each over the edges at a vertex.

    The other moves by as much, so that a stripe keeps its width, but not across a level of its own. Fields at a
    constant distance move as a single field with the levels of both would.
    """
    level = np.stack([nearest(x[:, i], levels) for i in (0, 1)], axis=1)
    steps, limit = level - x, fraction * reach + _rounding(x)
    gap = np.abs(steps)
    share = gap * limit[:, ::-1]
    tie = (share[:, 0] == share[:, 1]) & (steps[:, 0] > steps[:, 1])  # upwards, as `nearest` does
    first = (share[:, 0] < share[:, 1]) | tie
    chosen = np.stack([first, ~first], axis=1)
    step = np.where(chosen, steps, 0).sum(axis=1)
    near = np.any(chosen & (gap <= limit), axis=1)
    bounded = np.concatenate([[-np.inf], levels, [np.inf]])
    low = bounded[np.searchsorted(levels, x, side="right")]
    high = bounded[np.searchsorted(levels, x, side="left") + 1]
    other = np.clip(x + step[:, None], low, high)
    moved: Floats = np.where(near[:, None], np.where(chosen, level, other), x)
    return moved


def settled_cells(cells: Cells, y: Floats, levels: Floats) -> tuple[Bools, Bools]:
    """(c,) polygons that are material, and (c,) void, wherever the levels of two fields run; y (h, 2) at the slots."""
    width, begins = y[:, 0] - y[:, 1], cells.start[:-1]
    gap = np.diff(levels).max(initial=0.0)
    within = (y[:, 0] >= levels[0]) & (y[:, 1] < levels[-1])
    wide = (width >= gap - _rounding(y)) & within
    return np.logical_and.reduceat(wide, begins), np.maximum.reduceat(width, begins) <= _rounding(y)


def ranges(n: int, sides: tuple[Ints, Ints], difference: Floats) -> Floats:
    """(n,) the largest difference over the sides at each vertex."""
    reach = np.zeros(n)
    for end in sides:
        np.maximum.at(reach, end, difference)
    return reach


def _rounding(x: Floats) -> float:
    """What a constant field may be off by, once an earlier cut has interpolated it."""
    return float(ROUNDING * np.spacing(np.abs(x).max()))
