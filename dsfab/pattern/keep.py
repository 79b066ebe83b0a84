"""Regions that stay material whatever the stripes say: around loads and supports, and along the boundary."""

import igl
import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface


def distance_to_vertices(surface: Surface, vertices: Bools) -> Floats:
    """(n,) straight distance, metres, to what the marked vertices span: their faces, their edges, themselves."""
    ends = surface.edges.ends
    simplices = (
        surface.F[vertices[surface.F].all(axis=1)],
        ends[vertices[ends].all(axis=1)],
        np.flatnonzero(vertices)[:, None],
    )
    return _distance(surface, simplices)


def distance_to_boundary(surface: Surface) -> Floats:
    """(n,) straight distance, metres, to the boundary edges; infinite on a closed surface."""
    return _distance(surface, (surface.edges.ends[surface.edges.boundary],))


def _distance(surface: Surface, simplices: tuple[Ints, ...]) -> Floats:
    squared = np.full(surface.n, np.inf)
    for group in simplices:
        if len(group):
            squared = np.minimum(squared, igl.point_mesh_squared_distance(surface.V, surface.V, group)[0])
    return np.asarray(np.sqrt(squared))
