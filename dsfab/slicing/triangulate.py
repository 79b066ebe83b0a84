"""Convex polygons to triangles: of all triangulations the one whose worst triangle is best."""

import numpy as np

from dsfab.arrays import Floats, Ints, sorted_order
from dsfab.slicing.cells import CHUNK, Cells

LARGEST = 9
"""Polygons with more corners are first halved by a chord: the dynamic programme takes a time cubic in the corners."""


def triangulate(cells: Cells, X: Floats) -> tuple[Ints, Ints]:
    """Triangles (m, 3) that fill the convex polygons, oriented alike, and the polygon (m,) of each, ascending.

    X : (n, 3) positions. Polygons may have straight corners (180 degrees) but must have an area: then no triangle is
    without area, and no side of a polygon is passed over, so that neighbours fit.
    """
    waiting: dict[int, list[tuple[Ints, Ints]]] = {}
    for size in np.flatnonzero(np.bincount(cells.sizes)).tolist():
        which = np.flatnonzero(cells.sizes == size)
        waiting[size] = [(cells.corner[cells.start[which][:, None] + np.arange(size)], which)]
    triangles, owners = [], []
    while waiting:
        size = max(waiting)
        parts = waiting.pop(size)
        polygons, owner = (np.concatenate(column) for column in zip(*parts, strict=True))
        if size > LARGEST:
            for half, whose in _halves(polygons, owner, X):
                waiting.setdefault(half.shape[1], []).append((half, whose))
        else:
            for k in range(0, len(polygons), CHUNK):
                T, row = _best_triangles(polygons[k : k + CHUNK], X)
                triangles.append(T)
                owners.append(owner[k : k + CHUNK][row])
    T, owner = np.concatenate(triangles), np.concatenate(owners)
    order = sorted_order(owner)
    return T[order], owner[order]


def _quality(a: Floats, b: Floats, c: Floats) -> Floats:
    """(g,) 4 sqrt(3) area / (sum of squared sides): 1 for equilateral triangles, 0 without area [Bank, Smith 1997].

    a, b, c : (3, g) corners.
    """
    u, v = b - a, c - a
    w = v - u
    squares = sum((s[0] * s[0] + s[2] * s[2]) + s[1] * s[1] for s in (u, v, w))
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    return np.asarray(2 * np.sqrt(3) * np.sqrt(x * x + y * y + z * z) / np.maximum(squares, 1e-300))


def _best_triangles(polygons: Ints, X: Floats) -> tuple[Ints, Ints]:
    """Triangles of polygons (g, size) and the row of each: dynamic programme over sub-polygons i, i + 1, ..., j.

      k          best[i, j] = max over k of min(best[i, k], best[k, j], quality(i, k, j)):
     / \\         the triangle on the chord i-j, and what is best on its two other sides.
    i---j
    """
    g, size = polygons.shape
    if size == 3:
        return polygons, np.arange(g)
    P = [np.ascontiguousarray(X.take(column, axis=0).T) for column in polygons.T]
    best = {(i, i + 1): np.full(g, np.inf) for i in range(size - 1)}
    apex = np.zeros((size, size, g), dtype=np.int64)
    for span in range(2, size):
        for i in range(size - span):
            j = i + span
            worst = np.stack(
                [np.minimum(np.minimum(best[i, k], best[k, j]), _quality(P[i], P[k], P[j])) for k in range(i + 1, j)]
            )
            apex[i, j] = i + 1 + worst.argmax(axis=0)
            best[i, j] = worst.max(axis=0)
    return _chosen_triangles(polygons, apex)


def _chosen_triangles(polygons: Ints, apex: Ints) -> tuple[Ints, Ints]:
    g, size = polygons.shape
    found, rows = [], []
    chords = [(np.arange(g), np.zeros(g, dtype=np.int64), np.full(g, size - 1))]
    while chords:
        row, i, j = chords.pop()
        open_ = j - i >= 2
        row, i, j = row[open_], i[open_], j[open_]
        if len(row):
            k = apex[i, j, row]
            found.append(np.stack([polygons[row, i], polygons[row, k], polygons[row, j]], axis=1))
            rows.append(row)
            chords += [(row, i, k), (row, k, j)]
    return np.concatenate(found), np.concatenate(rows)


def _halves(polygons: Ints, owner: Ints, X: Floats) -> list[tuple[Ints, Ints]]:
    """Each polygon (g, size) cut by the chord whose smaller side has the largest area, as groups of equal size."""
    size = polygons.shape[1]
    spoke = X[polygons] - X[polygons[:, :1]]
    fan = np.linalg.norm(np.cross(spoke[:, :-1], spoke[:, 1:]), axis=2)
    upto = np.concatenate([np.zeros((len(fan), 1)), np.cumsum(fan, axis=1)], axis=1)
    i, j = np.triu_indices(size, 2)
    i, j = i[j - i < size - 1], j[j - i < size - 1]  # the pair 0, size - 1 is a side
    corner = np.linalg.norm(np.cross(spoke[:, i], spoke[:, j]), axis=2)
    ear = upto[:, j] - upto[:, i] - corner  # twice the area of i, i + 1, ..., j
    choice = np.minimum(ear, upto[:, -1:] - ear).argmax(axis=1)
    groups = []
    for c in np.unique(choice):
        rows = np.flatnonzero(choice == c)
        ring = np.arange(size)
        inner, outer = ring[i[c] : j[c] + 1], np.concatenate([ring[: i[c] + 1], ring[j[c] :]])
        groups += [(polygons[rows][:, inner], owner[rows]), (polygons[rows][:, outer], owner[rows])]
    return groups
