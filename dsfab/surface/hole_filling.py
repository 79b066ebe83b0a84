"""Triangles across a hole of a mesh, by dynamic programming over its outline [Barequet & Sharir 1995]."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lengths

LONG = 1e-3
"""Of two ways to fill a hole with as much area the one with shorter edges is better: their squares count by so much."""


def hole_triangles(P: Floats, joined: Bools) -> Ints | None:
    """(k - 2, 3) corners of triangles that fill the outline P (k, 3), with the least area; None where there are none.

    joined : (k, k) pairs of points that the mesh joins already, of which no edge may be made again.

    The triangles run around as the outline does.
    """
    k = len(P)
    if k == 3:
        return np.array([[0, 1, 2]])
    cost, apex = np.full((k, k), np.inf), np.full((k, k), -1)
    cost[np.arange(k - 1), np.arange(1, k)] = 0.0
    barred = joined.copy()
    barred[0, k - 1] = False  # an edge of the outline
    for span in range(2, k):
        for i in range(k - span):
            j, between = i + span, np.arange(i + 1, i + span)
            if barred[i, j]:
                continue
            total = cost[i, between] + cost[between, j] + _weights(P[i], P[between], P[j])
            best = int(total.argmin())
            cost[i, j], apex[i, j] = total[best], between[best]
    return _triangles(apex, k) if np.isfinite(cost[0, k - 1]) else None


def _weights(a: Floats, X: Floats, b: Floats) -> Floats:
    """(k,) area of the triangles a, X, b, and a little of the squares of their edges."""
    area = lengths(np.cross(X - a, b - a)) / 2
    squares = ((X - a) ** 2).sum(axis=1) + ((X - b) ** 2).sum(axis=1)
    return np.asarray(area + LONG * squares)


def _triangles(apex: Ints, k: int) -> Ints:
    """The triangles that the best apex of each pair of points leads to."""
    found, waiting = [], [(0, k - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i > 1:
            m = int(apex[i, j])
            found.append((i, m, j))
            waiting += [(i, m), (m, j)]
    return np.array(found)
