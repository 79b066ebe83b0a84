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
"""Which members with a slit between them become one."""

SLENDER = 3.0
"""4 area / perimeter is at most twice the width of a slit, and some more where it widens."""
BROAD = 2.5
"""What is so many times wider than the median member is several in one, or kept besides them."""
TOLD = (0.05, 0.25)
"""Lines to an opposite wall say nothing about an opening if they stand for the first of these shares of its walls, and
all from the second on. A wall more or less, as in the mirrored one on another mesh, makes no other opening of it."""
NARROWER = 0.9
"""An opening is a slit if it is narrower than this share of the members beside it. Where members crowd they are made
just as wide as the openings between them: on the sheet, of flat triangles, that is right to some percent."""
CRUMB, SEVERAL = 0.35, 8
"""An opening is a crumb if its size is under this share of the median's, of at least so many that say what is usual."""
ROOMY = 2.5
"""It is none if it is so many times as wide as the members beside it: filled between thin members it would be a plate.
Crumbs of crowns are up to 2 times as wide, the triangles that an edge leaves of a lattice of bars 4 and more."""
ALIKE = 0.03
"""Openings of which these shares differ by less may be the same but for the mesh."""


@dataclass(frozen=True, eq=False)
class Openings:
    """The void of a sheet that material encloses, and what the edge of the surface leaves of such.

    cells : all cells of the sheet.    part : the void ones alone, or some of them.    face : (f,) which cells they are.
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
        """The openings of a sheet; None where there is none, or nothing else."""
        if not cells.has_openings:
            return None
        part, face = part_of(cells.surface, ~cells.material)
        count, label = pieces(part.F, part.edges)
        return cls(cells, part, face, label, count, inner_walls(part, cells.surface, face))

    def some(self, wanted: Bools) -> "Openings":
        """Those that are marked (o,), numbered as they come."""
        part, left = part_of(self.part, wanted[self.label])
        face, label = self.face[left], (np.cumsum(wanted) - 1)[self.label[left]]
        return Openings(self.cells, part, face, label, int(wanted.sum()), inner_walls(part, self.cells.surface, face))

    def filled(self, wanted: Bools) -> Sheet:
        """The cells with the marked openings (o,) made material, each of the family of a cell beside it."""
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
        """(o,) 4 area / perimeter; infinite for those that walls do not enclose wholly."""
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
        """(o,) how wide they are over the narrower of the two members beside them: half of their walls have less.

        At least half of 4 area / perimeter, the width of a long slit: others are wide somewhere. With few opposite
        walls, as in a triangle, the side of a square of the same area counts; of both, by how much opposite walls tell,
        the harmonic mean. Infinite where no member is beside them, and for those with few opposite walls that the edge
        of the surface cuts open.
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
        told = np.clip((opposite / np.where(total > 0, total, 1.0) - TOLD[0]) / (TOLD[1] - TOLD[0]), 0, 1)
        told = np.where(enclosed, told, told == 1)
        found = _harmonic(between, square, told)
        around[~enclosed] = 1.0  # it does not count there
        return np.where(enclosed, np.maximum(found, self.round_sizes / (2 * around)), found)

    @cached_property
    def slits(self) -> Bools:
        """(o,) which of them are slits: those that are alike are or are not all together."""
        return self.narrowness < limit(self.narrowness, NARROWER, ALIKE)

    @cached_property
    def crowded(self) -> Bools:
        """(o,) slits between members that are nearer to each other than elsewhere: where so much material is asked for
        that openings are narrower than members anyway, closing them all would leave another structure.

        Members may be `CROWDING` times as wide, for their distance, as half of the openings by area have them.
        """
        area = np.where(np.isfinite(self.narrowness), np.bincount(self.label, self.part.areas, self.count), 0.0)
        usual = float(medians(self.narrowness, area, np.zeros(self.count, dtype=np.int64), 1)[0])
        least = NARROWER * min(1.0, max(0.0, (1 + usual) / CROWDING - 1))
        return self.slits & (self.narrowness < limit(self.narrowness, least, ALIKE))

    def slits_between(self, family: Bools) -> tuple[int, float]:
        """How many slits lie between members of a family, material cells (m',) of the sheet; and the share of the
        length of its walls from which it is too near to the next."""
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
        """(k,) how long lines across are over the narrower of the two members at their ends; not a number without."""
        return np.asarray(self._across.width / np.fmin(*self._members[self._edges[self._across.walls]].T))

    @cached_property
    def _edges(self) -> Ints:
        """(e,) the edges of the whole sheet that those of `part` are."""
        return whole_edges(self.part, self.cells.surface, self.face)

    @cached_property
    def _lengths(self) -> Floats:
        """(e,) of the edges, metres."""
        return self.part.edge_lengths

    @cached_property
    def _beside(self) -> Ints:
        """(e,) the opening that each edge of `part` is of."""
        found = np.empty(len(self.walls), dtype=np.int64)
        found[self.part.edges.of] = self.label[:, None]
        return found

    @cached_property
    def _members(self) -> Floats:
        """(e',) widths of the members beyond the walls, by the edges of the whole sheet.

        Not a number elsewhere; the median where material is too broad to be one member.
        """
        sheet = self.cells.surface
        wanted = np.zeros(len(sheet.edges.ends), dtype=bool)
        wanted[self._edges[self.walls]] = True
        material, face = part_of(sheet, self.cells.material)
        whole = whole_edges(material, sheet, face)
        away = crossings(material, material.edges.boundary, wanted[whole], (MIDDLE,))
        width = np.full(len(sheet.edges.ends), np.nan)
        median = medians(away.width, away.weight, np.zeros_like(away.face), 1)
        width[whole[away.walls[:, 0]]] = np.where(away.width < BROAD * median, away.width, median)
        return width


