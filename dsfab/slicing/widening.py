"""`widened_members`: where a member is narrower than a width, strips beside it become material.

opening
------.  - - - -  .------     Lines across the members of a sheet with round corners find the narrow places. There a
       `--.___.--'            strip of the width, and as long as that, lies over the member; what of it is void on both
        __.---.__             sides becomes material, and corners that this makes are rounded with all others.
------'  - - - -  `------
opening
"""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing.narrow_places import narrow_members
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.strips import Strip, with_strips
from dsfab.slicing.walls import Walls

APART = 0.8
"""Narrow places are so many widths from one another, so that the strips of a long member overlap."""
END = 6.0
"""Both sides of a member that ends are walls of one opening, less than so many widths apart along it: ends stay."""
WIDER = 1.04
"""A strip is a little wider than asked for: it is measured along walls that are not quite parallel."""


def widened_members(cells: Sheet, rounded: Sheet, least: float) -> tuple[Sheet, int]:
    """The cells with material beside members that are narrower than `least` metres once corners are `rounded`; and at
    how many places. Strips that would touch are made by calling it again."""
    if not len(narrow := narrow_members(rounded, least, APART * least)):
        return cells, 0
    walls, half = Walls.of(cells), np.array([WIDER * least / 2, least / 2])
    wall, ends = walls.nearest(cells.surface.V, narrow.reshape(-1, 3))
    wall, ends = wall.reshape(-1, 2), ends.reshape(-1, 2, 3)
    goes_on = _way_around(walls, wall) > END * least
    strips = []
    for place, sides in zip(ends[goes_on], wall[goes_on].tolist(), strict=True):
        both = (Strip.of(cells, walls, side, place, half) for side in sides)
        strips += [strip for strip in both if strip is not None]
    done, count = with_strips(cells, strips, least)
    return done, -(-count // 2)


def _way_around(walls: Walls, wall: Ints) -> Floats:
    """(k,) metres along the opening from one of two walls (k, 2) to the other; infinite between two openings."""
    chain, place = walls.chain[wall], walls.place[wall]
    way = np.abs(place[:, 1] - place[:, 0])
    around = np.where(walls.closed[chain[:, 0]], np.minimum(way, walls.total[chain[:, 0]] - way), way)
    return np.where(chain[:, 0] == chain[:, 1], around, np.inf)
