"""Boundaries, creases and corners of a surface, as curves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, distances_from_segments, lengths
from dsfab.surface.edge_changes import CREASE, border_edges, sharp_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import link_components

TOLERANCE = 1 / 50  # Largest move of boundaries and creases, in edge lengths.
CORNER = 30.0  # Least bend of a curve at a corner, degrees.
DULL = 0.6 * CREASE  # Least angle between the mean normals beside a short crease, degrees.
FINE = 1 / 80  # Largest radius for averaging a scan's normals, divided by the diagonal of its box.


class SmoothVertices(NamedTuple):
    """Vertices (k,) where exactly two edges of a curve meet.    edges : (k, 2) indices of the two edges.
    turn : (k,) angle between the edges' directions, radians.    arm : (k,) length of the shorter edge, metres."""

    vertex: Ints
    edges: Ints
    turn: Floats
    arm: Floats


def vertices_of_two_edges(V: Floats, ends: Ints) -> SmoothVertices:
    """Return the vertices of V (n, 3) at which exactly two edges of `ends` (e, 2) meet."""
    order = np.argsort(ends.ravel(), kind="stable")
    vertex = ends.ravel()[order]
    start = np.flatnonzero(np.diff(vertex, prepend=-1))
    two = start[np.diff(np.append(start, len(vertex))) == 2]
    places = np.stack([order[two], order[two + 1]], axis=1)
    far_ends = ends.ravel()[places ^ 1]
    inner = vertex[two]
    p, q = V[inner] - V[far_ends[:, 0]], V[far_ends[:, 1]] - V[inner]
    turn = np.arctan2(lengths(np.cross(p, q)), np.einsum("ki,ki->k", p, q))
    return SmoothVertices(inner, places // 2, turn, np.minimum(lengths(p), lengths(q)))


def design_features(surface: Surface, edge: float) -> Bools:
    """Return a mask (e,) of the edges on boundaries, seams and creases. Short creases with small angles do not count.
    edge : wanted edge length of a new mesh, metres."""
    sharp = sharp_edges(surface)
    marks = border_edges(surface) | sharp
    crease = np.flatnonzero(sharp)
    scale = max(edge, min(2 * surface.mean_edge, FINE * surface.size))
    short = crease[_crease_lengths(surface, crease) < 2 * scale]
    marks[short[_mean_bends(surface, short, scale) < np.radians(DULL)]] = False
    return marks


def _crease_lengths(surface: Surface, crease: Ints) -> Floats:
    passes = vertices_of_two_edges(surface.V, surface.edges.ends[crease])
    smooth = passes.edges[passes.turn < np.radians(CORNER)]
    count, part = link_components(len(crease), smooth[:, 0], smooth[:, 1])
    return np.asarray(np.bincount(part, surface.edge_lengths[crease], minlength=count)[part])


def _mean_bends(surface: Surface, crease: Ints, radius: float) -> Floats:
    if not len(crease):
        return np.zeros(0)
    start = surface.edges.start[crease]
    faces = np.stack([surface.edges.order[start], surface.edges.order[start + 1]], axis=1) // 3
    middle = surface.V[surface.edges.ends[crease]].mean(axis=1)
    toward = surface.centroids[faces] - middle[:, None]
    toward /= lengths(toward)[:, :, None]
    across = toward[:, 0] - toward[:, 1]
    _, near_faces = cKDTree(surface.centroids).query(middle, k=min(128, surface.m), distance_upper_bound=radius)
    near_faces = np.concatenate([near_faces.reshape(len(crease), -1), faces], axis=1)
    exists = near_faces < surface.m
    near_faces = np.where(exists, near_faces, 0)
    side = np.einsum("cki,ci->ck", surface.centroids[near_faces] - middle[:, None], across)
    weight = np.where(exists, surface.areas[near_faces], 0)
    u, v = (np.einsum("ck,cki->ci", weight * on_side, surface.normals[near_faces]) for on_side in (side > 0, side <= 0))
    bend = np.arctan2(lengths(np.cross(u, v)), np.einsum("ci,ci->c", u, v))
    slight = np.minimum(lengths(u), lengths(v)) < TOLERANCE * radius * surface.edge_lengths[crease]
    return np.where(slight, 0, bend)  # very narrow faces at the boundary have unreliable normals


@dataclass(frozen=True, eq=False)
class FeatureCurves:
    """The boundaries and creases of a surface as curves. Arc length continues from each curve to the next.
    points : (p, 3) the vertices along all curves, metres.    at : (p,) arc length at each point, metres.
    curve, vertex : (p,) number of each point's curve, and index of the surface's vertex.
    fixed  : (q,) vertices of the surface that may not move."""

    points: Floats
    at: Floats
    curve: Ints
    vertex: Ints
    fixed: Ints

    def place(self, positions: Floats) -> Floats:
        """Return the points (k, 3) of the curves at arc lengths `positions` (k,), metres."""
        k = np.clip(np.searchsorted(self.at, positions, side="right"), 1, len(self.at) - 1)
        t = np.clip((positions - self.at[k - 1]) / (self.at[k] - self.at[k - 1]), 0, 1)[:, None]
        return (1 - t) * self.points[k - 1] + t * self.points[k]

    def points_between(self, start: Floats, end: Floats) -> tuple[Ints, Ints]:
        """Return pairs (j,), (j,): index of an interval of arc length, and index of a point in this interval.
        start, end : (k,) ends of the intervals, metres."""
        low, high = np.searchsorted(self.at, start, side="right"), np.searchsorted(self.at, end, side="left")
        count = np.maximum(high - low, 0)
        which = np.repeat(np.arange(len(start)), count)
        return which, np.arange(len(which)) - (np.cumsum(count) - count)[which] + low[which]

    def deviation(self, start: Floats, end: Floats) -> tuple[Floats, Floats]:
        """Return the largest distance (k,) of the curve from each chord, and the arc length (k,) at this distance.
        start, end : (k,) arc lengths at the ends of the chords, metres."""
        which, point = self.points_between(start, end)
        distance = distances_from_segments(self.points[point], self.place(start)[which], self.place(end)[which])
        largest = np.zeros(len(start))
        np.maximum.at(largest, which, distance)
        position = (start + end) / 2
        reached = distance == largest[which]
        position[which[reached]] = self.at[point[reached]]
        return largest, position


def feature_curves(surface: Surface, edge: float) -> FeatureCurves:
    """Return the boundaries, creases and seams of a surface. Short creases with small angles do not count.
    edge : wanted edge length of a new mesh, metres."""
    ends = surface.edges.ends[design_features(surface, edge)]
    extremes = np.concatenate([surface.V.argmin(axis=0), surface.V.argmax(axis=0), surface.pinches])
    corners = np.zeros(surface.n, dtype=bool)
    corners[extremes] = True
    corners |= _corners(surface.V, ends, edge)
    chains = _chains(ends, corners)
    fixed = np.unique(np.concatenate([np.flatnonzero(corners), *(chain[:1] for chain in chains)]))
    if not chains:
        return FeatureCurves(np.zeros((0, 3)), np.zeros(0), fixed[:0], fixed[:0], fixed)
    vertex, curve = np.concatenate(chains), np.repeat(np.arange(len(chains)), [len(chain) for chain in chains])
    points = surface.V[vertex]
    step = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1)
    step[np.diff(curve, prepend=0) > 0] = surface.size  # a gap in arc length between two successive curves
    return FeatureCurves(points, np.cumsum(step), curve, vertex, fixed)


def _corners(V: Floats, ends: Ints, edge: float) -> Bools:
    degree = np.bincount(ends.ravel(), minlength=len(V))
    corners: Bools = (degree > 0) & (degree != 2)
    passes = vertices_of_two_edges(V, ends)
    missed = np.minimum(passes.arm, edge / 2) * np.sin(passes.turn / 2)
    corners[passes.vertex] = (passes.turn > np.radians(CORNER)) | (missed > 1.5 * TOLERANCE * edge)
    return corners


def _chains(ends: Ints, corners: Bools) -> list[Ints]:
    around: dict[int, list[int]] = {}
    for a, b in ends.tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    stops = {v for v in around if corners[v]}
    chains = []
    for starts in (sorted(stops), sorted(around)):
        for start in starts:
            while around[start]:
                chain, vertex = [start], around[start].pop()
                around[vertex].remove(start)
                while vertex != start and vertex not in stops:
                    chain.append(vertex)
                    vertex, before = around[vertex].pop(), vertex
                    around[vertex].remove(before)
                chains.append(np.array([*chain, vertex]))
    return chains
