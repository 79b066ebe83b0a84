"""`with_ears_turned`: slivers that a curved border cuts off are no part of a surface's shape."""

import numpy as np

from dsfab.surface.edge_changes import has_new_diagonal, quads, with_other_diagonals
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.flip import angle_at

BLUNT = 150.0
"""Degrees at the tip of a triangle with two border edges from which that is an ear."""


def with_ears_turned(surface: Surface) -> Surface:
    """The surface whose ears, flat triangles with all three corners on a curved border, share their tip with the face
    behind: the edge between both is turned.

    A mesh of a disc has them where a grid's corner or a Delaunay triangulation comes to lie on the border. Such a one
    spans two chords of the border alone, and the sheet seems to have a crease there that its shape has not.
    """
    edges, n = surface.edges, surface.n
    pairs = np.concatenate([edges.pairs, edges.pairs[:, ::-1]])
    bare = edges.boundary[edges.of].reshape(-1, 3).sum(axis=1) == 2
    quad = quads(surface.F, pairs)
    a, b, c, d = quad.T
    alike = surface.F.ravel()[pairs[:, 1]] == b  # two faces that are turned alike run along their edge both ways
    ear = bare[pairs[:, 0] // 3] & ~bare[pairs[:, 1] // 3] & alike & has_new_diagonal(quad, edges, n)
    ear &= angle_at(surface.V, c, a, b) > np.radians(BLUNT)
    for one, two in ((a, b), (b, a)):  # both new faces lie like the old ones
        ear &= angle_at(surface.V, one, two, c) + angle_at(surface.V, one, two, d) < np.pi
    chosen = np.flatnonzero(ear)
    behind = pairs[chosen, 1] // 3
    chosen = chosen[np.unique(behind, return_index=True)[1]]  # of two ears at one face the first
    if not len(chosen):
        return surface
    return Surface(surface.V, with_other_diagonals(surface.F, pairs[chosen], quad[chosen]))
