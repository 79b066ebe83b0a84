"""Points of both smooth skins over points of the mesh.

A triangle knows no curvature; its corners and their normals do. Half of what Phong tessellation [Boubekeur, Alexa 2008]
adds to a point reproduces every quadratic, spheres and cylinders to the third order, without a parametrisation. Creases
have normals on each side; at shorter ones it would leave the mesh by more than a solid may.
"""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.export.network.sides import Sides
from dsfab.export.smooth.dense import Dense, dense
from dsfab.export.smooth.source import Curved
from dsfab.surface import Surface
from dsfab.units import MM_PER_M

MOST = 1 / 5
"""Share of the thickness that a point is lifted at most: of the mesh's chord error no more counts than a quarter, see
`dsfab.export.smooth.limits`, and both skins and what is fitted to them stray a little more."""


@dataclass(frozen=True, eq=False)
class Lifting:
    """An uncut surface with its skins, see `Dense`."""

    skins: Dense

    @classmethod
    def of(cls, surface: Surface, curved: Curved) -> "Lifting":
        """Of the surface that a sheet was cut from."""
        return cls(dense(surface, curved))

    def points(self, weights: csr_array) -> Floats:
        """(k, 6) millimetres on the outer and on the inner skin, over points with barycentric weights (k, n)."""
        if not len(self.sides.creases):
            return self._points(weights)
        one, two = self.sides.rows(self._in_faces(weights))
        return np.asarray((self._points(one) + self._points(two)) / 2)

    def _in_faces(self, weights: csr_array) -> csr_array:
        """The weights (k, n), those of points between two faces beside a crease as of the nearest places: nothing says
        on which side they are, and seen from none they were 1.4 mm off the others of their chain."""
        between = self.sides.between_faces(weights)
        if not len(between):
            return weights
        nearest = self.weights_at(np.asarray(weights[between] @ self.skins.points))
        row = np.arange(weights.shape[0])
        row[between] = len(row) + np.arange(len(between))
        return csr_array(vstack([weights, nearest], format="csr")[row])

    def _points(self, weights: csr_array) -> Floats:
        """The same, over weights (k, s) on the columns of `sides`."""
        V, N = self.skins.points[self.sides.vertex], self.sides.normals
        P, n = np.asarray(weights @ V), np.asarray(weights @ N)
        along = np.einsum("ni,ni->n", V, N)
        outer = (N[:, :, None] * N[:, None, :]).reshape(-1, 9)
        pull = weights @ (along[:, None] * N)
        half = MM_PER_M * np.asarray(weights @ self.sides.half)[:, None]
        lift = (pull - np.einsum("kij,kj->ki", (weights @ outer).reshape(-1, 3, 3), P)) / 2
        lift *= np.minimum(2 * MOST * half / np.maximum(np.linalg.norm(lift, axis=1, keepdims=True), 1e-300), 1)
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
        D = half * n
        if len(self.sides.creases):
            D = D + MM_PER_M * np.asarray(weights @ self.sides.mitre)
        middle = P + lift + self.skins.shift * D
        return np.concatenate([middle + D, middle - D], axis=1)

    def away(self, Q: Floats) -> Floats:
        """(k, 6) from points (k, 6) beside the skins to these, across, over the places nearest to the middles."""
        there = self.points(self.weights_at((Q[:, :3] + Q[:, 3:]) / 2))
        across = there[:, :3] - there[:, 3:]
        beyond = np.einsum("ki,ki->k", across, Q[:, :3] - Q[:, 3:]) < 0  # where a seam's other side is as near
        there[beyond], across[beyond] = np.roll(there[beyond], 3, axis=1), -across[beyond]
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        ways = [np.einsum("ki,ki->k", (there - Q)[:, s : s + 3], across)[:, None] * across for s in (0, 3)]
        return np.concatenate(ways, axis=1)

    def weights_at(self, points: Floats) -> csr_array:
        """(k, n) barycentric weights of the places of the mesh nearest to points (k, 3), millimetres."""
        V, F = self.skins.points, self.skins.surface.F
        _, simplex, place = self._tree.squared_distance(V, F, np.ascontiguousarray(points))
        corners = F[np.asarray(simplex)]
        a, b, c = (V[corners[:, i]] for i in range(3))
        across = np.cross(b - a, c - a)
        area = np.einsum("ki,ki->k", across, across)
        one = np.einsum("ki,ki->k", np.cross(c - b, place - b), across) / area
        two = np.einsum("ki,ki->k", np.cross(a - c, place - c), across) / area
        share = np.clip(np.stack([one, two, 1 - one - two], axis=1), 0, 1)
        share /= share.sum(axis=1, keepdims=True)
        rows = np.arange(0, 3 * len(points) + 1, 3)
        return csr_array((share.ravel(), corners.ravel(), rows), shape=(len(points), len(V)))

    @cached_property
    def sides(self) -> Sides:
        """Of its creases."""
        return Sides.of(self.skins)

    @cached_property
    def _tree(self) -> igl.AABB:
        """Of the triangles: each look at places near points would make one."""
        tree = igl.AABB()
        tree.init(self.skins.points, self.skins.surface.F)
        return tree
