"""`with_least_widths`: openings and members that are narrower than a workshop makes, made one or made wider.

  \\   /  opening        A tip is filled up to its mouth, where its walls are as far apart as they may be; a neck is
---\\_/--- mouth         bridged, and so is a slit, piece by piece. Beside a member that is too narrow, strips become
    V    material       material. Material is added only, never taken away.
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.narrow_places import LOCAL, members_under, narrow_gaps, usual_width
from dsfab.slicing.necks import bridged_at, bridged_gaps
from dsfab.slicing.openings import Merging, Openings, filled_slits
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.strips import Strip, with_strips
from dsfab.slicing.walls import Walls

ROUNDS = 40
"""Strips that would touch are made one after the other: so often at most."""
TURNS = 6
"""Wider members leave narrower openings, which are closed in their turn: so often at most."""
APART = 2.0
"""Bridges that are made at once are so many widths from one another."""
WIDER, LONG = 1.1, 1.5
"""A strip beside a member is so many times as wide as asked, for walls are not quite parallel and vertices near to its
side are on it, and twice so long."""
SNAP = 0.05
"""Vertices nearer to the side of a strip than this share of half its width are on it. Edges that are shorter than a
hundredth of that leave finite elements no digits: a cantilever became a mechanism by one of 32 micrometres."""
ON_WALL = 1e-6
"""A place is on a wall if it is no further from it than this share of the width: else on the edge of the surface."""


class LeastWidths(NamedTuple):
    """All cells; how many openings were filled, how many bridges were built, strips laid beside members, and slits
    between wider members filled that this left, and bridges in necks that it left."""

    cells: Sheet
    filled: int
    bridged: int
    widened: int
    merged: int = 0
    necks: int = 0


def with_least_widths(
    cells: Sheet, gap: float, member: float, merge: Merging = "none", neck: float = 0.0
) -> LeastWidths:
    """The cells without openings under `gap` and members under `member`, metres, as far as material can do that.

    Members that are no narrower than most, see `LOCAL`, stay as they are, and so does what is narrow between
    two edges of the surface. 0 asks for nothing.

    merge : openings whose tips are filled may be narrower than the members beside them: which of these are filled.
    neck  : metres; openings that wider members leave narrower than that are bridged, too. Ends of filled tips are.
    """
    cells, filled = _without_specks(cells, gap)
    member = min(member, LOCAL * usual_width(cells)) if member else 0.0
    bridged, widened = 0, 0
    for _ in range(TURNS):
        cells, bridges = _closed(cells, gap)
        cells, strips = _broadened(cells, member)
        bridged, widened = bridged + bridges, widened + strips
        if not strips:
            break
    if not (bridged or widened):
        return LeastWidths(cells, filled, 0, 0)
    cells, specks = _without_specks(cells, gap)
    cells, merged = filled_slits(cells, merge) if merge != "none" else (cells, 0)
    cells, necks = _without_necks(cells, neck)
    return LeastWidths(cells, filled + specks, bridged, widened, merged, necks)


def _without_necks(cells: Sheet, neck: float) -> tuple[Sheet, int]:
    """The cells with bridges, `neck` metres broad, wherever openings are narrower, but for their tips; and how many."""
    total = 0
    for _ in range(TURNS if neck else 0):
        cells, count = bridged_gaps(cells, cells, neck, neck)
        if not count:
            break
        total += count
    return cells, total


def _without_specks(cells: Sheet, gap: float) -> tuple[Sheet, int]:
    """Openings in which a disc of that size has no room wherever it is: their 4 area / perimeter is less."""
    every = Openings.of(cells) if gap else None
    if every is None or not (small := every.round_sizes < gap).any():
        return cells, 0
    return every.filled(small), int(small.sum())


def _closed(cells: Sheet, gap: float) -> tuple[Sheet, int]:
    """The cells with bridges wherever openings are narrower than a gap, and how many."""
    total, idle = 0, 0
    for attempt in range(ROUNDS if gap else 0):
        places = narrow_gaps(cells, gap, APART * gap, tips=True, widest=attempt % 2 == 0)
        cells, count = bridged_at(cells, places, gap, SNAP)
        total, idle = total + count, 0 if count else idle + 1
        if not len(places) or idle == 2:  # neither from mouths nor from the narrowest places
            break
    return cells, total


def _broadened(cells: Sheet, member: float) -> tuple[Sheet, int]:
    """The cells with strips beside members wherever they are too narrow, and how many."""
    total = 0
    for _ in range(ROUNDS if member else 0):
        cells, count = _widened(cells, members_under(cells, member, LONG * member), member)
        total += count
        if not count:
            break
    return cells, total


def _widened(cells: Sheet, places: Floats, member: float) -> tuple[Sheet, int]:
    """Strips on both sides of members at points (k, 2, 3) on their walls, and how many. A side on the edge of the
    surface has none."""
    if not len(places):
        return cells, 0
    walls, half = Walls.of(cells), np.array([WIDER * member / 2, LONG * member])
    wall, ends = walls.nearest(cells.surface.V, places.reshape(-1, 3))
    inner = np.linalg.norm(ends - places.reshape(-1, 3), axis=1) < ON_WALL * member
    strips = []
    for place, sides, on in zip(places, wall.reshape(-1, 2), inner.reshape(-1, 2), strict=True):
        both = (Strip.of(cells, walls, side, place, half) for side in sides[on].tolist())
        strips += [strip for strip in both if strip is not None]
    return with_strips(cells, strips, member, SNAP)
