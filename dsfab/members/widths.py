"""How far a member reaches to the left and to the right of its axis."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.members.axis import MemberAxis
from dsfab.surface import Surface

ALONG = 0.5
"""Edges of the outline that run along the axis, by this cosine at least, are its sides; others end it."""


def sides(surface: Surface, cells: Ints, axis: MemberAxis) -> Floats:
    """(k, 2) metres from the stations of an axis to the outline of cells (c,), to the left and to the right of it."""
    a, b = _outline(surface, cells)
    middle, way = (a + b) / 2, b - a
    near = np.asarray(cKDTree(axis.P).query(middle)[1])
    cosine = np.abs(np.einsum("ei,ei->e", way, axis.T[near])) / np.linalg.norm(way, axis=1)
    left = np.einsum("ei,ei->e", middle - axis.P[near], axis.B[near]) >= 0
    found = np.zeros((len(axis.s), 2))
    for column, side in enumerate((left, ~left)):
        here = np.flatnonzero(side & (cosine > ALONG))
        if len(here):
            off = np.concatenate([a[here], b[here]]) - np.tile(axis.P[near[here]], (2, 1))
            T, B = (np.tile(x[near[here]], (2, 1)) for x in (axis.T, axis.B))
            s = np.tile(axis.s[near[here]], 2) + np.einsum("ei,ei->e", off, T)
            y = np.abs(np.einsum("ei,ei->e", off, B))
            order = np.argsort(s, kind="stable")
            found[:, column] = np.interp(axis.s, s[order], y[order], period=axis.length if axis.closed else None)
    return found


def _outline(surface: Surface, cells: Ints) -> tuple[Floats, Floats]:
    """(e, 3) both ends of the edges around cells (c,)."""
    edge, count = np.unique(surface.edges.of[cells], return_counts=True)
    ends = surface.edges.ends[edge[count == 1]]
    return surface.V[ends[:, 0]], surface.V[ends[:, 1]]
