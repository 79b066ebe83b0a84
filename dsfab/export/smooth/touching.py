"""Where outlines of a skin cross: OCCT calls such a face valid within its tolerances, and makes no triangles of it."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.smooth.solid import Piece, Skin

SAMPLES = 16
"""Chords of each curve, of which crossings are looked for."""

ROUNDED = 1e-9
"""Share of a chord's length within which a point counts as on it."""


def crossings(piece: Piece) -> Floats:
    """(k, 3) places on the upper side where the curves of a skin cross each other over the plane of their chart."""
    return np.concatenate([np.zeros((0, 3)), *(_in_skin(piece, skin) for skin in piece.skins)])


def _in_skin(piece: Piece, skin: Skin) -> Floats:
    x = np.linspace(0, 1, SAMPLES + 1)
    edges = [piece.edges[i] for loop in skin.loops for i, _ in loop]
    flat = np.stack([edge.flat[skin.chart](x) for edge in edges])
    start, end = flat[:, :-1].reshape(-1, 2), flat[:, 1:].reshape(-1, 2)
    one, two = _near(start, end)
    found = _across(start, end, one, two) & _across(start, end, two, one)
    places = np.stack([edge.upper(x[:-1]) for edge in edges]).reshape(-1, 3)
    return np.asarray(places[np.unique(np.concatenate([one[found], two[found]]))])


def _near(start: Floats, end: Floats) -> tuple[Ints, Ints]:
    """Pairs of chords that may cross, without those that meet at their ends."""
    reach = np.linalg.norm(end - start, axis=1).max()
    one, two = cKDTree((start + end) / 2).query_pairs(reach, output_type="ndarray").T
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
    first, second = ((along[:, 0] * v[:, 1] - along[:, 1] * v[:, 0]) / long for v in (to, past))
    return np.asarray((first * second < 0) & (np.minimum(np.abs(first), np.abs(second)) > ROUNDED * long))
