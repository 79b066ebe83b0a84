"""Smooth patches through the vertices of a mesh, and moves of vertices that make triangles nearly equilateral."""

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

CORNERS = ((0, 1), (1, 2), (2, 0))  # First and second corner of each half-edge of a face.


class SmoothPatches:
    """A smooth curved patch over each face of a surface [point-normal triangles, Vlachos et al. 2001]."""

    def __init__(self, surface: Surface) -> None:
        self._V, self._F = surface.V, surface.F
        features = feature_edges(surface)
        normals = _corner_normals(surface, features)
        self._controls = _controls(surface.V[surface.F], normals, features[surface.edges.of])

    def points(self, face: Ints, place: Floats) -> Floats:
        """Return the points (k, 3) of the patches over points `place` (k, 3) of flat faces (k,), metres."""
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
    """Return the barycentric coordinates (k, 3) of points `place` (k, 3) in triangles P (k, 3 corners, 3)."""
    areas = np.stack(
        [lengths(np.cross(P[:, (c + 1) % 3] - place, P[:, (c + 2) % 3] - place)) for c in range(3)], axis=1
    )
    return np.asarray(areas / areas.sum(axis=1, keepdims=True))


def _controls(P: Floats, normals: Floats, straight: Bools) -> Floats:
    controls = np.empty((len(P), 6, 3))
    for k, ends in enumerate(CORNERS):
        for end, (i, j) in enumerate((ends, ends[::-1])):
            height = np.einsum("mi,mi->m", P[:, j] - P[:, i], normals[:, i])
            height[straight[:, k]] = 0
            controls[:, 2 * k + end] = (2 * P[:, i] + P[:, j] - height[:, None] * normals[:, i]) / 3
    return controls


def _corner_normals(surface: Surface, features: Bools) -> Floats:
    fan = corner_fans(surface.F, surface.edges, apart=features).ravel()
    count = int(fan.max()) + 1
    weighted = (face_angles(surface.V, surface.F)[:, :, None] * surface.normals[:, None]).reshape(-1, 3)
    total: Floats = np.stack([np.bincount(fan, x, minlength=count).astype(np.float64) for x in weighted.T], axis=1)
    return np.asarray((total / lengths(total)[:, None])[fan].reshape(-1, 3, 3))


class NearestOnSurface:
    """Search for the nearest points of a surface."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface

    @cached_property
    def _tree(self) -> Any:
        tree = igl.AABB()
        tree.init(self.surface.V, self.surface.F)
        return tree

    def __call__(self, points: Floats) -> tuple[Ints, Floats]:
        """Return the faces (k,) nearest to points (k, 3), and the nearest points (k, 3) of these faces, metres."""
        if not len(points):
            return np.zeros(0, dtype=np.int64), points
        _, face, place = self._tree.squared_distance(self.surface.V, self.surface.F, np.ascontiguousarray(points))
        return np.asarray(face, dtype=np.int64), np.asarray(place)


def with_even_vertices(net: Net, curves: FeatureCurves, edge: float) -> Net:
    """Return the mesh with vertices moved to make triangles nearly equilateral. edge : wanted edge length, metres."""
    V, F, n = net.V, net.F, net.n
    doubled = area_vectors(V, F)
    weight = lengths(doubled) / net.size[F].mean(axis=1) ** 2
    centre = V[F].mean(axis=1) * weight[:, None]
    normal = _corner_sums(F, doubled, n)
    normal /= np.maximum(lengths(normal), np.finfo(float).tiny)[:, None]
    step = _corner_sums(F, centre, n) / np.bincount(F.ravel(), np.repeat(weight, 3), minlength=n)[:, None] - V
    step -= normal * np.einsum("ni,ni->n", normal, step)[:, None]
    goal = V + np.where((net.kind == FREE)[:, None], step, 0)
    positions = _even_steps(net, curves, edge)
    inner = net.kind[net.node] < FIXED
    goal[net.node[inner]] = curves.place(positions[inner])
    return with_vertices_at(net, goal, positions)


def with_vertices_on(net: Net, nearest: NearestOnSurface) -> Net:
    """Return the mesh with all vertices off boundaries and creases moved onto the surface of `nearest`."""
    goal, free = net.V.copy(), np.flatnonzero(net.kind == FREE)
    goal[free] = nearest(net.V[free])[1]
    return with_vertices_at(net, goal, net.at)


def _corner_sums(F: Ints, values: Floats, n: int) -> Floats:
    corners = F.ravel()
    return np.stack([np.bincount(corners, np.repeat(x, 3), minlength=n) for x in values.T], axis=1)


def _even_steps(net: Net, curves: FeatureCurves, edge: float) -> Floats:
    places = net.at.copy()
    for parity in (0, 1):
        k = np.arange(1 + parity, max(len(places) - 1, 1 + parity), 2)
        k = k[(net.curve[k - 1] == net.curve[k]) & (net.curve[k + 1] == net.curve[k])]
        size = net.size[net.node]
        before, after = size[k - 1] + size[k], size[k] + size[k + 1]
        goal = (places[k - 1] * after + places[k + 1] * before) / (before + after)
        goal = (goal + places[k]) / 2
        deviation = np.maximum(curves.deviation(places[k - 1], goal)[0], curves.deviation(goal, places[k + 1])[0])
        was = np.maximum(curves.deviation(places[k - 1], places[k])[0], curves.deviation(places[k], places[k + 1])[0])
        fine = deviation <= np.maximum(TOLERANCE * edge, was)
        places[k[fine]] = goal[fine]
    return places


def with_vertices_at(net: Net, goal: Floats, positions: Floats) -> Net:
    """Return the mesh with vertices moved to points `goal` (n, 3), metres.
    A vertex does not move if the move would rotate a face by over 60 degrees.
    positions : (k,) arc lengths, metres, of the vertices on boundaries and creases."""
    old_areas, V = area_vectors(net.V, net.F), goal.copy()
    face = np.arange(len(net.F))
    retreats = 6  # rounds that put back single vertices; then all vertices go back
    for k in range(retreats + 1):
        new_areas = area_vectors(V, net.F[face])
        was = old_areas[face]
        bad = np.einsum("mi,mi->m", was, new_areas) < 0.5 * lengths(was) * lengths(new_areas)
        if not bad.any():
            break
        back = np.unique(net.F[face[bad]])
        V[back] = net.V[back]
        if k == retreats:
            V, positions = net.V, net.at
    return replace(net, V=V, at=np.where((V != net.V).any(axis=1)[net.node], positions, net.at))
