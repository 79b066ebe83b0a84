"""Where a disc that rolls inside an opening stops: one arc there rounds off all that lies beyond it.

a ------.                    The corners of a blunt tip share a wall so short that neither has room for an arc of
void  .-'''-. corner         its own. A disc touches the walls before and behind both. The middles of all discs of a
     (   o   ) |             radius for which an opening has room are that opening offset inward, and this has a
      '-...-'  corner        corner where a disc stops.
b ------'
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.arcs import Arcs, crossing, touching_arcs, unit
from dsfab.slicing.flat_openings import FlatOpenings, nearest_in_plane
from dsfab.slicing.opening_corners import Corners
from dsfab.slicing.stretches import Stretches
from dsfab.slicing.walls import SHARPEST, following

BESIDE = 0.1
"""Nearer to a foot than this share of the radius, walls are about as near to the middle as the foot."""
NEARLY = 3e-3
"""A wall is touched by a disc where its distance from the nearest middle exceeds the radius by less than this share."""
AWAY = 1.2
"""Radii from the middle at least to a vertex that is surely beyond; the nearest one is in the plane of the disc."""
BEYOND = 0.6
"""Walls are looked at this share of the radius beyond where a disc touches them in the flat."""


@dataclass(frozen=True, eq=False)
class Stops:
    """Where discs stop in the flat.

    middle : (p, 2) metres.    before, behind : (p, 2) unit vectors from there to the walls that they touch.
    a, b   : (p,) these walls, by their places in `FlatOpenings.wall`, and the share of each that lies before the foot.
    """

    middle: Floats
    before: Floats
    behind: Floats
    a: Ints
    b: Ints
    share_a: Floats
    share_b: Floats

    def some(self, chosen: Bools) -> "Stops":
        """Those that are marked (p,)."""
        return Stops(*(getattr(self, field.name)[chosen] for field in fields(self)))


def rolled_arcs(corners: Corners, radius: float, taken: list[Stretches]) -> Iterator[tuple[Corners, Arcs]]:
    """Where discs of a radius, metres, stop in the openings: vertices (p,) beyond them, as corners, and the arcs (p,)
    in the frames of these, none of which reaches over another. Those that stop at one wall, or touch none when seen in
    space, are not listed.

    Twice, for vertices near the discs and for those at the end of what lies beyond: on a curved surface one of them may
    see the arc where the other does not. The second time without those in what is `taken` by then.
    """
    flat = FlatOpenings.of(corners.sheet, corners.walls)
    loops = [np.asarray(loop) for loop in flat.room(radius).to_polygons() if len(loop) > 2]
    if loops:
        stop, *tips = _tips(flat, _stops(flat, loops, radius), loops, radius)
        walls = corners.walls
        for tip in tips:
            wall, left = flat.wall[tip], np.ones(len(tip), dtype=bool)
            for stretches in taken:
                left &= ~stretches.cover(walls.chain[wall], walls.place[wall])
            yield _seen(corners, flat, stop.some(left), tip[left], radius)


def _seen(corners: Corners, flat: FlatOpenings, stop: Stops, tip: Ints, radius: float) -> tuple[Corners, Arcs]:
    """The arcs in the planes that touch the surface where walls `tip` (p,) start."""
    walls, V = corners.walls, corners.sheet.surface.V
    wall_a, wall_b, wall = flat.wall[stop.a], flat.wall[stop.b], flat.wall[tip]
    total, here, size = walls.total[walls.chain[wall]], walls.place[wall], np.full(len(wall), radius)
    way_a = (here - walls.place[wall_a] - stop.share_a * walls.length[wall_a]) % total
    way_b = (walls.place[wall_b] + stop.share_b * walls.length[wall_b] - here) % total
    tips = Corners(corners.sheet, walls, wall, np.zeros(len(wall)), here)

    def in_frame(w: Ints, share: Floats, to_wall: Floats) -> tuple[Floats, Floats]:
        """Feet and unit normals into the void, (p, 2) in the frames of the tips."""
        foot = walls.points(V, w, share) - tips.origin
        inward = -np.einsum("pj,pji->pi", to_wall, flat.frame[tip])
        p, n = (np.einsum("pi,pji->pj", x, tips.frames) for x in (foot, inward))
        return p, unit(n)

    one, two = in_frame(wall_a, stop.share_a, stop.before), in_frame(wall_b, stop.share_b, stop.behind)
    first, exists = crossing(*one, *two, size)
    every, more = np.arange(len(wall)), BEYOND * radius
    lines = tips.line(every, way_a + more, back=True), tips.line(every, way_b + more, back=False)
    arcs = touching_arcs(*lines, size, first)
    good = np.flatnonzero(arcs.touching & exists & (arcs.angle > SHARPEST))
    good = good[tips.some(good).stretches(arcs.some(good)).disjoint(len(good))]
    return tips.some(good), arcs.some(good)


def _stops(flat: FlatOpenings, loops: list[Floats], radius: float) -> Stops:
    """Those that stop between two walls of a chain; the middles of discs lie within loops."""
    middle, before, behind = _left_turns(loops)
    (a, share_a), (b, share_b) = flat.touched(middle + radius * before), flat.touched(middle + radius * behind)
    some = (flat.chain[a] == flat.chain[b]) & (a != b)
    return Stops(middle, before, behind, a, b, share_a, share_b).some(some)


def _left_turns(loops: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Where loops turn to the left by more than `SHARPEST`, and unit vectors to the right before and behind there."""
    empty = np.empty((0, 2))
    points, rights = [empty], ([empty], [empty])
    for loop in loops:
        ahead = unit(np.roll(loop, -1, axis=0) - loop)
        back = np.roll(ahead, 1, axis=0)
        turn = np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1))
        at = turn > SHARPEST
        points.append(loop[at])
        for right, along in zip(rights, (back, ahead), strict=True):
            right.append(np.stack([along[at, 1], -along[at, 0]], axis=1))
    return np.concatenate(points), np.concatenate(rights[0]), np.concatenate(rights[1])


