"""Small edges collapsed: a vertex moves onto its neighbour, and the cells between them are gone.

A vertex may move within every uncut face that its cells lie in: inside a face, or along an edge of it. The surface and
everything carried on it stay as they are then; what may move, by a tolerance, are the edges of stripes.
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, distinct, from_segments
from dsfab.slicing.mesh_edit import GAIN, Cut, independent
from dsfab.slicing.sheet import VOID
from dsfab.surface.neighbours import on_boundary

POOR = 25.0
"""Degrees: only at cells with a smaller angle edges are collapsed."""

STRAIGHT = 1e-12
"""A vertex this share of the largest coordinate off a line is on it."""


class Moves(NamedTuple):
    """Vertices v (k,) that may move onto their neighbours w (k,), and how far edges of stripes strayed then, metres."""

    v: Ints
    w: Ints
    strayed: Floats

    def some(self, which: Bools | Ints) -> "Moves":
        """Those that are marked (k,), or of these numbers."""
        return Moves(self.v[which], self.w[which], self.strayed[which])


def collapsed(cut: Cut, tolerance: float) -> tuple[Cut, int]:
    """The cells after one round of collapses that raise the smallest angle around a vertex, and how many there were.

    tolerance : metres that an edge of a stripe, of a family or of the surface may be off where it was at first.
    """
    moves = _along_lines(cut, _candidates(cut), tolerance)
    moves, gain = _better(cut, moves)
    if not len(moves.v):
        return cut, 0
    rank = np.empty(len(gain), dtype=np.int64)
    rank[np.argsort(-gain, kind="stable")] = np.arange(len(gain))
    stars = [cut.around(end) for end in (moves.v, moves.w)]
    row, face = (np.concatenate(column) for column in zip(*stars, strict=True))
    moves = moves.some(independent(row, face, rank, len(cut.F)))
    onto = np.arange(len(cut.V))
    onto[moves.v] = moves.w
    F = onto[cut.F]
    strayed = cut.strayed.copy()
    ends = cut.edges.ends[cut.lines]
    moved = np.zeros(len(cut.V))
    moved[moves.v] = moves.strayed
    for p, q in (ends.T, ends[:, ::-1].T):
        np.maximum.at(strayed, onto[q], moved[p])
    np.maximum.at(strayed, moves.w, moves.strayed)
    whole = (np.roll(F, 1, axis=1) != F).all(axis=1)
    return cut.with_cells(F, whole, strayed), len(moves.v)


def _candidates(cut: Cut) -> Moves:
    """Moves away from poor cells, of vertices that were made by the cut, within all uncut faces around them."""
    poor = (cut.angle < POOR) & (cut.family != VOID)
    edge = distinct(cut.edges.of[poor])
    v, w = np.concatenate([cut.edges.ends[edge], cut.edges.ends[edge][:, ::-1]]).T
    made = (cut.support[v] >= 0).sum(axis=1) > 1
    v, w = v[made], w[made]
    row, face = cut.around(v)
    corner, support = cut.corner[cut.parent[face]], cut.support[w[row]]
    outside = ((support >= 0) & (support[:, :, None] != corner[:, None]).all(axis=2)).any(axis=1)
    within = np.bincount(row, outside, len(v)) == 0
    v, w = v[within], w[within]
    return Moves(v, w, np.zeros(len(v)))


def _along_lines(cut: Cut, moves: Moves, tolerance: float) -> Moves:
    """The moves that keep all lines as they are connected, and where they are by the tolerance.

    A vertex without lines may go anywhere; others along a line, or off it to where no line is. Two joints of three
    lines may meet if material is one fan around them still: not along a border of families, at whose ends void is. The
    boundary of the surface is not left.
    """
    v, w, _ = moves
    count = np.bincount(cut.edges.ends[cut.lines].ravel(), minlength=len(cut.V))
    rim = on_boundary(cut.edges, len(cut.V))
    edge = cut.edge(v, w)
    along = cut.lines[edge]
    step = np.linalg.norm(cut.V[v] - cut.V[w], axis=1)
    slides = along & (count[v] == 2)
    total = cut.line_ends
    u = np.where(slides, total[v] - w, v)  # the other neighbour on the line
    off = np.where(slides, from_segments(cut.V[v], cut.V[u], cut.V[w]), step)
    off[off <= STRAIGHT * np.abs(cut.V).max()] = 0
    strayed = np.where(count[v] > 0, np.maximum.reduce([cut.strayed[v], cut.strayed[w], cut.strayed[u]]) + off, 0)
    joints = (count[v] == 3) & (count[w] == 3) & cut.outline[edge] & ~rim[v] & ~rim[w]
    connected = np.where(along, (count[v] == 2) | (count[w] == 2) | joints, count[w] == 0)
    onto = ~rim[v] | cut.edges.boundary[edge]
    allowed = (count[v] == 0) | (connected & onto & (strayed <= tolerance))
    return Moves(v, w, strayed).some(allowed)


def _better(cut: Cut, moves: Moves) -> tuple[Moves, Floats]:
    """The moves after which material has a larger smallest angle, void none smaller, and how much larger, degrees."""
    row, face = cut.around(moves.v)
    F, material = cut.F[face], cut.family[face] != VOID
    v, w = moves.v[row], moves.w[row]
    gone = (w[:, None] == F).any(axis=1)
    new = np.full(len(row), np.inf)
    new[~gone] = cut.angles(np.where(v[:, None] == F, w[:, None], F)[~gone], cut.parent[face[~gone]])
    before, after = np.full((2, 2, len(moves.v)), np.inf)
    for kind in (0, 1):
        mine = material == bool(kind)
        np.minimum.at(before[kind], row[mine], cut.angle[face[mine]])
        np.minimum.at(after[kind], row[mine], new[mine])
    good = (after[1] > GAIN * before[1]) & (after[0] >= np.minimum(before[0], after[1])) & (after[0] > 0)
    good &= np.isfinite(after[1]) & _linked(cut, moves, row, F)
    return moves.some(good), (after[1] - before[1])[good]


def _linked(cut: Cut, moves: Moves, row: Ints, F: Ints) -> Bools:
    """(k,) both ends of an edge have no neighbours in common but across its cells (link condition: [Dey et al. 1999]),
    and no triangle of lines closes.

    row, F : the cells around each v.
    """
    others = np.repeat(row, 3), F.ravel()
    known = (others[1] != moves.v[others[0]]) & (others[1] != moves.w[others[0]])
    pair = distinct(others[0][known] * len(cut.V) + others[1][known])
    at, x = pair // len(cut.V), pair % len(cut.V)
    there = cut.edge(x, moves.w[at])
    common = np.bincount(at[there >= 0], minlength=len(moves.v))
    both = (there >= 0) & cut.lines[there] & cut.lines[cut.edge(x, moves.v[at])]
    closes = np.bincount(at[both], minlength=len(moves.v)) > 0
    return np.asarray((common == cut.edges.count[cut.edge(moves.v, moves.w)]) & ~closes)
