"""`Windows`: what sources see through the edges of a mesh, in planes that it unfolds into (see `geodesic`)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints

SLACK = 1e-10
"""Rounding, as a share of the lengths, areas and angles that are compared."""


@dataclass(frozen=True, eq=False)
class Windows:
    """What sources see through edges, in the plane of each source: rows of numbers that are moved together.

    names  : (k, 5) see `edge` to `parallel`.    values : (k, 7) see `at_a` to `offset`.
    """

    names: Ints
    values: Floats

    @classmethod
    def of(
        cls, names: Sequence[Ints | Bools], A: Floats, B: Floats, start: Floats, end: Floats, offset: Floats
    ) -> "Windows":
        """Windows of five names (k,) each, from A (k, 2) to B (k, 2), metres, with start, end and offset (k,)."""
        numbers = np.stack([*A.T, *B.T, start, end, offset], axis=1)
        return cls(np.stack(names, axis=1), numbers)

    @property
    def edge(self) -> Ints:
        """(k,) the edges."""
        return self.names[:, 0]

    @property
    def face(self) -> Ints:
        """(k,) the faces that they are seen through; -1 for none."""
        return self.names[:, 1]

    @property
    def a(self) -> Ints:
        """(k,) the first vertices of the edges."""
        return self.names[:, 2]

    @property
    def b(self) -> Ints:
        """(k,) the other vertices."""
        return self.names[:, 3]

    @property
    def parallel(self) -> Bools:
        """(k,) whether the source is the line y = 0; it is the point (0, 0) otherwise."""
        return np.asarray(self.names[:, 4] > 0)

    @property
    def at_a(self) -> Floats:
        """(k, 2) where the first vertices are; sources are on the right of the way from A to B."""
        return self.values[:, 0:2]

    @property
    def at_b(self) -> Floats:
        """(k, 2) where the other vertices are."""
        return self.values[:, 2:4]

    @property
    def start(self) -> Floats:
        """(k,) P0 = A + start (B - A)."""
        return self.values[:, 4]

    @property
    def end(self) -> Floats:
        """(k,) P1 = A + end (B - A)."""
        return self.values[:, 5]

    @property
    def offset(self) -> Floats:
        """(k,) metres to be added to the distance from the source."""
        return self.values[:, 6]

    def at(self, which: Ints | Bools) -> "Windows":
        """Those that are marked (k,), or of these numbers."""
        return Windows(self.names[which], self.values[which])

    @classmethod
    def together(cls, some: Sequence["Windows"]) -> "Windows":
        """All windows of several, one behind the other."""
        return cls(np.concatenate([part.names for part in some]), np.concatenate([part.values for part in some]))

    def place(self, t: Floats) -> Floats:
        """(k, 2) A + t (B - A)."""
        return np.asarray(self.at_a + t[:, None] * (self.at_b - self.at_a))

    def distance(self, P: Floats) -> Floats:
        """(k,) of places (k, 2)."""
        return np.asarray(self.offset + np.where(self.parallel, P[:, 1], np.hypot(P[:, 0], P[:, 1])))

    def nearest(self) -> Floats:
        """(k,) the least distance within each."""
        P, Q = self.place(self.start), self.place(self.end)
        along = Q - P
        foot = np.clip(-dot2(P, along) / np.maximum(dot2(along, along), np.finfo(float).tiny), 0, 1)
        foot[self.parallel] = along[self.parallel, 1] < 0
        return self.distance(P + foot[:, None] * along)

    def rays(self, P: Floats) -> Floats:
        """(k, 2) the ways that rays go at places (k, 2)."""
        return np.where(self.parallel[:, None], (0.0, 1.0), P)

    def left(self, t: Floats, C: Floats) -> Floats:
        """(..., k) how far C (..., k, 2) is on the left of the ray through A + t (B - A), times a length; 0 within
        rounding."""
        P = self.place(t)
        ray = self.rays(P)
        off = cross2(ray, C - P)
        return np.where(np.abs(off) <= SLACK * size2(ray) * (size2(C) + size2(P)), 0.0, off)


def share(one: Floats, two: Floats) -> Floats:
    """(k,) where something that goes from one sign to the other, linearly, is zero, of the way from `one` (k,) to
    `two` (k,)."""
    span = one - two
    return np.divide(one, span, out=np.zeros_like(one), where=span != 0)


def size2(a: Floats) -> Floats:
    """(...) lengths of a (..., 2), roughly: |x| + |y|."""
    return np.asarray(np.abs(a[..., 0]) + np.abs(a[..., 1]))


def cross2(a: Floats, b: Floats) -> Floats:
    """(...) cross products of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def dot2(a: Floats, b: Floats) -> Floats:
    """(...) scalar products of a and b (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])
