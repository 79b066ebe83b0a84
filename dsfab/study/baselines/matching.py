"""Cutting a competitor until it has the mass that is asked for, to a thousandth."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dsfab.errors import PatternError
from dsfab.pattern import Drawable, Layer
from dsfab.pipeline.geometry import slicing_step
from dsfab.pipeline.log import Log
from dsfab.pipeline.patterns import WidthSearch, solved_layers, striped_families
from dsfab.pipeline.tidying import tidy_of
from dsfab.preset import Preset
from dsfab.results import DiffusionResult, EvenStripes, PatternResult
from dsfab.slicing import material_area
from dsfab.study.baselines.task import ComparisonTask, Structure

SAME_MASS = 1e-3
"""Largest difference in mass, as a share."""

DRAWN = 0.3
"""Share of that for the widths; the rest is for pieces that are dropped and point contacts that are joined."""

ROUNDS = 6
"""How often more is asked for to make up for what is dropped."""

FINE = 0.01
"""Snap fraction of a second try: values that are snapped to a level make the area jump, on coarse meshes by more."""

Drawing = Callable[[ComparisonTask, float, float], Sequence[Layer]]
"""(brief, share of the surface, tolerance) -> what to cut, with that share of material."""


def matched_structure(brief: ComparisonTask, drawing: Drawing) -> Structure:
    """The structure whose sheet, without pieces that reach no support, has the area of the brief.

    Where loose pieces are dropped, more is drawn, so that what carries has the same mass.

    Raises PatternError where the area cannot be met.
    """
    try:
        return _matched(brief, drawing)
    except PatternError:
        slicing = brief.preset.slicing.model_copy(update={"snap": min(FINE, brief.preset.slicing.snap)})
        return _matched(replace(brief, preset=brief.preset.model_copy(update={"slicing": slicing})), drawing)


def _matched(brief: ComparisonTask, drawing: Drawing) -> Structure:
    ask, nearest = brief.share, float("inf")
    for _ in range(ROUNDS):
        made = sliced_structure(brief, drawing(brief, ask, DRAWN * SAME_MASS * brief.share))
        off = made.sheet.surface.area / brief.area - 1
        if abs(off) <= SAME_MASS:
            return made
        nearest = min(nearest, off, key=abs)
        ask -= off * brief.share
        if not 0 < ask < 1:
            break
    raise PatternError(f"falls apart: without its loose pieces its mass is {abs(nearest):.1%} off at the nearest")


def sliced_structure(brief: ComparisonTask, layers: Sequence[Layer]) -> Structure:
    """Layers cut as the preset cuts, without the pieces that reach no support."""
    names, fields, levels, widths, _ = zip(*layers, strict=True)
    slicing = brief.preset.slicing.model_copy(update={"loose": "drop"})
    preset = brief.preset.model_copy(update={"slicing": slicing})
    tidy = tidy_of(preset, brief.stressed, layers)
    pattern = PatternResult(names, fields, levels, widths, tidy=tidy)
    made = slicing_step(preset, brief.surface, brief.statics, pattern, Log(None))
    return Structure(made.cells, names, made.sheet, len(made.pieces), preset.statics.thickness)


def area_share(brief: ComparisonTask, layers: Sequence[Layer]) -> float:
    """The share of the surface that layers make material."""
    fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
    tidy = tidy_of(brief.preset, brief.stressed, layers)
    return material_area(brief.surface, fields, levels, brief.preset.slicing.snap, tidy) / brief.surface.area


def striped_structure(
    brief: ComparisonTask, preset: Preset, diffusion: DiffusionResult, even: EvenStripes | None = None
) -> Structure:
    """Both families of stripes of a preset, as wide as the area of the brief asks: on the modes of `diffusion`, or
    evenly spaced."""
    radius = preset.pattern.width.widths(np.sqrt(brief.surface.area)).radius
    given = replace(brief.stressed, diffusion=diffusion)
    return widened_structure(brief, preset, striped_families(preset, given, radius, even=even))


def widened_structure(brief: ComparisonTask, preset: Preset, families: Sequence[Drawable]) -> Structure:
    """Families of stripes by the width rule of a preset, as wide as the area of the brief asks."""
    factor = 0.0

    def drawing(brief: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
        nonlocal factor
        width = preset.pattern.width.model_copy(update={"solid_fraction": share})
        asked = preset.model_copy(update={"pattern": preset.pattern.model_copy(update={"width": width})})
        search = WidthSearch(lambda layers: area_share(brief, layers), tolerance, factor)
        layers, factor = solved_layers(asked, brief.surface, brief.kept, families, search)
        return layers

    return matched_structure(brief, drawing)
