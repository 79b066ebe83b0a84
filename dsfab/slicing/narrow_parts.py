"""Parts of flat openings in which discs of a radius have no room: necks, blind alleys, tips, and whole openings."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.flat_openings import SMOOTH, FlatOpenings, nearest_in_plane, offset

LARGER = 1 + 4 * SMOOTH
"""Rooms are grown by so many radii, and meet straight walls for certain."""
ON_WALL = 4e-4
"""Outlines are on a wall where they are nearer to it than this share of the radius."""
SMALL = 1e-3
"""Parts of less area than this share of the radius squared are rounding."""
WIDE = 0.02
"""Arcs whose ends are nearer to one another than this share of the radius are rounding."""
LONG, BULKY = 4.0, 0.7
"""A tip so many radii long, with this share of the area of a strip as wide as its mouth, is a blind alley."""
ALLEY = 1.2, 3.2
"""It is shut between so many radii from its mouth, along its walls."""


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
    """Where no disc of a radius, metres, has room: necks, whole openings, blind alleys with two runs near their mouths.

    Tips, which end in nothing soon, are left out. Parts that go around something are left out too: there is room on all
    their sides, or none.
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
    start = np.cumsum([0, *(len(loop) for loop in outlines)])
    for k in _looked_at(np.concatenate(outlines), on_wall, start[:-1], LONG * radius).tolist():
        outline, on = outlines[k], on_wall[start[k] : start[k + 1]]
        if on.all():
            yield NarrowPart(outline, ())
        elif len(runs := _runs(outline, on, WIDE * radius)) > 1:
            yield NarrowPart(outline, runs)
        elif len(runs) == 1 and _is_alley(runs[0], radius):
            yield NarrowPart(outline, _beside_mouth(runs[0], radius))


def _looked_at(points: Floats, on_wall: Bools, start: Ints, long: float) -> Ints:
    """Outlines, which begin at `start` (k,) of all points (p, 2), that are on walls alone, or in several runs, or long:
    most are the tips of corners."""
    before = np.arange(len(points)) - 1
    before[start] = np.append(start[1:], len(points)) - 1
    runs = np.add.reduceat((on_wall & ~on_wall[before]).astype(np.int64), start)
    box = np.maximum.reduceat(points, start) - np.minimum.reduceat(points, start)
    whole = np.logical_and.reduceat(on_wall, start)
    return np.flatnonzero(whole | (runs > 1) | ((runs == 1) & (np.linalg.norm(box, axis=1) > long)))


def _runs(outline: Floats, on_wall: Bools, wide: float) -> tuple[Floats, ...]:
    """Stretches of the outline between its arcs whose ends are at least so far apart; one point at least each."""
    count = len(outline)
    begin = np.flatnonzero(~on_wall & np.roll(on_wall, 1))
    end = np.flatnonzero(on_wall & ~np.roll(on_wall, 1))  # the point behind an arc
    if not len(begin):
        return ()
    end = end[np.searchsorted(end, begin) % len(end)]
    arcs = np.linalg.norm(outline[end] - outline[begin], axis=1) > wide
    begin, end = begin[arcs], end[arcs]
    following = np.roll(begin, -1)
    size = (following - end) % count + 1
    return tuple(outline[(e + np.arange(k)) % count] for e, k in zip(end.tolist(), size.tolist(), strict=True))


def _is_alley(run: Floats, radius: float) -> bool:
    """Whether the wall (r, 2) around a tip encloses something long with two sides that do not close to a point."""
    mouth, middle = float(np.linalg.norm(run[-1] - run[0])), (run[0] + run[-1]) / 2
    length = float(np.linalg.norm(run - middle, axis=1).max())
    x, y = (run - middle).T
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    return length > LONG * radius and area > BULKY * mouth * length


def _beside_mouth(run: Floats, radius: float) -> tuple[Floats, Floats]:
    """The stretches (s, 2) of the wall (r, 2) around a blind alley at which it is shut, one on each side."""
    place = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
    low, high = (share * radius for share in ALLEY)
    sides = []
    for begin, end in ((low, high), (place[-1] - high, place[-1] - low)):
        at = np.concatenate([[begin], place[(place > begin) & (place < end)], [end]])
        sides.append(np.stack([np.interp(at, place, x) for x in run.T], axis=1))
    return sides[0], sides[1]


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
