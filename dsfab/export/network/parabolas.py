"""Curves and patches of degree 2 in place of 3, where nobody sees a difference: they have fewer poles to be written.

A cubic is a parabola where its third difference is 0. Along members and across them it nearly always is, to less than a
hundredth of what a solid may be off its mesh: of a catenoid two curves in three are, and the others are round corners.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.curves import ChainCurve

OFF = 1 / 10
"""Share of the distance that a solid may be off the mesh by which a parabola may be off a cubic."""

TURNED = np.tan(np.deg2rad([0.5, 0.25]))
"""Tangents of how far it may turn the ends of one, and out of the skins: these are smooth across borders."""

NOTHING = 1e-8
"""Millimetres of a third difference that is none: curves are cut and turned before they are written."""

BOW = np.sqrt(3) / 36
"""Largest value of x (1/2 - x) (1 - x): what a third difference of 1 bends a cubic away from a parabola."""


def with_parabolas(curves: Sequence[ChainCurve], distance: float, box: Floats) -> list[ChainCurve]:
    """Curves, as parabolas those whose cubics all are nearly one; a solid may be off its mesh by `distance`,
    millimetres. Where their poles, which are farther out, would leave a box (2, 3) by more, they stay cubics."""
    wide = box + distance * np.array([[-1.0], [1.0]])
    return [
        replace(curve, spans=lowered(curve.spans, 1)) if _nearly(curve.spans, OFF * distance, wide) else curve
        for curve in curves
    ]


def lowered(P: Floats, axis: int) -> Floats:
    """(k, 4, 6), or any with 4 along an axis: cubics as the parabolas through their ends and middles, still 4 poles."""
    P = P.swapaxes(0, axis)
    third = _third(P) / 6
    return np.stack([P[0], P[1] - third, P[2] + third, P[3]]).swapaxes(0, axis)


def lowered_patches(P: Floats, distance: float) -> Floats:
    """Patches of a region (ku, kv, 4, 4, 6) of degree 2 in each direction in which its sides are parabolas, where that
    moves no pole by more than a share of `distance`, millimetres; the sides stay."""
    for axis, sides in ((2, P[:, [0, -1], :, [0, -1]]), (3, P[[0, -1], :, [0, -1]])):
        if np.abs(_third(sides.swapaxes(0, -2))).max() < NOTHING:
            Q = lowered(P, axis)
            if np.abs(Q - P).max() <= OFF * distance:
                P = Q
    return P


def fewest(P: Floats, axis: int) -> Floats:
    """The poles of what is a parabola along an axis, 3 there as in (k, 3, 6), or those that are given, as (k, 4, 6)."""
    P = P.swapaxes(0, axis)
    if len(P) == 4 and np.abs(_third(P)).max() < NOTHING:
        P = np.stack([P[0], _middle_pole(P), P[3]])
    return P.swapaxes(0, axis)


def _third(P: Floats) -> Floats:
    """(..) third differences of poles (4, ..)."""
    return np.asarray(P[3] - P[0] - 3 * (P[2] - P[1]))


def _middle_pole(P: Floats) -> Floats:
    """(..) of parabolas given as cubics with poles (4, ..); the same to the last digit of those turned around."""
    return np.asarray((3 * (P[1] + P[2]) - (P[0] + P[3])) / 4)


def _nearly(spans: Floats, most: float, box: Floats) -> bool:
    """Whether cubics (k, 4, 6) are parabolas on both skins to `most` millimetres."""
    P = spans.reshape(-1, 4, 2, 3).swapaxes(0, 1)
    outer = _middle_pole(P)
    if (outer < box[0]).any() or (outer > box[1]).any():
        return False
    across = (P[:, :, 0] - P[:, :, 1]).sum(axis=0)[:, None]
    across = across / np.linalg.norm(across, axis=2, keepdims=True)
    third = _third(P)
    off, out = np.linalg.norm(third, axis=2), np.abs((third * across).sum(axis=2))
    handle = 3 * np.linalg.norm(P[[1, 3]] - P[[0, 2]], axis=3).min(axis=0)
    turned = (off / 2 <= TURNED[0] * handle) & (out / 2 <= TURNED[1] * handle)
    return bool((turned & (BOW * off <= most)).all())
