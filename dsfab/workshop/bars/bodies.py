"""Bars and plates where they are in the structure: for pictures, and for building models."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.workshop.bars.cutting import BarStock
from dsfab.workshop.bars.joints import BarLattice, Joint, LatticeBar
from dsfab.workshop.bars.lattice import CLEAR
from dsfab.workshop.bars.plan import BarPlan

BOX = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Corners of the six sides of a bar, seen from outside: bit 1 of a corner's number is up, bit 2 left, bit 4 its end."""


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """A part in space: its name, and quads (q, 4, 3), metres; corners may be twice there."""

    id: str
    member: str
    quads: Floats


def bar_body(bar: LatticeBar, stock: BarStock) -> tuple[Floats, Ints]:
    """Vertices (8, 3), metres, and triangles (12, 3) of a bar, without its mitres."""
    d, half = bar.direction, bar.bay.width / 2
    clear = [CLEAR * stock.bolt if end.root else 0.0 for end in bar.ends]
    middles = bar.points + np.array([clear[0], -clear[1]])[:, None] * d
    left = np.cross(bar.normals, d)
    sides = np.array([[y * half * left + z * stock.bar / 2 * bar.normals for z in (-1, 1)] for y in (-1, 1)])
    V = (middles[:, None, None] + sides.transpose(2, 0, 1, 3)).reshape(8, 3)
    return V, np.concatenate([BOX[:, [0, 1, 2]], BOX[:, [0, 2, 3]]])


def placed_parts(plan: BarPlan) -> list[PlacedPart]:
    """All bars, then the plates of nodes, as they are in the structure."""
    found, stock = plan.found, plan.stock
    bars = [PlacedPart(bar.bay.id, bar.bay.member, bar_body(bar, stock)[0][BOX]) for bar in found.bars]
    joints = [joint for joint in found.joints if joint.node.joined]
    return bars + [PlacedPart(joint.node.id, "", _plate_quads(joint, found, stock)) for joint in joints]


def _plate_quads(joint: Joint, found: BarLattice, stock: BarStock) -> Floats:
    """(q, 4, 3) the middle of a folded plate: a quad for each arm, and two triangles between the middle and each."""
    n, quads = joint.node.normal, list[Floats]()
    middle = joint.node.point - stock.lever * n
    corners = list[tuple[Floats, Floats]]()
    for k, side in joint.bars:
        bar = found.bars[k]
        d = bar.direction if side == 0 else -bar.direction
        left = np.cross(bar.normals[side], d)
        root, last = bar.points[side] - stock.lever * bar.normals[side], stock.bolts(bar)[1]
        fold = root + np.tan(bar.ends[side].dip / 2) * stock.lever * -d
        corners.append((fold - joint.half * left, fold + joint.half * left))
        end = root + last * d
        quads.append(np.array([corners[-1][0], end - joint.half * left, end + joint.half * left, corners[-1][1]]))
    if joint.leg:
        quads += _leg_quads(joint, middle)
    for one, two in zip(corners, [*corners[1:], corners[0]], strict=True):
        quads.append(np.array([middle, one[0], one[1], middle]))
        quads.append(np.array([middle, one[1], two[0], middle]))
    return np.array(quads)


def _leg_quads(joint: Joint, middle: Floats) -> list[Floats]:
    """(4, 3) each: the leg of a plate, and a triangle between it and the middle."""
    leg, n = joint.leg, joint.node.normal
    assert leg is not None
    aside = joint.half * np.cross(n, leg.way)
    fold = middle + joint.root * leg.way
    end = fold + leg.long * (np.cos(leg.fold) * leg.way + np.sin(leg.fold) * n)
    leg_itself = np.array([fold - aside, end - aside, end + aside, fold + aside])
    return [leg_itself, np.array([middle, fold - aside, fold + aside, middle])]
