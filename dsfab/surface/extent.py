"""`Extent`: the part of space that a picker means, so that what it picks can end along a line and not at vertices."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from dsfab.arrays import Floats, Ints, cross, lock
from dsfab.surface.mesh import Surface

PARALLEL = 1e-12
"""A line whose volume with two sides of a face is under this share of their lengths runs along the face."""
INSIDE = 1e-9
"""Barycentric rounding: a line meets faces that it passes by this share of them."""


@dataclass(frozen=True, eq=False)
class Extent:
    """A part of space.

    depth   : (k,) metres that points (k, 3) are within it, negative outside.
    creases : (c, 2, 3) segments along which its walls bend; the line in which it meets a surface has corners there.
    width   : metres, the half of it across where it is slender, roughly: what a mesh has to be finer than.
    """

    depth: Callable[[Floats], Floats]
    creases: Floats
    width: float

    def __post_init__(self) -> None:
        lock(self, "creases", np.float64, (None, 2, 3))

    @classmethod
    def union(cls, some: "list[Extent]") -> "Extent":
        """What is within any of several."""
        if len(some) == 1:
            return some[0]
        creases = np.concatenate([one.creases for one in some])
        return cls(lambda P: np.max([one.depth(P) for one in some], axis=0), creases, min(one.width for one in some))

    @classmethod
    def ball(cls, center: Floats, radius: float) -> "Extent":
        """Within a radius of a point (3,), metres."""
        return cls(lambda P: radius - np.linalg.norm(P - center, axis=1), np.empty((0, 2, 3)), radius)

    @classmethod
    def box(cls, low: Floats, high: Floats) -> "Extent":
        """Between two opposite corners (3,), metres."""
        corners = np.array(list(product(*np.stack([low, high], axis=1))))
        edges = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b).bit_count() == 1]
        middle, half = (low + high) / 2, (high - low) / 2

        def depth(P: Floats) -> Floats:
            off = np.abs(P - middle) - half
            return np.asarray(-np.linalg.norm(np.maximum(off, 0), axis=1) - np.minimum(off.max(axis=1), 0))

        return cls(depth, corners[np.array(edges)], float(np.sort(half)[1]))

    @classmethod
    def below(cls, direction: Floats, height: float, width: float) -> "Extent":
        """Where the product with a unit direction (3,) is under a height, metres."""
        return cls(lambda P: height - P @ direction, np.empty((0, 2, 3)), width)


def pierced(surface: Surface, a: Floats, b: Floats) -> tuple[Ints, Floats]:
    """(k,) faces that the segment from a to b (3,), metres, meets, and (k,) how far along it, 0 to 1, in this order.

    A face that it runs along counts as not met [Moeller and Trumbore 1997].
    """
    P, Q, R = (surface.V[surface.F[:, k]] for k in range(3))
    ray, u, v = np.broadcast_to(b - a, P.shape), Q - P, R - P
    normal, to = cross(ray, v), a - P
    volume = np.einsum("mi,mi->m", u, normal)
    least = PARALLEL * np.linalg.norm(b - a) * np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    safe = np.where(np.abs(volume) > least, volume, np.inf)
    one, side = np.einsum("mi,mi->m", to, normal) / safe, cross(to, u)
    two, t = np.einsum("mi,mi->m", ray, side) / safe, np.einsum("mi,mi->m", v, side) / safe
    met = np.isfinite(safe) & (one >= -INSIDE) & (two >= -INSIDE) & (one + two <= 1 + INSIDE) & (t >= 0) & (t <= 1)
    faces = np.flatnonzero(met)
    order = np.argsort(t[faces], kind="stable")
    return faces[order], t[faces[order]]
