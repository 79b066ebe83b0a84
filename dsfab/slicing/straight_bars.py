"""`with_straight_bars`: a bar in which stripes meet that miss each other is drawn straight from crossing to crossing.

Stripes that end at a singular point of the stress meet in a node (see `ends_meeting`), seldom head on: one begins
beside where the other ends, and between their last crossings the bar has a jog, a notch and a lump:

    --+--+-----+---          --+--+-----+---
      |  |__   |                \\  \\   |
      |__ o |  |   becomes       \\  \\  |         o : the node.    + : where it touches the members beyond
         |  |  |                  |  |  |
    -----+--+--+---          -----+--+--+---

It becomes as wide as the narrower of these two contacts. A stripe that passes beside such a point is thrown out of its
way by it, for the phase turns over within a few triangles there: it gets the bow and the width that it has in the mean.
"""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Ints
from dsfab.slicing.clean import Snapping, clean_split
from dsfab.slicing.closing import limit
from dsfab.slicing.fair_bar import FairBar
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID
from dsfab.slicing.stubs import with_crossings
from dsfab.slicing.tidy import Tidy, between_crossings

ASKEW = 0.25
"""Bars whose outline is nearer to the straight one than this share of their width stay as they are."""
UNEVEN = 0.12
"""So do those that bend, if their outline is nearer than this to that with an even bow."""
FAR = 1.5
"""And those whose outline is farther from it than this: members that bend otherwise, or that another one touches."""
SNAP = 0.02
"""Vertices nearer to a straight side than this share of the width are on it: no slivers."""
LARGER = 2.5
"""A bar may not become so many times as large or as small."""
ALIKE = 0.05
"""Bars of which these shares differ by less may be the same but for the mesh."""


def with_straight_bars(
    mesh: PolygonMesh, nodes: Bools, near: Bools, tidy: Tidy, size: float
) -> tuple[PolygonMesh, int]:
    """The mesh with bars through nodes (c,) between two contacts drawn straight, and those near singular points (c,)
    with an even bow; and at how many places.

    size : of the surface, metres.

    Nothing falls apart: both contacts stay, and nothing else touches a bar.
    """
    nodes, near, count = nodes & ~mesh.void, near & ~mesh.void, 0
    if not (nodes | near).any() or not mesh.void.any():
        return mesh, count
    bars = _askew_bars(mesh, nodes, near, tidy)
    mark = np.full(len(nodes), -1)
    for k, bar in enumerate(bars):
        mark[bar.cells] = k
    for k, bar in enumerate(bars):
        better, label = _straightened(mesh, mark == k, bar, size)
        if better is not None:
            mesh, mark, count = better, mark[label], count + 1
    return mesh, count


def _askew_bars(mesh: PolygonMesh, nodes: Bools, near: Bools, tidy: Tidy) -> list[FairBar]:
    """Bars that are drawn anew: nodes (c,), and what touches them from one crossing to the next, straight; and other
    stretches near singular points (c,). No two overlap.

    Crossings that touch a node count as node where that makes a bar: those of stripes that overlap before they end.
    """
    found, taken, none = list[FairBar](), np.zeros_like(nodes), np.zeros_like(nodes)
    for lumps, some in ((with_crossings(mesh, nodes), nodes), (nodes, nodes), (none, near)):
        label = mesh.parts(_with_beside(mesh, lumps | some, between_crossings(mesh, tidy, lumps)))
        for wanted in np.unique(label[some & (label >= 0) & ~taken]):
            cells = label == wanted
            bar = None if taken[cells].any() else FairBar.of(mesh, cells)
            if bar is not None and some is not nodes:
                bar = bar.bent(mesh)
            if bar is not None:
                found.append(bar)
                taken |= cells
    off = np.array([bar.off(mesh) for bar in found])
    straight, bent, most = (limit(off, each, ALIKE) for each in (ASKEW, UNEVEN, FAR))
    return [bar for bar, x in zip(found, off, strict=True) if (bent if any(bar.bow) else straight) < x < most]


def _with_beside(mesh: PolygonMesh, some: Bools, part: Ints) -> Bools:
    """(c,) polygons of the stretches (c,) of which there are some (c,), or that touch these."""
    one, two, _ = mesh.neighbours
    f, g = mesh.cells.owner[one], mesh.cells.owner[two]
    near = some.copy()
    near[np.concatenate([g[some[f]], f[some[g]]])] = True
    return np.asarray((part >= 0) & np.isin(part, part[near & (part >= 0)]))


def _straightened(mesh: PolygonMesh, bar: Bools, new: FairBar, size: float) -> tuple[PolygonMesh | None, Ints]:
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
