"""On which way the piece of a plank is put on: that in the middle of the normals at its nodes."""

import numpy as np

from dsfab.arrays import Floats

SLIDE = float(np.radians(10.0))
"""Slots of a piece open so that it can be put on along one direction, if the normals at its nodes are no farther from
that; it is spliced where they would be."""


def spread(normals: Floats) -> float:
    """The largest angle between unit vectors (q, 3) and the way in their middle, radians; 0 for none."""
    if len(normals) < 2:
        return 0.0
    return float(np.arccos(np.clip(normals @ middle(normals), -1.0, 1.0)).max())


def middle(normals: Floats) -> Floats:
    """(3,) the unit vector between those of some (q, 3) that are farthest from each other."""
    i, j = np.unravel_index(int((normals @ normals.T).argmin()), (len(normals),) * 2)
    way = normals[i] + normals[j]
    return np.asarray(way / np.linalg.norm(way))
