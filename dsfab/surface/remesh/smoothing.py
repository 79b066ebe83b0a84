"""Smooth patches through the vertices of a mesh, and vertices moved to even triangles."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, face_angles, lengths
from dsfab.surface.edge_changes import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.edges import FIXED, FREE, Net
from dsfab.surface.remesh.features import TOLERANCE, FeatureCurves
from dsfab.surface.topology import corner_fans

CORNERS = ((0, 1), (1, 2), (2, 0))
"""The half-edges of a face, by its corners."""


class SmoothPatches:
    """Curved point-normal triangles on the facets of a surface [Vlachos et al. 2001, PN triangles].

    The normals at a vertex on a crease are those of each side of it; along boundaries and creases the patches follow
    the straight edges, so that curves stay where they are.
    """

    def __init__(self, surface: Surface) -> None:
        self._V, self._F = surface.V, surface.F
        features = feature_edges(surface)
        normals = _corner_normals(surface, features)
        self._controls = _controls(surface.V[surface.F], normals, features[surface.edges.of])

    def points(self, face: Ints, place: Floats) -> Floats:
        """(k, 3) the points of the patches above places (k, 3) of faces (k,), metres."""
        P = self._V[self._F[face]]
        b = barycentric(P, place)
        controls = self._controls[face]
        result = np.einsum("kc,kci->ki", b**3, P)
        for k, (i, j) in enumerate(CORNERS):
            result += 3 * (b[:, i] ** 2 * b[:, j])[:, None] * controls[:, 2 * k]
            result += 3 * (b[:, i] * b[:, j] ** 2)[:, None] * controls[:, 2 * k + 1]
        edges = controls.mean(axis=1)
        middle = edges + (edges - P.mean(axis=1)) / 2
        return np.asarray(result + 6 * b.prod(axis=1)[:, None] * middle)


def barycentric(P: Floats, place: Floats) -> Floats:
    """(k, 3) coordinates of places (k, 3) in triangles P (k, 3 corners, 3)."""
    areas = np.stack(
        [lengths(np.cross(P[:, (c + 1) % 3] - place, P[:, (c + 2) % 3] - place)) for c in range(3)], axis=1
    )
    return np.asarray(areas / areas.sum(axis=1, keepdims=True))


def _controls(P: Floats, normals: Floats, straight: Bools) -> Floats:
    """(m, 6, 3) two control points on each edge of triangles P (m, 3, 3): thirds of it, in the planes of the normals
    (m, 3, 3) at their ends; on `straight` edges (m, 3) just thirds."""
    controls = np.empty((len(P), 6, 3))
    for k, ends in enumerate(CORNERS):
        for end, (i, j) in enumerate((ends, ends[::-1])):
            off = np.einsum("mi,mi->m", P[:, j] - P[:, i], normals[:, i])
            off[straight[:, k]] = 0
            controls[:, 2 * k + end] = (2 * P[:, i] + P[:, j] - off[:, None] * normals[:, i]) / 3
    return controls


def _corner_normals(surface: Surface, features: Bools) -> Floats:
    """(m, 3 corners, 3) unit normals: the mean of the faces around a vertex up to the next features (e,), weighted by
    their angles there."""
    fan = corner_fans(surface.F, surface.edges, apart=features).ravel()
    count = int(fan.max()) + 1
    weighted = (face_angles(surface.V, surface.F)[:, :, None] * surface.normals[:, None]).reshape(-1, 3)
    total: Floats = np.stack([np.bincount(fan, x, minlength=count).astype(np.float64) for x in weighted.T], axis=1)
    return np.asarray((total / lengths(total)[:, None])[fan].reshape(-1, 3, 3))


TURN = 0.5
"""Vertices whose move would turn a face by more than the angle of this cosine, 60 degrees, stay."""

RETREATS = 6
"""How often vertices that would turn faces are put back before all of them are."""


class NearestOnSurface:
    """The places of a surface nearest to points, by a tree of boxes that is made once, when it is first asked."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface

    @cached_property
    def _tree(self) -> Any:
        tree = igl.AABB()
        tree.init(self.surface.V, self.surface.F)
        return tree

    def __call__(self, points: Floats) -> tuple[Ints, Floats]:
        """(k,) the faces nearest to points (k, 3), and the places (k, 3) on them, metres."""
        if not len(points):
            return np.zeros(0, dtype=np.int64), points
        _, face, place = self._tree.squared_distance(self.surface.V, self.surface.F, np.ascontiguousarray(points))
        return np.asarray(face, dtype=np.int64), np.asarray(place)


