"""The parts of a structure of bars."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.messages import length, names_and_count
from dsfab.members import MemberGraph
from dsfab.workshop.bars.cutting import BarStock, bar_part, mitre_length, plate_part
from dsfab.workshop.bars.joints import BarLattice, Footing, Joint, LatticeBar, bar_lattice, leg_lines
from dsfab.workshop.bars.lattice import BAR_CLEARANCE, becomes_bars, member_lattice
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plates import plate_parts


@dataclass(frozen=True, eq=False)
class BarPlan:
    """Bars in space, and all flat parts. legless : names of supported nodes with a plate without a leg."""

    bar_lattice: BarLattice
    stock: BarStock
    parts: tuple[FlatPart, ...]
    legless: tuple[str, ...] = ()

    @property
    def too_short(self) -> tuple[str, ...]:
        """Names of bars that are too short for two bolts."""
        return tuple(bar.bay.id for bar in self.bar_lattice.bars if not self.stock.bolt_stations(bar)[0])

    @property
    def largest_sagitta(self) -> float:
        """Largest distance of a bar from the surface (m)."""
        return max(bar.sagitta for bar in self.bar_lattice.bars)

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences for the builder on the bars and plates."""
        folds = [joint.leg.fold for joint in self.bar_lattice.joints if joint.leg]
        return (*_possibility_lines(self), *leg_lines(folds, self.legless), *_omission_lines(self))


def bar_plan(graph: MemberGraph, normals: Floats, stock: BarStock, footing: Footing | None = None) -> BarPlan:
    """Return the bars, node plates, and discs (plates for members that do not become bars) of a graph.
    normals : (n, 3) at the vertices of the graph's sheet.    footing : supports at which plates get legs, or None.
    Raises PatternError for nodes without space for bars."""
    lattice = bar_lattice(graph, member_lattice(graph, stock.bolt), stock.bar, stock.bolt)
    lattice, legless = lattice.with_legs(footing) if footing else (lattice, [])
    nodes = lattice.lattice.nodes
    bars = [bar_part(bar, (nodes[bar.ends[0].node].id, nodes[bar.ends[1].node].id), stock) for bar in lattice.bars]
    plates = [plate_part(joint, lattice, stock) for joint in lattice.joints if joint.node.joined]
    discs = [member for member in graph.members if not becomes_bars(member) and member.kind != "fill"]
    below = -(stock.bar + stock.plate)
    parts = (*bars, *plates, *plate_parts(graph, discs, normals, below, stock.bolt))
    return BarPlan(lattice, stock, parts, tuple(legless))


def _possibility_lines(plan: BarPlan) -> Iterator[str]:
    bars, stock = plan.bar_lattice.bars, plan.stock
    joints = sum(joint.node.joined for joint in plan.bar_lattice.joints)
    yield (
        f"{len(bars)} straight bars of {length(stock.bar)} on {joints} plates of {length(stock.plate)}; the largest "
        f"distance from a bar to the surface is {length(plan.largest_sagitta)} "
        f"({max(bars, key=lambda bar: bar.sagitta).bay.id})"
    )
    if plan.too_short:
        yield (
            f"NOT POSSIBLE: {_names(plan.too_short)} too short for a bolt of {length(stock.bolt)} at each end; set "
            "a smaller workshop.bolt, narrower members, or a larger spacing"
        )
    dips = [(abs(end.dip), bar.bay.id) for bar in bars for end in bar.ends]
    twisted = max(bars, key=lambda bar: abs(bar.twist))
    yield (
        f"node plates are folded by up to {np.degrees(max(dips)[0]):.1f} degrees ({max(dips)[1]}); bars are twisted by "
        f"up to {abs(np.degrees(twisted.twist)):.1f} degrees ({twisted.bay.id}): twist the bars when you bolt them, or "
        "put packing at the ends of the bars"
    )
    yield from _sharp_angles(plan)


def _sharp_angles(plan: BarPlan) -> Iterator[str]:
    bars, stock = plan.bar_lattice.bars, plan.stock
    angle, node, bar_a, bar_b = min(
        (bars[k].ends[side].after, joint.node.id, bars[k].bay.id, bars[neighbour].bay.id)
        for joint in plan.bar_lattice.joints
        for (k, side), (neighbour, _) in zip(joint.bars, (*joint.bars[1:], joint.bars[0]), strict=True)
    )
    if angle < np.pi:
        degrees = f"{np.degrees(angle):.0f} degrees"
        yield f"the smallest angle between two bars at a node is {degrees}, between {bar_a} and {bar_b} at {node}"
    shares = {bar.bay.id: max(mitre_length(bar, end, stock) for end in bar.ends) / bar.length for bar in bars}
    weakened = sorted((name for name, share in shares.items() if share > 0.5), key=lambda name: -shares[name])
    if weakened:
        many = "1 bar loses" if len(weakened) == 1 else f"{len(weakened)} bars lose"
        yield (
            f"{many} more than half of one side to a mitre (an oblique cut), and may be too weak: "
            f"{names_and_count(weakened)}; narrower members would lose less"
        )


