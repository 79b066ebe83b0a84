"""Workshop: members as flat parts to cut from sheets, with bolts, splices and names, nested on the stock.

plan          the whole plan: `workshop_plan`           files      drawings and cut lists
development   strips developed into the plane           layers     height of each family over the surface
strips        parts and limits of strips                splices    divisions of long strips
plates        discs, and flat designs in pieces         parts      flat parts and engraved letters
card_models   models in card                            ground     feet and base plates of models
bars          straight bars on node plates              planks     upright planks with slots
nesting       parts on sheets                           stock      prices and hints
bodies        built members as bodies in space"""

from dsfab.workshop.bars import BAR_CLEARANCE, PlateArm, placed_parts, plate_arms
from dsfab.workshop.bodies import RefoldedPlan, RefoldedStrip, built_shapes, refolded_plan
from dsfab.workshop.development import Development, StripCourse, member_course
from dsfab.workshop.files import (
    bar_table,
    cut_list,
    cut_list_workbook,
    drawing_files,
    file_stem,
    node_table,
    write_workshop,
)
from dsfab.workshop.layers import Layering
from dsfab.workshop.nesting import NestedPart, NestedSheet, nest_parts
from dsfab.workshop.parts import FlatPart, Hole, half_plane_clip
from dsfab.workshop.plan import WorkshopPlan, workshop_plan
from dsfab.workshop.planks import PlankPlan, PlankStock, plank_plan
from dsfab.workshop.plates import SheetJoint, layer_numbers, sheet_parts
from dsfab.workshop.stock import money, stock_cost, stock_words
from dsfab.workshop.strips import StripLimits, StripParts, is_strip, strip_limits, strip_parts

__all__ = [
    "BAR_CLEARANCE", "Development", "FlatPart", "Hole", "Layering", "NestedPart", "NestedSheet", "PlankPlan",
    "PlankStock", "PlateArm", "RefoldedPlan", "RefoldedStrip", "SheetJoint", "StripCourse", "StripLimits",
    "StripParts", "WorkshopPlan", "bar_table", "built_shapes", "cut_list", "cut_list_workbook", "drawing_files",
    "file_stem", "half_plane_clip", "is_strip", "layer_numbers", "member_course", "money", "nest_parts",
    "node_table", "placed_parts", "plank_plan", "plate_arms", "refolded_plan", "sheet_parts", "stock_cost",
    "stock_words", "strip_limits", "strip_parts", "workshop_plan", "write_workshop",
]  # fmt: skip
