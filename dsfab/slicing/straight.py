"""Straight lines over a sheet, unfolded triangle by triangle, from one boundary to the next.

       apex              The frame of a half-edge: x from its first vertex to its last, y into its triangle. A line
      /    \\            comes in at (s, 0) and leaves over the next half-edge, or over the one after that; the twin of
     /  ^   \\           that one, seen from its own triangle, is the next frame. Nothing needs space.
----o---s----o----> x
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import Surface, next_half_edge

MOST_STEPS = 2000
"""Lines that cross more triangles than this run along a member, not across it."""


class FarEnds(NamedTuple):
    """Where lines (k,) end.

    edge   : the half-edge on the boundary, -1 for lines without an end.    place : metres along it.
    slope  : cosine between line and half-edge.    length : metres of the line.
    """

    edge: Ints
    place: Floats
    slope: Floats
    length: Floats

    def at(self, chosen: Ints) -> "FarEnds":
        """Some of them."""
        return FarEnds(self.edge[chosen], self.place[chosen], self.slope[chosen], self.length[chosen])


class _Lines(NamedTuple):
    """Lines on their way: number, half-edge that each came in over, metres along it, direction, metres behind."""

    number: Ints
    edge: Ints
    s: Floats
    x: Floats
    y: Floats
    way: Floats

    def at(self, on: Bools) -> "_Lines":
        return _Lines(self.number[on], self.edge[on], self.s[on], self.x[on], self.y[on], self.way[on])


def far_ends(surface: Surface, start: Ints, place: Floats, reach: float = np.inf) -> FarEnds:
    """Where lines end that begin on half-edges (k,), so many metres (k,) along them, and run square to these.

    reach : metres; longer lines need no end.
    """
    frames, twin, first = _frames(surface), surface.edges.twins, surface.F.ravel()
    against = first != first[twin]  # the twin runs the other way
    count = len(start)
    found = FarEnds(np.full(count, -1), np.zeros(count), np.ones(count), np.full(count, np.inf))
    lines = _Lines(np.arange(count), start, place, np.zeros(count), np.ones(count), np.zeros(count))
    for _ in range(MOST_STEPS):
        if not len(lines.number):
            break
        lines = _left(lines, frames[lines.edge])
        beyond = twin[lines.edge]
        if (ends := beyond < 0).any():
            here = lines.number[ends]
            found.edge[here], found.place[here] = lines.edge[ends], lines.s[ends]
            found.slope[here], found.length[here] = lines.x[ends], lines.way[ends]
        on = ~ends & np.isfinite(lines.way) & (lines.way <= reach)
        edge, lines = beyond[on], lines.at(on)
        turned = against[edge]
        s, x = np.where(turned, frames[edge, 0] - lines.s, lines.s), np.where(turned, -lines.x, lines.x)
        lines = lines._replace(edge=edge, s=s, x=x)
    return found


def _left(lines: _Lines, frame: Floats) -> _Lines:
    """The lines where they leave their triangles, seen from the half-edges over which they do, y outwards."""
    length, ax, ay, bx, by, cx, cy = frame.T
    s, x, y = lines.s, lines.x, lines.y
    over_next, over_last = by * x - bx * y, cy * x - cx * y  # outward speeds over both
    with np.errstate(divide="ignore", invalid="ignore"):
        to_next = np.where(over_next > 0, np.maximum(by * (length - s), 0) / over_next, np.inf)
        to_last = np.where(over_last > 0, np.maximum(-cy * s, 0) / over_last, np.inf)
        second = to_last < to_next
        step = np.where(second, to_last, to_next)
        ux, uy = np.where(second, cx, bx), np.where(second, cy, by)
        at = (s + step * x - np.where(second, ax, length)) * ux + (step * y - np.where(second, ay, 0)) * uy
    edge = next_half_edge(lines.edge, 1 + second)
    return _Lines(lines.number, edge, at, x * ux + y * uy, np.where(second, over_last, over_next), lines.way + step)


def _frames(surface: Surface) -> Floats:
    """(3 m, 7) of half-edges the length, the apex, and the unit directions of the next half-edge and the one after."""
    V, F = surface.V, surface.F
    along, apex = (V[np.roll(F, -k, axis=1)].reshape(-1, 3) - V[F].reshape(-1, 3) for k in (1, 2))
    size = np.linalg.norm(along, axis=1)
    ax, ay = np.einsum("hi,hi->h", apex, along) / size, 2 * np.repeat(surface.areas, 3) / size
    after, last = (np.roll(size.reshape(-1, 3), -k, axis=1).ravel() for k in (1, 2))
    return np.stack([size, ax, ay, (ax - size) / after, ay / after, -ax / last, -ay / last], axis=1)
