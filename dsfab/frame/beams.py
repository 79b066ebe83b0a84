"""Members as straight beams between their nodes.

node      end of the joint        end of the joint      node
  o=========|-------------------------|=========o        from one middle line to the next: a bay
   wide: both members are material      as wide as the member
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.frame.joints import AxisJoints, fitting
from dsfab.members import Member

TURN = 5.0
"""Degrees that a beam may leave out of its member's turning: bays that turn more become several beams."""
TAPER = 1.25
"""Nor over what its width changes by more than this factor: bays that taper become several beams."""
FINEST = 0.5
"""But none is shorter than this share of the width, joints left out."""
SHORT = 1e-3
"""Nodes of a member that are nearer than this share of its width are the same."""
SPREAD = 0.5
"""Within a joint a beam is wider than its member by this share of the other's width: that is material too, and forces
spread into it by 45 degrees. Against the sheet, tower, vaults and gridshell: 0 gives compliances of 1.10, 1.02 and 1.06
times the sheet's, 1 gives .96, 1.00 and .98."""
FINE = 17
"""Places along a bay at which its curvature and width are asked."""
LEAST = 0.05
"""AxisJoints that reach less far than this share of the width are none."""


class Row(NamedTuple):
    """A beam: its nodes, local z, width and shift in metres, member and its width over the length of its bay."""

    ends: tuple[int, int]
    normal: Floats
    width: float
    shift: float
    member: int
    stout: float


@dataclass(frozen=True, eq=False)
class Beams:
    """Columns of beams, see `Frame`.    stout : (b,) the width of the member over the length of its bay, 1 beside
    others that it grazes."""

    ends: Ints
    normal: Floats
    width: Floats
    shift: Floats
    member: Ints
    stout: Floats

    @classmethod
    def of(cls, rows: list[Row]) -> "Beams":
        """As columns."""
        ends = np.array([row.ends for row in rows], dtype=np.int64).reshape(-1, 2)
        normal = np.array([row.normal for row in rows]).reshape(-1, 3)
        width, shift, stout = (np.array([row[k] for row in rows], dtype=np.float64) for k in (2, 3, 5))
        return cls(ends, normal, width, shift, np.array([row.member for row in rows], dtype=np.int64), stout)

    def some(self, kept: Ints, ends: Ints) -> "Beams":
        """Some of them (k,), between nodes (b, 2) of other numbers."""
        shape = self.normal[kept], self.width[kept], self.shift[kept]
        return Beams(ends[kept], *shape, self.member[kept], self.stout[kept])

    def and_links(self, ends: Ints, normal: Floats, width: Floats) -> "Beams":
        """With links (k, 2) of a width (k,)."""
        none = np.zeros(len(ends))
        return Beams(
            np.concatenate([self.ends, ends]),
            np.concatenate([self.normal, normal]),
            np.concatenate([self.width, width]),
            np.concatenate([self.shift, none]),
            np.concatenate([self.member, np.full(len(ends), -1, dtype=np.int64)]),
            np.concatenate([self.stout, none]),
        )


def beams_along(joints: AxisJoints) -> Beams:
    """Beams along all axes, and links; new nodes are added between those of the joints."""
    rows = list[Row]()
    for number, member in enumerate(joints.lined):
        stations = _stations(joints, member)
        for begin, end in pairwise(stations):
            rows += _bay(joints, member, number, begin, end)
    for one, other, width in joints.links:
        rows.append(Row((one, other), joints.normal_at(one), width, 0.0, -1, 0.0))
    return Beams.of(rows)


def _stations(joints: AxisJoints, member: Member) -> list[tuple[float, int]]:
    """Arc lengths and nodes along a member, in order; of a closed one the first comes again at the end."""
    axis = member.axis
    assert axis is not None
    found = sorted(joints.on[member.id])
    if axis.closed:
        found = found or [(0.0, joints.node(axis.P[0], f"{member.id} 0"))]
        return [*found, (found[0][0] + member.length, found[0][1])]
    begin, end = joints.ends[member.id]
    near = SHORT * member.mean_width
    found = [one for one in found if begin - near <= one[0] <= end + near]
    for s, first in ((begin, True), (end, False)):
        if not any(abs(at - s) < near for at, _ in found):
            new = (s, joints.node(axis.at(np.array([s]))[0][0], f"{member.id} {'begin' if first else 'end'}"))
            found = [new, *found] if first else [*found, new]
    return found


def _bay(
    joints: AxisJoints, member: Member, number: int, begin: tuple[float, int], end: tuple[float, int]
) -> list[Row]:
    """The beams from one node of a member to the next."""
    (s, one), (t, other) = begin, end
    axis = member.axis
    assert axis is not None
    if t - s < (0.5 if one == other else SHORT) * member.mean_width:
        return []
    around = member.length if axis.closed else np.inf
    widths = joints.other_width(member, one), joints.other_width(member, other)
    at, spread = _divided(member, (s, t), widths, 3 if one == other else 1)
    inner, middle = at[1:-1] % around, ((at[:-1] + at[1:]) / 2) % around
    names = [f"{member.id} {x:.3f}" for x in inner]
    nodes = [one, *(joints.node(p, name) for p, name in zip(axis.at(inner)[0], names, strict=True)), other]
    left, right = (np.interp(middle, axis.s, side) for side in _sides(member).T)
    stout = 1.0 if joints.grazed & {one, other} else min(member.mean_width / (t - s), 1.0)
    return [
        Row(ends, normal, float(a + b + more), float(a - b) / 2, number, stout)
        for ends, normal, a, b, more in zip(pairwise(nodes), axis.at(middle)[2], left, right, spread, strict=True)
    ]


def _sides(member: Member) -> Floats:
    """(k, 2) metres that a member reaches to the left and to the right of its axis.

    A disc has material on both sides of the ring that stands for it, and an outline on the outer one only: it is as
    wide as its area over its length, at least.
    """
    if member.kind != "disc":
        return member.sides
    return np.maximum(member.sides, member.area / member.length / 2)


def _divided(
    member: Member, span: tuple[float, float], other: tuple[float, float], least: int
) -> tuple[Floats, Floats]:
    """(k + 1,) arc lengths that divide a bay into joints and beams that turn little, and (k,) what joints are wider."""
    (s, t), axis = span, member.axis
    assert axis is not None
    half = fitting(np.array(other) / 2, t - s)
    half[half < LEAST * member.mean_width] = 0.0
    fine, clear = np.linspace(s, t, FINE), np.linspace(s + half[0], t - half[1], FINE)
    if axis.closed:
        fine, clear = fine % member.length, clear % member.length
    bent = np.interp(fine, axis.s, np.hypot(axis.kg, axis.kn)).mean() * (t - s)
    width = np.interp(clear, axis.s, member.width)
    parts = max(np.degrees(bent) / TURN, np.log(width.max() / width.min()) / np.log(TAPER))
    count = max(least, min(int(np.ceil(parts)), int((t - s) / (FINEST * member.mean_width))))
    at = np.linspace(s + half[0], t - half[1], count + 1)
    spread = np.zeros(count)
    if half[0]:
        at, spread = np.concatenate([[s], at]), np.concatenate([[SPREAD * other[0]], spread])
    if half[1]:
        at, spread = np.concatenate([at, [t]]), np.concatenate([spread, [SPREAD * other[1]]])
    return at, spread
