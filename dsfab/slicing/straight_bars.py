"""`with_straight_bars`: a bar in which stripes meet that miss each other is drawn straight from crossing to crossing.

Stripes that end at a singular point of the stress meet in a node (see `ends_meeting`), seldom head on: one begins
beside where the other ends, and between their last crossings the bar has a jog, a notch and a lump:

    --+--+-----+---          --+--+-----+---
      |  |__   |                \\  \\   |
      |__ o |  |   becomes       \\  \\  |         o : the node.    + : where it touches the members beyond
         |  |  |                  |  |  |
    -----+--+--+---          -----+--+--+---

It becomes as wide as the narrower of these two contacts.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.clean import Snapping, clean_split
from dsfab.slicing.closing import limit
from dsfab.slicing.contacts import meeting
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID
from dsfab.slicing.stubs import with_crossings
from dsfab.slicing.tidy import Tidy, between_crossings
from dsfab.surface import connected

ASKEW = 0.25
"""Bars whose outline is nearer to the straight one than this share of their width stay as they are."""
FAR = 1.5
"""So do those whose outline is farther from it than this: members that bend, or that another one touches."""
OBLIQUE = 0.4
"""And those that touch a member along more than so many times less than their width: it is a share of that length."""
TINY = 1e-12
SNAP = 0.02
"""Vertices nearer to a straight side than this share of the width are on it: no slivers."""
LARGER = 2.5
"""A bar may not become so many times as large or as small."""
ALIKE = 0.05
"""Bars of which these shares differ by less may be the same but for the mesh."""


class StraightBar(NamedTuple):
    """A bar between two contacts as it will be.

    cells  : (c,) the polygons that it is now.    ends : (2, 3) the middles of its contacts, metres.
    sides  : (4, 3) metres, counter-clockwise; straight sides from 0 to 1 and from 2 to 3.
    width  : metres.    normal : (3,) unit.
    """

    cells: Bools
    ends: Floats
    sides: Floats
    width: float
    normal: Floats

    @classmethod
    def of(cls, mesh: PolygonMesh, cells: Bools) -> "StraightBar | None":
        """The bar of polygons (c,); None where it has not two contacts, or touches a member obliquely."""
        contacts = _contacts(mesh, cells)
        if len(contacts) != 2:
            return None
        ends, step = contacts.mean(axis=1), np.diff(contacts, axis=1)[:, 0]
        here = cells[mesh.cells.owner]
        spoke, ahead = (mesh.X[at[here]] - ends[0] for at in (mesh.cells.corner, mesh.cells.ahead(mesh.cells.corner)))
        normal = np.cross(spoke, ahead).sum(axis=0)
        normal /= np.linalg.norm(normal)
        axis = ends[1] - ends[0]
        across = np.cross(normal, axis / max(float(np.linalg.norm(axis)), TINY))
        widths, lengths = np.abs(step @ across), np.linalg.norm(step, axis=1)
        if (widths < OBLIQUE * lengths).any():
            return None
        half = step * (widths.min() / widths / 2)[:, None]
        sides = np.array([ends[0] + half[0], ends[1] - half[1], ends[1] + half[1], ends[0] - half[0]])
        return cls(cells, ends, sides, float(widths.min()), normal)

    def heights(self, X: Floats) -> Floats:
        """(2, k) metres of places X (k, 3) to the left of each side, which is inside."""
        found = []
        for begin, end in self.sides.reshape(2, 2, 3):
            left = np.cross(self.normal, end - begin)
            found.append((X - begin) @ left / np.linalg.norm(left))
        return np.array(found)

    def beside(self, X: Floats) -> Bools:
        """(k,) which places X (k, 3) lie between the contacts, or not farther beyond them than the bar is wide."""
        axis = self.ends[1] - self.ends[0]
        length = float(np.linalg.norm(axis))
        along = (X - self.ends[0]) @ axis / length
        return np.asarray((along > -self.width) & (along < length + self.width))

    def off(self, mesh: PolygonMesh) -> float:
        """How far its outline leaves the straight one at most, over its width."""
        corners = np.unique(mesh.cells.corner[self.cells[mesh.cells.owner]])
        return float(-self.heights(mesh.X[corners]).min()) / self.width


def with_straight_bars(mesh: PolygonMesh, nodes: Bools, tidy: Tidy, size: float) -> tuple[PolygonMesh, int]:
    """The mesh with bars through nodes (c,) between two contacts drawn straight; and at how many places.

    size : of the surface, metres.

    Nothing falls apart: both contacts stay, and nothing else touches a bar.
    """
    nodes, count = nodes & ~mesh.void, 0
    if not nodes.any() or not mesh.void.any():
        return mesh, count
    bars = _askew_bars(mesh, nodes, tidy)
    mark = np.full(len(nodes), -1)
    for k, bar in enumerate(bars):
        mark[bar.cells] = k
    for k, bar in enumerate(bars):
        better, label = _straightened(mesh, mark == k, bar, size)
        if better is not None:
            mesh, mark, count = better, mark[label], count + 1
    return mesh, count


def _askew_bars(mesh: PolygonMesh, nodes: Bools, tidy: Tidy) -> list[StraightBar]:
    """Bars that are to be straight: nodes (c,), and what touches them from one crossing to the next. No two overlap.

    Crossings that touch a node count as node where that makes a bar: those of stripes that overlap before they end.
    """
    found, taken = list[StraightBar](), np.zeros_like(nodes)
    for lumps in (with_crossings(mesh, nodes), nodes):
        label = mesh.parts(_with_beside(mesh, lumps, between_crossings(mesh, tidy, lumps)))
        for wanted in np.unique(label[nodes & (label >= 0) & ~taken]):
            cells = label == wanted
            bar = None if taken[cells].any() else StraightBar.of(mesh, cells)
            if bar is not None:
                found.append(bar)
                taken |= cells
    off = np.array([bar.off(mesh) for bar in found])
    least, most = (limit(off, each, ALIKE) for each in (ASKEW, FAR))
    return [bar for bar, x in zip(found, off, strict=True) if least < x < most]


def _with_beside(mesh: PolygonMesh, some: Bools, part: Ints) -> Bools:
    """(c,) polygons of the stretches (c,) of which there are some (c,), or that touch these."""
    one, two, _ = mesh.neighbours
    f, g = mesh.cells.owner[one], mesh.cells.owner[two]
    near = some.copy()
    near[np.concatenate([g[some[f]], f[some[g]]])] = True
    return np.asarray((part >= 0) & np.isin(part, part[near & (part >= 0)]))


def _straightened(mesh: PolygonMesh, bar: Bools, new: StraightBar, size: float) -> tuple[PolygonMesh | None, Ints]:
    """The mesh with polygons (c,) of a bar replaced by the straight one, and (c',) the polygon that each was; None
    where that is much larger or smaller."""
    opening = mesh.parts(mesh.void | bar)
    inside, made, source = np.isin(opening, opening[bar]) & (opening >= 0), mesh, np.arange(len(bar))
    for side in (0, 1):
        x = new.heights(made.X)[side]
        x[np.abs(x) < SNAP * new.width] = 0.0
        inside = inside & made.cells.reduced(np.logical_or, new.beside(made.X)[made.cells.corner])
        split = clean_split(made.cells, made.X, x, np.zeros(1), inside, Snapping(0.0, size))
        made, source = made.after(split), source[split.source]
        inside = inside[split.source] & (split.strip == 1)
    old, part = bar[source], made.parts(inside)
    filled = np.isin(part, part[old & inside]) & inside
    area = made.cells.areas(made.X)[0]
    sizes = sorted((float(area[old].sum()), float(area[filled].sum())))
    if not sizes[1] < LARGER * sizes[0]:
        return None, source
    family = np.where(old, VOID, made.family)
    family[filled] = np.bincount(mesh.family[bar]).argmax()
    return replace(made, family=family, also=np.where(old & ~filled, VOID, made.also)), source


def _contacts(mesh: PolygonMesh, bar: Bools) -> Floats:
    """(k, 2, 3) metres: where each stretch begins and ends along which polygons (c,) touch other material, seen
    counter-clockwise around them; none where they touch an edge of the surface."""
    one, two, _ = mesh.neighbours
    cells, beyond = mesh.cells, np.full(len(mesh.cells.corner), -1)
    beyond[one], beyond[two] = cells.owner[two], cells.owner[one]
    mine = bar[cells.owner]
    held = np.flatnonzero(mine & (beyond >= 0) & ~mesh.void[beyond] & ~bar[beyond])
    if (mine & (beyond < 0)).any() or not len(held):
        return np.empty((0, 2, 3))
    start, end = cells.corner[held], cells.ahead(cells.corner)[held]
    count, place = connected(len(held), *meeting(np.zeros_like(held), np.stack([start, end], axis=1), len(mesh.X)))
    found = []
    for k in range(count):
        first, last = np.setdiff1d(start[place == k], end[place == k]), np.setdiff1d(end[place == k], start[place == k])
        if len(first) != 1 or len(last) != 1:  # around it, or in one point with another
            return np.empty((0, 2, 3))
        found.append(mesh.X[[first[0], last[0]]])
    return np.array(found)
