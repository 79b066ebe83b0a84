"""Vertices moved to even triangles: free ones within the surface, those on curves along these."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import igl
import numpy as np

from dsfab.arrays import Floats, Ints, area_vectors, lengths
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.curves import FeatureCurves
from dsfab.surface.remesh.features import TOLERANCE
from dsfab.surface.remesh.net import FIXED, FREE, Net

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
