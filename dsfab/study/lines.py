"""The lines of a design: what an architect draws of it."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.lines import centre_lines, edge_lines
from dsfab.study.finished import Finished
from dsfab.surface.lines import Line, simplified

FULL = 0.5
"""Half-width in periods at which the stripes of a family touch everywhere: one sheet, without members."""


def design_lines(design: Finished, tolerance: float = 0.0) -> tuple[Line, ...]:
    """Edges of the kept sheet by family, then the middles of its members; metres, on the middle surface.

    tolerance : metres that points left out may be off the polylines; lengths are those of all points.
    A family whose stripes are nowhere, or touch everywhere, has no middles.
    """
    pattern = design.pattern
    phases = [stripe_phase(design, k) for k in range(len(pattern.names))]
    lines = edge_lines(design.sheet, design.surface, pattern.names, phases)
    for name, z, d in zip(pattern.names, phases, pattern.half_widths, strict=True):
        if z is not None and (d > 0).any() and (d < FULL).any():
            lines += centre_lines(design.sheet, name, z, d)
    return tuple(replace(line, points=simplified(line.points, tolerance)) for line in lines)


def stripe_phase(design: Finished, k: int) -> Floats | None:
    """z (n,) of field k, whose integers are the middles of its stripes; None for a field that draws none."""
    pattern = design.pattern
    field = pattern.fields[k]
    if pattern.names[k] not in ("major", "minor"):
        return None
    if field.ndim == 2:
        return np.asarray(field.mean(axis=1))
    which = ("major", "minor").index(pattern.names[k])
    return np.asarray(pattern.frequency[which] * field + pattern.phase[which])
