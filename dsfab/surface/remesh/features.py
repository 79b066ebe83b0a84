"""Boundaries, creases and corners that remeshing preserves, as curves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, from_segments, lengths
from dsfab.surface.edge_changes import CREASE, border_edges, sharp_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected

TOLERANCE = 1 / 50
"""Of the edge: how far the new boundaries and creases may be from those of the input."""

CORNER = 30.0
"""Degrees by which a curve turns at a vertex from which that is a corner."""

DULL = 0.6 * CREASE
"""Degrees between the mean normals on both sides of a crease below which that is one of a few faces only."""

FRAGMENT = 2.0
"""Times that length: shorter creases that are dull are slivers or noise. A longer one is a small step of the design."""

AROUND = 128
"""How many faces within the length of an edge, at most, make the mean normals."""

NOISY = 2.0
"""Times the mean edge of the file: normals are averaged over as much, however short the new edges are, for noise is as
wide as the file's own faces."""

FINE = 1 / 80
"""Of the box's diagonal, which `NOISY` does not go beyond: a file of longer edges is drawn, not scanned, and a bend
between two of its faces is meant."""


class Passes(NamedTuple):
    """Vertices (k,) in which just two of some edges meet, which (k, 2), by how much (k,) they turn there, radians, and
    the length (k,) of the shorter one, metres."""

    vertex: Ints
    edges: Ints
    turn: Floats
    arm: Floats


