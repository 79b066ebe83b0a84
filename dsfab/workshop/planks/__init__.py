"""Structures of planks that stand upright on the surface. Where planks cross, both have slots to half their depth.

slots   crossings of planks, and their slots    plank   a plank with its pieces, ends and cover plates
plan    the whole plan: `plank_plan`"""

from dsfab.workshop.planks.plan import PlankPlan, plank_courses, plank_plan, upright_course
from dsfab.workshop.planks.plank import PlankStock
from dsfab.workshop.planks.slots import standing_order

__all__ = ["PlankPlan", "PlankStock", "plank_courses", "plank_plan", "standing_order", "upright_course"]
