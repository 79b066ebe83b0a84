"""The workshop: members as flat parts to cut from sheets, with bolts, splices and names, nested on the stock.

course, development   an axis laid open, and a layer over it rolled out    layering   which family lies how high
strips, splices       parts of lying strips                                parts, letters   what is cut and engraved
"""

from dsfab.workshop.course import StripCourse, member_course
from dsfab.workshop.development import Development
from dsfab.workshop.layering import Layering
from dsfab.workshop.parts import FlatPart, Hole
from dsfab.workshop.strips import StripParts, strip_parts

__all__ = [
    "Development",
    "FlatPart",
    "Hole",
    "Layering",
    "StripCourse",
    "StripParts",
    "member_course",
    "strip_parts",
]