def _omission_lines(plan: BarPlan) -> Iterator[str]:
    lattice = plan.bar_lattice.lattice
    joined = [node for node in lattice.nodes if len(node.nodes) > 1]
    if joined:
        farthest = max(joined, key=lambda node: node.moved)
        yield (
            f"{len(joined)} plates each replace several nodes, because bars do not fit between the nodes; the largest "
            f"distance from a plate to its nodes is {length(farthest.moved)} ({farthest.id})"
        )
    if lattice.parallel:
        yield f"{_names(lattice.parallel)} left out, because other bars already join the same nodes"
    if lattice.rings:
        yield f"{_names(lattice.rings)} left out, because a closed member needs at least three nodes for bars"
    ends = [node for node in lattice.nodes if not node.joined]
    if ends:
        yield (
            f"{len(ends)} bars end without a plate, at edges of the surface: "
            f"{names_and_count([node.id for node in ends])}"
        )


def _names(names: tuple[str, ...]) -> str:
    return f"{names_and_count(names)} {'is' if len(names) == 1 else 'are'}"


BAR_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Corners of a bar's six sides, in order as seen from outside.
The number of a corner is a sum: 1 for up, 2 for left, and 4 for the end of the bar."""


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """Part in its position in space. quads : (q, 4, 3) corners of the part's quadrilaterals, metres."""

    id: str
    member: str
    quads: Floats


def bar_body(bar: LatticeBar, stock: BarStock) -> tuple[Floats, Ints]:
    """Return vertices (8, 3) in metres and triangles (12, 3) of a bar with straight ends."""
    d, half = bar.direction, bar.bay.width / 2
    clear = [BAR_CLEARANCE * stock.bolt if end.root else 0.0 for end in bar.ends]
    middles = bar.points + np.array([clear[0], -clear[1]])[:, None] * d
    sideways = np.cross(bar.normals, d)
    sides = np.array([[y * half * sideways + z * stock.bar / 2 * bar.normals for z in (-1, 1)] for y in (-1, 1)])
    V = (middles[:, None, None] + sides.transpose(2, 0, 1, 3)).reshape(8, 3)
    return V, np.concatenate([BAR_QUADS[:, [0, 1, 2]], BAR_QUADS[:, [0, 2, 3]]])


def placed_parts(plan: BarPlan) -> list[PlacedPart]:
    """Return all bars, then all node plates, at their positions in space."""
    lattice, stock = plan.bar_lattice, plan.stock
    bars = [PlacedPart(bar.bay.id, bar.bay.member, bar_body(bar, stock)[0][BAR_QUADS]) for bar in lattice.bars]
    joints = [joint for joint in lattice.joints if joint.node.joined]
    return bars + [PlacedPart(joint.node.id, "", _plate_quads(joint, lattice, stock)) for joint in joints]


def _plate_quads(joint: Joint, lattice: BarLattice, stock: BarStock) -> Floats:
    n, quads = joint.node.normal, list[Floats]()
    middle = joint.node.point - stock.lever * n
    corners = list[tuple[Floats, Floats]]()
    for k, side in joint.bars:
        bar = lattice.bars[k]
        d = bar.direction if side == 0 else -bar.direction
        sideways = np.cross(bar.normals[side], d)
        root, end_distance = bar.points[side] - stock.lever * bar.normals[side], stock.bolt_stations(bar)[1]
        fold = root + np.tan(bar.ends[side].dip / 2) * stock.lever * -d
        across, end = joint.half * sideways, root + end_distance * d
        corners.append((fold - across, fold + across))
        quads.append(np.array([fold - across, end - across, end + across, fold + across]))
    if joint.leg:
        quads += _leg_quads(joint, middle)
    for arm, next_arm in zip(corners, [*corners[1:], corners[0]], strict=True):
        quads.append(np.array([middle, arm[0], arm[1], middle]))
        quads.append(np.array([middle, arm[1], next_arm[0], middle]))
    return np.array(quads)


def _leg_quads(joint: Joint, middle: Floats) -> list[Floats]:
    leg, n = joint.leg, joint.node.normal
    assert leg is not None
    aside = joint.half * np.cross(n, leg.way)
    fold = middle + joint.root * leg.way
    end = fold + leg.length * (np.cos(leg.fold) * leg.way + np.sin(leg.fold) * n)
    leg_itself = np.array([fold - aside, end - aside, end + aside, fold + aside])
    return [leg_itself, np.array([middle, fold - aside, fold + aside, middle])]
