"""Remove stubs: stripes that run on past their last crossings to a node.

Stripes that end at a singular point of the stress meet in a node (see `with_meeting_ends`). The stubs that lead to it
are a bar across one opening, or a hook beside a member, with a lump at the node:

    ---+--+--+---           ---+--+--+---
       |  |  |                 |     |              o : the node.    + : the last crossings of its stubs.
       |  o  |     becomes     |     |
       |  |  |                 |     |
    ---+--+--+---           ---+--+--+---

Without them one opening remains. All sizes of openings are 4 area / perimeter over the median.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.slicing.cutting.loose_ends import Tidy, held_by, limit
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh, meeting
from dsfab.slicing.cutting.sheet import VOID
from dsfab.surface import connected

LARGE = 1.6
"""Stubs stay if the opening without them would be larger: one opening in twenty is as large."""
EYELET, LARGER = 0.5, 2.5
"""Limit for stubs around an eyelet, an opening under the first share of its neighbour: the second, not `LARGE`, because
such a hook divides nothing."""
GOOD = 1.1
"""Stubs stay if all openings beside them are larger: a stub of a Y divides those well."""
SMALL = 0.6
"""Stubs stay if the opening without them would be smaller."""
TURN = float(np.radians(110))
"""Largest turn of the remaining outline where a stub was removed: a second corner would be a member that ends in
nothing.
"""


def without_stubs(mesh: PolygonMesh, nodes: Bools, tidy: Tidy) -> tuple[PolygonMesh, int]:
    """Remove nodes (c,) and the stubs that lead to them if one good opening remains; return also the number of places.

    Parts stay connected and no new end appears: the members that touch a removed bar run past it and stay connected.
    """
    count = 0
    for joined in (False, True):
        lumps = with_crossings(mesh, nodes & ~mesh.void) if joined else nodes & ~mesh.void
        if not lumps.any() or not mesh.void.any():
            break
        bars = _Bars.of(mesh, held_by(mesh, tidy, lumps))
        off = bars.cut & ((bars.eyelets & (bars.beside == 2)) if joined else (bars.lumps | bars.eyelets))
        mesh = replace(mesh, family=np.where(off[bars.label] & (bars.label >= 0), VOID, mesh.family))
        count += int(off.sum())
    return mesh, count


def with_crossings(mesh: PolygonMesh, nodes: Bools) -> Bools:
    """(c,) nodes (c,), and crossings that touch them, of stubs that overlap before they end."""
    crossing = mesh.parts(~mesh.void & ((mesh.also != VOID) | nodes))
    return np.asarray(np.isin(crossing, crossing[nodes]) & (crossing >= 0))


@dataclass(frozen=True, eq=False)
class _Bars:
    """Bars between openings.

    label   : (c,) the bar of each polygon, or -1.
    area    : (b,) square metres.    wall : (b,) metres of outline towards other material or the edge of the surface.
    pair    : (k, 2) bars and the openings beside them, each once.    shared : (k,) metres of outline between the two.
    opening : (o, 2) area, square metres, and perimeter, metres, of each opening.
    cut     : (b,) True if the material around a bar stays connected without any bar, and ends nowhere.
    """

    label: Ints
    area: Floats
    wall: Floats
    pair: Ints
    shared: Floats
    opening: Floats
    cut: Bools

    @classmethod
    def of(cls, mesh: PolygonMesh, off: Bools) -> Self:
        label, opening = (_numbered(mesh.parts(some)) for some in (off, mesh.void))
        bars, openings = int(label.max(initial=-1)) + 1, int(opening.max(initial=-1)) + 1
        owner, beyond = mesh.cells.owner, mesh.beyond
        length = np.linalg.norm(mesh.X[mesh.cells.ahead(mesh.cells.corner)] - mesh.X[mesh.cells.corner], axis=1)
        mine, void = label[owner], np.where(beyond >= 0, opening[beyond], -1)
        around = (opening[owner] >= 0) & (void < 0)
        wall = (mine >= 0) & (void < 0) & ~((beyond >= 0) & (label[beyond] >= 0))
        beside = (mine >= 0) & (void >= 0)
        pair, of = np.unique(np.stack([mine[beside], void[beside]], axis=1), axis=0, return_inverse=True)
        area = mesh.cells.areas(mesh.X)[0]
        open_area = np.bincount(opening[mesh.void], area[mesh.void], openings)
        perimeter = np.bincount(opening[owner[around]], length[around], openings)
        held = wall & (beyond >= 0)
        cut = _together(mesh, label, held, beyond) & (_turns(mesh, label, np.flatnonzero(held)) < TURN)
        return cls(
            label,
            np.bincount(label[off], area[off], bars).astype(np.float64),
            np.bincount(mine[wall], length[wall], bars).astype(np.float64),
            pair,
            np.bincount(of.ravel(), length[beside], len(pair)).astype(np.float64),
            np.stack([open_area, perimeter], axis=1).astype(np.float64),
            cut,
        )

    @cached_property
    def sizes(self) -> Floats:
        found: Floats = 4 * self.opening[:, 0] / self.opening[:, 1]
        return np.asarray(found / np.median(found))

    @cached_property
    def beside(self) -> Ints:
        return np.bincount(self.pair[:, 0], minlength=len(self.area))

    def without(self, group: Ints, count: int) -> Floats:
        """(count,) sizes, over the median, of the openings without the bars of each group (b,); group -1 stays."""
        bar, opening = self.pair.T
        out = group[bar] >= 0
        both = np.unique(np.stack([group[bar[out]], opening[out]], axis=1), axis=0)
        area, around = (
            np.bincount(group[group >= 0], own[group >= 0], count) + np.bincount(both[:, 0], x[both[:, 1]], count)
            for own, x in zip((self.area, self.wall), self.opening.T, strict=True)
        )
        around -= np.bincount(group[bar[out]], self.shared[out], count)
        scale = np.median(4 * self.opening[:, 0] / self.opening[:, 1])
        return np.asarray(np.divide(4 * area, scale * around, out=np.full(count, np.inf), where=around > 0))

    @cached_property
    def alone(self) -> Floats:
        every = np.arange(len(self.area))
        return self.without(every, len(every))

    @cached_property
    def extremes(self) -> tuple[Floats, Floats]:
        """(b,) sizes of the smallest and of the largest opening beside each bar; infinite and 0 without."""
        least, most = np.full(len(self.area), np.inf), np.zeros(len(self.area))
        bar, opening = self.pair.T
        np.minimum.at(least, bar, self.sizes[opening])
        np.maximum.at(most, bar, self.sizes[opening])
        return least, most

    @cached_property
    def lumps(self) -> Bools:
        """(b,) bars in one opening that is larger and has a shorter outline without them."""
        return np.asarray((self.beside == 1) & (self.alone > np.maximum(1.02 * self.extremes[1], SMALL)))

    @cached_property
    def eyelets(self) -> Bools:
        """(b,) bars between openings that are one good opening without them; of bars at one opening all or none."""
        least, most = self.extremes
        ratio = np.divide(least, most, out=np.full_like(least, np.inf), where=most > 0)
        largest = np.where(_within(ratio, EYELET), LARGER, LARGE)
        fits = (self.beside > 1) & _within(least, GOOD) & (self.alone > SMALL) & _within(self.alone, largest)
        group, count = self._groups(fits)
        most = np.full(count, LARGE)
        np.maximum.at(most, group[fits], largest[fits])
        good = np.append(_within(self.without(group, count), most), False)  # group -1
        return np.asarray(good[group])

    def _groups(self, some: Bools) -> tuple[Ints, int]:
        """(b,) the group of each chosen bar (b,), -1 elsewhere: bars at one opening; and the number of groups."""
        count = len(self.area)
        bar, opening = self.pair[some[self.pair[:, 0]]].T
        label = connected(count + len(self.opening), bar, count + opening)[1][:count]
        group = _numbered(np.where(some, label, -1))
        return group, int(group.max(initial=-1)) + 1


def _together(mesh: PolygonMesh, label: Ints, held: Bools, beyond: Ints) -> Bools:
    """(b,) True if the material that touches a bar at its sides `contact_sides` (h,) is one piece without bars (c,)."""
    rest = mesh.parts(~mesh.void & (label < 0))
    touching = np.stack([label[mesh.cells.owner[held]], rest[beyond[held]]], axis=1)
    bar = np.unique(touching, axis=0)[:, 0]
    return np.asarray(np.bincount(bar, minlength=int(label.max(initial=-1)) + 1) <= 1)


def _turns(mesh: PolygonMesh, label: Ints, side: Ints) -> Floats:
    """(b,) largest turn of the remaining outline at the ends of a contact, radians, at sides (s,) of bars (c,)."""
    cells, count = mesh.cells, len(mesh.X)
    bar, ends = label[cells.owner[side]], np.stack([cells.corner[side], cells.ahead(cells.corner)[side]], axis=1)
    place = connected(len(side), *meeting(bar, ends, count))[1]
    rest = ~mesh.void & (label < 0)
    angle = np.bincount(cells.corner, _angles(mesh) * rest[cells.owner], count)
    key, times = np.unique(np.repeat(place, 2) * count + ends.ravel(), return_counts=True)
    key = key[times == 1]
    turn = np.bincount(key // count, np.maximum(np.pi - angle[key % count], 0), int(place.max(initial=-1)) + 1)
    found = np.zeros(int(label.max(initial=-1)) + 1)
    np.maximum.at(found, bar, turn[place])
    return found


def _angles(mesh: PolygonMesh) -> Floats:
    cells, X = mesh.cells, mesh.X
    here, after = cells.following, cells.following[cells.following]
    u, v = (X[cells.corner[there]] - X[cells.corner[here]] for there in (np.arange(len(here)), after))
    found = np.empty(len(here))
    found[here] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("hi,hi->h", u, v))
    return found


def _within(x: Floats, most: float | Floats) -> Bools:
    """(k,) mask of x (k,) under its limits; nearly equal values pass all or none."""
    limits = np.broadcast_to(most, x.shape)
    found = np.zeros(len(x), dtype=bool)
    for each in np.unique(limits):
        found |= (limits == each) & (x < limit(x[np.isfinite(x)], float(each)))
    return found


def _numbered(part: Ints) -> Ints:
    found: Ints = np.full(len(part), -1)
    found[part >= 0] = np.unique(part[part >= 0], return_inverse=True)[1].ravel()
    return found
