"""Polygons with five corners and more to triangles, each seen along its mean normal.

Few corners: the ear with the shortest cut is clipped again and again, all polygons of one size together. More: earcut
[Mapbox], which takes n^2 steps where outlines are long and smooth, or have long teeth. Many: Delaunay triangles between
the sides [CDT], n log n steps whatever the outline; earcut where that touches itself, as at a bridge to a hole.
"""

from itertools import pairwise
from typing import Any

import mapbox_earcut
import numpy as np
import pythoncdt as cdt

from dsfab.arrays import Bools, Floats, Ints

FEW = 12
"""Corners up to which ears are clipped by their cuts: it takes k^3 steps."""
MANY = 2000
"""Corners above which triangles are Delaunay's: of a comb of 100,000 earcut's take 4 s, these .2 s."""
NOISE = 32 * float(np.finfo(np.float64).eps)
"""A corner is straight where it is off the line of its neighbours by less, as a share of the largest coordinate."""
SAME_AREA = 1e-6
"""Largest accepted difference between the area of a polygon and that of its triangles, relative."""
ORDER = cdt.VertexInsertionOrder.AUTO
"""Of points: those near to each other follow each other."""
TOGETHER = 1 << 12
"""Polygons of one size that are cut together: as many as keep their numbers in the processor's cache."""


def small_polygons_cut(P: Floats) -> Ints:
    """(q, k - 2, 3) triangles, as corners 0..k-1, of q polygons P (q, k, 3) with 5 <= k <= `FEW` corners.

    Where no corner is an ear (a polygon that crosses itself) the shortest cut of all is made.
    """
    parts = [_ears(P[first : first + TOGETHER]) for first in range(0, len(P), TOGETHER)]
    return np.concatenate(parts) if parts else np.empty((0, P.shape[1] - 2, 3), dtype=np.int64)


def _ears(P: Floats) -> Ints:
    q, k, _ = P.shape
    P = P - P[:, :1]
    normal = np.cross(P, np.roll(P, -1, axis=1)).sum(axis=1)
    left, rows, cuts = np.tile(np.arange(k), (q, 1)), np.arange(q), []
    while left.shape[1] > 3:
        before, after = np.roll(left, 1, axis=1), np.roll(left, -1, axis=1)
        is_ear = _are_ears(P[rows[:, None], left], normal)
        length = np.linalg.norm(P[rows[:, None], before] - P[rows[:, None], after], axis=2)
        length = np.where(is_ear | ~is_ear.any(axis=1, keepdims=True), length, np.inf)
        best = length.argmin(axis=1)
        cuts.append(np.stack([before[rows, best], left[rows, best], after[rows, best]], axis=1))
        left = left[np.arange(left.shape[1]) != best[:, None]].reshape(q, -1)
    return np.stack([*cuts, left], axis=1)


