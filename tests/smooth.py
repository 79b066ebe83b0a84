"""Curved sheets as smooth STEP: what the tests of it share."""

from functools import partial

import numpy as np

from dsfab.design.output.files import curved_sheet
from dsfab.export import StepOptions, write
from dsfab.slicing import Sheet, cut
from dsfab.surface import Surface
from dsfab.thickening import Solid, offsets, thicken

THICKNESS = 0.04


def thickened(surface: Surface, sheet: Sheet) -> Solid:
    D = sheet.carry_corners(offsets(surface, THICKNESS).at_corners(surface.F), surface.F)
    return thicken(sheet.surface, D)


def holed(surface: Surface, centres: list[list[float]], radius: float) -> Sheet:
    """The surface with round holes; the edge is linear over each face."""
    away = np.linalg.norm(surface.V[:, None] - np.array(centres), axis=2).min(axis=1)
    return cut(surface, [away - radius], [np.array([0.0])]).subset()


def written(surface, sheet, path, step="smooth"):
    """The solid, the file read back by build123d, and what was said."""
    from build123d import import_step

    said: list[str] = []
    solid = thickened(surface, sheet)
    write(
        solid, path, step=StepOptions(step, curved=partial(curved_sheet, surface, sheet, THICKNESS)), note=said.append
    )
    return solid, import_step(path), said
