"""Cutting a competitor until it has the mass that is asked for, to a thousandth."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dsfab.errors import PatternError
from dsfab.pattern import JUMP, Drawable, Layer
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
"""(task, share of the surface, tolerance) -> what to cut, with that share of material."""


def matched_structure(task: ComparisonTask, drawing: Drawing) -> Structure:
    """The structure whose sheet, without pieces that reach no support, has the area of the task.

    Where loose pieces are dropped, more is drawn, so that what carries has the same mass.

    Raises PatternError where the area cannot be met.
    """
    try:
        return _matched(task, drawing)
    except PatternError:
        slicing = task.preset.slicing.model_copy(update={"snap": min(FINE, task.preset.slicing.snap)})
        return _matched(replace(task, preset=task.preset.model_copy(update={"slicing": slicing})), drawing)


def _matched(task: ComparisonTask, drawing: Drawing) -> Structure:
    ask, nearest = task.share, float("inf")
    for _ in range(ROUNDS):
        made = sliced_structure(task, drawing(task, ask, DRAWN * SAME_MASS * task.share))
        off = made.sheet.surface.area / task.area - 1
        if abs(off) <= SAME_MASS:
            return made
        nearest = min(nearest, off, key=abs)
        ask -= off * task.share
        if not 0 < ask < 1:
            break
    raise PatternError(f"falls apart: without its loose pieces its mass is {abs(nearest):.1%} off at the nearest")


def sliced_structure(task: ComparisonTask, layers: Sequence[Layer]) -> Structure:
    """Layers cut as the preset cuts, without the pieces that reach no support; nothing is added to the mass that they
    are drawn with."""
    names, fields, levels, widths, _ = zip(*layers, strict=True)
    slicing = task.preset.slicing.model_copy(update={"loose": "drop"})
    preset = task.preset.with_pattern(workshop=False).model_copy(update={"slicing": slicing})
    tidy = tidy_of(preset, task.stressed, layers)
    pattern = PatternResult(names, fields, levels, widths, tidy=tidy)
    made = slicing_step(preset, task.surface, task.statics, pattern, Log(None))
    return Structure(made.cells, names, made.sheet, len(made.pieces), preset.statics.thickness)


def area_share(task: ComparisonTask, layers: Sequence[Layer]) -> float:
    """The share of the surface that layers make material."""
    fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
    tidy = tidy_of(task.preset, task.stressed, layers)
    return material_area(task.surface, fields, levels, task.preset.slicing.snap, tidy) / task.surface.area


def striped_structure(
    task: ComparisonTask, preset: Preset, diffusion: DiffusionResult, even: EvenStripes | None = None
) -> Structure:
    """Both families of stripes of a preset, as wide as the area of the task asks: on the modes of `diffusion`, or
    evenly spaced."""
    radius = preset.pattern.width.widths(np.sqrt(task.surface.area)).radius
    task = replace(task, diffusion=diffusion)
    return widened_structure(task, preset, striped_families(preset, task.stressed, radius, even=even))


def widened_structure(task: ComparisonTask, preset: Preset, families: Sequence[Drawable]) -> Structure:
    """Families of stripes by the width rule of a preset, as wide as the area of the task asks.

    What leads nowhere is taken off if that preset asks for it, and not since the design is tidied: stripes that do not
    follow its stress all go astray of it.
    """
    task, factor = replace(task, preset=preset), 0.0

    def drawing(task: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
        nonlocal factor
        # what a preset allows its own share is not allowed here: masses are compared below
        update = {"solid_fraction": share, "solid_fraction_tolerance": JUMP}
        width = preset.pattern.width.model_copy(update=update)
        asked = preset.model_copy(update={"pattern": preset.pattern.model_copy(update={"width": width})})
        search = WidthSearch(lambda layers: area_share(task, layers), tolerance, factor)
        layers, factor = solved_layers(asked, task.surface, task.kept, families, search)
        return layers

    return matched_structure(task, drawing)
