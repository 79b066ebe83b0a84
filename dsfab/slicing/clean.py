"""`clean_split`: polygons cut such that none of the new ones is without area."""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.cells import Cells
from dsfab.slicing.snap import SNAP_FLOOR, nearest, snapped
from dsfab.slicing.split import SideValues, Split, split_cells
from dsfab.surface.mesh import ZERO_AREA

CELL_AREA = 1e3 * ZERO_AREA
"""A cell under this share of the squared size is not made (a margin over what `Surface` refuses)."""
FLATNESS = 1e-12
"""Nor is one whose area is under this share of its squared diameter: its corners lie on one line."""
ROUNDS = 12
"""How often vertices of cells that would have no area are moved before it is given up."""


class Snapping(NamedTuple):
    """How values are moved onto levels before a cut.

    fraction : of an edge's range.    size : of the surface, metres.    hold : vertices whose value is never moved.
    """

    fraction: float
    size: float
    hold: Ints | None = None


def clean_split(
    cells: Cells,
    X: Floats,
    x: Floats,
    levels: Floats,
    active: Bools,
    snapping: Snapping,
    above: Bools | None = None,
) -> Split:
    """`split_cells` of field x (n,) on vertices X (n, 3) after snapping; no new cell is without area (see `CELL_AREA`,
    `FLATNESS`).

    Values move onto levels only, never across one, so that the cut stays a cut of convex polygons by chords that do not
    cross.    active, above : see `split_cells`.
    """
    snap, size, hold = snapping
    if not len(levels) or not active.any():
        return Split.none(cells, active)
    free = np.ones(len(x), dtype=bool)
    free[[] if hold is None else hold] = False
    a, b = cells.sides(active)
    x = snapped(x, levels, (a, b), np.abs(x[a] - x[b]), max(snap, SNAP_FLOOR), free)
    for _ in range(ROUNDS):
        split = split_cells(cells, len(x), SideValues.of(cells, x), levels, active, above)
        corners = collapsed_corners(split, split.extended(X), size)
        corners = corners[corners < len(x)]
        stray = corners[(x[corners] != nearest(x[corners], levels)) & free[corners]]
        if not len(stray):
            break
        x[stray] = nearest(x[stray], levels)
    return split


def collapsed_corners(split: Split, X: Floats, size: float) -> Ints:
    """(k,) vertices, of X (n, 3), of the cells that a split made without area; those left whole do not count."""
    divided = np.flatnonzero(np.bincount(split.source)[split.source] > 1)
    if not len(divided):
        return divided
    cells = split.cells.some(divided)
    area, squared_reach = cells.areas(X)
    bad = area <= np.maximum(CELL_AREA * size**2, FLATNESS * squared_reach)
    return np.unique(cells.corner[bad[cells.owner]])
