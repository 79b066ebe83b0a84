"""Untrimmed patches between the curves around a region: Coons surfaces, a Bezier patch for each pair of spans.

        top                  Between cubics the bilinearly blended surface [Coons 1967] is a polynomial of degree
     o---o-----o             (3, 3) over each cell: its poles are the same blend of the curves' poles, and its
left |   |     | right       borders are the curves exactly. Cells of one region meet in isolines that they share.
     o---o-----o
       bottom

Between curves that bend in both directions such a surface strays from the sheet in its middle: by 3.9 mm on a sphere of
1 m where a region is 200 x 800 mm. A spline that is 0 along the border takes it back.
"""

from collections.abc import Callable, Sequence

import numpy as np

from dsfab.arrays import Floats, cross
from dsfab.export.network.inner import InnerSpline

PLACES = np.linspace(0, 1, 5)
"""Where a patch is asked whether it is folded, in both directions."""


def coons(bottom: Floats, right: Floats, top: Floats, left: Floats) -> Floats:
    """(ku, kv, 4, 4, d) poles of the patches between spans: bottom and top (ku, 4, d) from left to right, left and
    right (kv, 4, d) upwards."""
    b, t = bottom[:, None, :, None, :], top[:, None, :, None, :]
    lt, rt = left[None, :, None, :, :], right[None, :, None, :, :]
    u = _shares(bottom, top)[:, None, :, None, None]
    v = _shares(left, right)[None, :, None, :, None]
    a, c, e, f = bottom[0, 0], bottom[-1, -1], top[0, 0], top[-1, -1]
    corners = (1 - u) * (1 - v) * a + u * (1 - v) * c + (1 - u) * v * e + u * v * f
    P: Floats = np.asarray((1 - v) * b + v * t + (1 - u) * lt + u * rt - corners)
    P[:, 0, :, 0], P[:, -1, :, -1] = bottom, top
    P[0, :, 0], P[-1, :, -1] = left, right
    return P


def pulled(grids: Sequence[Floats], away: Callable[[Floats], Floats]) -> list[Floats]:
    """Patches of regions (ku, kv, 4, 4, d), their insides moved by what `away` says of points (k, d) of theirs; their
    borders stay, and cells meet as before."""
    both = [
        (InnerSpline.of(_way(P[:, 0, :, 0], P[:, -1, :, -1])), InnerSpline.of(_way(P[0, :, 0], P[-1, :, -1])))
        for P in grids
    ]
    at = list[Floats]()
    for P, (u, v) in zip(grids, both, strict=True):
        along = np.tensordot(u.hats, P, axes=([1, 2], [0, 2]))
        at.append(np.tensordot(v.hats, along, axes=([1, 2], [1, 2])))
    ways = away(np.concatenate([points.reshape(-1, points.shape[2]) for points in at]))
    ends = np.cumsum([points.shape[0] * points.shape[1] for points in at])
    found = list[Floats]()
    for P, (u, v), points, some in zip(grids, both, at, np.split(ways, ends[:-1]), strict=True):
        along = np.tensordot(u.poles, some.reshape(points.shape), axes=([2], [1]))
        found.append(P + np.tensordot(v.poles, along, axes=([2], [2])).transpose(2, 0, 3, 1, 4))
    return found


def _shares(one: Floats, other: Floats) -> Floats:
    """(k, 4) how far each pole of the spans of opposite sides is along them."""
    way = _way(one, other)
    return np.asarray(way[:-1, None] + np.diff(way)[:, None] * np.arange(4) / 3)


def _way(one: Floats, other: Floats) -> Floats:
    """(k + 1,) how far the ends of the spans of opposite sides are along them, as the mean of both."""
    way = np.zeros(len(one) + 1)
    for side in (one, other):
        long = np.cumsum(np.linalg.norm(side[:, -1, :3] - side[:, 0, :3], axis=1))
        way[1:] += long / long[-1] / 2
    return way


def least_jacobian(P: Floats) -> float:
    """The smallest ratio of normals of patches (..., 4, 4, 3), not of unit length, along the mean one to the largest
    of these; under 0 where one is folded."""
    P = P.reshape(-1, 4, 4, 3)
    y = 1 - PLACES
    B = np.stack([y**3, 3 * PLACES * y**2, 3 * PLACES**2 * y, PLACES**3], axis=1)
    C = np.stack([y**2, 2 * PLACES * y, PLACES**2], axis=1)
    du = np.einsum("xa,yb,kabi->kxyi", C, B, np.diff(P, axis=1))
    dv = np.einsum("xa,yb,kabi->kxyi", B, C, np.diff(P, axis=2))
    N = cross(du.reshape(-1, 3), dv.reshape(-1, 3)).reshape(du.shape)
    mean = N.mean(axis=(1, 2))
    along = np.einsum("kxyi,ki->kxy", N, mean)
    return float((along.min(axis=(1, 2)) / along.max(axis=(1, 2))).min())
