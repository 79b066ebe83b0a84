"""Whether a sheet hangs from masts, as a tent or a sail does, instead of standing on the low points of its edge."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lengths

CORNER = 45.0
"""Degrees in plan by which the edge turns at a corner from which it may hang."""
SCALLOP = 0.05
"""Share of the way between two corners by which an edge that a cable holds comes inwards in plan between them."""
SAG = 0.08
"""Share of the height by which the edge hangs below the line between two corners."""
SLANT = 0.3
"""Share of the height by which two corners differ between which a sail's edge may be straight in elevation, as a cable
in tension all but is; a shell's edge rises above that line."""
TAUT = 0.02
"""Share of the height by which such an edge is above the line at most."""


def mast_corners(P: Floats, arm: float, height: float) -> Ints:
    """(k,) where a sheet whose edge is the closed line P (n, 3), metres, hangs from masts; none where it does not.

    It does where its edge has three corners or more, and between any two of them comes inwards in plan and hangs below
    the line between them, or goes along it from a high corner to a low one. The edge of a roof that stands on its
    corners rises from them; a saddle's is straight in plan, too.
    arm : metres along the edge over which a corner's directions are measured.     height : of the whole sheet, metres.
    """
    at = _corners(P, arm)
    if len(at) < 3:
        return at[:0]
    middle = P[at].mean(axis=0)
    arcs = [P[np.arange(a, b + 1) % len(P)] for a, b in zip(at, np.append(at[1:], at[0] + len(P)), strict=True)]
    return at if all(_hangs(arc, middle, height) for arc in arcs) else at[:0]


def _hangs(arc: Floats, middle: Floats, height: float) -> bool:
    """Whether the edge from corner to corner, the line `arc` (k, 3), comes inwards in plan, to the middle (3,), and
    hangs below the straight line between its ends, or goes along it where it slants; `height` of the sheet, metres."""
    start, chord = arc[0], arc[-1] - arc[0]
    long = max(float(np.hypot(*chord[:2])), 1e-300)
    normal = np.array([-chord[1], chord[0]]) / long
    normal *= np.sign(normal @ (middle - start)[:2])
    inwards = float(((arc - start)[:, :2] @ normal).max())
    share = np.clip((arc - start)[:, :2] @ chord[:2] / long**2, 0, 1)
    below = start[2] + share * chord[2] - arc[:, 2]
    taut = abs(chord[2]) >= SLANT * height and float(below.min()) >= -TAUT * height
    return inwards >= SCALLOP * long and (taut or float(below.max()) >= SAG * height)


def _corners(P: Floats, arm: float) -> Ints:
    """(k,) where a closed line P (n, 3) turns in plan by `CORNER` and most within an arm's length of it, metres."""
    step = lengths(np.roll(P, -1, axis=0) - P)
    along = np.concatenate([[0], np.cumsum(step)])
    total, n = float(along[-1]), len(P)
    before, after = (np.searchsorted(along, (along[:-1] + way) % total) % n for way in (-arm, arm))
    p, q = (P - P[before])[:, :2], (P[after] - P)[:, :2]
    turn = np.abs(np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.einsum("ni,ni->n", p, q)))
    turn[turn < np.radians(CORNER)] = 0
    most: Bools = turn > 0
    for i in np.flatnonzero(most):
        gap = np.abs(along[:-1] - along[i])
        near = np.minimum(gap, total - gap) <= arm
        most[i] = int(np.flatnonzero(near)[turn[near].argmax()]) == i
    return np.flatnonzero(most)
