"""Where members end in nothing: at a loose end, or where they turn back on themselves.

A member should begin and end at a member of the other family, at what is kept besides the stripes (a rim, the region
around a support) or at the boundary of the surface. Two things are counted as dead ends:

loose ends : the middle of a member stops elsewhere: where the phase is not defined, or skips a line;
turns      : it comes along the stress and goes back along it, as level lines do around an extremum and beside a saddle.

                  |     |     A node is a turn where the ways that leave it point to the same side of the stress (here
    |             |     |     upright). Pieces that are over 30 degrees off the stress hang together with their nodes:
    o no turn      \\   /      a stretch of them is one turn if it has an odd number of such nodes.
    |               `-o-'

A turn in a member of the other family or in what is kept is a joint as good as another, and is not counted. Nor is
anything where the stress does not say which way: its confidence is low. A closed loop has two turns.
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, sorted_order, unfolded
from dsfab.slicing.middles import Middles
from dsfab.surface.topology import connected

OFF = 30.0
"""Degrees by which a member may be off the stress."""
CLEAR = 0.25
"""Confidence of the stress under which it says nothing: principal stresses differ by less than a tenth of their RMS."""


class DeadEnds(NamedTuple):
    """(e, 3) places of loose ends, and (t, 3) of turns, metres."""

    loose: Floats
    turns: Floats


def dead_ends(middles: Middles, along: Floats, deviation: Floats, confidence: Floats) -> DeadEnds:
    """The dead ends of a family.

    along      : (m, 3) unit direction on the faces that members should run along; either sign.
    deviation  : (m,) degrees by which they do not.    confidence : (m,) how clear that direction is, 0 to 1.
    """
    met = middles.at_nodes(middles.met)
    loose = (middles.degree == 1) & ~middles.edge & ~met
    clear = confidence[middles.face] > CLEAR
    back = _turned(middles, along[middles.face], clear)
    off = clear & (deviation[middles.face] > OFF)
    count, label = connected(len(back), middles.node[off, 0], middles.node[off, 1])
    odd = np.bincount(label[back], minlength=count) % 2 == 1
    counted = np.flatnonzero(back & ~met & odd[label])
    first = counted[np.unique(label[counted], return_index=True)[1]]
    return DeadEnds(middles.place[loose], middles.place[first])


def _turned(middles: Middles, along: Floats, clear: Bools) -> Bools:
    """(j,) nodes of two pieces that leave to the same side of the stress, which is clear in both."""
    some = np.flatnonzero(~middles.copy)  # each piece along an edge once
    step = middles.points[some, 1] - middles.points[some, 0]
    ahead = np.where(
        np.einsum("px,px->p", step, along[some]) < 0, -1, 1
    )  # square to the stress is one way or the other
    node, piece = middles.node[some].T.ravel(), np.tile(some, 2)
    side = np.concatenate([ahead, -ahead])
    order = sorted_order(node)
    pair = np.flatnonzero((np.diff(node[order]) == 0) & (middles.degree[node[order][1:]] == 2))
    one, two = order[pair], order[pair + 1]
    here, there = (middles.drawn.surface.normals[middles.face[piece[end]]] for end in (one, two))
    straight = unfolded(here, there, along[piece[two]])  # around a sharp edge of the surface
    alike = np.where(np.einsum("px,px->p", along[piece[one]], straight) < 0, -1, 1)
    found = np.zeros(len(middles.edge), dtype=bool)
    found[node[one]] = (side[one] * side[two] * alike > 0) & clear[piece[one]] & clear[piece[two]]
    return found
