"""Openings of a cut sheet: specks and slits that are filled, and strips of material across openings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, split_value
from dsfab.core.limits import CROWDING
from dsfab.slicing.cutting.cut import Recut
from dsfab.slicing.cutting.sheet import (
    VOID,
    LineKind,
    Sheet,
    face_subset,
    hydraulic_diameters,
    inner_walls,
    parent_edges,
    weighted_medians,
)
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.finishing.walls import Walls
from dsfab.slicing.measures.widths import MIDDLE, Crossings, crossings
from dsfab.surface import Surface, pieces

Merging = Literal["none", "slits", "crowded"]
"""Kinds of slits that finishing fills, so that the members beside them become one."""

NARROWER = 0.9
"""An opening is a slit if it is narrower than this share of the members beside it.

Crowded members are designed as wide as the openings between them; on flat triangles that is exact to some percent.
"""
CRUMB, SEVERAL = 0.35, 8
"""CRUMB is the size of a crumb, as a share of the median opening; SEVERAL openings are enough for a median."""
ALIKE = 0.03
"""Sizes of openings that differ by less than this share may differ only because of the mesh."""


@dataclass(frozen=True, eq=False)
class Openings:
    """The enclosed void of a sheet, and openings that the edge of the surface cuts.

    cells : all cells of the sheet.    part : all void cells, or a part of them.    face : (f,) the indices of these
            cells.
    label : (f,) the opening of each void cell, of `count`.    walls : (e,) the edges of `part` between void and
            material."""

    cells: Sheet
    part: Surface
    face: Ints
    label: Ints
    count: int
    walls: Bools

    @classmethod
    def from_sheet(cls, cells: Sheet) -> Self | None:
        """Return the openings of a sheet; None for a sheet of material or of void alone."""
        if not cells.has_openings:
            return None
        part, face = face_subset(cells.surface, ~cells.material)
        count, label = pieces(part.F, part.edges)
        return cls(cells, part, face, label, count, inner_walls(part, cells.surface, face))

    def subset(self, chosen: Bools) -> "Openings":
        """Return the marked openings (o,), renumbered."""
        part, remaining = face_subset(self.part, chosen[self.label])
        face, label = self.face[remaining], (np.cumsum(chosen) - 1)[self.label[remaining]]
        return Openings(self.cells, part, face, label, int(chosen.sum()), inner_walls(part, self.cells.surface, face))

    def fill(self, chosen: Bools) -> Sheet:
        """Return the cells with the marked openings (o,) as material, each of the family of a neighbouring cell."""
        cells, in_chosen = self.cells, chosen[self.label]
        family = cells.family.copy()
        family[self.face[in_chosen]] = self._families()[self.label[in_chosen]]
        return replace(cells, family=family)

    @cached_property
    def centroids(self) -> Floats:
        """(o, 3) centroids of the openings, metres."""
        area = self.part.areas
        total = np.bincount(self.label, area, self.count)
        return np.stack([np.bincount(self.label, area * x, self.count) / total for x in self.part.centroids.T], axis=1)

    @cached_property
    def hydraulic_diameters(self) -> Floats:
        """(o,) hydraulic diameters 4 area / perimeter; infinite for openings that walls do not enclose wholly."""
        return hydraulic_diameters(self.part, self.walls, self.label, self.count)

    def _families(self) -> Ints:
        """(o,) the largest family of the material that shares an edge with each opening."""
        piece = np.full(self.cells.surface.m, -1)
        piece[self.face] = self.label
        family = np.full(self.count, VOID)
        f, g = (self.cells.surface.edges.pairs // 3).T
        for void_cell, material_cell in ((f, g), (g, f)):
            touching = (piece[void_cell] >= 0) & (piece[material_cell] < 0)
            np.maximum.at(family, piece[void_cell[touching]], self.cells.family[material_cell[touching]])
        return family

    @cached_property
    def narrowness(self) -> Floats:
        """(o,) width of each opening over the narrower of the two members beside it: the median along its walls.

        It is at least half of 4 area / perimeter, the width of a long slit. An opening with few opposite walls, such as
        a triangle, counts with the side of the square of equal area instead. Between 5 and 25 % of opposite walls, the
        result
        is the weighted harmonic mean of both values. Infinite without members, and for openings with few opposite
        walls at the
        edge of the surface.
        """
        across, wall, member = self._wall_crossings, np.flatnonzero(self.walls), self._member_widths
        label, has_ratio = self.label[across.face], ~np.isnan(self._width_ratio)
        between = weighted_medians(self._width_ratio, across.weight, label, self.count)
        opposite = np.bincount(label, across.weight * has_ratio, self.count)
        total = np.bincount(self._opening_of_edge[wall], self._lengths[wall], self.count)
        around = weighted_medians(
            member[self._parent_edges[wall]], self._lengths[wall], self._opening_of_edge[wall], self.count
        )
        enclosed = np.isfinite(self.hydraulic_diameters)
        square = np.sqrt(np.bincount(self.label, self.part.areas, self.count)) / around
        square[~enclosed | np.isinf(around)] = np.inf
        opposite_share = np.clip((opposite / np.where(total > 0, total, 1.0) - 0.05) / (0.25 - 0.05), 0, 1)
        opposite_share = np.where(enclosed, opposite_share, opposite_share == 1)
        result = _harmonic(between, square, opposite_share)
        around[~enclosed] = 1.0  # 1.0 avoids a division by 0 and is not used
        return np.where(enclosed, np.maximum(result, self.hydraulic_diameters / (2 * around)), result)

    @cached_property
    def slits(self) -> Bools:
        """(o,) mask of the slits; of nearly equal openings, all or none are slits."""
        return self.narrowness < split_value(self.narrowness, NARROWER, ALIKE)

    @cached_property
    def crowded_slits(self) -> Bools:
        """(o,) mask of slits between members that are nearer to each other than elsewhere.

        In a dense pattern all openings are narrower than members, and closing them would leave another structure. So
        the limit is `CROWDING` times the median width of members for their distance.
        """
        area = np.where(np.isfinite(self.narrowness), np.bincount(self.label, self.part.areas, self.count), 0.0)
        usual = float(weighted_medians(self.narrowness, area, np.zeros(self.count, dtype=np.int64), 1)[0])
        least = NARROWER * min(1.0, max(0.0, (1 + usual) / CROWDING - 1))
        return self.slits & (self.narrowness < split_value(self.narrowness, least, ALIKE))

    def slits_between(self, family: Bools) -> tuple[int, float]:
        """Number of slits along members of a family, material cells (m',), and the share of their wall length
        beside slits."""
        own_edges = np.zeros(len(self.cells.surface.edges.ends), dtype=bool)
        own_edges[self.cells.surface.edges.of[family]] = True
        wall = self._wall_crossings.walls[:, 0]
        label, weight = self._opening_of_edge[wall], self._wall_crossings.weight
        own_length = np.bincount(label, weight * own_edges[self._parent_edges[wall]], self.count)
        narrow = np.nan_to_num(self._width_ratio, nan=np.inf) < 1
        narrow_length = float(weight @ (own_edges[self._parent_edges[wall]] & narrow & self.slits[label]))
        share = narrow_length / float(own_length.sum()) if own_length.any() else 0.0
        return int((self.slits & (own_length > np.bincount(label, weight, self.count) / 2)).sum()), share

    @cached_property
    def _wall_crossings(self) -> Crossings:
        return crossings(self.part, self.walls, shares=(MIDDLE,))

    @cached_property
    def _width_ratio(self) -> Floats:
        """(k,) length of lines across over the narrower of the two members at their ends; NaN without."""
        return np.asarray(
            self._wall_crossings.width / np.fmin(*self._member_widths[self._parent_edges[self._wall_crossings.walls]].T)
        )

    @cached_property
    def _parent_edges(self) -> Ints:
        return parent_edges(self.part, self.cells.surface, self.face)

    @cached_property
    def _lengths(self) -> Floats:
        return self.part.edge_lengths

    @cached_property
    def _opening_of_edge(self) -> Ints:
        opening = np.empty(len(self.walls), dtype=np.int64)
        opening[self.part.edges.of] = self.label[:, None]
        return opening

    @cached_property
    def _member_widths(self) -> Floats:
        """(e',) widths of the members beyond the walls, by the edges of the whole sheet; NaN elsewhere.

        Material broader than 2.5 medians is several members and counts with the median.
        """
        sheet = self.cells.surface
        wall_edges = np.zeros(len(sheet.edges.ends), dtype=bool)
        wall_edges[self._parent_edges[self.walls]] = True
        material, face = face_subset(sheet, self.cells.material)
        sheet_edges = parent_edges(material, sheet, face)
        member_crossings = crossings(material, material.edges.boundary, wall_edges[sheet_edges], (MIDDLE,))
        width = np.full(len(sheet.edges.ends), np.nan)
        median = weighted_medians(
            member_crossings.width, member_crossings.weight, np.zeros_like(member_crossings.face), 1
        )
        width[sheet_edges[member_crossings.walls[:, 0]]] = np.where(
            member_crossings.width < 2.5 * median, member_crossings.width, median
        )
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
    openings = Openings.from_sheet(cells)
    if openings is None or not (may_be_small := openings.hydraulic_diameters < 3 * size).any():
        return cells, 0
    candidates = openings.subset(may_be_small)  # fewer openings take a tenth of the time
    across = crossings(candidates.part, candidates.walls)
    width = weighted_medians(across.width, across.weight, candidates.label[across.face], candidates.count)
    smaller = np.clip(
        width, candidates.hydraulic_diameters / 2, candidates.hydraulic_diameters
    )  # half of it is the width of a long slit
    small = smaller < split_value(smaller, size, ALIKE * size if alike else 0.0)
    return candidates.fill(small), int(small.sum())


def filled_crumbs(cells: Sheet) -> tuple[Sheet, int]:
    """Make every opening that is far smaller than most material; return also their number.

    Sizes are 4 area / perimeter of enclosed openings. An opening that is 2.5 times as wide as the members beside it
    stays, because a plate between thin members would replace it. Nearly equal openings are filled all or none. Crumbs
    arise where members crowd, as around the crown of a dome, and where an edge leaves a corner of an opening.
    """
    openings = Openings.from_sheet(cells)
    if openings is None or np.isfinite(openings.hydraulic_diameters).sum() < SEVERAL:
        return cells, 0
    share = openings.hydraulic_diameters / np.median(
        openings.hydraulic_diameters[np.isfinite(openings.hydraulic_diameters)]
    )
    crumbs = share < split_value(share, CRUMB, ALIKE)
    if crumbs.any():
        narrowness = openings.subset(crumbs).narrowness
        crumbs[crumbs] = narrowness < split_value(narrowness, 2.5, ALIKE * 2.5)
    return (openings.fill(crumbs), int(crumbs.sum())) if crumbs.any() else (cells, 0)


def filled_slits(cells: Sheet, merge: Merging = "slits") -> tuple[Sheet, int]:
    """Make every slit material, so that the members beside it become one; return also their number.

    merge : "crowded" for the slits of `Openings.crowded_slits` only.

    Openings beside a broader member may become slits. So the function repeats until no slit is left."""
    filled = 0
    while (openings := Openings.from_sheet(cells)) is not None:
        slits = openings.crowded_slits if merge == "crowded" else openings.slits
        if not slits.any():
            break
        cells, filled = openings.fill(slits), filled + int(slits.sum())
    return cells, filled


SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3
"""Vertices nearer to the side of a strip than this share of half its width move onto it."""


@dataclass(frozen=True, eq=False)
class Strip:
    """A rectangular strip across void cells (c,): it begins in the first cell, and takes the family `family`.

    middle : (3,).    axes : (2, 3) unit vectors along and across.    half : (2,) half of its length and width, metres.
    """

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    @classmethod
    def between_walls(cls, cells: Sheet, walls: Walls, wall: int, ends: Floats, half: Floats) -> "Strip | None":
        """Return the strip in the opening at a wall, along the line between two ends (2, 3); None without an
        opening.
        """
        surface, first_cell = cells.surface, int(walls.inside[wall]) // 3
        direction = ends[1] - ends[0]
        gap = float(np.linalg.norm(direction))
        if not gap or cells.material[first_cell]:
            return None
        along = direction / gap
        across = np.cross(surface.normals[first_cell], along)
        across /= np.linalg.norm(across)
        family = int(cells.family[walls.outside[wall] // 3])
        strip = cls(np.array([first_cell]), family, ends.mean(axis=0), np.stack([along, across]), half)
        seen, waiting = [first_cell], [first_cell]
        while waiting:
            cell = waiting.pop()
            coordinates = strip.local_coordinates(surface.V[surface.F[cell]])
            next_coordinates = np.roll(coordinates, -1, axis=1)
            crossed = (
                (np.minimum(coordinates, next_coordinates) < 1) & (np.maximum(coordinates, next_coordinates) > -1)
            ).all(axis=0)
            new_cells = [c for c in cells.void_neighbours[cell][crossed].tolist() if c >= 0 and c not in seen]
            seen += new_cells
            waiting += new_cells
        return replace(strip, cells=np.array(seen))

    def local_coordinates(self, X: Floats) -> Floats:
        """(2, k) coordinates of points X (k, 3) along and across; the sides are at -1 and 1."""
        return np.asarray(self.axes @ (X - self.middle).T / self.half[:, None])


def with_strips(cells: Sheet, strips: list[Strip], width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """Make strips, and small openings that they cut off, material; return also the number of strips.

    One call makes as many strips as possible.
    width : metres; openings with 4 area / perimeter under 1.6 widths are small.    snap : see `SNAP`.
    """
    if not (strips := [strips[k] for k in disjoint_groups(cells, [strip.cells for strip in strips])]):
        return cells, 0
    return _without_pockets(_fill_strips(cells, strips, snap), cells.surface.n, width), len(strips)


def disjoint_groups(cells: Sheet, groups: Sequence[Ints]) -> list[int]:
    """Choose groups (c,) of cells that have no vertex in common with an earlier group; return their numbers."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for k, group in enumerate(groups):
        vertices = cells.surface.F[group]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(k)
    return chosen


def _fill_strips(cells: Sheet, strips: list[Strip], snap: float) -> Sheet:
    recut = Recut.from_cells(cells, np.concatenate([strip.cells for strip in strips]))
    mesh, owner, root = recut.mesh, np.full(len(recut.cells), -1), np.arange(len(recut.cells))
    for k, strip in enumerate(strips):
        owner[np.searchsorted(recut.cells, strip.cells)] = k
    inside, first_line = owner >= 0, mesh.lines.count
    mesh = replace(mesh, lines=mesh.lines.with_more(LineKind.STRIP, len(strips)))
    for axis in range(2):
        x = np.full(len(mesh.X), 2.0)
        for k, strip in enumerate(strips):
            slots = mesh.cells.slots(np.flatnonzero(inside & (owner[root] == k)))
            vertex = np.unique(mesh.cells.corner[slots])
            x[vertex] = strip.local_coordinates(mesh.X[vertex])[axis]
        on_side = np.abs(np.abs(x) - 1) < snap
        x[on_side] = np.sign(x[on_side])
        split = clean_split(mesh.cells, mesh.X, x, SIDES, inside, Snapping(0.0, cells.surface.size))
        root, inside = root[split.source], inside[split.source] & (split.strip == 1)
        mesh = mesh.after_split(split, first_line + owner[root][None])
    part, first_cells = mesh.part_labels(inside), np.searchsorted(recut.cells, [strip.cells[0] for strip in strips])
    chosen = inside & np.isin(part, part[inside & np.isin(root, first_cells)])
    family = np.array([strip.family for strip in strips])[owner[root]]
    return recut.merged_sheet(replace(mesh, family=np.where(chosen, family, mesh.family)), root)


def _without_pockets(cells: Sheet, before: int, width: float) -> Sheet:
    """The cells with the small openings beside strips filled; vertices of strips are not among the first `before`."""
    openings = Openings.from_sheet(cells)
    if openings is None:
        return cells
    at_strip = np.zeros(openings.count, dtype=bool)
    at_strip[openings.label[(cells.surface.F[openings.face] >= before).any(axis=1)]] = True
    small: Bools = at_strip & (openings.hydraulic_diameters < 1.6 * width)
    return openings.fill(small) if small.any() else cells
