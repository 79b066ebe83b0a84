"""Structures of straight bars between nodes, bolted on folded plates.

lattice   nodes, and the parts of members between nodes (bays)      joints   bars in space, and their angles
cutting   bars and plates as flat parts                             plan     the whole plan: `bar_plan`"""

from dsfab.workshop.bars.cutting import BarStock, PlateArm, plate_arms
from dsfab.workshop.bars.lattice import BAR_CLEARANCE
from dsfab.workshop.bars.plan import BarPlan, bar_body, bar_plan, placed_parts

__all__ = ["BAR_CLEARANCE", "BarPlan", "BarStock", "PlateArm", "bar_body", "bar_plan", "placed_parts", "plate_arms"]
