"""Openings of a cut sheet: small openings and slits become material."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, split_value
from dsfab.core.derived import derived
from dsfab.core.limits import CROWDING
from dsfab.slicing.cutting.cut import recut_polygons, with_polygons
from dsfab.slicing.cutting.sheet import VOID, LineKind, Sheet, SheetPart, hydraulic_diameters, weighted_medians
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.measures.widths import MIDDLE, Crossings, crossings

Merging = Literal["none", "slits", "crowded"]
"""Rule for slits (narrow openings) that finishing fills: none, all, or only slits between crowded members."""

NARROWER = 0.9
"""Largest width of a slit, as a fraction of the width of the members beside it.
The limit is under 1, so that small errors do not turn openings as wide as the members into slits."""
CRUMB, SEVERAL = 0.35, 8
"""A crumb is an opening smaller than CRUMB times the median size, in a sheet with at least SEVERAL openings."""
ALIKE = 0.03
"""Openings count as equal if their sizes differ by less than this fraction: the mesh may cause the difference."""


@dataclass(frozen=True, eq=False)
class Openings:
    """Openings of a sheet, enclosed or at its edge.
    void : void cells (f,) of these openings.    label : (f,) the opening of each void cell."""

    void: SheetPart
    material: SheetPart
    label: Ints
    count: int

    def subset(self, chosen: Bools) -> "Openings":
        """Return only the openings that the mask `chosen` (o,) marks, with new numbers from 0."""
        mask = np.zeros(self.void.cut_surface.m, dtype=bool)
        mask[self.void.cells[chosen[self.label]]] = True
        label = (np.cumsum(chosen) - 1)[self.label[chosen[self.label]]]
        return Openings(SheetPart.from_cells(self.void.cut_surface, mask), self.material, label, int(chosen.sum()))

    @cached_property
    def centroids(self) -> Floats:
        """(o, 3) centroids of the openings, metres."""
        areas, centroids = self.void.surface.areas[:, None], self.void.surface.centroids
        return group_sums(self.label, areas * centroids, self.count) / group_sums(self.label, areas, self.count)

    @cached_property
    def hydraulic_diameters(self) -> Floats:
        """(o,) hydraulic diameters 4 area / perimeter, metres; infinite for openings at the edge of the surface."""
        return hydraulic_diameters(self.void.surface, self.void.walls, self.label, self.count)

    @cached_property
    def narrowness(self) -> Floats:
        """(o,) median width of each opening / width of the narrower member beside it; infinite without members."""
        across, wall, member = self._crossings, np.flatnonzero(self.void.walls), self._member_widths
        label, has_ratio = self.label[across.face], ~np.isnan(self._width_ratio)
        between = weighted_medians(self._width_ratio, across.weight, label, self.count)
        opposite = np.bincount(label, across.weight * has_ratio, self.count)
        opening, length = self._opening_of_edge[wall], self.void.surface.edge_lengths[wall]
        total = np.bincount(opening, length, self.count)
        around = weighted_medians(member[self.void.parent_edges[wall]], length, opening, self.count)
        enclosed = np.isfinite(self.hydraulic_diameters)
        square = np.sqrt(np.bincount(self.label, self.void.surface.areas, self.count)) / around
        square[~enclosed | np.isinf(around)] = np.inf
        opposite_share = np.clip((opposite / np.where(total > 0, total, 1.0) - 0.05) / (0.25 - 0.05), 0, 1)
        opposite_share = np.where(enclosed, opposite_share, opposite_share == 1)
        result = _harmonic(between, square, opposite_share)
        around[~enclosed] = 1.0  # not used below; avoids a division by 0
        return np.where(enclosed, np.maximum(result, self.hydraulic_diameters / (2 * around)), result)

    @cached_property
    def slits(self) -> Bools:
        """(o,) mask of the slits: openings narrower than about `NARROWER` x the member beside them."""
        return self.narrowness < split_value(self.narrowness, NARROWER, ALIKE)

    @cached_property
    def crowded_slits(self) -> Bools:
        """(o,) mask of slits between members that are closer together than usual, by a factor of about `CROWDING`."""
        area = np.where(np.isfinite(self.narrowness), np.bincount(self.label, self.void.surface.areas, self.count), 0.0)
        usual = float(weighted_medians(self.narrowness, area, np.zeros(self.count, dtype=np.int64), 1)[0])
        least = NARROWER * min(1.0, max(0.0, (1 + usual) / CROWDING - 1))
        return self.slits & (self.narrowness < split_value(self.narrowness, least, ALIKE))

    def slits_between(self, family: Bools) -> tuple[int, float]:
        """Return the number of slits that lie mostly beside a family, and the share of the family's outline at slits.
        family : (m',) mask of the family's cells."""
        own_edges = np.zeros(len(self.void.cut_surface.edges.ends), dtype=bool)
        own_edges[self.void.cut_surface.edges.of[family]] = True
        wall = self._crossings.walls[:, 0]
        label, weight = self._opening_of_edge[wall], self._crossings.weight
        own_length = np.bincount(label, weight * own_edges[self.void.parent_edges[wall]], self.count)
        narrow = np.nan_to_num(self._width_ratio, nan=np.inf) < 1
        narrow_length = float(weight @ (own_edges[self.void.parent_edges[wall]] & narrow & self.slits[label]))
        share = narrow_length / float(own_length.sum()) if own_length.any() else 0.0
        return int((self.slits & (own_length > np.bincount(label, weight, self.count) / 2)).sum()), share

    @cached_property
    def _crossings(self) -> Crossings:
        return crossings(self.void.surface, self.void.walls, shares=(MIDDLE,))

    @cached_property
    def _width_ratio(self) -> Floats:
        """(k,) opening width / width of the narrower member, on each line across an opening; NaN without members."""
        member = self._member_widths[self.void.parent_edges[self._crossings.walls]]
        return np.asarray(self._crossings.width / np.fmin(*member.T))

    @cached_property
    def _opening_of_edge(self) -> Ints:
        opening = np.empty(len(self.void.walls), dtype=np.int64)
        opening[self.void.surface.edges.of] = self.label[:, None]
        return opening

    @cached_property
    def _member_widths(self) -> Floats:
        """(e,) width of the member at each edge between material and void, metres; NaN at further edges."""
        wall_edges = np.zeros(len(self.void.cut_surface.edges.ends), dtype=bool)
        wall_edges[self.void.parent_edges[self.void.walls]] = True
        surface, sheet_edges = self.material.surface, self.material.parent_edges
        across = crossings(surface, surface.edges.boundary, wall_edges[sheet_edges], (MIDDLE,))
        median = weighted_medians(across.width, across.weight, np.zeros_like(across.face), 1)
        width = np.full(len(wall_edges), np.nan)
        width[sheet_edges[across.walls[:, 0]]] = np.where(across.width < 2.5 * median, across.width, median)
        return width


@derived
def openings_of(sheet: Sheet) -> Openings | None:
    """Return the openings of a sheet; None for a sheet without void or without material."""
    if not sheet.has_openings:
        return None
    count, label = sheet.void_part.surface.pieces
    return Openings(sheet.void_part, sheet.material_part, label, count)


def with_filled(sheet: Sheet, chosen: Bools) -> Sheet:
    """Fill with material the openings that the mask `chosen` (o,) marks."""
    openings = openings_of(sheet)
    if openings is None or not chosen.any():
        return sheet
    opening = np.full(sheet.surface.m, -1)
    opening[openings.void.cells] = openings.label
    family_of_opening = np.full(openings.count, VOID)
    f, g = (sheet.surface.edges.pairs // 3).T
    for void_cell, material_cell in ((f, g), (g, f)):
        touching = (opening[void_cell] >= 0) & (opening[material_cell] < 0)
        np.maximum.at(family_of_opening, opening[void_cell[touching]], sheet.family[material_cell[touching]])
    in_chosen, family = chosen[openings.label], sheet.family.copy()
    family[openings.void.cells[in_chosen]] = family_of_opening[openings.label[in_chosen]]
    return replace(sheet, family=family)


def _harmonic(x: Floats, y: Floats, share: Floats) -> Floats:
    """Return the weighted harmonic mean (o,) of x and y. share : (o,) weight of x."""
    tiny = np.finfo(float).tiny
    inverse = share / np.maximum(x, tiny) + (1 - share) / np.maximum(y, tiny)
    return np.asarray(np.divide(1, inverse, out=np.full(len(x), np.inf), where=inverse > 0))


def filled_openings(cells: Sheet, size: float, alike: bool = False) -> tuple[Sheet, int]:
    """Fill each opening that is smaller than `size` metres; return also the number of filled openings.
    alike : True to fill all or none of a group of nearly equal openings."""
    openings = openings_of(cells)
    if openings is None or not (may_be_small := openings.hydraulic_diameters < 3 * size).any():
        return cells, 0
    candidates = openings.subset(may_be_small)  # measures only openings that may be small; this saves 90 % of the time
    across = crossings(candidates.void.surface, candidates.void.walls)
    width = weighted_medians(across.width, across.weight, candidates.label[across.face], candidates.count)
    diameters = candidates.hydraulic_diameters
    smaller = np.clip(width, diameters / 2, diameters)  # 4 area / perimeter of a long slit is twice its width
    small = may_be_small.copy()
    small[may_be_small] = smaller < split_value(smaller, size, ALIKE * size if alike else 0.0)
    return with_filled(cells, small), int(small.sum())


def filled_crumbs(cells: Sheet) -> tuple[Sheet, int]:
    """Fill every crumb, an opening far smaller than most openings; return also the number of crumbs."""
    openings = openings_of(cells)
    if openings is None or np.isfinite(diameters := openings.hydraulic_diameters).sum() < SEVERAL:
        return cells, 0
    share = diameters / np.median(diameters[np.isfinite(diameters)])
    crumbs = share < split_value(share, CRUMB, ALIKE)
    if crumbs.any():
        narrowness = openings.subset(crumbs).narrowness
        crumbs[crumbs] = narrowness < split_value(narrowness, 2.5, ALIKE * 2.5)
    return with_filled(cells, crumbs), int(crumbs.sum())


def filled_slits(cells: Sheet, merge: Merging = "slits") -> tuple[Sheet, int]:
    """Fill every slit (narrow opening) with material; return also the number of filled slits.
    merge : "crowded" to fill only `Openings.crowded_slits`."""
    filled = 0
    while (openings := openings_of(cells)) is not None:
        slits = openings.crowded_slits if merge == "crowded" else openings.slits
        if not slits.any():
            break
        cells, filled = with_filled(cells, slits), filled + int(slits.sum())
    return cells, filled


SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3  # A vertex nearer to a cut moves onto the cut; unit: the fillet's radius or the strip's half width.


@dataclass(frozen=True, eq=False)
class Strip:
    """A rectangular strip of material across void cells (c,).
    middle : (3,) metres.    axes : (2, 3) unit vectors along and across.    half : (2,) half length and half width."""

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    @classmethod
    def from_wall(cls, sheet: Sheet, wall: int, ends: Floats, half: Floats) -> "Strip | None":
        """Return a strip across an opening, along the line between `ends` (2, 3); None for equal ends.
        wall : wall at which the strip begins.    half : (2,) half length and half width, metres."""
        surface, first_cell = sheet.surface, int(sheet.walls.void_cells[wall])
        direction = ends[1] - ends[0]
        gap = float(np.linalg.norm(direction))
        if not gap:
            return None
        along = direction / gap
        across = np.cross(surface.normals[first_cell], along)
        across /= np.linalg.norm(across)
        family = int(sheet.family[sheet.walls.material_cells[wall]])
        strip = cls(np.array([first_cell]), family, ends.mean(axis=0), np.stack([along, across]), half)
        seen, waiting = [first_cell], [first_cell]
        while waiting:
            cell = waiting.pop()
            coordinates = strip.local_coordinates(surface.V[surface.F[cell]])
            next_coordinates = np.roll(coordinates, -1, axis=1)
            low, high = np.minimum(coordinates, next_coordinates), np.maximum(coordinates, next_coordinates)
            crossed = ((low < 1) & (high > -1)).all(axis=0)
            new_cells = [c for c in sheet.walls.void_neighbours[cell][crossed].tolist() if c >= 0 and c not in seen]
            seen += new_cells
            waiting += new_cells
        return replace(strip, cells=np.array(seen))

    def local_coordinates(self, X: Floats) -> Floats:
        """Return coordinates (2, k) of points X (k, 3) along and across the strip; from -1 to 1 inside the strip."""
        return np.asarray(self.axes @ (X - self.middle).T / self.half[:, None])


def with_strips(cells: Sheet, strips: list[Strip], width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """Fill strips, and small openings that the strips cut off; return also the number of strips.
    width : metres. An opening is small if 4 area / perimeter is under 1.6 x width."""
    if not (strips := [strips[k] for k in disjoint_groups(cells, [strip.cells for strip in strips])]):
        return cells, 0
    return _without_pockets(_fill_strips(cells, strips, snap), cells.surface.n, width), len(strips)


def disjoint_groups(cells: Sheet, groups: Sequence[Ints]) -> list[int]:
    """Return the numbers of groups of cells that share no vertex with an earlier group in the result."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for k, group in enumerate(groups):
        vertices = cells.surface.F[group]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(k)
    return chosen


def _fill_strips(cells: Sheet, strips: list[Strip], snap: float) -> Sheet:
    mesh, source = recut_polygons(cells, np.concatenate([strip.cells for strip in strips]))
    owner = np.full(cells.surface.m, -1)
    for k, strip in enumerate(strips):
        owner[strip.cells] = k
    inside, first_line = owner[source] >= 0, mesh.lines.count
    mesh = replace(mesh, lines=mesh.lines.with_more(LineKind.STRIP, len(strips)))
    for axis in range(2):
        x = np.full(len(mesh.X), 2.0)
        for k, strip in enumerate(strips):
            slots = mesh.cells.slots(np.flatnonzero(inside & (owner[source] == k)))
            vertex = np.unique(mesh.cells.corner[slots])
            x[vertex] = strip.local_coordinates(mesh.X[vertex])[axis]
        on_side = np.abs(np.abs(x) - 1) < snap
        x[on_side] = np.sign(x[on_side])
        split = clean_split(mesh.cells, mesh.X, x, SIDES, inside, Snapping(0.0, cells.surface.size))
        source, inside = source[split.source], inside[split.source] & (split.strip == 1)
        mesh = mesh.after_split(split, first_line + owner[source][None])
    part, first_cells = mesh.part_labels(inside), [strip.cells[0] for strip in strips]
    chosen = inside & np.isin(part, part[inside & np.isin(source, first_cells)])
    family = np.array([strip.family for strip in strips])[owner[source]]
    return with_polygons(cells, replace(mesh, family=np.where(chosen, family, mesh.family)), source)


def _without_pockets(cells: Sheet, before: int, width: float) -> Sheet:
    """Fill small openings beside strips. before : number of vertices before the strips were added."""
    openings = openings_of(cells)
    if openings is None:
        return cells
    at_strip = np.zeros(openings.count, dtype=bool)
    at_strip[openings.label[(cells.surface.F[openings.void.cells] >= before).any(axis=1)]] = True
    return with_filled(cells, at_strip & (openings.hydraulic_diameters < 1.6 * width))
