"""The members of a design: named parts of its finished sheet with axes, and the nodes at which they meet.

bands                      what the fields of a pattern draw; that none hides another is
`dsfab.slicing.measures.overlay`'s work
middle_lines, components   the middle line and the cells of each member    loose    what lies in no stripe
axis, widths               a smooth curve with its curvatures, and how far the member reaches to both sides of it
following                  strips that run into a rim and follow it end there
overlaps, nodes            where members cross, and what they end at       order, naming   names that a person reads
graph, assembly            all of it together: `Design.members`    regions   the cells by the stripes they lie in
"""

from dsfab.members.assembly import member_graph, spherical_normals
from dsfab.members.axes import MemberAxis
from dsfab.members.components import StripedCells, striped_cells
from dsfab.members.graph import Member, MemberGraph, Node

__all__ = [
    "Member",
    "MemberAxis",
    "MemberGraph",
    "Node",
    "StripedCells",
    "member_graph",
    "spherical_normals",
    "striped_cells",
]
