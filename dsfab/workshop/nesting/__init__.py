"""Nesting (arrangement) of parts on stock sheets.

skyline   parts in columns, and sheets with their skyline (upper edge of earlier parts)
sheets    nesting of all parts, and a search for fewer sheets"""

from dsfab.workshop.nesting.sheets import NestedSheet, nest_parts, require_spyrrow, stack_parts, with_fewer_sheets
from dsfab.workshop.nesting.skyline import NestedPart

__all__ = ["NestedPart", "NestedSheet", "nest_parts", "require_spyrrow", "stack_parts", "with_fewer_sheets"]