def _are_ears(P: Floats, normal: Floats) -> Bools:
    """(q, k) whether a corner of P (q, k, 3) is convex and its triangle empty, seen along normal (q, 3)."""
    k = P.shape[1]
    a, b, c = np.roll(P, 1, axis=1), P, np.roll(P, -1, axis=1)
    convex = np.einsum("qki,qi->qk", np.cross(b - a, c - b), normal) > 0
    others = P[:, (np.arange(k)[:, None] + np.arange(2, k - 1)) % k]  # (q, k, k - 3, 3): all but the ear's three
    within = np.ones(others.shape[:3], dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        side = np.cross((end - start)[:, :, None], others - start[:, :, None])
        within &= np.einsum("qkoi,qi->qko", side, normal) >= 0
    ears: Bools = convex & ~within.any(axis=2)
    return ears


def large_polygon_cut(P: Floats) -> Ints | None:
    """(k - 2, 3) triangles of one polygon P (k, 3), as corners 0..k-1, cut as it is seen along its normal.

    None where it crosses itself there, or has no area.

    Every corner is a corner of a triangle, also those in the middle of a straight side: neighbours may end there.
    """
    flat, noise = _in_plane(P)
    x, y = flat.T
    area = float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    if not area > 0:
        return None
    ring, runs = _without_straight(flat, noise)
    F = _with_runs(ring[_ring_cut(flat[ring])], runs)
    twice = _twice_areas(flat, F)
    sound = len(F) == len(P) - 2 and bool((twice > 0).all()) and abs(float(twice.sum()) - area) <= SAME_AREA * area
    return F if sound else None


def fan(k: int) -> Ints:
    """(k - 2, 3) triangles from the first of k corners."""
    return np.array([[0, b, c] for b, c in pairwise(range(1, k))], dtype=np.int64)


def _ring_cut(flat: Floats) -> Ints:
    """(t, 3) triangles of an outline (k, 2)."""
    if len(flat) <= MANY:
        return _earcut(flat)
    cut, ends = cdt.Triangulation(ORDER, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0), np.arange(len(flat))
    points: Any = np.ascontiguousarray(flat)  # a buffer, which Python has a word for from 3.12 on
    sides: Any = np.stack([ends, np.roll(ends, -1)], axis=1).astype(np.uint32)
    try:
        cut.insert_vertices(points)
        cut.insert_edges(sides)
    except RuntimeError:  # points twice, or sides that cross
        return _earcut(flat)
    cut.erase_outer_triangles()
    return np.asarray(cut.triangles_array()["vertices"], dtype=np.int64)


def _earcut(flat: Floats) -> Ints:
    found = mapbox_earcut.triangulate_float64(np.ascontiguousarray(flat), np.array([len(flat)], dtype=np.uint32))
    F: Ints = np.asarray(found, dtype=np.int64).reshape(-1, 3)
    turned = _twice_areas(flat, F) < 0  # versions differ in the direction
    return np.where(turned[:, None], F[:, ::-1], F)


def _in_plane(P: Floats) -> tuple[Floats, float]:
    """(k, 2) P (k, 3) in a plane square to its mean normal, counter-clockwise, in units of its size; and its noise."""
    size = float(np.ptp(P, axis=0).max()) or 1.0
    noise = NOISE * max(1.0, float(np.abs(P).max()) / size)
    P = (P - P.mean(axis=0)) / size
    normal = np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0)
    drop = int(np.abs(normal).argmax())
    right = np.cross(np.eye(3)[(drop + 1) % 3], normal)
    axes = np.stack([right, np.cross(normal, right)])
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    flat: Floats = P @ np.divide(axes, length, out=np.zeros_like(axes), where=length > 0).T
    return flat, noise


def _twice_areas(flat: Floats, F: Ints) -> Floats:
    a, b, c = flat[F[:, 0]], flat[F[:, 1]], flat[F[:, 2]]
    ab, ac = b - a, c - a
    twice: Floats = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    return twice


def _turns(flat: Floats) -> tuple[Floats, Bools]:
    """Of every corner of an outline (k, 2): how far it is right of the line between its neighbours, and whether the
    outline goes on there rather than back."""
    to, on = flat - np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0) - flat
    cut = np.linalg.norm(to + on, axis=1)
    twice = to[:, 0] * on[:, 1] - to[:, 1] * on[:, 0]
    height: Floats = np.divide(twice, cut, out=np.zeros_like(cut), where=cut > 0)
    return height, np.asarray(np.einsum("ki,ki->k", to, on) > 0)


def _without_straight(flat: Floats, noise: float) -> tuple[Ints, list[Ints]]:
    """The corners where the outline turns, and the straight runs between two of them, both ends included."""
    k = len(flat)
    height, onward = _turns(flat)
    turning = np.flatnonzero((np.abs(height) > noise) | ~onward)
    if len(turning) < 3:
        return np.arange(k), []
    ends = np.append(turning, turning[0] + k)
    return turning, [np.arange(a, b + 1) % k for a, b in pairwise(ends.tolist()) if b > a + 1]


def _with_runs(F: Ints, runs: list[Ints]) -> Ints:
    """Triangles F (t, 3) with straight runs in place of the sides from their first to their last corner.

    A run fans out from the corner opposite its side.
    """
    if not runs:
        return F
    table = {edge: apex for a, b, c in F.tolist() for edge, apex in (((a, b), c), ((b, c), a), ((c, a), b))}
    more, gone = [], set()
    for run in runs:
        first, last = int(run[0]), int(run[-1])
        apex = table.get((first, last))
        if apex is None:  # the outline crosses itself
            continue
        gone.add(frozenset((first, last, apex)))
        corners = run.tolist()
        more += [(a, b, apex) for a, b in pairwise(corners)]
        table[apex, first], table[last, apex] = corners[1], corners[-2]
    whole = [(a, b, c) for a, b, c in (*map(tuple, F.tolist()), *more) if frozenset((a, b, c)) not in gone]
    return np.array(whole, dtype=np.int64).reshape(-1, 3)
