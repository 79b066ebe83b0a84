"""`Frames`: a tangent frame at every vertex, and how directions are carried along edges from one to the next.

A direction field at the vertices of a surface is a number in each frame. Neighbours are compared after the rotation
that takes the normal of one onto that of the other [Knoeppel et al. 2013, section 6.1.1, on normals of the vertices].
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Floats, Ints
from dsfab.surface.hats import hat_gradients
from dsfab.surface.mesh import Surface

LEAST_WEIGHT = 0.05
"""Cotangent weights are at least this share of their median: negative ones of obtuse triangles would turn phases."""

TIE = 1e-7
"""Directions are taken to be turned by this angle, radians, when it is asked whether they point the same way."""


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames at the vertices of an oriented surface.

    normal, t1, t2 : (n, 3) right-handed and orthonormal.
    weight         : (e,) cotangent weights of the edges, not negative.
    """

    surface: Surface
    normal: Floats
    t1: Floats
    t2: Floats
    weight: Floats

    @classmethod
    def of(cls, surface: Surface) -> Self:
        """The first axis is that of x or y which is clear of the normal: no result depends on the choice."""
        normal = surface.vertex_normals.copy()
        normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
        axis = np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        t1 = unit(axis - dots(axis, normal)[:, None] * normal)
        return cls(surface, normal, t1, np.cross(normal, t1), _cotangents(surface))

    @property
    def ends(self) -> Ints:
        """(e, 2) the vertices of every edge."""
        return self.surface.edges.ends

    @cached_property
    def turning(self) -> Floats:
        """(e,) r: a direction at angle a in the frame of the second end is at angle a + r in that of the first."""
        i, j = self.ends.T
        across = np.cross(self.normal[j], self.normal[i])
        cosine = dots(self.normal[i], self.normal[j])[:, None]
        x = self.t1[j]
        y = x * cosine + np.cross(across, x) + across * (dots(across, x)[:, None] / (1 + np.maximum(cosine, -0.99)))
        return np.arctan2(dots(y, self.t2[i]), dots(y, self.t1[i]))

    def sides(self, g: Floats, i: Ints, j: Ints) -> Floats:
        """(k,) 1 where tangents g (n, 3) at vertices i and j (k,) point the same way, -1 where one is turned over.

        Which of two that are square to each other is turned over is decided by the surface's sense of turning: by
        rounding it would be another one when the surface is turned.
        """
        square = np.cross(self.normal[j], g[j])
        return np.where(dots(g[i], g[j]) + TIE * dots(g[i], square) < 0, -1.0, 1.0)

    def direction(self, angle: Floats) -> Floats:
        """(n, 3) unit vectors at angles (n,) in the frames."""
        return np.cos(angle)[:, None] * self.t1 + np.sin(angle)[:, None] * self.t2

    def laplacian(self, transport: Floats) -> csr_array:
        """(2 n, 2 n) real form of sum w |x_i - R x_j|^2 over the edges, R turning by the angles `transport` (e,)."""
        return twisted_laplacian(self.surface.n, self.ends, self.weight, transport, np.ones(len(self.weight)))


def twisted_laplacian(n: int, ends: Ints, weight: Floats, turn: Floats, sign: Floats) -> csr_array:
    """(2 n, 2 n) K with x^T K x = sum over edges (i, j) of w |x_i - R(turn) C x_j|^2, x = real parts, then imaginary.

    R turns by an angle, radians; C is the complex conjugate where sign is -1 [Knoeppel et al. 2015, eq. 8].
    """
    i, j = ends.T
    c, s = weight * np.cos(turn), weight * np.sin(turn)
    blocks = ((0, 0, c), (0, 1, -sign * s), (1, 0, s), (1, 1, sign * c))  # of R C: row part, column part, value
    rows, columns, values = [i, j, i + n, j + n], [i, j, i + n, j + n], [weight] * 4
    for a, b, value in blocks:
        rows += [i + a * n, j + b * n]
        columns += [j + b * n, i + a * n]
        values += [-value, -value]
    at = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(values), at), shape=(2 * n, 2 * n)).tocsr()


def dots(a: Floats, b: Floats) -> Floats:
    """(k,) scalar products of a and b (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def unit(x: Floats) -> Floats:
    """Vectors (..., 3) at length 1."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), np.finfo(float).tiny))


def corner_sums(surface: Surface, x: Floats) -> Floats:
    """(n,) sums over the corners of values x (m, 3) at the corners of faces."""
    return np.bincount(surface.F.ravel(), x.ravel(), surface.n).astype(np.float64)


def _cotangents(surface: Surface) -> Floats:
    g = hat_gradients(surface)
    after, before = np.roll(g, -1, axis=1), np.roll(g, -2, axis=1)
    opposite = -np.einsum("mci,mci->mc", after, before) * surface.areas[:, None]  # of the edge from corner c + 1
    per_edge = np.bincount(np.roll(surface.edges.of, -1, axis=1).ravel(), opposite.ravel(), len(surface.edges.ends))
    return np.asarray(np.maximum(per_edge, LEAST_WEIGHT * np.median(per_edge)))
