"""Straight lines across a sheet, from its walls inward: how far it is to the opposite wall.

------o------- wall      From points of every wall edge a straight line runs square to the edge, inside the sheet
      |                  and unfolded over the edges that it crosses, until it meets a boundary. The width is the
------x------- opposite  distance of its start from the edge that it meets.
"""

from dataclasses import dataclass, fields

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import next_half_edge
from dsfab.surface.mesh import Surface

MIDDLE = 0.5
AT = (1e-3, MIDDLE, 1 - 1e-3)
"""Where lines start on a wall edge: the shortest way between two polylines leaves from a corner of one of them, and the
middle stands for the edge in distributions."""
MOST_STEPS = 2000
"""Lines that cross more triangles than this run along a member, not across it."""
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

    def at(self, chosen: Ints) -> "_Spot":
        return _Spot(self.edge[chosen], self.t[chosen])


@dataclass(frozen=True, eq=False)
class _Rays:
    """Lines on their way: the half-edge that each came in over, point and unit direction (k, 3), metres behind it."""

    index: Ints
    came: Ints
    point: Floats
    direction: Floats
    length: Floats

    def at(self, chosen: Bools) -> "_Rays":
        return _Rays(*(getattr(self, field.name)[chosen] for field in fields(self)))


def crossings(surface: Surface, walls: Bools, start: Bools | None = None, at: tuple[float, ...] = AT) -> Crossings:
    """The way across a sheet from all its walls.

    surface : an edge-manifold sheet.    walls : (e,) which of its boundary edges are walls; lines that end on another
    boundary edge are left out.
    start   : (e,) the walls that lines start from; None for all.    at : where on them.
    """
    starting = walls if start is None else walls & start
    if not starting.any():
        none = np.empty((0, 2), dtype=np.int64)
        return Crossings(np.empty(0), np.empty((0, 3)), none[:, 0], np.empty(0), none)
    table, outward, twin = surface.edges, _outward(surface), _twins(surface)
    h = table.order[table.start[:-1][starting]]
    rays = begun = _started(surface, h, outward, at)
    met, width, slope, foot = (np.full(len(begun.index), x) for x in (-1, np.inf, 1.0, 0.0))
    for _ in range(MOST_STEPS):
        if not len(rays.index):
            break
        out, step = _exits(surface, rays, outward)
        ends = twin[out] < 0
        here = rays.index[ends]
        met[here] = out[ends]
        width[here], slope[here], foot[here] = _distance(surface, rays.at(ends), out[ends], step[ends])
        rays = _entered(surface, rays.at(~ends), out[~ends], step[~ends], twin, outward)
    good = np.flatnonzero((met >= 0) & walls[table.of.ravel()[met]] & (np.abs(slope) < OPPOSED))
    from_, to = _Spot(begun.came, np.repeat(at, len(h))), _Spot(met, foot)
    good = good[~_tips(surface, from_.at(good), to.at(good), width[good], slope[good])]
    weight = np.zeros((len(at), len(h)))
    weight[np.equal(at, MIDDLE)] = np.linalg.norm(_along(surface, h), axis=1)
    between = table.of.ravel()[np.stack([begun.came[good], met[good]], axis=1)]
    return Crossings(width[good], begun.point[good], begun.came[good] // 3, weight.ravel()[good], between)


def _distance(surface: Surface, rays: _Rays, out: Ints, step: Floats) -> tuple[Floats, Floats, Floats]:
    """(k,) metres from where lines started to the half-edges over which they leave; the cosine to these; the foot's t.

          o start
         /|           The foot of the start on the line of the edge, or the end of the edge nearest to it.
        / |
    ---x--+----x---
     met  foot
    """
    along = _along(surface, out)
    size = np.linalg.norm(along, axis=1)
    along /= size[:, None]
    length = rays.length + step
    slope = np.einsum("ki,ki->k", rays.direction, along)
    met = rays.point + step[:, None] * rays.direction - surface.V[surface.F.ravel()[out]]
    foot = np.einsum("ki,ki->k", met, along) - length * slope
    nearest = np.clip(foot, 0, size)
    return np.hypot(length * np.sqrt(1 - np.minimum(slope**2, 1)), foot - nearest), slope, nearest / size


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
    beside: list[list[int]] = [[] for _ in range(len(ends))]
    at = np.argsort(ends.ravel(), kind="stable") // 2  # edges by vertex: an even number at each
    for i, j in at.reshape(-1, 2).tolist():
        beside[i].append(j)
        beside[j].append(i)
    label, chain, loops = [-1] * len(ends), list[int](), 0
    for start in range(len(ends)):
        step = start if label[start] < 0 else -1
        loops += step >= 0
        while step >= 0:
            label[step] = loops - 1
            chain.append(step)
            step = next((k for k in beside[step] if label[k] < 0), -1)
    return np.array(label, dtype=np.int64), np.array(chain, dtype=np.int64), loops


def _along(surface: Surface, h: Ints) -> Floats:
    """(k, 3) from the first to the last vertex of half-edges."""
    F = surface.F.ravel()
    return np.asarray(surface.V[F[next_half_edge(h)]] - surface.V[F[h]])


def _outward(surface: Surface) -> Floats:
    """(3 m, 3) unit vectors in each face, square to each of its half-edges, pointing out of it."""
    every = np.arange(3 * surface.m)
    out = np.cross(_along(surface, every), np.repeat(surface.normals, 3, axis=0))
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def _twins(surface: Surface) -> Ints:
    """(3 m,) the half-edge on the other side, -1 on the boundary."""
    twin = np.full(3 * surface.m, -1)
    one, two = surface.edges.pairs.T
    twin[one], twin[two] = two, one
    return twin


def _started(surface: Surface, h: Ints, outward: Floats, at: tuple[float, ...]) -> _Rays:
    """Lines from the points `at` of half-edges h, square to them: all first points, then all second ones."""
    first, along = surface.V[surface.F.ravel()[h]], _along(surface, h)
    point = np.concatenate([first + t * along for t in at])
    came, count = np.tile(h, len(at)), len(at) * len(h)
    return _Rays(np.arange(count), came, point, -outward[came], np.zeros(count))


def _exits(surface: Surface, rays: _Rays, outward: Floats) -> tuple[Ints, Floats]:
    """The half-edge over which each line leaves its face, one of the two that it did not come in over; and how far."""
    options = np.stack([next_half_edge(rays.came), next_half_edge(rays.came, 2)], axis=1)
    normal = outward[options]
    corner = surface.V[surface.F.ravel()[options]]
    speed = np.einsum("kci,ki->kc", normal, rays.direction)
    gap = np.einsum("kci,kci->kc", normal, corner - rays.point[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(speed > 0, np.maximum(gap, 0) / speed, np.inf)
    pick = step.argmin(axis=1)
    rows = np.arange(len(pick))
    return options[rows, pick], step[rows, pick]


def _entered(surface: Surface, rays: _Rays, out: Ints, step: Floats, twin: Ints, outward: Floats) -> _Rays:
    """The lines in the next faces, as if these were unfolded into the plane of the last ones."""
    edge = _along(surface, out)
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    along = np.einsum("ki,ki->k", rays.direction, edge)
    through = np.einsum("ki,ki->k", rays.direction, outward[out])
    came = twin[out]
    direction = along[:, None] * edge - through[:, None] * outward[came]
    point = rays.point + step[:, None] * rays.direction
    return _Rays(rays.index, came, point, direction, rays.length + step)
