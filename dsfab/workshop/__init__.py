"""Workshop: members as flat parts to cut from sheets.

plan          the whole plan: `workshop_plan`           files      drawings and cut lists
development   strips developed into the plane           layers     height of each family over the surface
strips        parts and limits of strips                splices    divisions of long strips
plates        discs, and flat designs in pieces         parts      flat parts and engraved letters
card_models   models in card                            ground     feet and base plates of models
bars          straight bars on node plates              planks     upright planks with slots
nesting       parts on sheets                           stock      prices and hints
bodies        built members as bodies in space"""

from dsfab.workshop.bars import BAR_CLEARANCE, PlateArm, placed_parts, plate_arms
from dsfab.workshop.bodies import RefoldedStrip, built_shapes, refolded_plan
from dsfab.workshop.files import bar_table, drawing_files, file_stem, node_table, write_workshop
from dsfab.workshop.layers import Layering
from dsfab.workshop.nesting import NestedSheet
from dsfab.workshop.parts import FlatPart, half_plane_clip
from dsfab.workshop.plan import WorkshopPlan, workshop_plan
from dsfab.workshop.plates import layer_numbers
from dsfab.workshop.stock import money, stock_cost, stock_words
from dsfab.workshop.strips import is_strip

__all__ = [
    "BAR_CLEARANCE", "FlatPart", "Layering", "NestedSheet", "PlateArm", "RefoldedStrip", "WorkshopPlan", "bar_table",
    "built_shapes", "drawing_files", "file_stem", "half_plane_clip", "is_strip", "layer_numbers", "money", "node_table",
    "placed_parts", "plate_arms", "refolded_plan", "stock_cost", "stock_words", "workshop_plan", "write_workshop",
]  # fmt: skip