def with_even_vertices(net: Net, curves: FeatureCurves, edge: float) -> Net:
    """The net with free vertices moved within their tangent planes to the means of their faces, weighted by the faces'
    areas in wanted lengths squared, and those on curves to even steps along these."""
    V, F, n = net.V, net.F, net.n
    doubled = area_vectors(V, F)
    weight = lengths(doubled) / net.size[F].mean(axis=1) ** 2
    centre = V[F].mean(axis=1) * weight[:, None]
    normal = _summed(F, doubled, n)
    normal /= np.maximum(lengths(normal), np.finfo(float).tiny)[:, None]
    whole = np.bincount(F.ravel(), np.repeat(weight, 3), minlength=n)
    step = _summed(F, centre, n) / whole[:, None] - V
    step -= normal * np.einsum("ni,ni->n", normal, step)[:, None]
    goal = V + np.where((net.kind == FREE)[:, None], step, 0)
    at = _even_steps(net, curves, edge)
    inner = net.kind[net.node] < FIXED
    goal[net.node[inner]] = curves.place(at[inner])
    return with_vertices_at(net, goal, at)


def with_vertices_on(net: Net, nearest: NearestOnSurface) -> Net:
    """The net with its free vertices on the surface."""
    goal, free = net.V.copy(), np.flatnonzero(net.kind == FREE)
    goal[free] = nearest(net.V[free])[1]
    return with_vertices_at(net, goal, net.at)


def _summed(F: Ints, values: Floats, n: int) -> Floats:
    """(n, 3) the sums of what faces (m, 3) have, at their corners."""
    corners = F.ravel()
    return np.stack([np.bincount(corners, np.repeat(x, 3), minlength=n) for x in values.T], axis=1)


def _even_steps(net: Net, curves: FeatureCurves, edge: float) -> Floats:
    """(k,) places of the nodes so that the steps to both sides are as long in wanted lengths, where the edges stay
    near the curve; every second node moves at once."""
    at = net.at.copy()
    for parity in (0, 1):
        k = np.arange(1 + parity, max(len(at) - 1, 1 + parity), 2)
        k = k[(net.curve[k - 1] == net.curve[k]) & (net.curve[k + 1] == net.curve[k])]
        size = net.size[net.node]
        before, after = size[k - 1] + size[k], size[k] + size[k + 1]
        goal = (at[k - 1] * after + at[k + 1] * before) / (before + after)
        goal = (goal + at[k]) / 2
        far = np.maximum(curves.deviation(at[k - 1], goal)[0], curves.deviation(goal, at[k + 1])[0])
        was = np.maximum(curves.deviation(at[k - 1], at[k])[0], curves.deviation(at[k], at[k + 1])[0])
        fine = far <= np.maximum(TOLERANCE * edge, was)
        at[k[fine]] = goal[fine]
    return at


def with_vertices_at(net: Net, goal: Floats, at: Floats) -> Net:
    """The net with its vertices at goals (n, 3), metres, and its nodes at places (k,), but where that turns a face."""
    old, V = area_vectors(net.V, net.F), goal.copy()
    face = np.arange(len(net.F))
    for k in range(RETREATS + 1):
        new = area_vectors(V, net.F[face])
        was = old[face]
        bad = np.einsum("mi,mi->m", was, new) < TURN * lengths(was) * lengths(new)
        if not bad.any():
            break
        back = np.unique(net.F[face[bad]])
        V[back] = net.V[back]
        if k == RETREATS:
            V, at = net.V, net.at
    shifted = (V != net.V).any(axis=1)[net.node]
    return replace(net, V=V, at=np.where(shifted, at, net.at))
