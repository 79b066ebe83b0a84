"""Structures of straight bars between nodes, bolted on folded plates.

lattice   nodes of a graph of members, and the bays between them    joints   bars in space, and their angles
cutting   bars and plates as flat parts                             plan     the whole plan: `bar_plan`"""

from dsfab.workshop.bars.cutting import BarStock, PlateArm, bar_part, mitre_length, plate_arms, plate_part
from dsfab.workshop.bars.joints import BarEnd, BarLattice, Joint, LatticeBar, bar_lattice
from dsfab.workshop.bars.lattice import BAR_CLEARANCE, Bay, Lattice, LatticeNode, member_lattice
from dsfab.workshop.bars.plan import BarPlan, PlacedPart, bar_body, bar_plan, placed_parts

__all__ = [
    "BAR_CLEARANCE", "BarEnd", "BarLattice", "BarPlan", "BarStock", "Bay", "Joint", "Lattice", "LatticeBar",
    "LatticeNode", "PlacedPart", "PlateArm", "bar_body", "bar_lattice", "bar_part", "bar_plan", "member_lattice",
    "mitre_length", "placed_parts", "plate_arms", "plate_part",
]  # fmt: skip