def _tips(flat: FlatOpenings, stop: Stops, loops: list[Floats], radius: float) -> tuple[Stops, Ints, Ints]:
    """Those beyond which no other disc has room; and for each two walls (p,) that start beyond, near it and far away.

    Behind a neck an opening may widen again: that is no tip.
    """
    size = np.bincount(flat.chain)
    begin = np.cumsum(size) - size
    first, most = begin[flat.chain[stop.a]], size[flat.chain[stop.a]]
    count = (stop.b - stop.a) % most
    row = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 1
    wall = first[row] + (stop.a[row] - first[row] + step) % most[row]
    start = flat.start[wall]
    touched = _distance(flat.start, loops)[wall] < (1 + NEARLY) * radius
    for to_wall in (stop.before, stop.behind):
        foot = (stop.middle + radius * to_wall)[row]
        touched &= np.linalg.norm(start - foot, axis=1) > BESIDE * radius
    free = np.bincount(row, touched, len(count)) == 0
    far = np.linalg.norm(start - stop.middle[row], axis=1)
    near = far < AWAY * radius
    nearby, farthest = (
        wall[order][np.unique(row[order], return_index=True)[1]]
        for order in (np.lexsort((np.where(near, -far, far), near, row)), np.lexsort((-far, row)))
    )
    return stop.some(free), nearby[free], farthest[free]


def _distance(points: Floats, loops: list[Floats]) -> Floats:
    """(k,) of points (k, 2) from the nearest of closed loops."""
    after = following(np.repeat(np.arange(len(loops)), [len(loop) for loop in loops]))
    edges = np.stack([np.arange(len(after)), after], axis=1)
    return nearest_in_plane(points, np.concatenate(loops), edges).distance
