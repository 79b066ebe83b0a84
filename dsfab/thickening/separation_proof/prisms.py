"""Prisms over the cells: which may be folded, and how far they reach."""

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.thickening.separation_proof.boxes import Boxes
from dsfab.thickening.separation_proof.layer import OffsetLayer

CHUNK = 1 << 14
"""Cells looked at together: as many as the processor's cache takes."""

Three = tuple[Floats, Floats, Floats]


def prisms(layer: OffsetLayer, boxes: Boxes, off: float) -> tuple[Bools, Floats, Floats]:
    """(m',) prisms that may be folded; (k,) the least cosine between skins and axis in each box; (m',) the reach."""
    F, m = layer.cells.F, layer.cells.m
    upper = np.ascontiguousarray((layer.cells.V + (layer.shift + 1) * layer.carried).T)
    lower = np.ascontiguousarray((layer.cells.V + (layer.shift - 1) * layer.carried).T)
    box = boxes.of[layer.parent]
    axes = np.ascontiguousarray(boxes.axis.T)
    folded, reach, cosine = np.empty(m, dtype=bool), np.empty(m), np.empty(m)
    for begin in range(0, m, CHUNK):
        part = slice(begin, begin + CHUNK)
        corner = np.ascontiguousarray(F[part].T)
        over, under = (np.stack([column.take(corner) for column in skin]) for skin in (upper, lower))
        axis = np.stack([column.take(box[part]) for column in axes])
        folded[part], cosine[part], reach[part] = _prism(over, under, axis, off)
    least = np.ones(len(boxes.axis))
    np.minimum.at(least, box, cosine)
    return folded, least, reach


def _prism(upper: Floats, lower: Floats, axis: Floats, off: float) -> tuple[Bools, Floats, Floats]:
    """Of prisms with corners (3 xyz, 3, m): folded or not, the least cosine of their skins to an axis, their reach.

    They hold for corners that are off by up to `off`: a determinant of three vectors up to r long is off by 3 r^2 off,
    and the normal of a triangle of sides up to s by 4 s off.
    """
    middle = (upper.sum(axis=1) + lower.sum(axis=1)) / 6
    A, B = lower - middle[:, None], upper - middle[:, None]
    reach = np.sqrt(np.maximum((A**2).sum(axis=0), (B**2).sum(axis=0)).max(axis=0)) + off
    (p, q, r), (u, v, w) = ((P[:, 1] - P[:, 0], P[:, 2] - P[:, 0], P[:, 2] - P[:, 1]) for P in (A, B))
    bottom, top = _cross(q, p), _cross(u, v)
    least = np.minimum(_dot(bottom, A[:, 0]), _dot(top, B[:, 0]))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        under, over = _cross(A[:, i], A[:, j]), _cross(B[:, j], B[:, i])
        for side, point in ((under, B[:, j]), (under, B[:, i]), (over, A[:, i]), (over, A[:, j])):
            np.minimum(least, _dot(side, point), out=least)
    cosines = []
    for normal, sides, sign in ((top, (u, v, w), 1), (bottom, (p, q, r), -1)):
        length = np.maximum(np.sqrt(_dot(normal, normal)), np.finfo(float).tiny)
        side = np.sqrt(np.maximum.reduce([_dot(s, s) for s in sides])) + 2 * off
        tilt = 5 * off * side / length
        cosines.append(np.where(tilt < 0.5, sign * _dot(normal, axis) / length - 2 * tilt, -1.0))
    return least <= 4 * off * reach**2, np.minimum(*cosines), reach


def _cross(a: Floats, b: Floats) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Three, b: Floats | Three) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
