"""Parts of flat openings in which discs of a radius have no room: tips, necks, and whole openings."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.slicing.flat_openings import SMOOTH, FlatOpenings, nearest_in_plane, offset

LARGER = 1 + 4 * SMOOTH
"""Rooms are grown by so many radii, and meet straight walls for certain."""
ON_WALL = 4e-4
"""Outlines are on a wall where they are nearer to it than this share of the radius."""
SMALL = 1e-3
"""Parts of less area than this share of the radius squared are rounding."""
WIDE = 0.02
"""Arcs whose ends are nearer to one another than this share of the radius are rounding."""


@dataclass(frozen=True, eq=False)
class NarrowPart:
    """A part of an opening: its outline (k, 2), metres, and what of it lies on walls, one run after another between the
    arcs that part it from rooms: (r, 2) each. None for an opening that has no room at all.
    """

    outline: Floats
    runs: tuple[Floats, ...]

    def narrowest(self) -> Floats:
        """(2, 2) the points of two runs that are nearest to one another."""
        found = [_nearest(a, b) for a, b in combinations(self.runs, 2)]
        return min(found, key=lambda points: float(np.linalg.norm(points[1] - points[0])))


def narrow_parts(flat: FlatOpenings, radius: float) -> Iterator[NarrowPart]:
    """Where no disc of a radius, metres, has room: necks and whole openings; tips, which end in nothing, are left out.

    Parts that go around something are left out too: there is room on all their sides, or none.
    """
    if not len(flat.wall):
        return
    parts = (flat.shape - offset(flat.room(radius), LARGER * radius)).decompose()
    loops = [part.to_polygons() for part in parts if part.area() > SMALL * radius**2]
    outlines = [np.asarray(loop[0]) for loop in loops if len(loop) == 1]
    if not outlines:
        return
    middles = np.concatenate([(loop + np.roll(loop, -1, axis=0)) / 2 for loop in outlines])
    on_wall = flat.distance(middles) < ON_WALL * radius
    for outline, on in zip(outlines, np.split(on_wall, np.cumsum([len(loop) for loop in outlines])[:-1]), strict=True):
        if on.all():
            yield NarrowPart(outline, ())
        elif len(runs := _runs(outline, on, WIDE * radius)) > 1:
            yield NarrowPart(outline, runs)


def _runs(outline: Floats, on_wall: Bools, wide: float) -> tuple[Floats, ...]:
    """Stretches of the outline between its arcs whose ends are at least so far apart; one point at least each."""
    count = len(outline)
    begin = np.flatnonzero(~on_wall & np.roll(on_wall, 1))
    end = np.flatnonzero(on_wall & ~np.roll(on_wall, 1))  # the point behind an arc
    if len(begin) < 2:
        return ()
    end = end[np.searchsorted(end, begin) % len(end)]
    arcs = np.linalg.norm(outline[end] - outline[begin], axis=1) > wide
    begin, end = begin[arcs], end[arcs]
    following = np.roll(begin, -1)
    size = (following - end) % count + 1
    return tuple(outline[(e + np.arange(k)) % count] for e, k in zip(end.tolist(), size.tolist(), strict=True))


def _nearest(one: Floats, two: Floats) -> Floats:
    """(2, 2) the points of two open polylines that are nearest to one another."""
    found = []
    for points, line, turned in ((one, two, False), (two, one, True)):
        simplex = np.arange(len(line))[:, None]
        near = nearest_in_plane(points, line, simplex if len(line) == 1 else np.hstack([simplex[:-1], simplex[1:]]))
        k = int(near.squared.argmin())
        pair = np.stack([points[k], near.place[k, :2]])
        found.append((float(near.squared[k]), pair[::-1] if turned else pair))
    return min(found, key=lambda each: each[0])[1]
