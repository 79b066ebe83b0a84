"""Structures of planks that stand upright on the surface.
slots   crossings of planks
plank   a plank with pieces, ends and cover plates
plan    the whole plan"""

from dsfab.workshop.planks.plan import PlankPlan, plank_courses, plank_plan, upright_course
from dsfab.workshop.planks.plank import PlankStock
from dsfab.workshop.planks.slots import standing_order

__all__ = ["PlankPlan", "PlankStock", "plank_courses", "plank_plan", "standing_order", "upright_course"]
