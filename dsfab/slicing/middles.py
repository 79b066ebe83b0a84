"""`Middles`: the middles of all members of a family on a chart, piece by piece, and how the pieces hang together.

A phase is linear over each face, so the line z = k is one straight piece in each face that it meets. Where the chart is
cut open, faces on both sides see the phase differently, but draw the same line: pieces hang together where they end at
the same place. A phase that is a whole number at a vertex makes a line through that vertex, or along an edge:

        o            o            o            the piece of a face ends at edges, at a vertex, or at two
       / \\          /|\\          / \\
    --x---x--      / | \\        /   \\
     /     \\      /  |  \\      /     \\
    o-------o    o---x---o    x=======x
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.slicing.drawn import ON, Drawn

SAME = 1e-5
"""Pieces that end at places of an edge that are this near, as a share of it, hang together."""


@dataclass(frozen=True, eq=False)
class Middles:
    """The middles of family k.

    face : (s,) of each piece.    at : (s, 2, 3) barycentric coordinates of its ends.    node : (s, 2) where it ends.
    copy : (s,) pieces along an edge of which an earlier one is the same.    edge : (j,) whether nodes are on the
    boundary of the surface.
    """

    drawn: Drawn
    k: int
    face: Ints
    at: Floats
    node: Ints
    copy: Bools
    edge: Bools

    @cached_property
    def points(self) -> Floats:
        """(s, 2, 3) ends, metres."""
        surface = self.drawn.surface
        return np.asarray(np.einsum("sec,scx->sex", self.at, surface.V[surface.F[self.face]]))

    @cached_property
    def length(self) -> Floats:
        """(s,) metres; half of it for each of the two pieces along an edge."""
        metres = np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1)
        key = self.node.min(axis=1) * len(self.edge) + self.node.max(axis=1)
        group = grouped(key)[2]
        return np.asarray(metres / np.bincount(group)[group])

    @cached_property
    def degree(self) -> Ints:
        """(j,) how many pieces end at each node."""
        return np.bincount(self.node[~self.copy].ravel(), minlength=len(self.edge))

    def at_nodes(self, marked: Bools) -> Bools:
        """(j,) nodes at which one of the ends (s, 2) is marked."""
        found = np.zeros(len(self.edge), dtype=bool)
        found[self.node[marked]] = True
        return found

    @cached_property
    def met(self) -> Bools:
        """(s, 2) ends that lie in a member of the other family, or in what is kept besides the stripes."""
        face, at = np.repeat(self.face, 2), self.at.reshape(-1, 3)
        inside = self.drawn.inside(1 - self.k, face, at) | self.drawn.is_kept(face, at)
        return np.asarray(inside.reshape(-1, 2))

    @cached_property
    def place(self) -> Floats:
        """(j, 3) where the nodes are, metres."""
        found = np.empty((len(self.edge), 3))
        found[self.node] = self.points
        return found


class _Pieces(NamedTuple):
    """Faces (s,), numbers of lines (s,), and the slots (s, 2) of faces at which pieces end: 0 to 2 a corner, 3 to 5 the
    edge from corner slot - 3."""

    face: Ints
    line: Ints
    slot: Ints


def middles(drawn: Drawn, k: int) -> Middles:
    """The middles of the members of family k: none where half-widths are 0."""
    F = drawn.surface.F
    pieces = _pieces(drawn, k)
    z = drawn.z[F[pieces.face], k] - pieces.line[:, None]
    at = np.stack([_barycentric(z, pieces.slot[:, e]) for e in (0, 1)], axis=1)
    node, on_edge = _nodes(drawn, pieces, at)
    low, high = node.min(axis=1), node.max(axis=1)
    _, begins, group = grouped(low * (int(node.max(initial=0)) + 1) + high)
    first = np.full(len(begins), len(low))
    np.minimum.at(first, group, np.arange(len(low)))
    return Middles(drawn, k, pieces.face, at, node, first[group] != np.arange(len(low)), on_edge)


def _pieces(drawn: Drawn, k: int) -> _Pieces:
    z, d = drawn.corners(drawn.z[:, k]), drawn.corners(drawn.d[:, k]).max(axis=0)
    least, most = z.min(axis=0), z.max(axis=0)
    low, high = np.ceil(least).astype(np.int64), np.floor(most).astype(np.int64)
    count = np.where(drawn.known[:, k] & (d > 0) & (most - least > ON), np.maximum(high - low + 1, 0), 0)
    face = np.repeat(np.arange(len(count)), count)
    line = low[face] + np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    side = np.sign(z[:, face] - line).T
    meets = np.concatenate([side == 0, side * np.roll(side, -1, axis=1) < 0], axis=1)
    two = meets.sum(axis=1) == 2
    slot = np.nonzero(meets[two])[1].reshape(-1, 2)
    return _Pieces(face[two], line[two], slot)


def _barycentric(z: Floats, slot: Ints) -> Floats:
    """(s, 3) coordinates of the ends at slots (s,) of pieces z = 0, z (s, 3) at the corners."""
    row, here, on_edge = np.arange(len(z)), slot % 3, slot >= 3
    there = (here + 1) % 3
    a, b = z[row, here], z[row, there]
    t = np.where(on_edge, a / np.where(on_edge, a - b, 1.0), 0.0)
    found = np.zeros((len(z), 3))
    found[row, here] = 1 - t
    found[row, there] = t
    return found


def _nodes(drawn: Drawn, pieces: _Pieces, at: Floats) -> tuple[Ints, Bools]:
    """(s, 2) the node of each end, and (j,) whether nodes are on the boundary of the surface.

    Ends are compared by where they are on an edge; those at vertices come before all of them.
    """
    table, F = drawn.table, drawn.surface.F
    face, slot, weight = np.repeat(pieces.face, 2), pieces.slot.ravel(), at.reshape(-1, 3)
    corner, on_edge, row = slot % 3, slot >= 3, np.arange(len(slot))
    vertex, edge = drawn.place[F[face, corner]], table.of[face, corner]
    t = weight[row, (corner + 1) % 3]
    t = np.where(vertex == table.ends[edge, 0], t, 1 - t)
    key = np.where(on_edge, edge + len(F) * 3, vertex)
    order = np.lexsort((np.where(on_edge, t, 0.0), key))
    apart = (np.diff(key[order]) != 0) | (np.diff(np.where(on_edge, t, 0.0)[order]) > SAME)
    node = np.empty(len(slot), dtype=np.int64)
    node[order] = np.concatenate([[0], np.cumsum(apart)]) if len(slot) else np.empty(0, dtype=np.int64)
    rim = np.zeros(drawn.surface.n, dtype=bool)
    rim[table.ends[table.boundary]] = True
    outside = np.zeros(int(node.max(initial=-1)) + 1, dtype=bool)
    outside[node] = np.where(on_edge, table.boundary[edge], rim[vertex])
    return node.reshape(-1, 2), outside
