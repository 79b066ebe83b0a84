"""Parts on stock sheets: strips of like bend lie in each other, piled up on the skyline of what is there already; what
is short goes into the gaps between them.

A part is known by its lower and its upper edge in narrow columns, both widened by half of the gap all around: wherever
two such shapes do not overlap, the parts are a gap apart. The columns take the extreme values within them, so that they
never take less room than there is. The same parts by their boxes are tried too, and each size of stock first: the
fewest square metres win, so boxes never need fewer.

columns   a part in columns      filling   a sheet with its skyline and its gaps      sheets   all parts: `nested`
emptying, spyrrow_program   fewer sheets by a solver, if one likes      clearance   what it says is measured by this
"""

from dsfab.workshop.nesting.sheets import NestedSheet, emptied, nested, require_spyrrow, stacked
from dsfab.workshop.nesting.skyline import NestedPart

__all__ = ["NestedPart", "NestedSheet", "emptied", "nested", "require_spyrrow", "stacked"]
