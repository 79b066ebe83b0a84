"""Reference axes that turn with the surface: what signs and repeated eigenvalues of modes are settled by.

An eigenvector is known up to its sign, and where a surface is symmetric up to a rotation within its eigenspace. Some
choice must be made, and a choice by the coordinates would give another picture when the surface is turned.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.sparse import one_blas_thread
from dsfab.surface.hats import voronoi_mass
from dsfab.surface.mesh import Surface

CLEAR = 1e-2
"""A moment under this share of its natural size is taken for zero, and two inertias this close for equal."""


def reference_axes(surface: Surface, weights: Sequence[Floats] = (), vectors: Sequence[Floats] = ()) -> Floats:
    """(3, 3) right-handed orthonormal axes, one a row, made of what turns with the surface.

    weights : (n,) each, not negative: scalars on the vertices, such as the size of the load or what is supported.
    vectors : (3,) each, such as the resultant of the loads.

    In this order, each only for what the ones before leave open: the vectors; from the surface's centroid to that of
    every weight; the skew of the area; principal axes of inertia of the area and of the weights, pointed to where the
    third moment is positive. Only directions that all of these leave open (a dome under its own weight has a whole
    plane of them, and any rotation of its pattern is as good) are settled by the coordinates x, y, z.
    """
    with one_blas_thread():
        return _axes(surface, weights, vectors)


def _axes(surface: Surface, weights: Sequence[Floats], vectors: Sequence[Floats]) -> Floats:
    mass = voronoi_mass(surface)
    x = surface.V - mass @ surface.V / mass.sum()
    measures = [mass, *(mass * weight for weight in weights if (mass * weight).sum() > 0)]
    size = np.sqrt(float(mass @ (x**2).sum(axis=1)) / mass.sum())
    axes: list[Floats] = []
    for candidate in (*_directions(x / size, measures, vectors), *np.eye(3)):
        left = candidate - sum(((axis @ candidate) * axis for axis in axes), np.zeros(3))
        if np.linalg.norm(left) > CLEAR:
            axes.append(left / np.linalg.norm(left))
        if len(axes) == 2:
            break
    return np.stack([*axes, np.cross(axes[0], axes[1])])


def _directions(x: Floats, measures: Sequence[Floats], vectors: Sequence[Floats]) -> Iterator[Floats]:
    """Candidates, of length about 1 where they are clear and about 0 where they mean nothing."""
    for vector in vectors:
        length = float(np.linalg.norm(vector))
        if length > 0:
            yield np.asarray(vector) / length
    shares = [measure / measure.sum() for measure in measures]
    for share in shares[1:]:
        yield share @ x
    yield shares[0] @ ((x**2).sum(axis=1)[:, None] * x)
    for share in shares:
        centred = x - share @ x
        inertia, axes = np.linalg.eigh(centred.T @ (share[:, None] * centred))
        for i in (2, 1, 0):
            others = np.delete(inertia, i)
            third = float(share @ (centred @ axes[:, i]) ** 3)
            if np.abs(others - inertia[i]).min() > CLEAR * inertia[2]:
                yield axes[:, i] * _pointed(axes[:, i], third, inertia[2])


def _pointed(axis: Floats, third: float, largest: float) -> float:
    """The sign of an axis: by its third moment, else by its clearest coordinate, for then both ways are alike."""
    if abs(third) > CLEAR * largest**1.5:
        return float(np.sign(third))
    return float(np.sign(axis[int(np.argmax(np.abs(axis) > 0.5))]))
