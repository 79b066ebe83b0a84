"""`apart`: the proof for all cells."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening.rounding import is_fine, rounding_step
from dsfab.thickening.separation_proof.boxes import boxes_of
from dsfab.thickening.separation_proof.layer import OffsetLayer
from dsfab.thickening.separation_proof.prisms import prisms
from dsfab.thickening.separation_proof.windings import fronts, once_around

BOXES = (1000, 8000)
"""About how many boxes a surface is divided into, where its faces and its thickness are small enough; the second number
only where the first leaves something open."""

ROUNDING = 1e-13
"""Share of the largest coordinate by which computed places are off, at most."""

MOST_BAD = 0.05
"""With a larger share of folded prisms nothing is proven."""


def apart(layer: OffsetLayer) -> Bools:
    """(m',) cells whose prism surely meets no other one, however its sides are divided by diagonals.

    This holds for the vertices as they are and as files of single precision hold them (where `is_fine`).
    """
    cells, uncut = layer.cells, layer.uncut
    if len(misoriented_edges(uncut.F, uncut.edges)):
        return np.zeros(cells.m, dtype=bool)
    off = ROUNDING * float(np.abs(uncut.V).max() + np.abs(layer.D).max())
    if is_fine(uncut.V, layer.D):
        off += rounding_step(uncut.V, layer.D)
    sure = np.zeros(cells.m, dtype=bool)
    for count in BOXES:
        boxes = boxes_of(layer, off, count)
        folded, cosine, reach = prisms(layer, boxes, off)
        if folded.mean() > MOST_BAD:
            return sure
        good = once_around(layer, boxes, fronts(boxes, cosine), off)
        sure |= good[boxes.of[layer.parent]]
        if sure.all():
            break
    if folded.any():
        sure &= ~_near(layer, folded, reach)
    return sure


def _near(layer: OffsetLayer, folded: Bools, reach: Floats) -> Bools:
    """(m',) cells whose prisms may come near a folded one."""
    middle = layer.cells.centroids + layer.shift * layer.carried[layer.cells.F].mean(axis=1)
    bad = np.flatnonzero(folded)
    size = 2.1 * reach  # around the mean of the middle layer, which the mean of the corners is
    lists = cKDTree(middle).query_ball_point(middle[bad], size[bad] + size.max())
    near = np.zeros(len(folded), dtype=bool)
    near[np.concatenate([np.asarray(found, dtype=np.int64) for found in lists])] = True
    return near
