"""Where outlines of a skin cross: OCCT calls such a face valid within its tolerances, and makes no triangles of it."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.smooth.edges import Edge
from dsfab.export.smooth.solid import SmoothPiece, SmoothSkin

SAMPLES = 16
"""Chords of each curve, of which crossings are looked for."""

SHARP = 0.5
"""Cosine of the angle between the sides of a corner that is sharp."""

ROUNDED = 1e-9
"""Share of a chord's length within which a point counts as on it."""


def crossings(piece: SmoothPiece) -> Floats:
    """(k, 3) places on the upper side where the curves of a skin cross each other over the plane of their chart."""
    return np.concatenate([np.zeros((0, 3)), *(_in_skin(piece, skin) for skin in piece.skins)])


def _in_skin(piece: SmoothPiece, skin: SmoothSkin) -> Floats:
    x = np.linspace(0, 1, SAMPLES + 1)
    edges = [piece.edges[i] for loop in skin.loops for i, _ in loop]
    flat = np.stack([edge.flat[skin.chart](x) for edge in edges])
    start, end = flat[:, :-1].reshape(-1, 2), flat[:, 1:].reshape(-1, 2)
    one, two = _near(start, end)
    found = _across(start, end, one, two) & _across(start, end, two, one)
    places = np.stack([edge.upper(x[:-1]) for edge in edges]).reshape(-1, 3)
    ends = np.concatenate([edge.upper(x[[0, -1]]) for edge in edges])
    return np.concatenate([places[np.unique(np.r_[one[found], two[found]])], ends[_twisted(edges, skin)]])


def _twisted(edges: list[Edge], skin: SmoothSkin) -> Ints:
    """The ends 2 k and 2 k + 1 of edges k at sharp corners whose sides change places close to them: they cross there.

    The chords that meet at a corner do not show that; the tangents do, beside the ways to the middles of the edges.
    """
    way = np.array([way for loop in skin.loops for _, way in loop])
    number = np.split(np.arange(len(way)), np.cumsum([len(loop) for loop in skin.loops])[:-1])
    before = np.concatenate([np.roll(some, 1) for some in number])
    flat = [edge.flat[skin.chart] for edge in edges]
    lines = [curve.poles[:: 1 if ahead else -1] for curve, ahead in zip(flat, way, strict=True)]
    middle = np.concatenate([curve(np.array([0.5])) for curve in flat])
    into, out = (np.stack([line[[0, 1, -2, -1]] for line in lines])[i] for i in (before, np.arange(len(way))))
    near = into[:, 3] - into[:, 2], out[:, 1] - out[:, 0]
    far = into[:, 3] - middle[before], middle - out[:, 0]
    sharp = np.einsum("ki,ki->k", *near) < -SHARP * np.prod([np.linalg.norm(v, axis=1) for v in near], axis=0)
    bad = np.flatnonzero(sharp & (_turn(*near) * _turn(*far) < 0))
    return np.concatenate([2 * before[bad] + way[before[bad]], 2 * bad + ~way[bad]])


def _turn(one: Floats, two: Floats) -> Floats:
    """(k,) positive where vectors turn to the left."""
    return np.asarray(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


def _near(start: Floats, end: Floats) -> tuple[Ints, Ints]:
    """Pairs of chords that may cross, without those that meet at their ends."""
    middle, long = (start + end) / 2, np.linalg.norm(end - start, axis=1)
    reach = long.max()
    one, two = cKDTree(middle).query_pairs(reach, output_type="ndarray").T
    apart = np.linalg.norm(middle[one] - middle[two], axis=1)
    close = apart <= (1 + ROUNDED) * (long[one] + long[two]) / 2  # chords that cross are; most others are shorter
    one, two = one[close], two[close]
    meet = np.zeros(len(one), dtype=bool)
    for a in (start, end):
        for b in (start, end):
            meet |= np.linalg.norm(a[one] - b[two], axis=1) < 1e-9 * reach
    return one[~meet], two[~meet]


def _across(start: Floats, end: Floats, line: Ints, chord: Ints) -> Bools:
    """(k,) whether the ends of a chord lie on different sides of a line, and neither on it but for rounding."""
    along = (end - start)[line]
    long = np.linalg.norm(along, axis=1)
    to, past = start[chord] - start[line], end[chord] - start[line]
    first, second = _turn(along, to) / long, _turn(along, past) / long
    return np.asarray((first * second < 0) & (np.minimum(np.abs(first), np.abs(second)) > ROUNDED * long))
