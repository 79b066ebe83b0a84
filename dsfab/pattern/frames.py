"""`Frames`: a tangent frame at every vertex, and how directions are carried along edges from one to the next.

A direction field at the vertices of a surface is a number in each frame. Neighbours are compared after the rotation
that takes the normal of one onto that of the other [Knoeppel et al. 2013, section 6.1.1, on normals of the vertices].
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Floats, Ints, cross
from dsfab.sparse import OnePattern
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
        square = cross(self.normal[j], g[j])
        return np.where(dots(g[i], g[j]) + TIE * dots(g[i], square) < 0, -1.0, 1.0)

    def direction(self, angle: Floats) -> Floats:
        """(n, 3) unit vectors at angles (n,) in the frames."""
        return np.cos(angle)[:, None] * self.t1 + np.sin(angle)[:, None] * self.t2

    def twisted(self, turn: Floats, sign: Floats | float = 1.0) -> Floats:
        """(4, e) the part between both ends of x^T K x = sum over edges (i, j) of w |x_i - R(turn) C x_j|^2.

        R turns by an angle (e,), radians; C is the complex conjugate where sign (e,) is -1 [Knoeppel et al. 2015, eq.
        8]. w R C as real numbers: row by row what each part of x_i takes from each part of x_j.
        """
        c, s = self.weight * np.cos(turn), self.weight * np.sin(turn)
        return np.stack([c, -sign * s, s, sign * c])

    @cached_property
    def one_number(self) -> OnePattern:
        """Factors of matrices that couple the numbers at both ends of every edge."""
        return OnePattern(self.surface.V)

    @cached_property
    def two_numbers(self) -> "TwistedFactors":
        """The same with two numbers at every vertex."""
        return TwistedFactors(self.surface.V, self.ends)


class TwistedFactors:
    """Factors of twisted Laplacians on points V (n, 3) and edges (e, 2), which have one pattern: it is analysed once.

    Inside, both parts of a complex number stand one after the other: a solver finds blocks of two then.
    """

    def __init__(self, V: Floats, ends: Ints) -> None:
        n = len(V)
        i, j = 2 * ends.T
        parts = ((0, 0), (0, 1), (1, 0), (1, 1))
        rows = np.concatenate([i + a for a, _ in parts] + [j + b for _, b in parts] + [np.arange(2 * n)])
        columns = np.concatenate([j + b for _, b in parts] + [i + a for a, _ in parts] + [np.arange(2 * n)])
        place = coo_array((np.arange(1, len(rows) + 1), (rows, columns)), shape=(2 * n, 2 * n)).tocsr()
        self._place, self._indices, self._indptr = place.data - 1, place.indices, place.indptr
        self._ends, self._n = ends, n
        self._pattern = OnePattern(V, np.repeat(np.arange(n), 2), many_solves=True)

    def matrix(self, twisted: Floats, diagonal: Floats) -> csr_array:
        """(2 n, 2 n) K + diagonal (2 n,), both parts of each number one after the other; see `Frames.twisted`.

        diagonal : real parts, then imaginary ones.
        """
        n = self._n
        weight = np.hypot(twisted[0], twisted[2])
        whole = np.bincount(self._ends.ravel(), np.repeat(weight, 2), n) + diagonal.reshape(2, n)
        values = np.concatenate([-twisted.ravel(), -twisted.ravel(), whole.T.ravel()])
        return csr_array((values[self._place], self._indices, self._indptr), shape=(2 * n, 2 * n))

    def factor(self, twisted: Floats, diagonal: Floats) -> Callable[[Floats], Floats]:
        """b -> (K + diagonal)^-1 b until the next one is asked for; b (2 n,) is real parts, then imaginary ones."""
        solve = self._pattern.factor(self.matrix(twisted, diagonal))
        return lambda b: solve(b.reshape(2, -1).T.ravel()).reshape(-1, 2).T.ravel()


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
