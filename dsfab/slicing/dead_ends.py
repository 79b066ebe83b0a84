"""Where members end in nothing: at a loose end, or where they turn back on themselves.

A member should begin and end at a member of the other family, at what is kept besides the stripes (a rim, the region
around a support) or at the boundary of the surface. Two things are counted as dead ends:

loose ends : the middle of a member stops elsewhere: where the phase is not defined, or skips a line;
turns      : it turns back, as level lines do around an extremum and beside a saddle. There it leaves the direction
             of the stress, passes square to it and comes back. So a turn is a stretch of a middle that is off that
             direction by over 30 degrees all along and by over 60 somewhere outside of members of the other family
             and of what is kept: a turn on a crossing member is a joint as good as another. A closed loop has two.
             Where the stress says nothing (its confidence is low in the mean) nothing is counted.
"""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.middles import Middles
from dsfab.surface.topology import connected

OFF = 30.0
"""Degrees by which a member may be off the stress."""
SQUARE = 60.0
"""Degrees beyond which it runs across rather than along."""
CLEAR = 0.25
"""Confidence of the stress under which it says nothing: principal stresses differ by less than a tenth of their RMS."""


class DeadEnds(NamedTuple):
    """(e, 3) places of loose ends, and (t, 3) of turns, metres."""

    loose: Floats
    turns: Floats


def dead_ends(middles: Middles, deviation: Floats, confidence: Floats) -> DeadEnds:
    """The dead ends of a family; deviation (m,) from the stress, degrees, and its confidence (m,) on the faces."""
    loose = (middles.degree == 1) & ~middles.edge & ~middles.at_nodes(middles.met)
    return DeadEnds(middles.place[loose], _turns(middles, deviation, confidence))


def _turns(middles: Middles, deviation: Floats, confidence: Floats) -> Floats:
    drawn = middles.drawn
    off = np.flatnonzero(deviation[middles.face] > OFF)
    face, node, length = middles.face[off], middles.node[off], middles.length[off]
    count, label = connected(len(middles.edge), node[:, 0], node[:, 1])
    stretch, middle = label[node[:, 0]], middles.at[off].mean(axis=1)
    met = drawn.inside(1 - middles.k, face, middle) | drawn.is_kept(face, middle)
    square = np.bincount(stretch, (deviation[face] > SQUARE) & ~met, count) > 0
    total = np.maximum(np.bincount(stretch, length, count), np.finfo(float).tiny)
    clear = np.bincount(stretch, length * confidence[face], count) / total > CLEAR
    sums = np.stack([np.bincount(stretch, length * x, count) for x in middles.points[off].mean(axis=1).T], axis=1)
    return np.asarray((sums / total[:, None])[square & clear])