def _harmonic(x: Floats, y: Floats, share: Floats) -> Floats:
    """(o,) the weighted harmonic mean of x and y, which may be infinite; `share` (o,) is the weight of x."""
    tiny = np.finfo(float).tiny
    inverse = share / np.maximum(x, tiny) + (1 - share) / np.maximum(y, tiny)
    return np.asarray(np.divide(1, inverse, out=np.full(len(x), np.inf), where=inverse > 0))


def filled_openings(cells: Sheet, size: float, alike: bool = False) -> tuple[Sheet, int]:
    """The cells with every opening smaller than `size` metres made material, and how many there were.

    alike : whether openings of that size that may be the same but for the mesh are filled all or none.

    An opening is void that material encloses. Its size is the width that half of its walls do not exceed, but no more
    than 4 area / perimeter, nor less than half of that: a triangle with a long tip has opposite walls in its tip alone,
    and is wide elsewhere. It takes the family of a material cell beside it.
    """
    every = Openings.of(cells)
    if every is None or not (near := every.round_sizes < SLENDER * size).any():
        return cells, 0
    few = every.some(near)  # looking across those alone takes a tenth of the time
    across = crossings(few.part, few.walls)
    width = medians(across.width, across.weight, few.label[across.face], few.count)
    smaller = np.clip(width, few.round_sizes / 2, few.round_sizes)  # half is the width of a long slit
    small = smaller < limit(smaller, size, ALIKE * size if alike else 0.0)
    return few.filled(small), int(small.sum())


def filled_crumbs(cells: Sheet) -> tuple[Sheet, int]:
    """The cells with every opening made material that is far smaller than most, and how many there were.

    Sizes are 4 area / perimeter of openings that material encloses; what is `ROOMY` beside its members stays. Those
    that are alike are filled all or none. There are such where members crowd, as around the crown of a dome, and where
    an edge leaves a corner of an opening.
    """
    every = Openings.of(cells)
    if every is None or np.isfinite(every.round_sizes).sum() < SEVERAL:
        return cells, 0
    share = every.round_sizes / np.median(every.round_sizes[np.isfinite(every.round_sizes)])
    crumbs = share < limit(share, CRUMB, ALIKE)
    if crumbs.any():
        narrowness = every.some(crumbs).narrowness
        crumbs[crumbs] = narrowness < limit(narrowness, ROOMY, ALIKE * ROOMY)
    return (every.filled(crumbs), int(crumbs.sum())) if crumbs.any() else (cells, 0)


def filled_slits(cells: Sheet, merge: Merging = "slits") -> tuple[Sheet, int]:
    """The cells with every slit made material, so that the members beside it are one; and how many there were.

    merge : "crowded" for those alone where members crowd, `Openings.crowded`.

    What is beside a broader member may be a slit then: so often as there are any.
    """
    filled = 0
    while (found := Openings.of(cells)) is not None:
        slits = found.crowded if merge == "crowded" else found.slits
        if not slits.any():
            break
        cells, filled = found.filled(slits), filled + int(slits.sum())
    return cells, filled


POCKET = 1.6
"""What a strip parts off is filled where 4 area / perimeter is under this many widths."""
SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3
"""Vertices nearer to the side of a strip than this share of half its width are on it."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Void cells (c,) that a strip crosses, the first of which it begins in, and the family that it takes.

    middle : (3,).    axes : (2, 3) unit vectors along and across.    half : (2,) half of its length and width, metres.
    """

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    @classmethod
    def of(cls, cells: Sheet, walls: Walls, wall: int, ends: Floats, half: Floats) -> "Strip | None":
        """In the opening at a wall, along the line between two ends (2, 3); None where there is none."""
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
    """The cells with as many strips as can be made at once, and small openings that these part off, as material; and
    how many strips. `width`, metres, is what small refers to; for `snap` see `SNAP`."""
    if not (strips := [strips[k] for k in apart(cells, [strip.cells for strip in strips])]):
        return cells, 0
    return _without_pockets(_filled(cells, strips, snap), cells.surface.n, width), len(strips)


def apart(cells: Sheet, groups: Sequence[Ints]) -> list[int]:
    """The numbers of those groups (c,) of cells that have no vertex in common with one chosen before."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for k, group in enumerate(groups):
        vertices = cells.surface.F[group]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(k)
    return chosen


def _filled(cells: Sheet, strips: list[Strip], snap: float) -> Sheet:
    """The strips made material."""
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
    """The cells with the small openings beside strips, whose vertices are not among the first `before`, filled."""
    every = Openings.of(cells)
    if every is None:
        return cells
    beside = np.zeros(every.count, dtype=bool)
    beside[every.label[(cells.surface.F[every.face] >= before).any(axis=1)]] = True
    small: Bools = beside & (every.round_sizes < POCKET * width)
    return every.filled(small) if small.any() else cells
