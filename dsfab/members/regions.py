"""The finished sheet divided into regions that lie in the same stripes: what CAD solids by members are made of.

A crossing is a region of its own, and so is each stretch of a member between two crossings. What lies in no stripe
(fillets, bridges, filled openings) is loose: it says nothing of where a region should end.
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Ints
from dsfab.members.bands import pattern_bands
from dsfab.members.components import DISC, roundness
from dsfab.results import PatternResult
from dsfab.slicing import Sheet, overlaid
from dsfab.surface import Surface, connected


class StripedCells(NamedTuple):
    """sheet : m cells, divided along hidden edges too.   label : (m,) equal for cells that lie in the same stripes.
    loose : (m,) cells that lie in none."""

    sheet: Sheet
    label: Ints
    loose: Bools


def striped_cells(surface: Surface, sheet: Sheet, pattern: PatternResult) -> StripedCells:
    """The cells of a kept sheet that was cut from `surface` along a pattern, by the stripes that they lie in.

    A disc that is kept around a point is one region: stripes that end below it would cut it to pieces.
    """
    bands = pattern_bands(surface, sheet, pattern)
    overlay = overlaid(sheet, surface, [band.drawn for band in bands])
    part, round_ = overlay.part.copy(), roundness(overlay)
    for k, band in enumerate(bands):
        disc = part[:, k] >= 0
        disc &= (round_[part[:, k]] > DISC) & band.drawn.hides
        part[disc] = np.where(np.arange(part.shape[1]) == k, part[disc], -1)
    label = np.unique(part, axis=0, return_inverse=True)[1].ravel()
    return _without_slivers(overlay.sheet, label.astype(np.int64), np.asarray((part < 0).all(axis=1)))


def _without_slivers(sheet: Sheet, label: Ints, loose: Bools) -> StripedCells:
    """Loose cells that hang together and have neighbours of one label only take it: slivers at the edge of a stripe,
    where its walls were made fair."""
    f, g = sheet.surface.edges.pairs.T // 3
    both = loose[f] & loose[g]
    count, part = connected(len(label), f[both], g[both])
    f, g = np.concatenate([f, g]), np.concatenate([g, f])
    beside = loose[f] & ~loose[g]
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, part[f[beside]], label[g[beside]])
    np.maximum.at(high, part[f[beside]], label[g[beside]])
    sliver = loose & (low == high)[part]
    return StripedCells(sheet, np.where(sliver, low[part], label), loose & ~sliver)
