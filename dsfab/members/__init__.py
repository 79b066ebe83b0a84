"""The members of a design: named parts of the sheet, and the nodes where members meet.

axes         middle lines of stripes, smooth axes and widths of members
components   parts of the stripes that become members
loose_cells  mesh faces outside of all stripes, and strips along a rim
graph        overlaps of members, and nodes; `MemberGraph`
assembly     order and names of members; `member_graph`"""

from dsfab.members.assembly import member_graph, spherical_normals
from dsfab.members.axes import MemberAxis
from dsfab.members.components import cells_by_stripes
from dsfab.members.graph import Member, MemberGraph, Node

__all__ = ["Member", "MemberAxis", "MemberGraph", "Node", "cells_by_stripes", "member_graph", "spherical_normals"]
