"""`flipped`: edges turned within the two faces beside them, where these are in one plane, nearly, and get better."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, cross, lengths
from dsfab.surface.edge_changes import has_new_diagonal, quads
from dsfab.surface.mesh import Surface

BETTER = 1.0
"""Degrees that the smallest angle of two faces has to gain."""
ROUNDS = 8
"""How often edges are turned at most: each time those that do not share a face."""


def flipped(surface: Surface, may: Bools, stays: Ints, close: float) -> Surface:
    """The surface with edges turned, so that smallest angles grow.

    may   : (n,) only faces with a corner among these change.    stays : (k, 2) vertices, edges between which stay.
    close : metres that the surface may move by at most.
    """
    keys = _keys(surface.n, *stays.T)
    for _ in range(ROUNDS):
        F = _turned(surface, may, keys, close)
        if F is None:
            break
        surface = Surface(surface.V, F)
    return surface


def _keys(n: int, a: Ints, b: Ints) -> Ints:
    """(k,) one number for each edge between vertices (k,), whichever comes first."""
    return np.asarray(np.minimum(a, b) * n + np.maximum(a, b))


def _turned(surface: Surface, may: Bools, stays: Ints, close: float) -> Ints | None:
    """(m, 3) faces after one round, or None where no edge is turned."""
    V, F, edges = surface.V, surface.F, surface.edges
    h = edges.pairs
    quad = quads(F, h)
    a, b, c, d = quad.T
    some = (F.ravel()[h[:, 1]] == b) & ~np.isin(_keys(surface.n, a, b), stays) & (may[a] | may[b] | may[c] | may[d])
    h, quad = h[some], quad[some]
    a, b, c, d = quad.T
    gain = np.minimum(_smallest_angle(V, d, c, a), _smallest_angle(V, c, d, b))
    gain -= np.minimum(_smallest_angle(V, a, b, c), _smallest_angle(V, b, a, d))
    gain[~_fit(surface, h // 3, quad, close)] = -np.inf
    best = np.full(surface.m, BETTER)
    np.maximum.at(best, (h // 3).ravel(), np.repeat(gain, 2))
    chosen = np.flatnonzero((gain > BETTER) & (gain[:, None] == best[h // 3]).all(axis=1))
    one, two = h[chosen].T // 3
    first = np.unique(np.concatenate([one, two]), return_index=True)[1]  # of equal gains at one face the first
    once = np.zeros(2 * len(chosen), dtype=bool)
    once[first] = True
    chosen = chosen[once[: len(chosen)] & once[len(chosen) :]]
    if not len(chosen):
        return None
    F = F.copy()
    F[h[chosen, 0] // 3] = np.column_stack([d, c, a])[chosen]
    F[h[chosen, 1] // 3] = np.column_stack([c, d, b])[chosen]
    return F


def _fit(surface: Surface, faces: Ints, quad: Ints, close: float) -> Bools:
    """(k,) whether two faces (k, 2) around an edge a-b, quads (k, 4), may have the edge c-d instead: it is no edge
    yet, lies within `close` of them, and neither turns over."""
    a, b, c, d = (surface.V[k] for k in quad.T)
    across = cross(b - a, d - c)
    off = np.abs(np.einsum("ki,ki->k", across, c - a)) / np.maximum(lengths(across), np.finfo(float).tiny)
    normal = surface.normals[faces].sum(axis=1)
    turns = [np.einsum("ki,ki->k", cross(q - p, r - p), normal) for p, q, r in ((d, c, a), (c, d, b))]
    new = has_new_diagonal(quad, surface.edges, surface.n)
    return np.asarray(new & (off <= close) & (turns[0] > 0) & (turns[1] > 0))


def _smallest_angle(V: Floats, a: Ints, b: Ints, c: Ints) -> Floats:
    """(k,) degrees, of triangles with corners a, b, c (k,)."""
    P = np.stack([V[a], V[b], V[c]])
    sides = np.roll(P, -1, axis=0) - P
    size = np.maximum(lengths(sides), np.finfo(float).tiny)
    cosine = -np.einsum("ski,ski->sk", sides, np.roll(sides, 1, axis=0)) / (size * np.roll(size, 1, axis=0))
    return np.asarray(np.degrees(np.arccos(np.clip(cosine.max(axis=0), -1, 1))))
