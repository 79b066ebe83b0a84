"""`BarPlan`: the parts of a design that is built of bars, and what is to be known of it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import MemberGraph
from dsfab.wording import length, some_names
from dsfab.workshop.bars.cutting import BarStock, bar_part, mitre_length, plate_part
from dsfab.workshop.bars.joints import BarLattice, LatticeBar, bar_lattice
from dsfab.workshop.bars.lattice import is_barred, member_lattice
from dsfab.workshop.legs import Footing, leg_lines
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plates import plate_parts

MOST = 0.5
"""Share of a bar's length; bars that lose a side to a neighbour for more of it are named."""


@dataclass(frozen=True, eq=False)
class BarPlan:
    """Bars with their angles, what they are cut from, and all parts: bars, plates of nodes, and discs; and names of
    nodes at supports whose plates have no leg."""

    found: BarLattice
    stock: BarStock
    parts: tuple[FlatPart, ...]
    legless: tuple[str, ...] = ()

    @property
    def loose(self) -> tuple[str, ...]:
        """Names of bars that are too short for a bolt at each end."""
        return tuple(bar.bay.id for bar in self.found.bars if not self.stock.bolts(bar)[0])

    @property
    def strayed(self) -> float:
        """Metres by which bars leave the surface, at most."""
        return max(bar.sagitta for bar in self.found.bars)

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences: what is possible, and what is not."""
        legged = {joint.node.id: joint.leg for joint in self.found.joints if joint.leg}
        return (*_possible(self), *leg_lines([leg.fold for leg in legged.values()], self.legless), *_left_out(self))


def bar_plan(graph: MemberGraph, normals: Floats, stock: BarStock, footing: Footing | None = None) -> BarPlan:
    """The bars, plates and discs of a graph; normals (n, 3) at the vertices of its sheet; with legs where it is held.

    Raises PatternError where nodes are too near to each other for bars.
    """
    found = bar_lattice(graph, member_lattice(graph, stock.bolt), stock.bar, stock.bolt)
    found, legless = found.with_legs(footing) if footing else (found, [])
    nodes = found.lattice.nodes
    bars = [bar_part(bar, (nodes[bar.ends[0].node].id, nodes[bar.ends[1].node].id), stock) for bar in found.bars]
    plates = [plate_part(joint, found, stock) for joint in found.joints if joint.node.joined]
    discs = [member for member in graph.members if not is_barred(member) and member.kind != "fill"]
    below = -(stock.bar + stock.plate)
    parts = (*bars, *plates, *plate_parts(graph, discs, normals, below, stock.bolt))
    return BarPlan(found, stock, parts, tuple(legless))


def _possible(plan: BarPlan) -> Iterator[str]:
    bars, stock = plan.found.bars, plan.stock
    joints = sum(joint.node.joined for joint in plan.found.joints)
    yield (
        f"{len(bars)} straight bars of {length(stock.bar)} on {joints} plates of {length(stock.plate)}; they leave the "
        f"surface by up to {length(plan.strayed)} ({max(bars, key=_sagitta).bay.id})"
    )
    if plan.loose:
        yield (
            f"NOT POSSIBLE: {_names(plan.loose)} too short for a bolt of {length(stock.bolt)} at each end; set "
            "workshop.bolt smaller, make members narrower, or their spacing larger"
        )
    dips = [(abs(end.dip), bar.bay.id) for bar in bars for end in bar.ends]
    twisted = max(bars, key=lambda bar: abs(bar.twist))
    yield (
        f"plates are folded by up to {np.degrees(max(dips)[0]):.1f} degrees ({max(dips)[1]}), and bars turned about "
        f"their length by up to {abs(np.degrees(twisted.twist)):.1f} degrees ({twisted.bay.id}): twisted as they are "
        "bolted, or packed at their ends"
    )
    yield from _sharp_angles(plan)


def _sharp_angles(plan: BarPlan) -> Iterator[str]:
    """Where the sharpest angle is, and which bars lose most of a side to such."""
    bars, stock = plan.found.bars, plan.stock
    angle, node, one, other = min(
        (bars[k].ends[side].after, joint.node.id, bars[k].bay.id, bars[beside].bay.id)
        for joint in plan.found.joints
        for (k, side), (beside, _) in zip(joint.bars, (*joint.bars[1:], joint.bars[0]), strict=True)
    )
    if angle < np.pi:
        told = f"is {np.degrees(angle):.0f} degrees, of {one} and {other} at {node}"
        yield f"the sharpest angle between two bars of a node {told}"
    shares = {bar.bay.id: max(mitre_length(bar, end, stock) for end in bar.ends) / bar.length for bar in bars}
    most = sorted((name for name, share in shares.items() if share > MOST), key=lambda name: -shares[name])
    if most:
        many = "1 bar loses" if len(most) == 1 else f"{len(most)} bars lose"
        yield (
            f"{many} a side for more than half of the length to a "
            f"neighbour at a sharp angle, and may be too weak: {some_names(most)}; "
            "narrower members lose less"
        )


def _sagitta(bar: LatticeBar) -> float:
    return bar.sagitta


def _left_out(plan: BarPlan) -> Iterator[str]:
    lattice = plan.found.lattice
    joined = [node for node in lattice.nodes if len(node.nodes) > 1]
    if joined:
        farthest = max(joined, key=lambda node: node.moved)
        yield (
            f"{len(joined)} plates stand for several nodes each, which are nearer to each other than a bar is long: "
            f"up to {length(farthest.moved)} from where these are ({farthest.id})"
        )
    if lattice.parallel:
        yield f"{_names(lattice.parallel)} left out, beside other bars between the same nodes"
    if lattice.rings:
        yield f"{_names(lattice.rings)} left out: closed, with fewer than three nodes"
    ends = [node for node in lattice.nodes if not node.joined]
    if ends:
        yield f"{len(ends)} bars end without a plate, at edges of the surface: {some_names([node.id for node in ends])}"


def _names(names: tuple[str, ...]) -> str:
    """'A01.2 and 3 others are'."""
    return f"{some_names(names)} {'is' if len(names) == 1 else 'are'}"
