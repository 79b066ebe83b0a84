"""`bridged_necks`: where an opening is narrower than a width, the members beside it become one.

room  `--.  .--`  room      Discs of the width have room on both sides of a neck and none in it. The bridge is a
- - -   bridge   - - -      strip of material across the narrowest place, as broad as the width; what is left of
      .--'  '--.            the neck beside it are tips of two openings.
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.flat_openings import FlatOpenings
from dsfab.slicing.narrow_parts import narrow_parts
from dsfab.slicing.narrow_places import narrow_gaps
from dsfab.slicing.openings import Openings
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.strips import SNAP, Strip, with_strips
from dsfab.slicing.walls import Walls

ROUNDS = 4
"""A bridge may leave necks on both of its sides, and two bridges that would touch are made one after the other."""
REACH = 0.25
"""A bridge runs so many widths past its neck, along walls that it meets askew."""
SLIMMER = (1.0, 0.5)
"""Bridges are tried with these shares of their width, and as much nearer to one another: over a ridge a broad one may
not end on the other wall. What is left beside a slim one is bridged in the next round."""


@dataclass(frozen=True, eq=False)
class Neck:
    """A place where an opening is too narrow: points (2, 3) on both of its walls, and the numbers of these."""

    ends: Floats
    walls: tuple[int, int]


def bridged_necks(cells: Sheet, width: float) -> tuple[Sheet, int]:
    """The cells with openings bridged wherever they are narrower than `width` metres, and how many bridges it took.

    Openings that are nowhere so wide, and small ones that a bridge parts off, become material. Openings that the edge
    of the surface cuts open stay as they are, and so do tips, which `rounded_corners` rounds.
    """
    count = 0
    for _ in range(ROUNDS):
        if not cells.has_openings:
            break
        walls = Walls.of(cells)
        necks, lost = _narrow(cells, walls, width)
        cells, more = _with_bridges(_filled(cells, lost), walls, necks, width)
        if not more:
            break
        count += more
    return cells, count


def bridged_gaps(cells: Sheet, rounded: Sheet, least: float, width: float) -> tuple[Sheet, int]:
    """The cells with bridges, `width` metres broad, where openings are narrower than `least` metres once their corners
    are `rounded`; and how many bridges that took.

    Necks are found in openings laid flat. What that does not see, where a surface is folded, or where walls leave no
    room for an arc, is found here as `features` measures it.
    """
    for slim in (share * width for share in SLIMMER):
        better, count = bridged_at(cells, narrow_gaps(rounded, least, 2 * slim), slim)
        if count:
            return better, count
    return cells, 0


def bridged_at(cells: Sheet, places: Floats, width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """The cells with bridges, `width` metres broad, between points (k, 2, 3) on or near two walls each, as many as can
    be at once; and how many. For `snap` see `with_strips`."""
    if not len(places):
        return cells, 0
    walls = Walls.of(cells)
    wall, ends = walls.nearest(cells.surface.V, places.reshape(-1, 3))
    pairs = zip(ends.reshape(-1, 2, 3), wall.reshape(-1, 2).tolist(), strict=True)
    necks = [Neck(place, (one, two)) for place, (one, two) in pairs]
    return _with_bridges(cells, walls, necks, width, snap)


def _with_bridges(cells: Sheet, walls: Walls, necks: list[Neck], width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """The cells with as many necks bridged as can be at once, and how many."""
    bridges = [bridge for neck in necks if (bridge := _bridge(cells, walls, neck, width)) is not None]
    return with_strips(cells, bridges, width, snap)


def _narrow(cells: Sheet, walls: Walls, width: float) -> tuple[list[Neck], list[int]]:
    """The necks of openings, and a void cell of each opening that is all too narrow."""
    flat = FlatOpenings.of(cells, walls)
    necks, lost = [], list[int]()
    for part in narrow_parts(flat, width / 2):
        if not part.runs:
            lost.append(int(walls.inside[flat.wall[flat.touched(part.outline[:1])[0][0]]]) // 3)
            continue
        number, share = flat.touched(part.narrowest())
        wall = flat.wall[number]
        ends = walls.points(cells.surface.V, wall, share)
        if np.linalg.norm(ends[1] - ends[0]) < width:  # else the opening is curved, and only looks narrow from there
            necks.append(Neck(ends, (int(wall[0]), int(wall[1]))))
    return necks, lost


def _filled(cells: Sheet, lost: list[int]) -> Sheet:
    """The openings of these void cells made material."""
    every = Openings.of(cells) if lost else None
    if every is None:
        return cells
    wanted = np.zeros(every.count, dtype=bool)
    wanted[every.label[np.searchsorted(every.face, lost)]] = True
    return every.filled(wanted)


def _bridge(cells: Sheet, walls: Walls, neck: Neck, width: float) -> Strip | None:
    """The strip between both walls of a neck; None where it would not end there."""
    gap = float(np.linalg.norm(neck.ends[1] - neck.ends[0]))
    half = np.array([gap / 2 + REACH * width, width / 2])
    strip = Strip.of(cells, walls, neck.walls[0], neck.ends, half)
    return strip if strip is not None and int(walls.inside[neck.walls[1]]) // 3 in strip.cells else None
