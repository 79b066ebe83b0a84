"""What remeshing keeps: boundaries and creases as curves, measured by their length, and the corners between them."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, from_segments
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.features import CORNER, TOLERANCE, design_features, smooth_passes

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
