"""In which order members are named: along the structure, or around it."""

import numpy as np

from dsfab.arrays import Floats, Ints

TIE = 1e-3
"""Places that differ by less than this share of the structure's size are the same place along it."""
ROUND, HOLLOW = 0.5, 0.4
"""Members stand around something if their places spread in a second direction by more than this share of the first,
and none is nearer to the middle than this share of the farthest."""


def along_structure(places: Floats, lengths: Floats, size: float) -> Ints:
    """(k,) the order in which to name members at places (k, 3) with lengths (k,), metres, on a structure of a size.

    Around the structure, counter-clockwise seen from above and from the x axis on, where they stand in a ring, as
    meridians do; else along the direction in which they spread most, which points to growing x, y or z. Of those that
    are at the same place along it the shorter one is first, then the one at the smaller x, y, z.
    """
    if len(places) < 2:
        return np.arange(len(places))
    off = places - places.mean(axis=0)
    spread, axes = np.linalg.svd(off, full_matrices=False)[1:]
    spread, axes = np.append(spread, [0.0, 0.0])[:3], _pointing(np.linalg.svd(off)[2] if len(places) < 3 else axes)
    key = off @ axes[0]
    if len(places) > 2 and spread[1] > ROUND * spread[0]:
        up = axes[2]
        x = np.eye(3)[0] if abs(up[0]) < 1 / np.sqrt(2) else np.eye(3)[1]
        x = x - (x @ up) * up
        right, ahead = off @ x / np.linalg.norm(x), off @ np.cross(up, x / np.linalg.norm(x))
        radius = np.hypot(right, ahead)
        if radius.min() > HOLLOW * radius.max():
            turn = TIE * size / radius.max()
            key = np.mod(np.arctan2(ahead, right) + turn, 2 * np.pi) * radius.max()
        elif spread[1] > (1 - TIE) * spread[0]:
            key = off @ x
    columns = [_steps(values, TIE * size) for values in (*places.T[::-1], lengths, key)]
    return np.lexsort(columns)


def _pointing(axes: Floats) -> Floats:
    """Unit vectors (d, 3) turned so that the largest coordinate of each is positive."""
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
    return np.asarray(axes * np.where(largest < 0, -1.0, 1.0))


def _steps(values: Floats, gap: float) -> Ints:
    """(k,) numbers of values (k,) that grow where there is a gap between one and the next larger one."""
    order = np.argsort(values, kind="stable")
    found = np.empty(len(values), dtype=np.int64)
    found[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return found
