"""Structures of upright planks: they stand on the surface, along its normals, and are halved where they cross.

slots     where planks cross, and what is cut out of both      outline   of a plank, with its slots and ends
ways      on which way a piece is put on                       plank     one of them, divided, with ends and covers
sawing    all of them as flat parts                            found     what is known of these parts
plan      all of it: `plank_plan`
"""

from dsfab.workshop.planks.plan import PlankPlan, plank_courses, plank_parts, plank_plan, upright
from dsfab.workshop.planks.plank import PlankStock
from dsfab.workshop.planks.slots import ORDER, Crossing, PlankParts, Slot, plank_crossings, slot_width, standing_order

__all__ = [
    "ORDER",
    "Crossing",
    "PlankParts",
    "PlankPlan",
    "PlankStock",
    "Slot",
    "plank_courses",
    "plank_crossings",
    "plank_parts",
    "plank_plan",
    "slot_width",
    "standing_order",
    "upright",
]
