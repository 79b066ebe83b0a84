"""The lines of a design: what an architect draws of it."""

from dataclasses import replace

import numpy as np

from dsfab.pipeline.design import Design
from dsfab.slicing.lines import STRIPES, CornerLines, Phase, centre_lines, chart_lines, edge_lines
from dsfab.surface import StructureLine, simplified_line
from dsfab.surface.corner_field import CornerField

FULL = 0.5
"""Half-width in periods at which the stripes of a family touch everywhere: one sheet, without members."""


def design_lines(design: Design, tolerance: float = 0.0) -> tuple[StructureLine, ...]:
    """Edges of the kept sheet by family, then the middles of its members; metres, on the middle surface.

    tolerance : metres that points left out may be off the polylines; lengths are those of all points.
    A family whose stripes are nowhere, or touch everywhere, has no middles.
    """
    pattern, sheet, surface = design.pattern, design.sheet, design.surface
    phases = [stripe_phase(design, k) for k in range(len(pattern.names))]
    lines = edge_lines(sheet, surface, pattern.names, phases)
    half_widths = dict(zip(pattern.names, pattern.half_widths, strict=True))  # alike where a family has several
    for k, name in enumerate(pattern.names):
        z, d = phases[k], half_widths[name]
        if z is None or pattern.names.index(name) < k or not ((d > 0).any() and (d < FULL).any()):
            continue
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            lines += chart_lines(sheet, surface, pattern.names, name, pattern.even.chart, d)
        else:
            lines += centre_lines(sheet, name, z, d)
    return tuple(replace(line, points=simplified_line(line.points, tolerance)) for line in lines)


def stripe_phase(design: Design, k: int) -> Phase:
    """Whose integers are the middles of the stripes of field k: z (n,), or that at corners where no value at a vertex
    serves; None for a field that draws none."""
    pattern = design.pattern
    field = pattern.fields[k]
    if pattern.names[k] not in STRIPES:
        return None
    if isinstance(field, CornerField):
        return CornerLines(field, pattern.levels[k])
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return np.asarray(field.mean(axis=1))
    which = STRIPES.index(pattern.names[k])
    return np.asarray(pattern.frequency[which] * field + pattern.phase[which])
