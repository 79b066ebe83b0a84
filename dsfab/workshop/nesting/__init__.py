"""Nesting (arrangement) of parts on stock sheets: above the upper edge (skyline) of earlier parts, or in gaps below.

Sheets are divided into narrow columns. A part is stored as the heights of its lower and upper edge in each column,
moved outwards by half of the gap between parts. Further trials nest the boxes of parts, or begin with another stock
size. The least area or cost wins.
skyline   parts in columns, and sheets with skyline and gaps
sheets    nesting of all parts, and a search for fewer sheets with the package spyrrow"""

from dsfab.workshop.nesting.sheets import NestedSheet, nest_parts, require_spyrrow, stack_parts, with_fewer_sheets
from dsfab.workshop.nesting.skyline import NestedPart

__all__ = ["NestedPart", "NestedSheet", "nest_parts", "require_spyrrow", "stack_parts", "with_fewer_sheets"]
