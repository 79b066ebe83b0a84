"""Quads to triangles: along the shorter diagonal, but for those that lie across a fold of what is around them.

  b          A valley runs from a to c. Cut from b to d, as is shorter where c and a are at different heights, its
 / \\         line has a tooth in each quad; cut from a to c, both triangles go on in the planes of the quads beside.
a - c
 \\ /
  d
"""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, unit_vectors

FLAT, WARPED = (float(np.cos(np.radians(angle))) for angle in (2, 10))
"""Quads whose triangles are more parallel than the one are flat; those that are less parallel than the other may lie
across a fold."""
ON, BETTER = 2 * float(np.sin(np.radians(10) / 2)), 0.25
"""The longer diagonal is taken where its triangles go on in the flat faces beside them within 10 degrees, and bend
there by so small a share of what those of the shorter one do. On a saddle no quad is flat."""


def quads_cut(V: Floats, corners: Ints, sizes: Ints, quads: Ints) -> Ints:
    """(2 q, 3) the two triangles of each of the faces `quads` (q,), which have four corners.

    V : (n, 3).    corners : (c,) of all faces, one after the other; those of quads outside 0..n-1 are cut anyhow.
    sizes : (f,) how many each face has.

    Where one diagonal alone stays inside a quad it is that; where they are equal, the one from the first corner.
    """
    start = np.cumsum(sizes) - sizes
    Q = corners[start[quads][:, None] + np.arange(4)]
    P = V[_inside(Q, len(V))] if len(Q) and len(V) else np.zeros((len(Q), 4, 3))
    d02, d13 = P[:, 2] - P[:, 0], P[:, 3] - P[:, 1]
    area = np.cross(d02, d13)
    normals = np.stack([np.cross(P[:, j] - P[:, i], P[:, k] - P[:, i]) for i, j, k in _TRIANGLES], axis=1)
    fits = np.einsum("qti,qi->qt", normals, area) > 0
    fits02, fits13 = fits[:, :2].all(axis=1), fits[:, 2:].all(axis=1)
    shorter = np.linalg.norm(d13, axis=1) < (1 - 1e-9) * np.linalg.norm(d02, axis=1)
    other = np.where(fits02 == fits13, shorter, fits13)
    at = unit_vectors(normals)
    parallel = np.where(other, *(np.einsum("qi,qi->q", at[:, k], at[:, k + 1]) for k in (2, 0)))
    rows = np.flatnonzero(fits02 & fits13 & (parallel < WARPED))
    if len(rows):
        bent = np.zeros(len(sizes), dtype=bool)
        bent[quads] = parallel < FLAT
        beside = _normals_beside(V, corners, sizes, bent, start[quads[rows]])
        bend = [_bend(at[rows][:, which], beside) for which in _AT_SIDES]
        chosen, instead = np.where(other[rows], bend[::-1], bend)
        other[rows] ^= instead < np.minimum(ON, BETTER * chosen)
    cut = np.where(other[:, None], [[1, 2, 3, 1, 3, 0]], [[0, 1, 2, 0, 2, 3]])
    return np.take_along_axis(Q, cut, axis=1).reshape(-1, 3)


_TRIANGLES = (0, 1, 2), (0, 2, 3), (1, 2, 3), (1, 3, 0)
"""Of a quad cut from corner 0 to 2, and of one cut from 1 to 3."""
_AT_SIDES = (0, 0, 1, 1), (3, 2, 2, 3)
"""The triangle at each side, which runs from the corner of its number to the next, for both cuts."""


def _inside(corners: Ints, n: int) -> Ints:
    return np.where((corners < 0) | (n <= corners), 0, corners)


def _bend(at: Floats, beside: Floats) -> Floats:
    """(r,) how far unit normals (r, 4, 3) of triangles are off those beside them at most: chords of angles."""
    there = (beside != 0).any(axis=2)
    return np.asarray((np.linalg.norm(at - beside, axis=2) * there).max(axis=1))


def _normals_beside(V: Floats, corners: Ints, sizes: Ints, bent: Bools, first: Ints) -> Floats:
    """(r, 4, 3) unit normals of the flat faces beyond the sides of quads, 0 where there is none, or more than one.

    bent : (f,) faces that are not flat.    first : (r,) the places of the first corners among `corners`.
    """
    owner, h = np.repeat(np.arange(len(sizes)), sizes), np.arange(len(corners))
    start = np.cumsum(sizes) - sizes
    onward = np.where(h + 1 < (start + sizes)[owner], h + 1, start[owner])
    a, b = _inside(corners, len(V)), _inside(corners[onward], len(V))
    origin = V[a[start[owner]]]
    turned = np.cross(V[a] - origin, V[b] - origin)
    N = unit_vectors(np.stack([np.bincount(owner, x, len(sizes)) for x in turned.T], axis=1))
    _, edge, count = np.unique(np.minimum(a, b) * len(V) + np.maximum(a, b), return_inverse=True, return_counts=True)
    side = first[:, None] + np.arange(4)
    beyond = np.bincount(edge, h)[edge[side]].astype(np.int64) - side  # of two numbers' sum, the other
    beyond = np.where(count[edge[side]] == 2, beyond, side)
    known = (beyond != side) & ~bent[owner[beyond]]
    same = np.where(a[beyond] == a[side], -1.0, 1.0) * known
    return np.asarray(same[..., None] * N[owner[beyond]])
