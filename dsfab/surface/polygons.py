"""Polygons: a mesh of them as arrays, and their triangles."""

from dataclasses import dataclass
from itertools import chain

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.polygon_cuts import FEW, fan, large_polygon_cut, small_polygons_cut
from dsfab.surface.quad_cuts import quads_cut


@dataclass(frozen=True, eq=False)
class Polygons:
    """A mesh of polygons: V (n, 3) in the file's unit, and the corners of all faces one after the other.

    corners : (c,) vertex indices; face k has sizes[k] of them.
    """

    V: Floats
    corners: Ints
    sizes: Ints

    def part(self, faces: Ints) -> "Polygons":
        """The same vertices with some of the faces (f,), in their order."""
        owner = np.repeat(np.arange(len(self.sizes)), self.sizes)
        return Polygons(self.V, self.corners[np.isin(owner, faces)], self.sizes[faces])


def polygons(V: list[list[float]], faces: list[list[int]]) -> Polygons:
    """From lists, as the readers meet them."""
    return Polygons(
        np.array(V, dtype=np.float64).reshape(-1, 3),
        np.fromiter(chain.from_iterable(faces), dtype=np.int64),
        np.array([len(face) for face in faces], dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class CutPolygons:
    """Triangles of polygons.

    F : (m, 3) vertex indices. owner : (m,) the polygon of each, ascending.
    fanned : (p,) polygons that could only be cut as fans, from their first corners, because they cross themselves.
    """

    F: Ints
    owner: Ints
    fanned: Ints


def triangles(mesh: Polygons) -> CutPolygons:
    """Polygons cut into triangles.

    A quad is cut as `dsfab.surface.quad_cuts` says, mostly along its shorter diagonal, a larger polygon as
    `dsfab.surface.polygon_cuts` does. Polygons with fewer than three corners are dropped;
    one with a vertex outside the mesh, or that is not finite, is fanned, for the caller to refuse.
    """
    start = np.concatenate([[0], np.cumsum(mesh.sizes)[:-1]]).astype(np.int64)
    of3, of4 = np.flatnonzero(mesh.sizes == 3), np.flatnonzero(mesh.sizes == 4)
    cuts = [mesh.corners[start[of3][:, None] + np.arange(3)], quads_cut(mesh.V, mesh.corners, mesh.sizes, of4)]
    owners = [of3, np.repeat(of4, 2)]
    fanned: list[int] = []
    for k in np.unique(mesh.sizes[mesh.sizes > 4]).tolist():
        of = np.flatnonzero(mesh.sizes == k)
        corners = mesh.corners[start[of][:, None] + np.arange(k)]
        F, crossed = _polygons_cut(mesh.V, corners)
        cuts.append(np.take_along_axis(corners, F.reshape(len(of), -1), axis=1).reshape(-1, 3))
        owners.append(np.repeat(of, k - 2))
        fanned.extend(of[crossed].tolist())
    F, owner = np.concatenate(cuts), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return CutPolygons(F[order], owner[order], np.array(sorted(fanned), dtype=np.int64))


def _polygons_cut(V: Floats, corners: Ints) -> tuple[Ints, Bools]:
    """(q, k - 2, 3) triangles, as corners 0..k-1, of q polygons (q, k), and which (q,) cross themselves."""
    q, k = corners.shape
    there = (corners >= 0) & (corners < len(V))
    P = V[np.where(there, corners, 0)] if len(V) else np.zeros((q, k, 3))
    sound = there.all(axis=1) & np.isfinite(P).all(axis=(1, 2))
    F, crossed = np.tile(fan(k), (q, 1, 1)), np.zeros(q, dtype=bool)
    if k <= FEW:
        F[sound] = small_polygons_cut(P[sound])
        return F, crossed
    for i in np.flatnonzero(sound).tolist():
        cut = large_polygon_cut(P[i])
        crossed[i] = cut is None
        F[i] = F[i] if cut is None else cut
    return F, crossed
