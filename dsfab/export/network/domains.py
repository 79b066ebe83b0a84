"""Where surfaces of trimmed regions are parametrised: a parallelogram around the outline in the mean plane."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from dsfab.arrays import Floats

ASLANT = 1 / 4
"""Least sine of the angle of a parallelogram that surfaces are over: they are folded otherwise where they bend."""


@dataclass(frozen=True, eq=False)
class FaceDomain:
    """A parallelogram in the plane of the first two axes (3, 3), around edges.

    origin : (3,)    sides : (2, 2) its directions.    low, high : (2,) where it begins and ends along these.
    uv, z : (k, 2) parameters and (k,) heights of points inside of it, of which there are `inside`, and of edges.
    """

    origin: Floats
    axes: Floats
    sides: Floats
    low: Floats
    high: Floats
    uv: Floats
    z: Floats
    inside: int

    @classmethod
    def of(cls, points: Floats, edges: Floats, axes: Floats, sides: Floats) -> "FaceDomain":
        """Around edges (j, 3), and a little larger."""
        origin, across = edges.mean(axis=0), np.linalg.inv(sides)
        inside, around = (points - origin) @ axes.T, (edges - origin) @ axes.T
        at, ends = inside[:, :2] @ across, around[:, :2] @ across
        low, high = ends.min(axis=0) - 1, ends.max(axis=0) + 1
        within = ((at > low) & (at < high)).all(axis=1)
        uv = (np.concatenate([at[within], ends]) - low) / (high - low)
        z = np.concatenate([inside[within, 2], around[:, 2]])
        return cls(origin, axes, sides, low, high, uv, z, int(within.sum()))

    def lifted(self, z: Floats) -> Floats:
        """(p + 1, p + 1, 3) poles that lie evenly over it, at heights z (p + 1, p + 1)."""
        u, v = (np.linspace(self.low[i], self.high[i], len(z)) for i in (0, 1))
        plane = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=2) @ self.sides
        return np.asarray(self.origin + np.concatenate([plane, z[..., None]], axis=2) @ self.axes)

    def least_beyond(self, ways: Floats, box: Floats) -> Floats:
        """(2, 2) right-handed directions, of those of ways (k, 2) in the plane, along which the corners of the
        parallelogram around all points are least out of a box, at the heights of a quadric."""
        at = (self.low + self.uv * (self.high - self.low)) @ self.sides
        heights = lstsq(_quadric(at), self.z, check_finite=False)[0]
        long = np.linalg.norm(ways, axis=1)[:, None]
        ways = ways[long[:, 0] > 0] / long[long > 0][:, None]  # a closed edge has no chord
        turned = np.stack([-ways[:, 1], ways[:, 0]])
        ends = np.stack([(at @ turned).min(axis=0), (at @ turned).max(axis=0)])  # (2, k) how far left of each way
        i, j = np.triu_indices(len(ways), 1)
        sine = (ways @ turned)[j, i]
        i, j = np.where(sine > 0, (i, j), (j, i))  # right-handed, or the surface faces the other way
        i, j, sine = (x[np.abs(sine) >= ASLANT] for x in (i, j, np.abs(sine)))
        if not len(i):
            return self.sides
        along = ways[i] * (-ends[::-1, j] / sine)[..., None]  # (2, pairs, 2)
        corners = along[:, None] + ways[j] * (ends[:, i] / sine)[..., None]
        z = _quadric(corners.reshape(-1, 2)) @ heights
        placed = np.concatenate([corners.reshape(-1, 2), z[:, None]], axis=1) @ self.axes + self.origin
        out = _outside(placed, box).reshape(4, len(i), 3).max(axis=(0, 2), initial=0.0)
        best = int(out.argmin())
        return ways[[i[best], j[best]]]


def _quadric(at: Floats) -> Floats:
    """(k, 6) what the coefficients of a quadric count at places (k, 2)."""
    x, y = at.T
    return np.stack([np.ones(len(at)), x, y, x * x, x * y, y * y], axis=1)


def beyond(points: Floats, box: Floats) -> float:
    """How far any of points (..., 3) is out of a box (2, 3)."""
    return float(_outside(points, box).max(initial=0.0))


def _outside(points: Floats, box: Floats) -> Floats:
    """(..., 3) how far points (..., 3) are out of a box (2, 3) along each axis; below 0 inside."""
    return np.asarray(np.maximum(box[0] - points, points - box[1]))
