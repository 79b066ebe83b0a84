"""Least widths for a workshop: narrow members widened, narrow necks of openings bridged or filled."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, Ints, along_segments
from dsfab.slicing.cutting.sheet import Sheet, inner_walls, medians, part_of
from dsfab.slicing.finishing.flat_openings import FlatOpenings, narrow_parts
from dsfab.slicing.finishing.openings import SNAP as OPENINGS_SNAP
from dsfab.slicing.finishing.openings import Merging, Openings, Strip, filled_slits, with_strips
from dsfab.slicing.finishing.walls import Walls
from dsfab.slicing.measures.widths import MIDDLE, Crossings, crossings
from dsfab.surface import Surface

LOCAL = 0.8
"""A member is narrow at a place where it has less than this share of the median width of all."""
NOWHERE = np.empty((0, 2, 3))


def narrow_gaps(cells: Sheet, least: float, apart: float, tips: bool = False, widest: bool = False) -> Floats:
    """(k, 2, 3) points on both walls of openings where these are nearer than `least` metres; the narrowest gap first,
    and of those less than `apart` metres from it no other.

    tips : also where walls close to a tip.    widest : the widest of these gaps first: the mouth of a tip.
    """
    if not cells.has_openings:
        return NOWHERE
    void, from_void = part_of(cells.surface, ~cells.material)
    across = crossings(void, inner_walls(void, cells.surface, from_void), tips=tips, reach=least)
    return _narrowest(void, across, least, apart, widest)


def narrow_members(cells: Sheet, least: float, apart: float) -> Floats:
    """(k, 2, 3) points on both sides of members between openings that are narrower than `least` metres there, and than
    members usually are, as `narrow_gaps`."""
    if not cells.has_openings:
        return NOWHERE
    material, from_material = part_of(cells.surface, cells.material)
    across = crossings(material, inner_walls(material, cells.surface, from_material))
    usual = medians(across.width, across.weight, np.zeros(len(across.width), dtype=np.int64), 1)[0]
    return _narrowest(material, across, min(least, LOCAL * float(usual)), apart)


def usual_width(cells: Sheet) -> float:
    """Metres that members beside half of the walls of openings do not exceed; infinite without openings."""
    if not cells.has_openings:
        return float("inf")
    material, from_material = part_of(cells.surface, cells.material)
    inner = inner_walls(material, cells.surface, from_material)
    across = crossings(material, material.edges.boundary, inner, at=(MIDDLE,))
    return float(medians(across.width, across.weight, np.zeros(len(across.width), dtype=np.int64), 1)[0])


def members_under(cells: Sheet, least: float, apart: float) -> Floats:
    """(k, 2, 3) points on both sides of members that are narrower than `least` metres, as `narrow_gaps`: also of those
    between an opening and the edge of the surface."""
    if not cells.has_openings:
        return NOWHERE
    material, from_material = part_of(cells.surface, cells.material)
    inner = inner_walls(material, cells.surface, from_material)
    across = crossings(material, material.edges.boundary, inner, reach=least)
    return _narrowest(material, across, least, apart)


def _narrowest(part: Surface, across: Crossings, least: float, apart: float, widest: bool = False) -> Floats:
    narrow = np.flatnonzero(across.width < least)
    narrow = narrow[np.argsort(-across.width[narrow] if widest else across.width[narrow], kind="stable")]
    start, (one, two) = across.place[narrow], part.V[part.edges.ends[across.walls[narrow, 1]]].transpose(1, 0, 2)
    ends = np.stack([start, one + along_segments(start, one, two)[:, None] * (two - one)], axis=1)
    chosen, middles = list[int](), np.empty((0, 3))
    for k, middle in enumerate(ends.mean(axis=1)):
        if not (np.linalg.norm(middles - middle, axis=1) < apart).any():
            chosen.append(k)
            middles = np.vstack([middles, middle])
    return ends[chosen]


NECKS_ROUNDS = 4
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
    for _ in range(NECKS_ROUNDS):
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


def bridged_at(cells: Sheet, places: Floats, width: float, snap: float = OPENINGS_SNAP) -> tuple[Sheet, int]:
    """The cells with bridges, `width` metres broad, between points (k, 2, 3) on or near two walls each, as many as can
    be at once; and how many. For `snap` see `with_strips`."""
    if not len(places):
        return cells, 0
    walls = Walls.of(cells)
    wall, ends = walls.nearest(cells.surface.V, places.reshape(-1, 3))
    pairs = zip(ends.reshape(-1, 2, 3), wall.reshape(-1, 2).tolist(), strict=True)
    necks = [Neck(place, (one, two)) for place, (one, two) in pairs]
    return _with_bridges(cells, walls, necks, width, snap)


def _with_bridges(
    cells: Sheet, walls: Walls, necks: list[Neck], width: float, snap: float = OPENINGS_SNAP
) -> tuple[Sheet, int]:
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


WIDENING_APART = 0.8
"""Narrow places are so many widths from one another, so that the strips of a long member overlap."""
END = 6.0
"""Both sides of a member that ends are walls of one opening, less than so many widths apart along it: ends stay."""
WIDENING_WIDER = 1.04
"""A strip is a little wider than asked for: it is measured along walls that are not quite parallel."""


def widened_members(cells: Sheet, rounded: Sheet, least: float) -> tuple[Sheet, int]:
    """The cells with material beside members that are narrower than `least` metres once corners are `rounded`; and at
    how many places. Strips that would touch are made by calling it again."""
    if not len(narrow := narrow_members(rounded, least, WIDENING_APART * least)):
        return cells, 0
    walls, half = Walls.of(cells), np.array([WIDENING_WIDER * least / 2, least / 2])
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


SLICING_ROUNDS = 40
"""Strips that would touch are made one after the other: so often at most."""
TURNS = 6
"""Wider members leave narrower openings, which are closed in their turn: so often at most."""
SLICING_APART = 2.0
"""Bridges that are made at once are so many widths from one another."""
SLICING_WIDER, LONG = 1.1, 1.5
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
    for attempt in range(SLICING_ROUNDS if gap else 0):
        places = narrow_gaps(cells, gap, SLICING_APART * gap, tips=True, widest=attempt % 2 == 0)
        cells, count = bridged_at(cells, places, gap, SNAP)
        total, idle = total + count, 0 if count else idle + 1
        if not len(places) or idle == 2:  # neither from mouths nor from the narrowest places
            break
    return cells, total


def _broadened(cells: Sheet, member: float) -> tuple[Sheet, int]:
    """The cells with strips beside members wherever they are too narrow, and how many."""
    total = 0
    for _ in range(SLICING_ROUNDS if member else 0):
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
    walls, half = Walls.of(cells), np.array([SLICING_WIDER * member / 2, LONG * member])
    wall, ends = walls.nearest(cells.surface.V, places.reshape(-1, 3))
    inner = np.linalg.norm(ends - places.reshape(-1, 3), axis=1) < ON_WALL * member
    strips = []
    for place, sides, on in zip(places, wall.reshape(-1, 2), inner.reshape(-1, 2), strict=True):
        both = (Strip.of(cells, walls, side, place, half) for side in sides[on].tolist())
        strips += [strip for strip in both if strip is not None]
    return with_strips(cells, strips, member, SNAP)
