"""`SmoothSurface`: a smooth surface through the vertices of a triangle mesh, where finer meshes find their points."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, lock
from dsfab.slicing import three_each
from dsfab.surface import Surface

CREASE = np.cos(np.radians(30))
"""A face that leans more than 30 degrees from the mean normal at a vertex keeps its own normal there: a crease."""


@dataclass(frozen=True, eq=False)
class SmoothSurface:
    """Every face bent to a quadratic patch over its barycentric coordinates: p + sum over edges of 4 l_i l_j bulge.

    surface : the flat faces.
    bulge   : (e, 3) how far the middle of each edge leaves its chord, metres. Flat faces and creases stay.

    The middle of an edge from a to b is that of the cubic which leaves a and b at right angles to the normals there
    [Vlachos, Peters, Boyd and Mitchell 2001]:  bulge = ((a - b) . n_a n_a + (b - a) . n_b n_b) / 8. It is the same
    whichever side the normals point to, and belongs to the edge, so that patches meet without gaps.
    """

    surface: Surface
    bulge: Floats

    def __post_init__(self) -> None:
        lock(self, "bulge", np.float64, (len(self.surface.edges.ends), 3))

    @classmethod
    def through(cls, surface: Surface) -> "SmoothSurface":
        """The smooth surface through the vertices of `surface`."""
        normals, F, edges = _corner_normals(surface), surface.F, surface.edges
        start, end = F, np.roll(F, -1, axis=1)
        chord = surface.V[end] - surface.V[start]  # (m, half-edge, 3)
        n_a, n_b = normals, np.roll(normals, -1, axis=1)
        bent = (_along(chord, n_b) - _along(chord, n_a)) / 8
        total = np.stack([np.bincount(edges.of.ravel(), bent[..., k].ravel()) for k in range(3)], axis=1)
        return cls(surface, total / edges.count[:, None])

    def points(self, weights: csr_array) -> Floats:
        """(k, 3) metres: the points with barycentric weights (k, n), at most three in a row, all within one face."""
        flat = np.asarray(weights @ self.surface.V)
        if not self.bulge.any():
            return flat
        edges, (column, weight) = self.surface.edges, three_each(weights)
        for i, j in ((0, 1), (1, 2), (0, 2)):
            product = 4 * weight[:, i] * weight[:, j]
            between = np.flatnonzero(product > 0)
            flat[between] += product[between, None] * self.bulge[edges.between(column[between, i], column[between, j])]
        return flat


def _along(chord: Floats, normal: Floats) -> Floats:
    return np.asarray((chord * normal).sum(axis=-1, keepdims=True) * normal)


def _corner_normals(surface: Surface) -> Floats:
    """(m, 3, 3) unit normals at the corners of each face: the mean around the vertex, or the face's own at a crease."""
    corner, face = surface.F.ravel(), np.repeat(np.arange(surface.m), 3)
    first = np.zeros(surface.n, dtype=np.int64)
    first[corner[::-1]] = face[::-1]
    own = surface.normals[face]
    # around a vertex of a one-sided sheet the faces disagree: all are turned as the first one is
    side = np.where((own * surface.normals[first[corner]]).sum(axis=1) < 0, -1.0, 1.0)
    weighted = own * (side * surface.areas[face])[:, None]
    mean = np.stack([np.bincount(corner, weighted[:, k], surface.n) for k in range(3)], axis=1)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    smooth = np.abs((own * mean[corner]).sum(axis=1)) > CREASE
    return np.asarray(np.where(smooth[:, None], mean[corner], own).reshape(-1, 3, 3))
