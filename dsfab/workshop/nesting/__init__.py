"""Nesting of parts on stock sheets: parts lie on the skyline of earlier parts; short parts fill the gaps below it.

A part is stored by its lower and upper edges in narrow columns, each edge moved outwards by half of the gap. Further
trials nest the boxes of parts, or begin with another stock size. The least area or cost wins.

skyline   parts in columns, and sheets with skyline and gaps
sheets    all parts, and fewer sheets by spyrrow"""

from dsfab.workshop.nesting.sheets import NestedSheet, nest_parts, require_spyrrow, stack_parts, with_fewer_sheets
from dsfab.workshop.nesting.skyline import NestedPart

__all__ = ["NestedPart", "NestedSheet", "nest_parts", "require_spyrrow", "stack_parts", "with_fewer_sheets"]
