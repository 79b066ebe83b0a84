"""Vertices at one place that are no seam: there two sheets of a mesh, or one with itself, pass through each other.

A seam has an open edge at one side at least. Where faces close around both vertices there is nothing to sew, and made
one they would give four faces to each edge along the crossing, two of which would have to go:

       \\ /           |
        x      not   +      Sheets that are there twice lie on each other instead: their faces repeat, and are sewn.
       / \\           |
"""

import numpy as np

from dsfab.arrays import Bools, Ints
from dsfab.surface.topology import connected, edge_table


def crossings(F: Ints, pairs: Ints) -> Bools:
    """(p,) which pairs (p, 2) of vertices at one place lie where sheets of faces F (m, 3) cross.

    They are inner vertices of both, and the ends of such a crossing at the edges of both.
    """
    edges = edge_table(F)
    n = int(max(F.max(), pairs.max())) + 1
    inner = np.zeros(n, dtype=bool)
    inner[F] = True
    inner[edges.ends[edges.count != 2]] = False
    low, high = np.sort(pairs, axis=1).T
    key = edges.ends[:, 0] * n + edges.ends[:, 1]
    found = inner[low] & inner[high] & ~np.isin(low * n + high, key)
    if not found.any():
        return np.asarray(found)
    twice = _twice(F, connected(n, low, high)[1])
    found &= ~(twice[low] & twice[high])
    return np.asarray(found | _ends(edges.ends, pairs, found))


def _twice(F: Ints, became: Ints) -> Bools:
    """(n,) vertices of faces that repeat others once vertices are what they `became` (n,)."""
    _, same, count = np.unique(np.sort(became[F], axis=1), axis=0, return_inverse=True, return_counts=True)
    twice = np.zeros(len(became), dtype=bool)
    twice[F[(count > 1)[same.ravel()]]] = True
    return twice


def _ends(edges: Ints, pairs: Ints, found: Bools) -> Bools:
    """(p,) which of the other pairs are neighbours, along edges (e, 2) on both sides, of one that was found."""
    near: dict[int, set[int]] = {}
    for a, b in edges[np.isin(edges, pairs[found]).any(axis=1)].tolist():
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    other: dict[int, list[int]] = {}
    for one, both in enumerate(pairs.tolist()):
        for vertex in () if found[one] else both:
            other.setdefault(vertex, []).append(one)
    ends = np.zeros(len(pairs), dtype=bool)
    for a, b in pairs[found].tolist():
        for c in near[a]:
            for one in other.get(c, ()):
                ends[one] |= int(pairs[one].sum()) - c in near[b]
    return ends
