"""Mirrors through a surface's middle, and the groups that they generate: where they may be, and images under them."""

from collections.abc import Iterator, Sequence

import numpy as np

from dsfab.arrays import Floats, lengths
from dsfab.surface.mesh import Surface

LARGEST_GROUP = 240
"""Elements of the largest group that is accepted: twice those of the icosahedron, and some room."""
SNAP = 1e-6
"""Entries of matrices that differ by less are the same."""
CLEAR = 1e-2
"""Moments of inertia that differ by less than this share of the largest are the same."""
FAR = 1e-3
"""Points are as far as the farthest, to this share of the surface's size."""
PLANES = 24
"""Mirrors through an axis that are tried: through the farthest points from it, and between two of them."""


def mirror(normal: Floats) -> Floats:
    """(3, 3) the mirror across the plane with a unit normal (3,)."""
    return np.eye(3) - 2 * np.outer(normal, normal)


def centroid(surface: Surface) -> Floats:
    """(3,) of the area, metres."""
    return np.asarray(surface.areas @ surface.centroids / surface.area)


def round_axis(surface: Surface, axes: Floats) -> Floats | None:
    """The one of the axes, (3, 3) orthonormal rows, around which the inertia of the area is the same, or None."""
    x = surface.centroids - centroid(surface)
    inertia = [float(surface.areas @ (x @ axis) ** 2) for axis in axes]
    for k in range(3):
        i, j = (inertia[(k + step) % 3] for step in (1, 2))
        if abs(i - j) < CLEAR * max(inertia):
            return np.asarray(axes[k])
    return None


def far_directions(x: Floats, size: float, count: int = 1) -> Floats:
    """(k, 3) unit directions from the axis to the points that are farthest from it, of x (n, 3) across the axis.

    count : how many points there are to be, at least; those that are as far as the last are taken too.
    """
    distance = lengths(x)
    least = np.partition(distance, -count)[-count]
    far = np.flatnonzero(distance > least - FAR * size)
    return np.asarray(x[far] / distance[far, None])


def planes_through(axis: Floats, far: Floats) -> Iterator[Floats]:
    """Normals of mirrors through an axis that may take directions far (k, 3) to each other."""
    for direction in far[:PLANES]:
        for through in (far[0] + direction, np.cross(axis, far[0] + direction)):
            if (length := np.linalg.norm(through)) > CLEAR:
                yield np.cross(axis, through / length)


def generated_group(generators: Sequence[Floats], largest: int = LARGEST_GROUP) -> Floats:
    """(g, 3, 3) all products of rotations and mirrors, the identity first; raises OverflowError for too many."""
    found = np.empty((largest + 1 + len(generators), 3, 3))
    found[0], count, walked = np.eye(3), 1, 0
    while walked < count:
        for g in generators:
            new = g @ found[walked]
            if not (np.abs(found[:count] - new).max(axis=(1, 2)) < SNAP).any():
                found[count] = new
                count += 1
        walked += 1
        if count > largest:
            raise OverflowError
    return found[:count].copy()
