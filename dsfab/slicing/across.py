"""Straight lines across a sheet, from its walls inward: how far it is to the opposite wall.

------o------- wall      From points of every wall edge a straight line runs square to the edge, inside the sheet
      |                  and unfolded over the edges that it crosses, until it meets a boundary. The width is the
------x------- opposite  distance of its start from the edge that it meets.
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, sorted_order
from dsfab.slicing.straight import FarEnds, far_ends
from dsfab.surface import Surface, next_half_edge

MIDDLE = 0.5
AT = (1e-3, MIDDLE, 1 - 1e-3)
"""Where lines start on a wall edge: the shortest way between two polylines leaves from a corner of one of them, and the
middle stands for the edge in distributions."""
OPPOSED = float(np.sin(np.radians(20)))
"""Walls count as opposite where they are parallel to 20 degrees. Walls that meet at a larger angle make a corner: the
way across goes to zero there, and says nothing about a width."""
TAPER = float(np.radians(1.5))
"""Walls that converge by at least this angle may end in a tip."""
TIP = (0.4, 1.7)
"""And do when the way around the end, from one wall to the other, is this many times that of a wedge of their angle."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Lines across a sheet that ended on an opposite wall, but for those in a tip: a taper ends in nothing anyway.

    width  : (k,) metres, the distance of a line's start from the edge that it meets.
    place  : (k, 3) where it starts, metres.    face : (k,) the triangle there.
    weight : (k,) metres of wall that it stands for: the edge for lines from the middle, 0 for the others.
    walls  : (k, 2) the edges of the surface from which and to which it runs.
    """

    width: Floats
    place: Floats
    face: Ints
    weight: Floats
    walls: Ints


@dataclass(frozen=True, eq=False)
class _Spot:
    """Points on half-edges (k,), at (1 - t) first + t last vertex."""

    edge: Ints
    t: Floats

    def at(self, chosen: Ints | Bools) -> "_Spot":
        return _Spot(self.edge[chosen], self.t[chosen])


def crossings(
    surface: Surface,
    walls: Bools,
    start: Bools | None = None,
    at: tuple[float, ...] = AT,
    tips: bool = False,
    reach: float = np.inf,
) -> Crossings:
    """The way across a sheet from all its walls.

    surface : an edge-manifold sheet.    walls : (e,) which of its boundary edges are walls; lines that end on another
    boundary edge are left out.
    start   : (e,) the walls that lines start from; None for all.    at : where on them.    tips : with those in a tip.
    reach   : metres; wider places may be left out.
    """
    starting = walls if start is None else walls & start
    if not starting.any():
        none = np.empty((0, 2), dtype=np.int64)
        return Crossings(np.empty(0), np.empty((0, 3)), none[:, 0], np.empty(0), none)
    h, of = surface.edges.order[surface.edges.start[:-1][starting]], surface.edges.of.ravel()
    size = np.linalg.norm(_along(surface, h), axis=1)
    begun = _Spot(np.tile(h, len(at)), np.repeat(at, len(h)))
    ends = far_ends(surface, begun.edge, begun.t * np.tile(size, len(at)), reach / np.sqrt(1 - OPPOSED**2))
    good = np.flatnonzero((ends.edge >= 0) & walls[of[ends.edge]] & (np.abs(ends.slope) < OPPOSED))
    met, width = _feet(surface, ends.at(good))
    on = tips | ~_tips(surface, begun.at(good), met, width, ends.slope[good])
    good, met, width = good[on], met.at(on), width[on]
    begun = begun.at(good)
    weight = np.where(begun.t == MIDDLE, np.tile(size, len(at))[good], 0.0)
    point = surface.V[surface.F.ravel()[begun.edge]] + begun.t[:, None] * _along(surface, begun.edge)
    between = of[np.stack([begun.edge, met.edge], axis=1)]
    return Crossings(width, point, begun.edge // 3, weight, between)


def _feet(surface: Surface, ends: FarEnds) -> tuple[_Spot, Floats]:
    """Where the half-edges that lines meet are nearest to their starts, and how far that is, metres.

          o start
         /|           The foot of the start on the line of the edge, or the end of the edge nearest to it.
        / |
    ---x--+----x---
     met  foot
    """
    size = np.linalg.norm(_along(surface, ends.edge), axis=1)
    foot = ends.place - ends.length * ends.slope
    nearest = np.clip(foot, 0, size)
    width = np.hypot(ends.length * np.sqrt(1 - np.minimum(ends.slope**2, 1)), foot - nearest)
    return _Spot(ends.edge, nearest / size), width


def _tips(surface: Surface, one: _Spot, two: _Spot, width: Floats, slope: Floats) -> Bools:
    """(k,) whether the two walls of each line close to a tip: they converge, and meet about where that leads.

    slope : (k,) cosine between a line and the half-edge that it meets; negative where the walls converge along that.

    A wedge of angle a that is w wide ends w / (2 tan(a / 2)) further on; the way along its walls is twice that.
    """
    loop, middle, ahead, total = _around(surface)

    def position(spot: _Spot) -> Floats:
        size = np.linalg.norm(_along(surface, spot.edge), axis=1)
        return np.asarray(middle[spot.edge] + np.where(ahead[spot.edge], 1, -1) * (spot.t - 0.5) * size)

    onward = (position(one) - position(two)) * np.where((slope < 0) == ahead[two.edge], 1, -1)
    way = np.where(loop[one.edge] == loop[two.edge], onward % total[loop[one.edge]], np.inf)
    angle = np.arcsin(np.minimum(np.abs(slope), 1))
    wedge = width / np.tan(np.maximum(angle, TAPER) / 2)
    ends = one.edge, next_half_edge(one.edge), two.edge, next_half_edge(two.edge)
    corner = np.stack([surface.F.ravel()[h] for h in ends])
    neighbours = (corner[:2, None] == corner[None, 2:]).any(axis=(0, 1))  # the way across is nothing where they meet
    return np.asarray(neighbours | ((angle >= TAPER) & (way >= TIP[0] * wedge) & (way <= TIP[1] * wedge)))


def _around(surface: Surface) -> tuple[Ints, Floats, Bools, Floats]:
    """(3 m,) of half-edges on the boundary: loop, metres along it to their middle, whether they run that way.

    And the length of each loop. Loops need no orientation of the faces.
    """
    edge = np.flatnonzero(surface.edges.boundary)
    h = surface.edges.order[surface.edges.start[:-1][edge]]
    label, chain, loops = _chained(surface.edges.ends[edge])
    length = np.linalg.norm(_along(surface, h), axis=1)
    total = np.bincount(label, length, loops).astype(np.float64)
    first = np.searchsorted(label[chain], np.arange(loops))
    after = np.roll(chain, -1)
    after[np.append(first[1:], len(chain)) - 1] = chain[first]
    ahead = (surface.edges.ends[edge[after]] == surface.F.ravel()[next_half_edge(h[chain])][:, None]).any(axis=1)
    loop, place, forward = np.full(3 * surface.m, -1), np.zeros(3 * surface.m), np.zeros(3 * surface.m, dtype=bool)
    loop[h], forward[h[chain]] = label, ahead
    place[h[chain]] = np.cumsum(length[chain]) - length[chain] / 2 - (np.cumsum(total) - total)[label[chain]]
    return loop, place, forward, total


def _chained(ends: Ints) -> tuple[Ints, Ints, int]:
    """The loop of each edge (e,) by its ends (e, 2), the edges loop by loop in their order, and the number of loops."""
    slot = sorted_order(ends.ravel())  # 2 i + s is end s of edge i; by vertex, an even number at each
    onward = np.empty_like(slot)
    onward[slot] = (
        slot.reshape(-1, 2)[:, ::-1].ravel() ^ 1
    )  # who leaves by an end leaves the next edge by its other end
    after, leaving = onward.tolist(), (2 * np.arange(len(ends)) + (ends[:, 0] > ends[:, 1])).tolist()
    label, chain, loops = [-1] * len(ends), list[int](), 0
    for start, state in enumerate(leaving):
        edge, loops = start, loops + (label[start] < 0)
        while label[edge] < 0:
            label[edge] = loops - 1
            chain.append(edge)
            state = after[state]
            edge = state >> 1
    return np.array(label, dtype=np.int64), np.array(chain, dtype=np.int64), loops


def _along(surface: Surface, h: Ints) -> Floats:
    """(k, 3) from the first to the last vertex of half-edges."""
    F = surface.F.ravel()
    return np.asarray(surface.V[F[next_half_edge(h)]] - surface.V[F[h]])
