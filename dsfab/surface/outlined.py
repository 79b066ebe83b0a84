"""`Outlined`: a surface while a line is drawn on it, and `edge_crossings`: where that crosses its edges."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.extent import Extent
from dsfab.surface.mesh import Surface
from dsfab.surface.refine import halved

EVEN = 0.002
"""How far the edges that follow a curved line may be off it, as a share of the `Extent.width`."""
NEAR = 0.25
"""Vertices move onto the line if that is nearer along an edge than this share of it."""
BISECTIONS = 48
"""Steps by which it is found where an edge meets the line: as far as digits go."""
LOOKED = 7
"""Points between the ends of an edge at which it is looked for the line."""


@dataclass(frozen=True, eq=False)
class Outlined:
    """A surface some of whose vertices lie on outlines.

    on    : (n,) vertices on the line that is being drawn.    fixed : (n,) those on earlier ones, which stay.
    """

    surface: Surface
    on: Bools
    fixed: Bools

    def halved(self, edges: Bools, places: Floats | None = None) -> "Outlined":
        """With marked edges (e,) divided in their middle, or at places (k, 3) that lie on the line."""
        old = self.surface
        V, F, _ = halved(old.V, old.F, old.edges, edges)
        count = len(V) - old.n
        if places is not None:
            V[old.n :] = places
        new = np.full(count, places is not None)
        between = self.fixed[old.edges.ends[edges]].all(axis=1)
        return Outlined(Surface(V, F), np.append(self.on, new), np.append(self.fixed, between))

    def moved(self, vertices: Ints, places: Floats) -> "Outlined":
        """With vertices (k,) on the line, at places (k, 3)."""
        V, on = self.surface.V.copy(), self.on.copy()
        V[vertices], on[vertices] = places, True
        return replace(self, surface=Surface(V, self.surface.F), on=on)

    def depth(self, extent: Extent) -> Floats:
        """(n,) how deep vertices are in an extent: 0 on the line."""
        return np.where(self.on, 0.0, extent.depth(self.surface.V))

    def divided(self, faces: Ints, places: Floats, on: bool) -> "Outlined":
        """With faces (k,) divided in three around places (k, 3) in them."""
        s, count = self.surface, len(faces)
        new = s.n + np.arange(count)
        stay = np.delete(s.F, faces, axis=0)
        fans = [np.column_stack([s.F[faces, i], s.F[faces, (i + 1) % 3], new]) for i in range(3)]
        grown = Surface(np.concatenate([s.V, places]), np.concatenate([stay, *fans]))
        return Outlined(
            grown, np.append(self.on, np.full(count, on)), np.append(self.fixed, np.zeros(count, dtype=bool))
        )


class EdgeCrossings(NamedTuple):
    """Edges (k,) that the line crosses, ascending, how far along (k,), 0 at their first end to 1, and where (k, 3)."""

    edge: Ints
    share: Floats
    place: Floats


def edge_crossings(made: Outlined, extent: Extent) -> EdgeCrossings:
    """Where the line crosses edges between what is within and what is not, by bisection.

    An edge from the line to one side of it may begin on the other side: there it crosses the line once more.
    """
    s, depth = made.surface, made.depth(extent)
    sign = np.sign(depth[s.edges.ends])
    edge = np.flatnonzero(sign.prod(axis=1) < 0)
    start, sides = np.zeros(len(edge)), sign[edge, 0]
    for end in (0, 1):
        maybe = np.flatnonzero((sign[:, end] == 0) & (sign[:, 1 - end] != 0))
        maybe = maybe[np.abs(depth[s.edges.ends[maybe, 1 - end]]) < s.edge_lengths[maybe]]
        begin = _other_side(s, extent, maybe, end, sign[maybe, 1 - end])
        there = begin > 0
        edge, start = np.append(edge, maybe[there]), np.append(start, np.abs(end - begin[there]))
        sides = np.append(sides, -sign[maybe[there], 1 - end])
    order = np.argsort(edge)
    edge, start, sides = edge[order], start[order], sides[order]
    a, b = s.V[s.edges.ends[edge]].transpose(1, 0, 2)
    low, high = start, np.where(sign[edge, 1] == 0, 0.0, 1.0)
    for _ in range(BISECTIONS if len(edge) else 0):
        middle = (low + high) / 2
        same = np.sign(extent.depth(a + middle[:, None] * (b - a))) == sides
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    share = (low + high) / 2
    return EdgeCrossings(edge, share, a + share[:, None] * (b - a))


def _other_side(s: Surface, extent: Extent, edges: Ints, end: int, sign: Floats) -> Floats:
    """(k,) the share of edges (k,), from an end (0 or 1) on the line, up to which they are on the side that `sign` (k,)
    of their other end is not; 0 where they nowhere are."""
    a, b = s.V[s.edges.ends[edges, end]], s.V[s.edges.ends[edges, 1 - end]]
    found = np.zeros(len(edges))
    for t in np.arange(1, LOOKED + 1) / (LOOKED + 1):
        depth = extent.depth(a + t * (b - a))
        found[sign * depth < -EVEN * extent.width] = t
    return found
