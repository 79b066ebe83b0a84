"""The nearest places of a mesh to points."""

from typing import NamedTuple

import igl
import numpy as np

from dsfab.arrays import Floats, Ints


class NearestPlaces(NamedTuple):
    """Of points (k,): squared distance, in the mesh's unit squared; the simplex that is nearest; the place (k, 3)."""

    squared: Floats
    simplex: Ints
    place: Floats

    @property
    def distance(self) -> Floats:
        """(k,) in the mesh's unit."""
        return np.sqrt(self.squared)


def nearest(points: Floats, V: Floats, simplices: Ints) -> NearestPlaces:
    """The places nearest to points (k, 3) on triangles (m, 3), edges (m, 2) or vertices (m, 1) of V (n, 3); m > 0.

    By a tree of boxes [Jacobson et al. 2018, libigl].
    """
    if not len(points):
        return NearestPlaces(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    given = (np.ascontiguousarray(x) for x in (points, V, simplices))
    squared, simplex, place = igl.point_mesh_squared_distance(*given)
    return NearestPlaces(np.asarray(squared), np.asarray(simplex, dtype=np.int64), np.asarray(place))


def weights_at(places: Floats, V: Floats, corners: Ints) -> Floats:
    """(k, 3) barycentric weights of places (k, 3) in triangles with corners (k, 3) of V (n, 3)."""
    return np.asarray(igl.barycentric_coordinates(places, *(np.ascontiguousarray(V[corners[:, i]]) for i in range(3))))
