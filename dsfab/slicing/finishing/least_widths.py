"""Minimum widths of members and openings for a workshop."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, positions_on_segments
from dsfab.slicing.cutting.sheet import Sheet, SheetPart, weighted_medians
from dsfab.slicing.cutting.walls import Walls
from dsfab.slicing.finishing.flat_openings import flat_openings_of, narrow_parts
from dsfab.slicing.finishing.openings import SNAP as OPENINGS_SNAP
from dsfab.slicing.finishing.openings import Merging, Strip, filled_slits, openings_of, with_filled, with_strips
from dsfab.slicing.measures.widths import MIDDLE, Crossings, crossings
from dsfab.surface import Surface

LOCAL = 0.8  # Largest width of a narrow member, as a fraction of the median width.
NOWHERE = np.empty((0, 2, 3))


def narrow_gaps(cells: Sheet, least: float, apart: float, tips: bool = False, widest: bool = False) -> Floats:
    """Return places where openings are narrower than `least` metres: pairs of points (k, 2, 3) on opposite walls.
    apart  : least distance between two places, metres.    tips : True to include pointed ends of openings.
    widest : True to begin with the widest place. By default, the narrowest place is first."""
    if not cells.has_openings:
        return NOWHERE
    void = cells.void_part
    across = crossings(void.surface, void.walls, tips=tips, reach=least)
    return _narrowest(void.surface, across, least, apart, widest)


def narrow_members(cells: Sheet, least: float, apart: float) -> Floats:
    """Return places where members are narrower than `least` metres: pairs of points (k, 2, 3) on opposite edges.
    At these places, members are also narrower than `LOCAL` x median width.
    apart : least distance between two places, metres."""
    if not cells.has_openings:
        return NOWHERE
    material = cells.material_part
    across = crossings(material.surface, material.walls)
    return _narrowest(material.surface, across, min(least, LOCAL * _median_width(across)), apart)


def usual_width(cells: Sheet) -> float:
    """Return the median width of members, metres; infinite without openings."""
    if not cells.has_openings:
        return float("inf")
    return _median_width(_crossings_from_openings(cells.material_part, shares=(MIDDLE,)))


def _median_width(across: Crossings) -> float:
    return float(weighted_medians(across.width, across.weight, np.zeros(len(across.width), dtype=np.int64), 1)[0])


def _crossings_from_openings(material: SheetPart, **options: Any) -> Crossings:
    return crossings(material.surface, material.surface.edges.boundary, material.walls, **options)


def members_under(cells: Sheet, least: float, apart: float) -> Floats:
    """Return places where members are narrower than `least` metres: pairs of points (k, 2, 3) on opposite edges.
    apart : least distance between two places, metres."""
    if not cells.has_openings:
        return NOWHERE
    across = _crossings_from_openings(cells.material_part, reach=least)
    return _narrowest(cells.material_part.surface, across, least, apart)


def _narrowest(part: Surface, across: Crossings, least: float, apart: float, widest: bool = False) -> Floats:
    narrow = np.flatnonzero(across.width < least)
    narrow = narrow[np.argsort(-across.width[narrow] if widest else across.width[narrow], kind="stable")]
    start = across.place[narrow]
    wall_start, wall_end = part.V[part.edges.ends[across.walls[narrow, 1]]].transpose(1, 0, 2)
    share = positions_on_segments(start, wall_start, wall_end)[:, None]
    ends = np.stack([start, wall_start + share * (wall_end - wall_start)], axis=1)
    chosen, middles = list[int](), np.empty((0, 3))
    for k, middle in enumerate(ends.mean(axis=1)):
        if not (np.linalg.norm(middles - middle, axis=1) < apart).any():
            chosen.append(k)
            middles = np.vstack([middles, middle])
    return ends[chosen]


REACH = 0.25  # A bridge extends beyond each wall of the opening by this fraction of the bridge's width.


@dataclass(frozen=True, eq=False)
class Neck:
    """A narrow place of an opening. ends : (2, 3) points on two opposite walls, m. walls : numbers of the walls."""

    ends: Floats
    walls: tuple[int, int]


def bridged_necks(cells: Sheet, width: float) -> tuple[Sheet, int]:
    """Add bridges where openings are narrower than `width` metres; return also the number of bridges."""
    count = 0
    for _ in range(4):  # repeat, because the opening may remain narrow beside a bridge
        if not cells.has_openings:
            break
        necks, lost = _necks_and_lost_openings(cells, width)
        bridges = _bridges(cells, necks, width)
        cells = with_filled(cells, lost)
        bridges = [bridge for bridge in bridges if not cells.material[bridge.cells[0]]]
        cells, new_count = with_strips(cells, bridges, width)
        if not new_count:
            break
        count += new_count
    return cells, count


def bridged_gaps(cells: Sheet, rounded: Sheet, least: float, width: float) -> tuple[Sheet, int]:
    """Add bridges where openings of `rounded` are narrower than `least` metres; return also the number of bridges.
    rounded : sheet in which widths are measured.    width : largest width of bridges, metres."""
    for slim in (1.0 * width, 0.5 * width):  # a narrow bridge fits where a broad bridge does not
        better, count = bridged_at(cells, narrow_gaps(rounded, least, 2 * slim), slim)
        if count:
            return better, count
    return cells, 0


def bridged_at(cells: Sheet, places: Floats, width: float, snap: float = OPENINGS_SNAP) -> tuple[Sheet, int]:
    """Add bridges of `width` metres at `places` (k, 2, 3), pairs of points; return also the number of bridges."""
    if not len(places):
        return cells, 0
    wall, ends = cells.walls.nearest(places.reshape(-1, 3))
    pairs = zip(ends.reshape(-1, 2, 3), wall.reshape(-1, 2).tolist(), strict=True)
    necks = [Neck(place, (wall_a, wall_b)) for place, (wall_a, wall_b) in pairs]
    return with_strips(cells, _bridges(cells, necks, width), width, snap)


def _necks_and_lost_openings(cells: Sheet, width: float) -> tuple[list[Neck], Bools]:
    flat, walls, openings = flat_openings_of(cells), cells.walls, openings_of(cells)
    assert openings is not None
    necks, lost = [], np.zeros(openings.count, dtype=bool)
    for part in narrow_parts(flat, width / 2):
        if not part.runs:
            cell = walls.void_cells[flat.wall[flat.nearest_walls(part.outline[:1])[0][0]]]
            lost[openings.label[np.searchsorted(openings.void.cells, cell)]] = True
            continue
        number, share = flat.nearest_walls(part.narrowest())
        wall = flat.wall[number]
        ends = walls.points(wall, share)
        if np.linalg.norm(ends[1] - ends[0]) < width:  # narrow in space, and not only in the opening's plane
            necks.append(Neck(ends, (int(wall[0]), int(wall[1]))))
    return necks, lost


def _bridges(cells: Sheet, necks: list[Neck], width: float) -> list[Strip]:
    bridges = []
    for neck in necks:
        half = np.array([float(np.linalg.norm(neck.ends[1] - neck.ends[0])) / 2 + REACH * width, width / 2])
        strip = Strip.from_wall(cells, neck.walls[0], neck.ends, half)
        if strip is not None and cells.walls.void_cells[neck.walls[1]] in strip.cells:
            bridges.append(strip)
    return bridges


def widened_members(cells: Sheet, rounded: Sheet, least: float) -> tuple[Sheet, int]:
    """Widen members that are narrower than `least` metres, by strips; return also the number of widened places.
    rounded : sheet in which widths are measured."""
    if not len(narrow := narrow_members(rounded, least, 0.8 * least)):
        return cells, 0
    half = np.array([1.04 * least / 2, least / 2])
    wall, ends = cells.walls.nearest(narrow.reshape(-1, 3))
    wall, ends = wall.reshape(-1, 2), ends.reshape(-1, 2, 3)
    goes_on = _way_around(cells.walls, wall) > 6.0 * least  # False at a member's end: the wall around the end is short
    strips = []
    for place, sides in zip(ends[goes_on], wall[goes_on].tolist(), strict=True):
        strips += _strips_at(cells, sides, place, half)
    widened, count = with_strips(cells, strips, least)
    return widened, -(-count // 2)


def _way_around(walls: Walls, wall: Ints) -> Floats:
    chain, place = walls.chain[wall], walls.place[wall]
    direct = np.abs(place[:, 1] - place[:, 0])
    around = np.where(walls.closed[chain[:, 0]], np.minimum(direct, walls.total[chain[:, 0]] - direct), direct)
    return np.where(chain[:, 0] == chain[:, 1], around, np.inf)


MOST_ROUNDS = 40  # Maximum number of rounds. Bridges or strips that one round adds do not touch each other.
TURNS = 6  # Maximum number of repetitions of two steps: bridges in openings, then strips beside members.
SNAP = 0.05  # Vertices move onto a strip's side if they are nearer than this fraction of its half width.


class LeastWidths(NamedTuple):
    """The cells after all changes; numbers of filled openings, bridges, widened places, filled slits, late bridges."""

    cells: Sheet
    filled: int
    bridged: int
    widened: int
    merged: int = 0
    necks: int = 0


def with_least_widths(
    cells: Sheet, gap: float, member: float, merge: Merging = "none", neck: float = 0.0
) -> LeastWidths:
    """Add material where openings are narrower than `gap` metres, or members narrower than `member` metres.
    A limit of 0 has no effect.
    merge : which slits to fill after widening.    neck : least width of openings after widening, metres."""
    cells, filled = _without_specks(cells, gap)
    member = min(member, LOCAL * usual_width(cells)) if member else 0.0
    bridged, widened = 0, 0
    for _ in range(TURNS):
        cells, bridges = _with_bridged_gaps(cells, gap)
        add_strips = partial(_with_side_strips, member=member)
        cells, strips = _until_stable(add_strips, cells, MOST_ROUNDS if member else 0)
        bridged, widened = bridged + bridges, widened + strips
        if not strips:
            break
    if not (bridged or widened):
        return LeastWidths(cells, filled, 0, 0)
    cells, specks = _without_specks(cells, gap)
    cells, merged = filled_slits(cells, merge) if merge != "none" else (cells, 0)
    cells, necks = _until_stable(lambda sheet: bridged_gaps(sheet, sheet, neck, neck), cells, TURNS if neck else 0)
    return LeastWidths(cells, filled + specks, bridged, widened, merged, necks)


def _until_stable(change: Callable[[Sheet], tuple[Sheet, int]], cells: Sheet, rounds: int) -> tuple[Sheet, int]:
    total = 0
    for _ in range(rounds):
        cells, count = change(cells)
        if not count:
            break
        total += count
    return cells, total


def _without_specks(cells: Sheet, gap: float) -> tuple[Sheet, int]:
    openings = openings_of(cells) if gap else None
    if openings is None:
        return cells, 0
    small = openings.hydraulic_diameters < gap
    return with_filled(cells, small), int(small.sum())


def _with_bridged_gaps(cells: Sheet, gap: float) -> tuple[Sheet, int]:
    total, idle = 0, 0
    for attempt in range(MOST_ROUNDS if gap else 0):
        places = narrow_gaps(cells, gap, 2.0 * gap, tips=True, widest=attempt % 2 == 0)
        cells, count = bridged_at(cells, places, gap, SNAP)
        total, idle = total + count, 0 if count else idle + 1
        if not len(places) or idle == 2:  # two rounds, widest or narrowest first, gave no bridge
            break
    return cells, total


def _with_side_strips(cells: Sheet, member: float) -> tuple[Sheet, int]:
    if not len(places := members_under(cells, member, 1.5 * member)):
        return cells, 0
    half = np.array([1.1 * member / 2, 1.5 * member])  # 1.1 leaves a margin for walls that are not parallel
    wall, ends = cells.walls.nearest(places.reshape(-1, 3))
    inner = np.linalg.norm(ends - places.reshape(-1, 3), axis=1) < 1e-6 * member  # mask of ends that lie on walls
    strips = []
    for place, sides, on_wall in zip(places, wall.reshape(-1, 2), inner.reshape(-1, 2), strict=True):
        strips += _strips_at(cells, sides[on_wall].tolist(), place, half)
    return with_strips(cells, strips, member, SNAP)


def _strips_at(cells: Sheet, walls: list[int], place: Floats, half: Floats) -> list[Strip]:
    strips = (Strip.from_wall(cells, wall, place, half) for wall in walls)
    return [strip for strip in strips if strip is not None]
