"""Straight lines across a sheet, from its walls inward: how far it is to the opposite wall.

------o------- wall      From points of every wall edge a straight line runs square to the edge, inside the sheet
      |                  and unfolded over the edges that it crosses, until it meets a boundary. The width is the
------x------- opposite  distance of its start from the edge that it meets.
"""

from dataclasses import dataclass, fields

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface

AT = (1e-3, 0.5, 1 - 1e-3)
"""Where lines start on a wall edge: the shortest way between two polylines leaves from a corner of one of them, and the
middle stands for the edge in distributions."""
MIDDLE = 1
MOST_STEPS = 2000
"""Lines that cross more triangles than this run along a member, not across it."""
OPPOSED = float(np.cos(np.radians(20)))
"""Walls count as opposite where they are parallel to 20 degrees. Walls that meet at a larger angle make a corner: the
way across goes to zero there, and says nothing about a width."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Lines across a sheet that ended on an opposite wall.

    width  : (k,) metres, the distance of a line's start from the edge that it meets.
    place  : (k, 3) where it starts, metres.    face : (k,) the triangle there.
    weight : (k,) metres of wall that it stands for: the edge for lines from the middle, 0 for the others.
    """

    width: Floats
    place: Floats
    face: Ints
    weight: Floats


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


def crossings(surface: Surface, walls: Bools) -> Crossings:
    """The way across a sheet from all its walls.

    surface : an edge-manifold sheet.    walls : (e,) which of its boundary edges are walls; lines that end on another
    boundary edge are left out.
    """
    table, outward, twin = surface.edges, _outward(surface), _twins(surface)
    h = table.order[table.start[:-1][walls]]
    rays = start = _started(surface, h, outward)
    length, met = np.full(len(start.index), np.inf), np.full(len(start.index), -1)
    for _ in range(MOST_STEPS):
        if not len(rays.index):
            break
        out, step = _exits(surface, rays, outward)
        ends = twin[out] < 0
        met[rays.index[ends]], length[rays.index[ends]] = out[ends], _distance(surface, rays, out, step, outward)[ends]
        rays = _entered(surface, rays.at(~ends), out[~ends], step[~ends], twin, outward)
    good = np.isfinite(length) & walls[table.of.ravel()[met]]
    weight = np.zeros((len(AT), len(h)))
    weight[MIDDLE] = np.linalg.norm(_along(surface, h), axis=1)
    return Crossings(length[good], start.point[good], start.came[good] // 3, weight.ravel()[good])


def _distance(surface: Surface, rays: _Rays, out: Ints, step: Floats, outward: Floats) -> Floats:
    """(k,) from where lines started to the edges over which they leave; infinite where these are not opposite.

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
    square = np.einsum("ki,ki->k", rays.direction, outward[out])
    met = rays.point + step[:, None] * rays.direction - surface.V[surface.F.ravel()[out]]
    foot = np.einsum("ki,ki->k", met - length[:, None] * rays.direction, along)
    distance = np.hypot(length * square, foot - np.clip(foot, 0, size))
    return np.asarray(np.where(square > OPPOSED, distance, np.inf))


def _along(surface: Surface, h: Ints) -> Floats:
    """(k, 3) from the first to the last vertex of half-edges."""
    F = surface.F.ravel()
    return np.asarray(surface.V[F[_next(h)]] - surface.V[F[h]])


def _next(h: Ints) -> Ints:
    return h - h % 3 + (h + 1) % 3


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


def _started(surface: Surface, h: Ints, outward: Floats) -> _Rays:
    """Lines from the points `AT` of half-edges h, square to them: all first points, then all second ones."""
    first, along = surface.V[surface.F.ravel()[h]], _along(surface, h)
    point = np.concatenate([first + t * along for t in AT])
    came, count = np.tile(h, len(AT)), len(AT) * len(h)
    return _Rays(np.arange(count), came, point, -outward[came], np.zeros(count))


def _exits(surface: Surface, rays: _Rays, outward: Floats) -> tuple[Ints, Floats]:
    """The half-edge over which each line leaves its face, one of the two that it did not come in over; and how far."""
    options = np.stack([_next(rays.came), _next(_next(rays.came))], axis=1)
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
