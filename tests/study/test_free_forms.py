"""Free-form roofs of others at equal mass: evenly spaced stripes of each width rule, against the stiffest modes."""

from functools import cache
from typing import NamedTuple

import pytest

from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.design.even_stripes import even_stripes
from dsfab.design.mode_search import stressed_step
from dsfab.design.stripe_pattern import drawable_families
from dsfab.preset.file import load_preset, with_overrides
from dsfab.preset.model import Preset
from dsfab.results import Log
from dsfab.study.baselines import ComparisonTask
from dsfab.study.baselines.structures import striped_structure, widened_structure
from dsfab.study.judges import quick
from tests.meshes import mesh_file
from tests.presets import ROOF_MODES

SHARE = 0.5

pytestmark = pytest.mark.slow


class Modes(NamedTuple):
    """What `auto` chose on a mesh: modes and phases of the major and of the minor stripes."""

    file: str
    mode: tuple[int, int]
    phase: tuple[float, float]


BOTANIC = Modes("Botanic.obj", (3, 3), (0.0625, 0.25))
OPENING = Modes("roof_with_opening.obj", (2, 1), (0.0, 0.875))


@cache
def on_modes(chosen: Modes) -> Design:
    """The roof on these."""
    given = {"surface.file": str(mesh_file(chosen.file)), "surface.unit": "m"}
    for k, name in enumerate(("major", "minor")):
        given |= {f"pattern.{name}.mode": chosen.mode[k], f"pattern.{name}.phase": chosen.phase[k]}
    return draft(load_preset(ROOF_MODES, given))


def task_of(made: Design, preset: Preset, even=None) -> ComparisonTask:
    frequency, area = made.pattern.frequency, SHARE * made.surface.area
    return ComparisonTask(preset, made.surface, made.statics, made.diffusion, frequency, area, even)


@cache
def modes(chosen: Modes) -> float:
    """Joules of the better width rule."""
    made = on_modes(chosen)
    found = []
    for rule in ("constant", "graded"):
        own = with_overrides(made.resolved_preset, {"pattern.width.rule": rule})
        task = task_of(made, own)
        found.append(quick(task, striped_structure(task, own, made.diffusion)).compliance)
    return min(found)


@cache
def evenly(chosen: Modes, halve: bool, rule: str, q: float) -> float:
    """Joules of evenly spaced stripes, in the mean as far apart as those on modes."""
    made = on_modes(chosen)
    surface, statics, diffusion = made.surface, made.statics, made.diffusion
    own = made.resolved_preset
    families = drawable_families(own, made.analysis)
    spacing = [surface.area / float(surface.vertex_areas @ family.slope) for family in families]
    apart = {f"pattern.{name}.spacing": h for name, h in zip(("major", "minor"), spacing, strict=True)}
    width = {"pattern.width.rule": rule, "pattern.width.q": q}
    own = with_overrides(own, {"pattern.method": "stripes", "pattern.halve": halve, **apart, **width})
    even = even_stripes(own, surface, statics)
    task = task_of(made, own, even)
    if rule != "stressed":
        structure = striped_structure(task, own, diffusion, even)
    else:
        grading = stressed_step(own, made.analysis, Log(None), even=even)
        structure = widened_structure(task, own, drawable_families(own, made.analysis, 0.0, grading, even))
    assert structure.sheet.surface.area == pytest.approx(task.area, rel=1e-3)
    return quick(task, structure).compliance


@pytest.mark.parametrize(
    ("chosen", "halve", "rule", "most"),
    [
        (BOTANIC, True, "graded", 0.20),  # recorded: 0.190
        (BOTANIC, True, "stressed", 0.20),  # 0.161 to 0.187: one filled opening more makes this difference
        (OPENING, False, "stressed", 0.78),  # 0.757: under its own weight alone what is wider is heavier too
    ],
)
def test_evenly_spaced_stripes_are_stiffer_than_the_stiffest_modes(chosen, halve, rule, most):
    assert evenly(chosen, halve, rule, 0.5) < most * modes(chosen)


def test_widths_by_the_root_of_the_stress_are_stiffer_than_linear_or_equal_widths():
    """Why `auto` tries them: 3.1, 1.8 and 2.5 times the uncut sheet, which is heavier."""
    gentle = evenly(BOTANIC, True, "graded", 0.5)
    assert gentle < 0.75 * evenly(BOTANIC, True, "constant", 1.0)
    assert gentle < 0.75 * evenly(BOTANIC, True, "graded", 1.0)
