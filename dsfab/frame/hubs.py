"""Discs, which are kept around points: a node in the middle, and spokes to the nodes on the ring that stands for it."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.frame.joints import AxisJoints
from dsfab.members import Member

SPOKES = 3
"""A disc with fewer nodes on its ring has no hub."""


def add_hubs(joints: AxisJoints) -> None:
    """A hub for each disc; its spokes are as wide, together, as the ring is long.

    Under a load on the hub such spokes give .73 times as much as a clamped plate, 1.15 times as much as a plate on a
    simple support: Pa^2/(2 pi E t^3) against .217 and .552 Pa^2/(E t^3), .637 and .159 [Timoshenko, Woinowsky-Krieger
    1959, 19]."""
    for member in joints.lined:
        nodes = sorted({number for _, number in joints.on[member.id]})
        if member.kind == "disc" and member.axis and member.axis.closed and len(nodes) >= SPOKES:
            hub = joints.node(_middle(member), f"{member.id} hub")
            joints.links += [(hub, number, member.length / len(nodes)) for number in nodes]


def _middle(member: Member) -> Floats:
    """(3,) the middle of a closed axis."""
    assert member.axis is not None
    return np.asarray(member.axis.P[:-1].mean(axis=0))