def smooth_passes(V: Floats, ends: Ints) -> Passes:
    """The vertices of V (n, 3) in which two of the edges (e, 2) meet, smoothly or not."""
    order = np.argsort(ends.ravel(), kind="stable")
    vertex = ends.ravel()[order]
    start = np.flatnonzero(np.diff(vertex, prepend=-1))
    two = start[np.diff(np.append(start, len(vertex))) == 2]
    at = np.stack([order[two], order[two + 1]], axis=1)
    other = ends.ravel()[at ^ 1]
    inner = vertex[two]
    p, q = V[inner] - V[other[:, 0]], V[other[:, 1]] - V[inner]
    turn = np.arctan2(lengths(np.cross(p, q)), np.einsum("ki,ki->k", p, q))
    return Passes(inner, at // 2, turn, np.minimum(lengths(p), lengths(q)))


def design_features(surface: Surface, edge: float) -> Bools:
    """(e,) boundaries, seams and creases, without short pieces of creases that are sharp on a few faces only: the edges
    of slivers and the noise of scans, at the scale of new edges of `edge` metres or of a scan's own."""
    sharp = sharp_edges(surface)
    marks = border_edges(surface) | sharp
    crease = np.flatnonzero(sharp)
    scale = max(edge, min(NOISY * surface.mean_edge, FINE * surface.size))
    short = crease[_stretches(surface, crease) < FRAGMENT * scale]
    marks[short[_mean_bends(surface, short, scale) < np.radians(DULL)]] = False
    return marks


def _stretches(surface: Surface, crease: Ints) -> Floats:
    """(c,) the length of the smooth curve of creases (c,) that each is part of, metres."""
    ends = surface.edges.ends[crease]
    passes = smooth_passes(surface.V, ends)
    smooth = passes.edges[passes.turn < np.radians(CORNER)]
    count, part = connected(len(crease), smooth[:, 0], smooth[:, 1])
    return np.asarray(np.bincount(part, surface.edge_lengths[crease], minlength=count)[part])


def _mean_bends(surface: Surface, crease: Ints, radius: float) -> Floats:
    """(c,) angles between the mean normals of the faces around each crease (c,), on its one side and on the other,
    radians."""
    if not len(crease):
        return np.zeros(0)
    start = surface.edges.start[crease]
    faces = np.stack([surface.edges.order[start], surface.edges.order[start + 1]], axis=1) // 3
    middle = surface.V[surface.edges.ends[crease]].mean(axis=1)
    toward = surface.centroids[faces] - middle[:, None]
    toward /= lengths(toward)[:, :, None]
    across = toward[:, 0] - toward[:, 1]
    tree = cKDTree(surface.centroids)
    _, near = tree.query(middle, k=min(AROUND, surface.m), distance_upper_bound=radius)
    near = np.concatenate([near.reshape(len(crease), -1), faces], axis=1)
    there = near < surface.m
    near = np.where(there, near, 0)
    side = np.einsum("cki,ci->ck", surface.centroids[near] - middle[:, None], across)
    weight = np.where(there, surface.areas[near], 0)
    u, v = (np.einsum("ck,cki->ci", weight * on, surface.normals[near]) for on in (side > 0, side <= 0))
    bend = np.arctan2(lengths(np.cross(u, v)), np.einsum("ci,ci->c", u, v))
    slight = np.minimum(lengths(u), lengths(v)) < TOLERANCE * radius * surface.edge_lengths[crease]
    return np.where(slight, 0, bend)  # a sliver alone, at the boundary, has no direction


KINK = 1.5
"""Times the tolerance: a vertex of a curve that a chord of an edge past it would miss by more is a corner too."""


@dataclass(frozen=True, eq=False)
class FeatureCurves:
    """The boundaries and creases of a surface: curves between corners, one after another on one axis of length.

    points : (p, 3) the vertices of all curves in their order, metres.   at : (p,) their places on the axis, metres.
    curve  : (p,) the curve of each.   vertex : (p,) which vertex of the surface each is.
    fixed  : (q,) vertices of the surface that stay: corners, and the extremes of its box.
    """

    points: Floats
    at: Floats
    curve: Ints
    vertex: Ints
    fixed: Ints

    def place(self, at: Floats) -> Floats:
        """(k, 3) the points at places (k,) of the axis, metres."""
        k = np.clip(np.searchsorted(self.at, at, side="right"), 1, len(self.at) - 1)
        t = np.clip((at - self.at[k - 1]) / (self.at[k] - self.at[k - 1]), 0, 1)[:, None]
        return (1 - t) * self.points[k - 1] + t * self.points[k]

    def between(self, start: Floats, end: Floats) -> tuple[Ints, Ints]:
        """(j,) which of intervals (k,) of the axis, and (j,) points of the curves that lie inside of it."""
        low, high = np.searchsorted(self.at, start, side="right"), np.searchsorted(self.at, end, side="left")
        count = np.maximum(high - low, 0)
        which = np.repeat(np.arange(len(start)), count)
        first = np.cumsum(count) - count
        return which, np.arange(len(which)) - first[which] + low[which]

    def deviation(self, start: Floats, end: Floats) -> tuple[Floats, Floats]:
        """(k,) how far the curves leave their chords from start to end (k,), metres; (k,) where on the axis most."""
        which, point = self.between(start, end)
        far = from_segments(self.points[point], self.place(start)[which], self.place(end)[which])
        largest = np.zeros(len(start))
        np.maximum.at(largest, which, far)
        most = (start + end) / 2
        reached = far == largest[which]
        most[which[reached]] = self.at[point[reached]]
        return largest, most


def feature_curves(surface: Surface, edge: float) -> FeatureCurves:
    """The boundaries, the creases and the seams of a one-sided surface, for edges of `edge` metres.

    A vertex where other than two of their edges meet, where a curve turns sharply, or which is the outermost of the
    surface in x, y or z is fixed.
    """
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
    step[np.diff(curve, prepend=0) > 0] = surface.size  # curves lie apart on the axis
    return FeatureCurves(points, np.cumsum(step), curve, vertex, fixed)


def _corners(V: Floats, ends: Ints, edge: float) -> Bools:
    """(n,) vertices of the feature edges (e, 2) that no curve passes smoothly."""
    degree = np.bincount(ends.ravel(), minlength=len(V))
    corners: Bools = (degree > 0) & (degree != 2)
    passes = smooth_passes(V, ends)
    missed = np.minimum(passes.arm, edge / 2) * np.sin(passes.turn / 2)
    corners[passes.vertex] = (passes.turn > np.radians(CORNER)) | (missed > KINK * TOLERANCE * edge)
    return corners


def _chains(ends: Ints, corners: Bools) -> list[Ints]:
    """Vertices (k,) of each curve from corner to corner along edges (e, 2); a closed one without a corner begins at
    the first of its vertices."""
    around: dict[int, list[int]] = {}
    for a, b in ends.tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    stops = {v for v in around if corners[v]}
    chains = []
    for starts in (sorted(stops), sorted(around)):
        for start in starts:
            while around[start]:
                chain, at = [start], around[start].pop()
                around[at].remove(start)
                while at != start and at not in stops:
                    chain.append(at)
                    at, before = around[at].pop(), at
                    around[at].remove(before)
                chains.append(np.array([*chain, at]))
    return chains
