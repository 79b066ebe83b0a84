"""Evenly spaced stripes on a free-form canopy with two openings, against stripes on modes of equal mass."""

from pathlib import Path

import numpy as np
import pytest

import dsfab
from dsfab.design import draft
from dsfab.design.even_stripes import even_stripes
from dsfab.design.stripe_pattern import drawable_families
from dsfab.preset.file import load_preset, with_overrides
from dsfab.study.baselines import ComparisonTask
from dsfab.study.baselines.structures import striped_structure
from dsfab.study.judges import quick
from tests.canopy import canopy

PRESET = Path(__file__).parents[2] / "docs" / "examples" / "canopy.toml"
SHARE = 0.45


def test_the_mesh_of_the_gallery_is_the_one_that_is_described():
    made, shipped = canopy(), dsfab.read_surface(PRESET.with_name("canopy.obj"), "m")
    assert (made.F == shipped.F).all()
    assert np.abs(made.V - shipped.V).max() < 1e-4


@pytest.mark.slow
def test_at_equal_mass_and_spacing_they_are_over_twice_as_stiff():
    """Recorded: 0.468 halved, the default; 0.485 free."""
    preset = with_overrides(load_preset(PRESET), {"pattern.method": "modes"})
    made = draft(preset)
    surface, statics, diffusion = made.surface, made.statics, made.diffusion
    families = drawable_families(preset, made.analysis)
    spacing = [surface.area / float(surface.vertex_areas @ family.slope) for family in families]
    apart = {f"pattern.{name}.spacing": h for name, h in zip(("major", "minor"), spacing, strict=True)}
    found = {}
    for halve in (None, True):
        even, own = None, made.pattern.preset_with_choices(preset)
        if halve:
            own = with_overrides(preset, {"pattern.method": "stripes", "pattern.halve": halve, **apart})
            even = even_stripes(own, surface, statics)
        task = ComparisonTask(own, surface, statics, diffusion, made.pattern.frequency, SHARE * surface.area, even)
        structure = striped_structure(task, own, diffusion, even)
        assert structure.sheet.surface.area == pytest.approx(task.area, rel=1e-3)
        found[halve] = quick(task, structure).compliance
    assert found[True] < 0.48 * found[None]


@pytest.mark.slow
def test_no_member_ends_in_the_air_and_none_has_a_tooth():
    design = dsfab.run(load_preset(PRESET))
    cells = design.slicing.cells
    turn = cells.walls.turns
    assert np.degrees(-turn[np.isfinite(turn)].min()) < 60  # 98 with a tooth of 6 cm at the rim of an opening
    quality = design.quality()
    assert len(design.slicing.pieces) == 1
    assert quality.dead_ends == 0
    assert quality.slits == 0
    assert quality.crossing_angle > 40
