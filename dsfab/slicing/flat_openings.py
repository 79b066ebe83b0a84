"""`FlatOpenings`: the openings of a sheet laid flat, to ask where a disc has room."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing.arcs import TINY, unit
from dsfab.slicing.parts import part_of
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.walls import Walls, following
from dsfab.surface import NearestPlaces, nearest, pieces

if TYPE_CHECKING:
    import manifold3d

APART = 2.0
"""Openings are laid beside one another, so many times the largest from each to the next."""
SMOOTH = 1e-3
"""Steps of an offset shape that are shorter than this share of the offset are rounding."""
SEGMENTS = 48
"""Of a circle, in an offset shape."""


@dataclass(frozen=True, eq=False)
class FlatOpenings:
    """The openings that walls enclose wholly, each seen square to its mean plane.

    wall  : (w',) their walls.    chain : (w',) of each, numbered as they come.    after : (w',) the next in its chain.
    start : (w', 2) where they start, metres.    frame : (w', 2, 3) unit vectors of the plane.
    """

    wall: Ints
    chain: Ints
    after: Ints
    start: Floats
    frame: Floats

    @classmethod
    def of(cls, sheet: Sheet, walls: Walls) -> "FlatOpenings":
        """The openings of a sheet."""
        void, face = part_of(sheet.surface, ~sheet.material)
        count, label = pieces(void.F, void.edges)
        opening = np.empty(sheet.surface.m, dtype=np.int64)
        opening[face] = label
        mine = opening[walls.inside // 3]
        whole = np.ones(count, dtype=bool)
        whole[mine[~walls.closed[walls.chain]]] = False
        wall = np.flatnonzero(whole[mine])
        mine = mine[wall]
        frame = _mean_planes(void.normals * void.areas[:, None], label, count)[mine]
        start = np.einsum("wi,wji->wj", sheet.surface.V[walls.start[wall]], frame)
        low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(low, mine, start)
        np.maximum.at(high, mine, start)
        size = float(np.max((high - low)[whole], initial=0.0))
        across = int(np.ceil(np.sqrt(count)))
        place = np.stack([np.arange(count) % across, np.arange(count) // across], axis=1) * APART * size
        chain = np.cumsum(np.diff(walls.chain[wall], prepend=walls.chain[wall[:1]]) != 0)
        return cls(wall, chain, following(chain), start - low[mine] + place[mine], frame)

    @cached_property
    def shape(self) -> "manifold3d.CrossSection":
        """All of them."""
        import manifold3d

        loops = np.split(self.start, np.flatnonzero(np.diff(self.chain)) + 1)
        return manifold3d.CrossSection(loops if len(self.wall) else [], manifold3d.FillRule.Positive)

    def room(self, radius: float) -> "manifold3d.CrossSection":
        """The middles of all discs of a radius, metres, that lie inside."""
        return offset(self.shape, -radius)

    def touched(self, points: Floats) -> tuple[Ints, Floats]:
        """(p,) the nearest wall to points (p, 2), by its place in `wall`; and which share of it lies before."""
        found = self._nearest(points)
        one, two = self.start[found.simplex], self.start[self.after[found.simplex]]
        size = np.maximum(np.linalg.norm(two - one, axis=1), TINY)
        return found.simplex, np.clip(np.linalg.norm(found.place[:, :2] - one, axis=1) / size, 0, 1)

    def distance(self, points: Floats) -> Floats:
        """(p,) metres from points (p, 2) to the nearest wall."""
        return self._nearest(points).distance

    def _nearest(self, points: Floats) -> NearestPlaces:
        return nearest_in_plane(points, self.start, np.stack([np.arange(len(self.wall)), self.after], axis=1))


def nearest_in_plane(points: Floats, V: Floats, simplices: Ints) -> NearestPlaces:
    """The places nearest to points (k, 2) on edges (m, 2) or vertices (m, 1) of V (n, 2)."""
    return nearest(np.pad(points, ((0, 0), (0, 1))), np.pad(V, ((0, 0), (0, 1))), simplices)


def offset(shape: "manifold3d.CrossSection", by: float) -> "manifold3d.CrossSection":
    """A shape grown by a length, or shrunk where that is negative."""
    import manifold3d

    return shape.offset(by, manifold3d.JoinType.Round, circular_segments=SEGMENTS).simplify(SMOOTH * abs(by))


def _mean_planes(normal: Floats, label: Ints, count: int) -> Floats:
    """(count, 2, 3) unit vectors square to the mean of normals (f, 3) with labels (f,)."""
    mean = unit(np.stack([np.bincount(label, x, count) for x in normal.T], axis=1))
    one = unit(np.cross(np.eye(3)[np.abs(mean).argmin(axis=1)], mean))
    return np.stack([one, np.cross(mean, one)], axis=1)
