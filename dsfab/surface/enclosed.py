"""What triangles enclose: signed volume and area, a few faces at a time, which is faster and needs little memory."""

from collections.abc import Iterator

import numpy as np

from dsfab.arrays import Floats, Ints

CHUNK = 1 << 15
"""Faces measured together."""


def box(V: Floats, F: Ints) -> Floats:
    """(2, 3) lowest and highest corner of the vertices V (n, 3) that faces F (m, 3) use."""
    used = np.zeros(len(V), dtype=bool)
    used[F.ravel()] = True
    points = V if used.all() else V[used]
    return np.array([[f(column) for column in points.T] for f in (np.min, np.max)])


def signed_volume(V: Floats, F: Ints) -> float:
    """Volume inside closed faces F (m, 3) of vertices V (n, 3), in their unit cubed; negative where they face inwards.

    By the divergence theorem: signed tetrahedra from the middle of the box, so that no digits are lost far out.
    """
    return float(_tetrahedra(V, F).sum())


def signed_volumes(V: Floats, F: Ints, shell: Ints, count: int) -> Floats:
    """(count,) the same of each closed shell of faces, `shell` (m,) the number of each face's; negative for voids."""
    return np.bincount(shell, _tetrahedra(V, F), count).astype(np.float64)


def total_area(V: Floats, F: Ints) -> float:
    """Area of all faces F (m, 3) of vertices V (n, 3), in their unit squared."""
    return sum(float(np.sqrt((N**2).sum(axis=0)).sum()) / 2 for _, _, N in _faces(V, F))


def _tetrahedra(V: Floats, F: Ints) -> Floats:
    """(m,) signed volumes of the tetrahedra from the middle of the box to each face."""
    found = np.zeros(len(F))
    for some, a, N in _faces(V, F):
        found[some] = (a * N).sum(axis=0) / 6
    return found


def _faces(V: Floats, F: Ints) -> Iterator[tuple[slice, Floats, Floats]]:
    """Some faces, their first corners from the middle of the box (3, k), and twice their area vectors (3, k)."""
    if not len(F):
        return
    columns = np.ascontiguousarray((V - box(V, F).mean(axis=0)).T)
    for k in range(0, len(F), CHUNK):
        some = slice(k, k + CHUNK)
        a, b, c = (np.stack([column.take(corner) for column in columns]) for corner in F[some].T)
        (x, y, z), (u, v, w) = b - a, c - a
        yield some, a, np.stack([y * w - z * v, z * u - x * w, x * v - y * u])
