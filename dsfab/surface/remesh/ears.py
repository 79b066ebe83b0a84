"""`with_ears_turned`: slivers that a curved border cuts off are no part of a surface's shape."""

import numpy as np

from dsfab.arrays import Floats, Ints, lengths
from dsfab.surface.edge_changes import has_new_diagonal, quads, with_other_diagonals
from dsfab.surface.mesh import Surface

BLUNT = 150.0
"""Degrees at the tip of a triangle with two border edges from which that is an ear."""


def with_ears_turned(surface: Surface) -> Surface:
    """The surface whose ears, flat triangles with all three corners on a curved border, share their tip with the face
    behind: the edge between both is turned.

    A mesh of a disc has them where a grid's corner or a Delaunay triangulation comes to lie on the border. Such a one
    spans two chords of the border alone, and the sheet seems to have a crease there that its shape has not.
    """
    edges, n = surface.edges, surface.n
    pairs = edges.pairs
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    bare = edges.boundary[edges.of].reshape(-1, 3).sum(axis=1) == 2
    quad = quads(surface.F, pairs)
    a, b, c, d = quad.T
    alike = surface.F.ravel()[pairs[:, 1]] == b  # two faces that are turned alike run along their edge both ways
    ear = bare[pairs[:, 0] // 3] & ~bare[pairs[:, 1] // 3] & alike & has_new_diagonal(quad, edges, n)
    ear &= _angles(surface.V, a, c, b) > np.radians(BLUNT)
    ear &= (_angles(surface.V, b, a, c) + _angles(surface.V, b, a, d) < np.pi) & (
        _angles(surface.V, a, b, c) + _angles(surface.V, a, b, d) < np.pi
    )
    chosen = np.flatnonzero(ear)
    behind = pairs[chosen, 1] // 3
    chosen = chosen[np.unique(behind, return_index=True)[1]]  # of two ears at one face the first
    if not len(chosen):
        return surface
    return Surface(surface.V, with_other_diagonals(surface.F, pairs[chosen], quad[chosen]))


def _angles(V: Floats, one: Ints, at: Ints, other: Ints) -> Floats:
    """(k,) radians between the ways from vertices `at` (k,) to `one` and `other`."""
    p, q = V[one] - V[at], V[other] - V[at]
    return np.asarray(np.arctan2(lengths(np.cross(p, q)), np.einsum("ki,ki->k", p, q)))
