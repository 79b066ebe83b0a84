"""Edges that a change of the mesh must keep: boundaries and creases."""

import numpy as np

from dsfab.arrays import Bools
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges

CREASE = 30.0
"""Degrees between the normals of neighbours from which their edge is a crease."""


def feature_edges(surface: Surface) -> Bools:
    """(e,) edges on the boundary, at a crease, or where neighbours face opposite sides."""
    return border_edges(surface) | sharp_edges(surface)


def border_edges(surface: Surface) -> Bools:
    """(e,) edges on the boundary, or where neighbours face opposite sides."""
    marks = surface.edges.boundary.copy()
    marks[misoriented_edges(surface.F, surface.edges)] = True
    return marks


def sharp_edges(surface: Surface) -> Bools:
    """(e,) edges of two faces whose normals are `CREASE` apart or more."""
    marks = np.zeros(len(surface.edges.ends), dtype=bool)
    one, two = surface.normals[surface.edges.pairs // 3].transpose(1, 0, 2)
    marks[surface.edges.count == 2] = np.einsum("ei,ei->e", one, two) < np.cos(np.radians(CREASE))
    return marks
