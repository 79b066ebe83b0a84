"""The competitor that knows the compliance: topology optimisation, its densities cut along a level line."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import PatternError
from dsfab.pattern import Layer, solved_factor, vertex_means
from dsfab.study.baselines.matching import area_share, matched_structure
from dsfab.study.baselines.task import ComparisonTask, Structure, Variant
from dsfab.study.simp import Densities, Simp, densities


def simp(task: ComparisonTask) -> list[Variant]:
    """Densities of the same area by SIMP, cut where they exceed the value that gives that area; see `free_task`."""
    free = free_task(task)
    return [Variant("", lambda: _cut(free, optimised_densities(free)))]


def free_task(task: ComparisonTask, ask: Simp | None = None) -> ComparisonTask:
    """The task with nothing kept but what is drawn and discs around loads and supports as large as the filter reaches.

    An optimiser that had to keep the rim of a preset would spend its material as the preset does, and be as good or bad
    as that: on an L-bracket at 30 % of the material 3.2 or 5.0 times as soft as the whole plate.
    """
    radius = (ask or Simp()).filter_radius(task.surface)
    return replace(task, preset=task.preset.with_pattern(keep=radius, rim=0.0))


def optimised_densities(task: ComparisonTask, ask: Simp | None = None) -> Densities:
    """The densities of faces for the area, loads and kept regions of a task; they weigh what that area does."""
    statics, weights = task.preset.statics, task.preset.followed
    sheet = statics.sheet().on(task.surface)
    loads = {name: load.of_thickness(task.surface, task.share) for name, load in task.loads.items()}
    return densities(sheet, loads, task.area, task.kept_faces, weights, ask)


def level_line(task: ComparisonTask, density: Floats) -> Structure:
    """The structure where densities of faces (m,), averaged around the vertices, exceed one value."""
    return matched_structure(task, partial(_drawing, vertex_means(task.surface, density)))


def _cut(task: ComparisonTask, found: Densities) -> Structure:
    """`level_line`; where it falls apart, the reason tells how much was left grey."""
    try:
        return level_line(task, found.density)
    except PatternError as error:
        raise PatternError(
            f"{error}; SIMP left {found.grey(task.surface):.0%} of the area neither void nor material"
        ) from None


def _drawing(field: Floats, task: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
    """What is kept, and where a field (n,) exceeds the value that makes `share` of the surface material."""
    high, low = float(field.max()), float(field.min())
    margin = 1e-3 * (high - low)
    every = np.full(task.surface.n, np.inf)

    def layers(depth: float) -> list[Layer]:
        level = high + margin - depth * (high - low + 2 * margin)
        return [*task.kept, Layer("simp", field, np.array([level]), every)]

    return layers(solved_factor(lambda depth: area_share(task, layers(depth)), share, tolerance))
