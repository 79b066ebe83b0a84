"""The workshop: members as flat parts to cut from sheets, with bolts, splices and names, nested on the stock.

course, development   an axis laid open, and a layer over it rolled out    layering   which family lies how high
strips, splices       parts of lying strips                                plates, sheet   discs; flat designs
parts, letters        what is cut and engraved                             limits     what can be bent and drilled
model, ground, base   models in card, with feet in a plate
nesting, hints        parts on sheets; what would save some               prices     what these cost
plan                  all of it: `workshop_plan`
bars                  straight bars between nodes, on plates             planks     upright ones, in slots
routes                which way it is built, and why
refolding, built      strips bent back into space; members as bodies of their parts
drawings, tables      outlines, cut lists                              files      all that a workshop opens
"""

from dsfab.workshop.bars import CLEAR, PlateArm, half_plane_clip, placed_parts, plate_arms
from dsfab.workshop.bodies import RefoldedPlan, RefoldedStrip, built_shapes, refolded
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
from dsfab.workshop.nesting import NestedPart, NestedSheet, nested
from dsfab.workshop.parts import FlatPart, Hole
from dsfab.workshop.plan import WorkshopPlan, workshop_plan
from dsfab.workshop.planks import PlankPlan, PlankStock, plank_plan
from dsfab.workshop.plates import SheetJoint, layer_numbers, sheet_parts
from dsfab.workshop.stock import money, stock_cost, stock_words
from dsfab.workshop.strips import StripLimits, StripParts, is_strip, strip_limits, strip_parts

__all__ = [
    "CLEAR",
    "Development",
    "FlatPart",
    "Hole",
    "Layering",
    "NestedPart",
    "NestedSheet",
    "PlankPlan",
    "PlankStock",
    "PlateArm",
    "RefoldedPlan",
    "RefoldedStrip",
    "SheetJoint",
    "StripCourse",
    "StripLimits",
    "StripParts",
    "WorkshopPlan",
    "bar_table",
    "built_shapes",
    "cut_list",
    "cut_list_workbook",
    "drawing_files",
    "file_stem",
    "half_plane_clip",
    "is_strip",
    "layer_numbers",
    "member_course",
    "money",
    "nested",
    "node_table",
    "placed_parts",
    "plank_plan",
    "plate_arms",
    "refolded",
    "sheet_parts",
    "stock_cost",
    "stock_words",
    "strip_limits",
    "strip_parts",
    "workshop_plan",
    "write_workshop",
]
