"""The smooth surface through the vertices of a mesh: a cubic patch on each facet, flat along boundaries and creases."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, face_angles, lengths
from dsfab.surface.creases import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corner_fans

CORNERS = ((0, 1), (1, 2), (2, 0))
"""The half-edges of a face, by its corners."""


class SmoothPatches:
    """Curved point-normal triangles on the facets of a surface [Vlachos et al. 2001, PN triangles].

    The normals at a vertex on a crease are those of each side of it; along boundaries and creases the patches follow
    the straight edges, so that curves stay where they are.
    """

    def __init__(self, surface: Surface) -> None:
        self._V, self._F = surface.V, surface.F
        features = feature_edges(surface)
        normals = _corner_normals(surface, features)
        self._controls = _controls(surface.V[surface.F], normals, features[surface.edges.of])

    def points(self, face: Ints, place: Floats) -> Floats:
        """(k, 3) the points of the patches above places (k, 3) of faces (k,), metres."""
        P = self._V[self._F[face]]
        b = barycentric(P, place)
        controls = self._controls[face]
        result = np.einsum("kc,kci->ki", b**3, P)
        for k, (i, j) in enumerate(CORNERS):
            result += 3 * (b[:, i] ** 2 * b[:, j])[:, None] * controls[:, 2 * k]
            result += 3 * (b[:, i] * b[:, j] ** 2)[:, None] * controls[:, 2 * k + 1]
        edges = controls.mean(axis=1)
        middle = edges + (edges - P.mean(axis=1)) / 2
        return np.asarray(result + 6 * b.prod(axis=1)[:, None] * middle)


def barycentric(P: Floats, place: Floats) -> Floats:
    """(k, 3) coordinates of places (k, 3) in triangles P (k, 3 corners, 3)."""
    areas = np.stack(
        [lengths(np.cross(P[:, (c + 1) % 3] - place, P[:, (c + 2) % 3] - place)) for c in range(3)], axis=1
    )
    return np.asarray(areas / areas.sum(axis=1, keepdims=True))


def _controls(P: Floats, normals: Floats, straight: Bools) -> Floats:
    """(m, 6, 3) two control points on each edge of triangles P (m, 3, 3): thirds of it, in the planes of the normals
    (m, 3, 3) at their ends; on `straight` edges (m, 3) just thirds."""
    controls = np.empty((len(P), 6, 3))
    for k, ends in enumerate(CORNERS):
        for end, (i, j) in enumerate((ends, ends[::-1])):
            off = np.einsum("mi,mi->m", P[:, j] - P[:, i], normals[:, i])
            off[straight[:, k]] = 0
            controls[:, 2 * k + end] = (2 * P[:, i] + P[:, j] - off[:, None] * normals[:, i]) / 3
    return controls


def _corner_normals(surface: Surface, features: Bools) -> Floats:
    """(m, 3 corners, 3) unit normals: the mean of the faces around a vertex up to the next features (e,), weighted by
    their angles there."""
    fan = corner_fans(surface.F, surface.edges, apart=features).ravel()
    count = int(fan.max()) + 1
    weighted = (face_angles(surface.V, surface.F)[:, :, None] * surface.normals[:, None]).reshape(-1, 3)
    total: Floats = np.stack([np.bincount(fan, x, minlength=count).astype(np.float64) for x in weighted.T], axis=1)
    return np.asarray((total / lengths(total)[:, None])[fan].reshape(-1, 3, 3))
