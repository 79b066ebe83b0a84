"""Openings of a cut sheet: specks and slits that are filled, and strips of material across openings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.limits import CROWDING
from dsfab.slicing.cutting.cut import Recut
from dsfab.slicing.cutting.loose_ends import limit
from dsfab.slicing.cutting.sheet import VOID, Sheet, inner_walls, medians, part_of, round_sizes, whole_edges
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.finishing.walls import Walls
from dsfab.slicing.measures.widths import MIDDLE, Crossings, crossings
from dsfab.surface import Surface, pieces

Merging = Literal["none", "slits", "crowded"]
"""Members that become one across a slit."""

NARROWER = 0.9
"""An opening is a slit if it is narrower than this share of the members beside it.

Crowded members are designed as wide as the openings between them; on flat triangles that is exact to some percent.
"""
CRUMB, SEVERAL = 0.35, 8
"""Size of a crumb, as a share of the median opening; least number of openings for a median."""
ALIKE = 0.03
"""Openings of which these shares differ by less may be equal but for the mesh."""


@dataclass(frozen=True, eq=False)
class Openings:
    """The enclosed void of a sheet, and openings that the edge of the surface cuts.

    cells : all cells of the sheet.    part : the void ones alone, or a part of them.    face : (f,) their indices.
    label : (f,) the opening of each, of `count`.    walls : (e,) the edges of `part` between void and material.
    """

    cells: Sheet
    part: Surface
    face: Ints
    label: Ints
    count: int
    walls: Bools

    @classmethod
    def of(cls, cells: Sheet) -> Self | None:
        """Return the openings of a sheet; None for a sheet of material or of void alone."""
        if not cells.has_openings:
            return None
        part, face = part_of(cells.surface, ~cells.material)
        count, label = pieces(part.F, part.edges)
        return cls(cells, part, face, label, count, inner_walls(part, cells.surface, face))

    def some(self, wanted: Bools) -> "Openings":
        """Return the marked openings (o,), renumbered."""
        part, left = part_of(self.part, wanted[self.label])
        face, label = self.face[left], (np.cumsum(wanted) - 1)[self.label[left]]
        return Openings(self.cells, part, face, label, int(wanted.sum()), inner_walls(part, self.cells.surface, face))

    def filled(self, wanted: Bools) -> Sheet:
        """Return the cells with the marked openings (o,) as material, each of the family of a neighbouring cell."""
        cells, here = self.cells, wanted[self.label]
        family = cells.family.copy()
        family[self.face[here]] = self._families()[self.label[here]]
        return replace(cells, family=family)

    @cached_property
    def places(self) -> Floats:
        """(o, 3) their centroids, metres."""
        area = self.part.areas
        total = np.bincount(self.label, area, self.count)
        return np.stack([np.bincount(self.label, area * x, self.count) / total for x in self.part.centroids.T], axis=1)

    @cached_property
    def round_sizes(self) -> Floats:
        """(o,) hydraulic diameters 4 area / perimeter; infinite for openings that walls do not enclose wholly."""
        return round_sizes(self.part, self.walls, self.label, self.count)

    def _families(self) -> Ints:
        """(o,) the largest family of the material that shares an edge with each."""
        piece = np.full(self.cells.surface.m, -1)
        piece[self.face] = self.label
        found = np.full(self.count, VOID)
        f, g = (self.cells.surface.edges.pairs // 3).T
        for here, there in ((f, g), (g, f)):
            at = (piece[here] >= 0) & (piece[there] < 0)
            np.maximum.at(found, piece[here[at]], self.cells.family[there[at]])
        return found

    @cached_property
    def narrowness(self) -> Floats:
        """(o,) width of each opening over the narrower of the two members beside it: the median along its walls.

        It is at least half of 4 area / perimeter, the width of a long slit. An opening with few opposite walls, such as
        a triangle, counts with the side of the square of equal area instead. Between 5 and 25 % of opposite walls it is
        the weighted harmonic mean of both. Infinite without members, and for openings with few opposite walls at the
        edge of the surface.
        """
        across, wall, member = self._across, np.flatnonzero(self.walls), self._members
        label, known = self.label[across.face], ~np.isnan(self._ratio)
        between = medians(self._ratio, across.weight, label, self.count)
        opposite = np.bincount(label, across.weight * known, self.count)
        total = np.bincount(self._beside[wall], self._lengths[wall], self.count)
        around = medians(member[self._edges[wall]], self._lengths[wall], self._beside[wall], self.count)
        enclosed = np.isfinite(self.round_sizes)
        square = np.sqrt(np.bincount(self.label, self.part.areas, self.count)) / around
        square[~enclosed | np.isinf(around)] = np.inf
        told = np.clip((opposite / np.where(total > 0, total, 1.0) - 0.05) / (0.25 - 0.05), 0, 1)
        told = np.where(enclosed, told, told == 1)
        found = _harmonic(between, square, told)
        around[~enclosed] = 1.0  # without effect
        return np.where(enclosed, np.maximum(found, self.round_sizes / (2 * around)), found)

    @cached_property
    def slits(self) -> Bools:
        """(o,) mask of the slits; nearly equal openings are slits all or none."""
        return self.narrowness < limit(self.narrowness, NARROWER, ALIKE)

    @cached_property
    def crowded(self) -> Bools:
        """(o,) mask of slits between members that are nearer to each other than elsewhere.

        In a dense pattern all openings are narrower than members, and closing them would leave another structure. So
        the limit is `CROWDING` times the median width of members for their distance.
        """
        area = np.where(np.isfinite(self.narrowness), np.bincount(self.label, self.part.areas, self.count), 0.0)
        usual = float(medians(self.narrowness, area, np.zeros(self.count, dtype=np.int64), 1)[0])
        least = NARROWER * min(1.0, max(0.0, (1 + usual) / CROWDING - 1))
        return self.slits & (self.narrowness < limit(self.narrowness, least, ALIKE))

    def slits_between(self, family: Bools) -> tuple[int, float]:
        """Number of slits along members of a family, material cells (m',), and the share of their wall length at
        slits.
        """
        own = np.zeros(len(self.cells.surface.edges.ends), dtype=bool)
        own[self.cells.surface.edges.of[family]] = True
        wall = self._across.walls[:, 0]
        label, weight = self._beside[wall], self._across.weight
        mine = np.bincount(label, weight * own[self._edges[wall]], self.count)
        narrow = np.nan_to_num(self._ratio, nan=np.inf) < 1
        near = float(weight @ (own[self._edges[wall]] & narrow & self.slits[label]))
        share = near / float(mine.sum()) if mine.any() else 0.0
        return int((self.slits & (mine > np.bincount(label, weight, self.count) / 2)).sum()), share

    @cached_property
    def _across(self) -> Crossings:
        return crossings(self.part, self.walls, at=(MIDDLE,))

    @cached_property
    def _ratio(self) -> Floats:
        """(k,) length of lines across over the narrower of the two members at their ends; NaN without."""
        return np.asarray(self._across.width / np.fmin(*self._members[self._edges[self._across.walls]].T))

    @cached_property
    def _edges(self) -> Ints:
        return whole_edges(self.part, self.cells.surface, self.face)

    @cached_property
    def _lengths(self) -> Floats:
        return self.part.edge_lengths

    @cached_property
    def _beside(self) -> Ints:
        found = np.empty(len(self.walls), dtype=np.int64)
        found[self.part.edges.of] = self.label[:, None]
        return found

    @cached_property
    def _members(self) -> Floats:
        """(e',) widths of the members beyond the walls, by the edges of the whole sheet; NaN elsewhere.

        Material broader than 2.5 medians is several members and counts with the median.
        """
        sheet = self.cells.surface
        wanted = np.zeros(len(sheet.edges.ends), dtype=bool)
        wanted[self._edges[self.walls]] = True
        material, face = part_of(sheet, self.cells.material)
        whole = whole_edges(material, sheet, face)
        away = crossings(material, material.edges.boundary, wanted[whole], (MIDDLE,))
        width = np.full(len(sheet.edges.ends), np.nan)
        median = medians(away.width, away.weight, np.zeros_like(away.face), 1)
        width[whole[away.walls[:, 0]]] = np.where(away.width < 2.5 * median, away.width, median)
        return width


def _harmonic(x: Floats, y: Floats, share: Floats) -> Floats:
    """(o,) the weighted harmonic mean of x and y, which may be infinite; `share` (o,) is the weight of x."""
    tiny = np.finfo(float).tiny
    inverse = share / np.maximum(x, tiny) + (1 - share) / np.maximum(y, tiny)
    return np.asarray(np.divide(1, inverse, out=np.full(len(x), np.inf), where=inverse > 0))


def filled_openings(cells: Sheet, size: float, alike: bool = False) -> tuple[Sheet, int]:
    """Make every opening smaller than `size` metres material; return also their number.

    alike : if True, nearly equal openings of about that size are filled all or none.

    The size of an opening is its median width along the walls, but between half of and all of 4 area / perimeter. For
    example, a triangle with a long tip has opposite walls in the tip alone, and is wider elsewhere. An opening takes
    the family of a neighbouring material cell.
    """
    every = Openings.of(cells)
    if every is None or not (near := every.round_sizes < 3 * size).any():
        return cells, 0
    few = every.some(near)  # measuring these alone takes a tenth of the time
    across = crossings(few.part, few.walls)
    width = medians(across.width, across.weight, few.label[across.face], few.count)
    smaller = np.clip(width, few.round_sizes / 2, few.round_sizes)  # half is the width of a long slit
    small = smaller < limit(smaller, size, ALIKE * size if alike else 0.0)
    return few.filled(small), int(small.sum())


def filled_crumbs(cells: Sheet) -> tuple[Sheet, int]:
    """Make every opening that is far smaller than most material; return also their number.

    Sizes are 4 area / perimeter of enclosed openings. An opening that is 2.5 times as wide as the members beside it
    stays, because a plate between thin members would replace it. Nearly equal openings are filled all or none. Crumbs
    arise where members crowd, as around the crown of a dome, and where an edge leaves a corner of an opening.
    """
    every = Openings.of(cells)
    if every is None or np.isfinite(every.round_sizes).sum() < SEVERAL:
        return cells, 0
    share = every.round_sizes / np.median(every.round_sizes[np.isfinite(every.round_sizes)])
    crumbs = share < limit(share, CRUMB, ALIKE)
    if crumbs.any():
        narrowness = every.some(crumbs).narrowness
        crumbs[crumbs] = narrowness < limit(narrowness, 2.5, ALIKE * 2.5)
    return (every.filled(crumbs), int(crumbs.sum())) if crumbs.any() else (cells, 0)


def filled_slits(cells: Sheet, merge: Merging = "slits") -> tuple[Sheet, int]:
    """Make every slit material, so that the members beside it become one; return also their number.

    merge : "crowded" for the slits of `Openings.crowded_slits` only.

    Openings beside a broader member may become slits; so it repeats until no slit is left.
    """
    filled = 0
    while (found := Openings.of(cells)) is not None:
        slits = found.crowded if merge == "crowded" else found.slits
        if not slits.any():
            break
        cells, filled = found.filled(slits), filled + int(slits.sum())
    return cells, filled


SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3
"""Vertices nearer to the side of a strip than this share of half its width move onto it."""


@dataclass(frozen=True, eq=False)
class Strip:
    """A rectangular strip across void cells (c,), the first of which it begins in, and the family that it takes.

    middle : (3,).    axes : (2, 3) unit vectors along and across.    half : (2,) half of its length and width, metres.
    """

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    @classmethod
    def of(cls, cells: Sheet, walls: Walls, wall: int, ends: Floats, half: Floats) -> "Strip | None":
        """Return the strip in the opening at a wall, along the line between two ends (2, 3); None without an
        opening.
        """
        surface, first = cells.surface, int(walls.inside[wall]) // 3
        way = ends[1] - ends[0]
        gap = float(np.linalg.norm(way))
        if not gap or cells.material[first]:
            return None
        along = way / gap
        across = np.cross(surface.normals[first], along)
        across /= np.linalg.norm(across)
        family = int(cells.family[walls.outside[wall] // 3])
        strip = cls(np.array([first]), family, ends.mean(axis=0), np.stack([along, across]), half)
        seen, waiting = [first], [first]
        while waiting:
            cell = waiting.pop()
            here = strip.within(surface.V[surface.F[cell]])
            there = np.roll(here, -1, axis=1)
            crossed = ((np.minimum(here, there) < 1) & (np.maximum(here, there) > -1)).all(axis=0)
            others = [c for c in cells.void_beside[cell][crossed].tolist() if c >= 0 and c not in seen]
            seen += others
            waiting += others
        return replace(strip, cells=np.array(seen))

    def within(self, X: Floats) -> Floats:
        """(2, k) coordinates of points X (k, 3) along and across; the sides are at -1 and 1."""
        return np.asarray(self.axes @ (X - self.middle).T / self.half[:, None])


def with_strips(cells: Sheet, strips: list[Strip], width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """Make as many strips as possible at once, and small openings that these cut off, material; return also their
    number.

    width : metres; openings with 4 area / perimeter under 1.6 widths are small.    snap : see `SNAP`.
    """
    if not (strips := [strips[k] for k in apart(cells, [strip.cells for strip in strips])]):
        return cells, 0
    return _without_pockets(_filled(cells, strips, snap), cells.surface.n, width), len(strips)


def apart(cells: Sheet, groups: Sequence[Ints]) -> list[int]:
    """Choose groups (c,) of cells that have no vertex in common with an earlier one; return their numbers."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for k, group in enumerate(groups):
        vertices = cells.surface.F[group]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(k)
    return chosen


def _filled(cells: Sheet, strips: list[Strip], snap: float) -> Sheet:
    some = Recut.of(cells, np.concatenate([strip.cells for strip in strips]))
    mesh, owner, root = some.mesh, np.full(len(some.cells), -1), np.arange(len(some.cells))
    for k, strip in enumerate(strips):
        owner[np.searchsorted(some.cells, strip.cells)] = k
    inside = owner >= 0
    for axis in range(2):
        x = np.full(len(mesh.X), 2.0)
        for k, strip in enumerate(strips):
            slots = mesh.cells.slots(np.flatnonzero(inside & (owner[root] == k)))
            vertex = np.unique(mesh.cells.corner[slots])
            x[vertex] = strip.within(mesh.X[vertex])[axis]
        near = np.abs(np.abs(x) - 1) < snap
        x[near] = np.sign(x[near])
        split = clean_split(mesh.cells, mesh.X, x, SIDES, inside, Snapping(0.0, cells.surface.size))
        mesh, root, inside = mesh.after(split), root[split.source], inside[split.source] & (split.strip == 1)
    part, first = mesh.parts(inside), np.searchsorted(some.cells, [strip.cells[0] for strip in strips])
    chosen = inside & np.isin(part, part[inside & np.isin(root, first)])
    family = np.array([strip.family for strip in strips])[owner[root]]
    return some.together(replace(mesh, family=np.where(chosen, family, mesh.family)), root)


def _without_pockets(cells: Sheet, before: int, width: float) -> Sheet:
    """The cells with the small openings beside strips filled; vertices of strips are not among the first `before`."""
    every = Openings.of(cells)
    if every is None:
        return cells
    beside = np.zeros(every.count, dtype=bool)
    beside[every.label[(cells.surface.F[every.face] >= before).any(axis=1)]] = True
    small: Bools = beside & (every.round_sizes < 1.6 * width)
    return every.filled(small) if small.any() else cells
