"""Where the openings and the members of a sheet are narrow, on the sheet itself, wherever it is folded."""

import numpy as np

from dsfab.arrays import Floats, along_segments
from dsfab.slicing.across import MIDDLE, Crossings, crossings
from dsfab.slicing.parts import inner_walls, medians, part_of
from dsfab.slicing.sheet import Sheet
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
