"""Remove stubs: the ends of stripes between their last crossings and a node (place where ends meet).

    ---+--+--+---           ---+--+--+---
       |  |  |                 |     |              o : the node.    + : the last crossings of its stubs.
       |  o  |     becomes     |     |
       |  |  |                 |     |
    ---+--+--+---           ---+--+--+---

In this module, the size of an opening is 4 area / perimeter, divided by the median of all openings."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, split_value
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh, adjacent_sides
from dsfab.slicing.cutting.sheet import VOID
from dsfab.slicing.finishing.loose_ends import Tidy, dependent_polygons, nodes_of
from dsfab.surface import link_components

LARGE = 1.6
"""Largest size / median size of openings left by a removed stub (stripe end). Usually 5 % of openings are larger."""
EYELET, LARGER = 0.5, 2.5
"""An eyelet is an opening under EYELET times the size of a neighbouring opening. Where a stub beside an eyelet is
removed, the remaining opening may have a size up to LARGER times the median."""
GOOD = 1.1  # A stripe's end stays if all openings beside it exceed this x median size.
SMALL = 0.6  # A stripe's end stays if its removal leaves openings below this x median.
TURN = float(np.radians(110))
"""Maximum change of direction of the outline, radians, where a stub (end of a stripe) was removed."""


def without_stubs(mesh: PolygonMesh, tidy: Tidy) -> tuple[PolygonMesh, int]:
    """Remove nodes (places where ends of stripes meet) and these ends, if a suitable opening remains.
    Return also the number of removed pieces.    tidy : rules for dead ends."""
    nodes, count = nodes_of(mesh), 0
    for include_crossings in (False, True):
        lumps = with_crossings(mesh, nodes & ~mesh.void) if include_crossings else nodes & ~mesh.void
        if not lumps.any() or not mesh.void.any():
            break
        bars = _Bars.from_polygons(mesh, dependent_polygons(mesh, tidy, lumps))
        removable = bars.eyelets & (bars.opening_count == 2) if include_crossings else bars.lumps | bars.eyelets
        removed = bars.cut & removable
        mesh = replace(mesh, family=np.where(removed[bars.label] & (bars.label >= 0), VOID, mesh.family))
        count += int(removed.sum())
    return mesh, count


def with_crossings(mesh: PolygonMesh, nodes: Bools) -> Bools:
    """Return a mask (c,) of the polygons in `nodes` (c,), and of stripe crossings connected to them."""
    crossing = mesh.part_labels(~mesh.void & ((mesh.also != VOID) | nodes))
    return np.asarray(np.isin(crossing, crossing[nodes]) & (crossing >= 0))


@dataclass(frozen=True, eq=False)
class _Bars:
    """Bars (b,) that could be removed: connected pieces of material between openings (o,)."""

    label: Ints
    area: Floats
    wall: Floats
    pair: Ints
    shared: Floats
    opening: Floats
    cut: Bools

    @classmethod
    def from_polygons(cls, mesh: PolygonMesh, removable: Bools) -> Self:
        label, opening = (_renumbered_parts(mesh.part_labels(polygons)) for polygons in (removable, mesh.void))
        bars, openings = int(label.max(initial=-1)) + 1, int(opening.max(initial=-1)) + 1
        owner, beyond = mesh.cells.owner, mesh.polygon_across
        length = np.linalg.norm(mesh.X[mesh.cells.next_values(mesh.cells.corner)] - mesh.X[mesh.cells.corner], axis=1)
        bar, void = label[owner], np.where(beyond >= 0, opening[beyond], -1)
        around = (opening[owner] >= 0) & (void < 0)
        wall = (bar >= 0) & (void < 0) & ~((beyond >= 0) & (label[beyond] >= 0))
        borders_void = (bar >= 0) & (void >= 0)
        pairs = np.stack([bar[borders_void], void[borders_void]], axis=1)
        pair, pair_of_side = np.unique(pairs, axis=0, return_inverse=True)
        area = mesh.cells.areas(mesh.X)[0]
        open_area = np.bincount(opening[mesh.void], area[mesh.void], openings)
        perimeter = np.bincount(opening[owner[around]], length[around], openings)
        contact_sides = wall & (beyond >= 0)
        cut = _stays_connected(mesh, label, contact_sides, beyond)
        cut &= _turns(mesh, label, np.flatnonzero(contact_sides)) < TURN
        return cls(
            label,
            np.bincount(label[removable], area[removable], bars).astype(np.float64),
            np.bincount(bar[wall], length[wall], bars).astype(np.float64),
            pair,
            np.bincount(pair_of_side.ravel(), length[borders_void], len(pair)).astype(np.float64),
            np.stack([open_area, perimeter], axis=1).astype(np.float64),
            cut,
        )

    @cached_property
    def sizes(self) -> Floats:
        diameters: Floats = 4 * self.opening[:, 0] / self.opening[:, 1]
        return np.asarray(diameters / np.median(diameters))

    @cached_property
    def opening_count(self) -> Ints:
        return np.bincount(self.pair[:, 0], minlength=len(self.area))

    def sizes_without(self, group: Ints, count: int) -> Floats:
        """Return the size (count,) of the opening that remains without the bars of each group.
        group : (b,) the group of each bar, or -1."""
        bar, opening = self.pair.T
        removed = group[bar] >= 0
        touched = np.unique(np.stack([group[bar[removed]], opening[removed]], axis=1), axis=0)
        area, around = (
            np.bincount(group[group >= 0], bar_total[group >= 0], count)
            + np.bincount(touched[:, 0], x[touched[:, 1]], count)
            for bar_total, x in zip((self.area, self.wall), self.opening.T, strict=True)
        )
        around -= np.bincount(group[bar[removed]], self.shared[removed], count)
        scale = np.median(4 * self.opening[:, 0] / self.opening[:, 1])
        return np.asarray(np.divide(4 * area, scale * around, out=np.full(count, np.inf), where=around > 0))

    @cached_property
    def sizes_without_each(self) -> Floats:
        every = np.arange(len(self.area))
        return self.sizes_without(every, len(every))

    @cached_property
    def extremes(self) -> tuple[Floats, Floats]:
        """Sizes (b,) of the smallest, and (b,) of the largest opening beside each bar; inf and 0 without openings."""
        smallest, largest = np.full(len(self.area), np.inf), np.zeros(len(self.area))
        bar, opening = self.pair.T
        np.minimum.at(smallest, bar, self.sizes[opening])
        np.maximum.at(largest, bar, self.sizes[opening])
        return smallest, largest

    @cached_property
    def lumps(self) -> Bools:
        """(b,) mask of bars that touch a single opening, if the opening grows without the bar."""
        return np.asarray(
            (self.opening_count == 1) & (self.sizes_without_each > np.maximum(1.02 * self.extremes[1], SMALL))
        )

    @cached_property
    def eyelets(self) -> Bools:
        """(b,) mask of bars between openings. Without these bars, the joined openings have a suitable size."""
        smallest, limits = self.extremes
        ratio = np.divide(smallest, limits, out=np.full_like(smallest, np.inf), where=limits > 0)
        largest = np.where(_below_limits(ratio, EYELET), LARGER, LARGE)
        fits = (
            (self.opening_count > 1)
            & _below_limits(smallest, GOOD)
            & (self.sizes_without_each > SMALL)
            & _below_limits(self.sizes_without_each, largest)
        )
        group, count = self._groups(fits)
        limits = np.full(count, LARGE)
        np.maximum.at(limits, group[fits], largest[fits])
        # bars without a group have index -1, so they read the last value, False
        accepted = np.append(_below_limits(self.sizes_without(group, count), limits), False)
        return np.asarray(accepted[group])

    def _groups(self, chosen: Bools) -> tuple[Ints, int]:
        count = len(self.area)
        bar, opening = self.pair[chosen[self.pair[:, 0]]].T
        label = link_components(count + len(self.opening), bar, count + opening)[1][:count]
        group = _renumbered_parts(np.where(chosen, label, -1))
        return group, int(group.max(initial=-1)) + 1


def _stays_connected(mesh: PolygonMesh, label: Ints, contact_sides: Bools, beyond: Ints) -> Bools:
    rest = mesh.part_labels(~mesh.void & (label < 0))
    touching = np.stack([label[mesh.cells.owner[contact_sides]], rest[beyond[contact_sides]]], axis=1)
    bar = np.unique(touching, axis=0)[:, 0]
    return np.asarray(np.bincount(bar, minlength=int(label.max(initial=-1)) + 1) <= 1)


def _turns(mesh: PolygonMesh, label: Ints, side: Ints) -> Floats:
    cells, count = mesh.cells, len(mesh.X)
    bar, ends = label[cells.owner[side]], np.stack([cells.corner[side], cells.next_values(cells.corner)[side]], axis=1)
    place = link_components(len(side), *adjacent_sides(bar, ends, count))[1]
    rest = ~mesh.void & (label < 0)
    angle = np.bincount(cells.corner, _angles(mesh) * rest[cells.owner], count)
    key, times = np.unique(np.repeat(place, 2) * count + ends.ravel(), return_counts=True)
    key = key[times == 1]
    turn = np.bincount(key // count, np.maximum(np.pi - angle[key % count], 0), int(place.max(initial=-1)) + 1)
    turns = np.zeros(int(label.max(initial=-1)) + 1)
    np.maximum.at(turns, bar, turn[place])
    return turns


def _angles(mesh: PolygonMesh) -> Floats:
    cells, X = mesh.cells, mesh.X
    corner_slot, next_slot = cells.following, cells.following[cells.following]
    place = X[cells.corner[corner_slot]]
    u, v = X[cells.corner] - place, X[cells.corner[next_slot]] - place
    angles = np.empty(len(corner_slot))
    angles[corner_slot] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("hi,hi->h", u, v))
    return angles


def _below_limits(x: Floats, limit_of_each: float | Floats) -> Bools:
    limits = np.broadcast_to(limit_of_each, x.shape)
    result = np.zeros(len(x), dtype=bool)
    for threshold in np.unique(limits):
        result |= (limits == threshold) & (x < split_value(x[np.isfinite(x)], float(threshold)))
    return result


def _renumbered_parts(part: Ints) -> Ints:
    numbers: Ints = np.full(len(part), -1)
    numbers[part >= 0] = np.unique(part[part >= 0], return_inverse=True)[1].ravel()
    return numbers
