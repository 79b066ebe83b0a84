"""Where members cross: the places at which the middle lines of both are, by the values of their fields.

Lines on a mesh may miss each other where they should meet, by rounding. Here every cell is asked that two members
share: the line of the first runs through it from side to side, and it crosses the second where that one's offset from
its own middle changes its sign between the two. What two members share without such a place is grazing.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing import Overlay
from dsfab.surface import connected

EXACT = 2.0**-30
"""Offsets that are less, in periods or metres, count as this much, with the sign at the first end of the edge: so that
a crossing on an edge is in one of the two cells beside it."""


class SharedPatch(NamedTuple):
    """Cells (c,) that two members a, b share and that hang together; points (k, 3) at which their middles cross there,
    metres, and the cell of each (k,)."""

    a: int
    b: int
    cells: Ints
    points: Floats
    at: Ints


@dataclass(frozen=True, eq=False)
class _Shared:
    """Cells (c,) that fields `one` and `two` share, the members a, b (c,) there, and the patch (c,) of each."""

    one: int
    two: int
    cells: Ints
    a: Ints
    b: Ints
    patch: Ints

    @classmethod
    def of(cls, overlay: Overlay, member: Ints, one: int, two: int) -> "_Shared | None":
        both = (member[:, one] >= 0) & (member[:, two] >= 0) & (member[:, one] != member[:, two])
        cells = np.flatnonzero(both)
        if not len(cells):
            return None
        place = np.full(len(both), -1)
        place[cells] = np.arange(len(cells))
        f, g = place[overlay.linked.T]
        near = (f >= 0) & (g >= 0)
        f, g = f[near], g[near]
        a, b = member[cells, one], member[cells, two]
        same = (a[f] == a[g]) & (b[f] == b[g])
        return cls(one, two, cells, a, b, connected(len(cells), f[same], g[same])[1])


def overlaps(overlay: Overlay, member: Ints) -> list[SharedPatch]:
    """Every patch that two members share.

    member : (m, f) the member that each cell of the overlay is a part of for each field, -1 for none.
    """
    found = []
    count = member.shape[1]
    for k in range(count):
        for other in range(k + 1, count):
            if (shared := _Shared.of(overlay, member, k, other)) is not None:
                found += _patches(overlay, shared)
    return found


def _patches(overlay: Overlay, shared: _Shared) -> list[SharedPatch]:
    row, points = _crossings(overlay, shared)
    order = np.argsort(shared.patch, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(shared.patch))[:-1])
    of = shared.patch[row]
    found = []
    for number, group in enumerate(groups):
        here = of == number
        first = group[0]
        cells = shared.cells[group]
        found.append(
            SharedPatch(int(shared.a[first]), int(shared.b[first]), cells, points[here], shared.cells[row[here]])
        )
    return found


def _crossings(overlay: Overlay, shared: _Shared) -> tuple[Ints, Floats]:
    """Of the shared cells those in which both middles cross (q,), and where, (q, 3)."""
    surface, cells = overlay.sheet.surface, shared.cells
    one, two = (overlay.offset[cells, :, field] for field in (shared.one, shared.two))
    crossed = np.sign(one) * np.roll(np.sign(one), -1, axis=1) < 0
    row = np.flatnonzero(crossed.sum(axis=1) == 2)
    side = np.nonzero(crossed[row])[1].reshape(-1, 2)
    F, one, two = surface.F[cells[row]], one[row], two[row]
    here, there, t = _places_on_sides(one, F, side)
    every = np.arange(len(row))[:, None]
    other = two[every, here] + t * (two[every, there] - two[every, here])
    other = np.where(np.abs(other) < EXACT, np.copysign(EXACT, two[every, here]), other)
    meets = np.sign(other[:, 0]) * np.sign(other[:, 1]) < 0
    a, b = surface.V[F[every, here]], surface.V[F[every, there]]
    at, other = (a + t[..., None] * (b - a))[meets], np.abs(other[meets])
    t = other[:, :1] / other.sum(axis=1, keepdims=True)
    return row[meets], at[:, 0] + t * (at[:, 1] - at[:, 0])


def _places_on_sides(offset: Floats, F: Ints, side: Ints) -> tuple[Ints, Ints, Floats]:
    """(q, 2) corners at the ends of two sides (q, 2) of cells F (q, 3), the vertex with the lower number first, and
    (q, 2) the share of the way between them at which offsets (q, 3) are 0. Both cells at an edge find the same."""
    row = np.arange(len(F))[:, None]
    p, q = side, (side + 1) % 3
    turn = F[row, p] > F[row, q]
    p, q = np.where(turn, q, p), np.where(turn, p, q)
    a, b = np.abs(offset[row, p]), np.abs(offset[row, q])
    return p, q, a / (a + b)
