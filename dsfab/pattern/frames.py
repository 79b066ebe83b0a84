"""`Frames`: a tangent frame at every vertex, and how directions are carried along edges from one to the next.

A direction field at the vertices of a surface is a number in each frame. Neighbours are compared after the rotation
that takes the normal of one onto that of the other [Knoeppel et al. 2013, section 6.1.1, on normals of the vertices].
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Complexes, Floats, Ints, cross, unit_vectors
from dsfab.pattern.twisted import TwistedFactors
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
        t1 = unit_vectors(axis - dots(axis, normal)[:, None] * normal)
        return cls(surface, normal, t1, cross(normal, t1), _cotangents(surface))

    @property
    def ends(self) -> Ints:
        """(e, 2) the vertices of every edge."""
        return self.surface.edges.ends

    @cached_property
    def turning(self) -> Floats:
        """(e,) r: a direction at angle a in the frame of the second end is at angle a + r in that of the first."""
        i, j = self.ends.T
        across = cross(self.normal[j], self.normal[i])
        cosine = dots(self.normal[i], self.normal[j])[:, None]
        x = self.t1[j]
        y = x * cosine + cross(across, x) + across * (dots(across, x)[:, None] / (1 + np.maximum(cosine, -0.99)))
        return np.arctan2(dots(y, self.t2[i]), dots(y, self.t1[i]))

    def sides(self, g: Floats, i: Ints, j: Ints) -> Floats:
        """(k,) 1 where tangents g (n, 3) at vertices i and j (k,) point the same way, -1 where one is turned over.

        Which of two that are square to each other is turned over is decided by the surface's sense of turning: by
        rounding it would be another one when the surface is turned.
        """
        turned = g + TIE * cross(self.normal, g)
        return np.where(dots(g[i], turned[j]) < 0, -1.0, 1.0)

    def direction(self, angle: Floats) -> Floats:
        """(n, 3) unit vectors at angles (n,) in the frames."""
        return np.cos(angle)[:, None] * self.t1 + np.sin(angle)[:, None] * self.t2

    def coupling(self, turn: Floats) -> Complexes:
        """(e,) w e^{i turn}: what the numbers at both ends of the edges share when one is the other, turned (e,)."""
        return np.asarray(self.weight * np.exp(1j * turn))

    @cached_property
    def twisted(self) -> TwistedFactors:
        """Factors of matrices that couple the numbers at both ends of every edge."""
        return TwistedFactors(self.surface.V, self.ends)


def dots(a: Floats, b: Floats) -> Floats:
    """(k,) scalar products of a and b (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def corner_sums(surface: Surface, x: Floats) -> Floats:
    """(n,) sums over the corners of values x (m, 3) at the corners of faces."""
    return np.bincount(surface.F.ravel(), x.ravel(), surface.n).astype(np.float64)


def _cotangents(surface: Surface) -> Floats:
    g = hat_gradients(surface)
    after, before = np.roll(g, -1, axis=1), np.roll(g, -2, axis=1)
    opposite = -np.einsum("mci,mci->mc", after, before) * surface.areas[:, None]  # of the edge from corner c + 1
    per_edge = np.bincount(np.roll(surface.edges.of, -1, axis=1).ravel(), opposite.ravel(), len(surface.edges.ends))
    return np.asarray(np.maximum(per_edge, LEAST_WEIGHT * np.median(per_edge)))
