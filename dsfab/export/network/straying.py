"""How far trimmed faces are off the mesh between the places where they are held: between these they may wave."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.export.network.heights import rows_at

PLACES = (np.stack(np.meshgrid(*[np.arange(24)] * 2, indexing="ij"), axis=2).reshape(-1, 2) + 0.5) / 24
"""(k, 2) of the square that a surface is over: of a face of 40 mm beside a cow's ear, 12 along a side missed a bulge
of 1.6 mm in a corner."""

ROWS = rows_at(PLACES)


@dataclass(frozen=True, eq=False)
class FaceLimits:
    """What faces are asked for, millimetres.

    gap : between trimmed ones and their edges.
    off : what points inside may be off; where the gap is wider, but such that edges can be split, too.
    box : (2, 3) where poles should be.
    beyond_mesh : how much farther points (k, 3) are from the mesh than they may be (k,), where that is asked, too.
    """

    gap: float
    off: float
    box: Floats
    beyond_mesh: Callable[[Floats], Floats] | None = None


def farthest(
    surfaces: Sequence[tuple[Floats, Floats]],
    lines: Sequence[Sequence[Floats]],
    beyond_mesh: Callable[[Floats], Floats] | None,
) -> float:
    """The most that a region's surfaces, poles (p + 1, p + 1, 3) and axes, are farther from a mesh than they may be,
    inside of its outlines (., 3) on each of them; none where nobody asks."""
    if beyond_mesh is None:
        return -np.inf
    inside = [
        places_inside(*surface, outlines) for surface, outlines in zip(surfaces, zip(*lines, strict=True), strict=True)
    ]
    return float(beyond_mesh(np.concatenate(inside)).max(initial=-np.inf))


def places_inside(poles: Floats, axes: Floats, lines: Sequence[Floats]) -> Floats:
    """(k, 3) points of a surface with such poles (p + 1, p + 1, 3) and axes that closed lines (., 3) go around."""
    points = ROWS(len(poles) - 1) @ poles.reshape(-1, 3)
    return np.asarray(points[enclosed(points @ axes[:2].T, [line @ axes[:2].T for line in lines])])


def enclosed(points: Floats, lines: Sequence[Floats]) -> Bools:
    """(k,) which points (k, 2) of a plane an odd number of closed lines (., 2) goes around."""
    x, y = points.T
    found = np.zeros(len(points), dtype=bool)
    for line in lines:
        (ax, ay), (bx, by) = line.T, np.roll(line, -1, axis=0).T
        slope = (bx - ax) / np.where(by != ay, by - ay, 1.0)
        above = ay > y[:, None]
        i, j = np.nonzero(above != np.roll(above, -1, axis=1))  # few: only there it is asked on which side they pass
        beside = x[i] < ax[j] + (y[i] - ay[j]) * slope[j]
        found ^= np.bincount(i[beside], minlength=len(points)) % 2 == 1
    return found
