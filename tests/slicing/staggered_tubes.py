"""An upright tube of staggered triangles."""

import numpy as np

from dsfab.surface import Surface


def staggered_tube(around: int, along: int, radius: float = 1.0, height: float = 2.0) -> Surface:
    """An upright cylinder, open at both ends; its normals point outwards."""
    i, j = np.meshgrid(np.arange(around), np.arange(along + 1), indexing="ij")
    angle = 2 * np.pi * (i + 0.5 * (j % 2)).ravel() / around
    V = np.c_[radius * np.cos(angle), radius * np.sin(angle), height * j.ravel() / along]
    i, j = (k.ravel() for k in np.meshgrid(np.arange(around), np.arange(along), indexing="ij"))
    a, right = i * (along + 1) + j, (i + 1) % around * (along + 1) + j
    even = j % 2 == 0
    F = np.concatenate(
        [np.c_[a, right, a + 1][even], np.c_[right, right + 1, a + 1][even]]
        + [np.c_[a, right, right + 1][~even], np.c_[a, right + 1, a + 1][~even]]
    )
    return Surface(V, F)
