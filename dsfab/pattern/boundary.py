"""Where stripes run along the boundary: an edge that gets a member is straight, one that cuts stripes is frayed."""

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.surface import connected
from dsfab.surface.mesh import Surface

ALONG = 0.3
"""Stripes run along the boundary where the cosine between it and their gradient is less: within 17 degrees."""


def boundary_lines(surface: Surface, g: Floats, shortest: float = 0.0) -> Bools:
    """(n,) vertices of the boundary along which stripes run whose gradients point along g (n, 3).

    shortest : metres; where they run along it for less, as across the corner of a plate, there is none.
    """
    ends = surface.edges.ends[surface.edges.boundary]
    step = surface.V[ends[:, 1]] - surface.V[ends[:, 0]]
    moment = np.zeros((surface.n, 3, 3))
    for k in (0, 1):
        np.add.at(moment, ends[:, k], step[:, :, None] * step[:, None, :])
    on = np.zeros(surface.n, dtype=bool)
    on[ends] = True
    at = np.flatnonzero(on)
    tangent = np.linalg.eigh(moment[at])[1][:, :, 2]
    found = np.zeros(surface.n, dtype=bool)
    found[at] = np.abs(np.einsum("ni,ni->n", tangent, g[at])) < ALONG
    both = found[ends].all(axis=1)
    count, run = connected(surface.n, *ends[both].T)
    length = np.bincount(run[ends[both, 0]], np.linalg.norm(step[both], axis=1), count)
    return np.asarray(found & (length[run] >= shortest))
