"""Whether a surface stays where it stands: whether it would fall over, or turn about the line that its feet are on."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface import Surface

TIPS = 1.03
"""It falls over if all feet are within half a turn of the middle of its plan, by so much."""
LINE = 1 / 12
"""Feet in line are narrower in plan than this share of the width of the surface across that line."""


def tips(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Whether the middle of a surface's plan is beside all feet, (k, 3) points of each in metres: on those alone it
    would have to be held down."""
    if not feet:
        return False
    middle = surface.areas @ surface.centroids / surface.area
    x, y = (np.concatenate(feet) - middle)[:, :2].T
    angle = np.sort(np.arctan2(y, x))
    return bool(np.diff(angle, append=angle[0] + 2 * np.pi).max() > TIPS * np.pi)


def turns(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Whether two feet or more, points (k, 3) each, are in one line, about which the surface would turn: a saddle on
    two of its corners."""
    if len(feet) < 2:
        return False
    plan = np.concatenate(feet)[:, :2]
    along = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
    across = np.array([-along[1], along[0]])
    return bool(np.ptp(plan @ across) < LINE * np.ptp(surface.V[:, :2] @ across))
