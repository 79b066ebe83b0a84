"""A design as smooth STEP takes it: the uncut surface with its offsets, and the sheet divided into charts."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.smooth.source import Curved, Divided
from dsfab.pipeline.design import Design
from dsfab.slicing import Sheet, cut
from dsfab.slicing.corners import outline_labels
from dsfab.surface import Surface
from dsfab.surface.cover import one_sided_pieces
from dsfab.thickening import offsets
from dsfab.thickening.offset import SHIFT, Side

SNAP = 0.1
"""Snap fraction of the borders of charts (see `cut`)."""


def curved_design(design: Design) -> Curved:
    """The sheet of a design; raises ExportError where the solid is more than that sheet, thickened."""
    ask = design.preset.thickening
    if ask.extra:
        raise ExportError("the solid has extra parts beside the sheet")
    if design.solid.repairs.rung == "united":
        raise ExportError("the sheet crosses itself, and its parts are fused there")
    return curved_sheet(design.surface, design.sheet, design.preset.statics.thickness, ask.side)


def curved_sheet(surface: Surface, sheet: Sheet, thickness: float | Floats, side: Side = "mid") -> Curved:
    """A kept sheet and the surface it was cut from.

    thickness : metres, or (n,) of them.   Raises ExportError for a surface with one side only.
    """
    if one_sided_pieces(surface.F, surface.edges).any():
        raise ExportError("the surface has one side only, so it has no two skins")
    D = offsets(surface, thickness, side).D
    return Curved(surface.V, surface.F, D, SHIFT[side], lambda fields: divided(surface, sheet, D, fields))


def divided(surface: Surface, sheet: Sheet, D: Floats, fields: Floats) -> Divided:
    """The kept sheet cut along the upper envelope of fields (n, c) on the uncut surface."""
    count = fields.shape[1]
    chart = np.zeros(sheet.surface.m, dtype=np.int64)
    if count > 1:
        over = [fields[:, k] - fields[:, k + 1 :].max(axis=1) for k in range(count - 1)]
        parts = cut(sheet.surface, [sheet.carry(x) for x in over], [np.zeros(1)] * len(over), SNAP)
        chart = np.where(parts.material, parts.family, count - 1)
        family, weights = sheet.family[parts.parent], parts.weights @ sheet.weights
        sheet = Sheet(parts.surface, sheet.parent[parts.parent], family, weights)
        chart = _where_largest(sheet.carry(fields), sheet.surface.F, chart)
    labels = outline_labels(sheet, surface)
    return Divided(sheet.surface.V, sheet.surface.F, sheet.carry(D), chart, labels.half_edge, labels.family)


def _where_largest(fields: Floats, F: Ints, chart: Ints) -> Ints:
    """(m,) charts, but for faces where theirs is largest at no corner: there the largest in the middle.

    Where three borders meet, what is cut away by one of them may be none of the others': it would be left to the last
    chart, which may be far away.
    """
    corners = fields[F]
    own = np.take_along_axis(corners, chart[:, None, None], axis=2)[:, :, 0]
    lost = (own < corners.max(axis=2)).all(axis=1)
    return np.where(lost, corners.mean(axis=1).argmax(axis=1), chart)
