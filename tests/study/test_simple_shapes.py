"""Evenly spaced stripes on simple shapes, against stripes on modes of equal mass and mean spacing, judged quickly."""

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
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.baselines.structures import striped_structure, widened_structure
from dsfab.study.judges import quick
from tests.meshes import mesh_file
from tests.presets import BARREL_VAULT_MODES, DOME_MODES, GLOBE_MODES, ROOF_MODES


class Reached(NamedTuple):
    """A preset on modes, how compliant stripes are at most over it, at 50 and 30 %, and edges in metres, or its own."""

    preset: str
    most: tuple[float, float]
    mesh: str = ""
    edge: float = 0.0


RECORDED = {
    "dome": Reached(DOME_MODES, (0.82, 0.80)),  # 0.807, 0.789
    "globe": Reached(GLOBE_MODES, (0.31, 0.21), edge=0.1),  # 0.296, 0.202; on the preset's own mesh 0.432, 0.327
    "vault": Reached(BARREL_VAULT_MODES, (0.87, 0.84)),  # 0.852, 0.826
    "hypar": Reached(ROOF_MODES, (0.98, 0.99), "hypar.obj"),  # 0.967, 0.976
}


@cache
def drafted(path: str, mesh: str, edge: float) -> Design:
    """A preset on modes: the dome's is looked at by three tests."""
    keys = {"surface.file": str(mesh_file(mesh)), "surface.refine": 0.25, "surface.smooth": True} if mesh else {}
    keys |= {"surface.edge": edge} if edge else {}
    return draft(with_overrides(load_preset(path), keys))


def striped_alike(made: Design) -> Preset:
    """A preset on modes, on stripes of the same mean spacings."""
    surface = made.surface
    families = drawable_families(made.resolved_preset, made.analysis)
    spacing = [surface.area / float(surface.vertex_areas @ family.slope) for family in families]
    apart = {f"pattern.{name}.spacing": h for name, h in zip(("major", "minor"), spacing, strict=True)}
    return with_overrides(made.resolved_preset, {"pattern.method": "stripes", **apart})


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDED)
def test_stiffness_over_modes_agrees_with_the_recorded_values(name):
    path, most, mesh, edge = RECORDED[name]
    made = drafted(path, mesh, edge)
    base, surface, own = made.resolved_preset, made.surface, striped_alike(made)
    even = even_stripes(own, surface, made.statics)
    for share, limit in zip((0.5, 0.3), most, strict=True):
        compliance = []
        for preset, stripes in ((own, even), (base, None)):
            shared = surface, made.statics, made.diffusion, made.pattern.frequency
            task = ComparisonTask(preset, *shared, share * surface.area, stripes)
            compliance.append(quick(task, striped_structure(task, preset, made.diffusion, stripes)).compliance)
        assert compliance[0] < limit * compliance[1]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "most"), [(0.5, 1.46), (0.3, 1.58)])  # 1.43, 1.54
def test_on_a_dome_widths_that_even_out_the_stress_come_near_to_the_uncut_sheet(share, most):
    made = drafted(DOME_MODES, "", 0.0)
    surface, statics, diffusion = made.surface, made.statics, made.diffusion
    keys = {"pattern.width.rule": "stressed", "pattern.width.solid_fraction": share}
    own = with_overrides(striped_alike(made), keys)
    even = even_stripes(own, surface, statics)
    grading = stressed_step(own, made.analysis, Log(None), even=even)
    task = ComparisonTask(own, surface, statics, diffusion, made.pattern.frequency, share * surface.area, even)
    structure = widened_structure(task, own, drawable_families(own, made.analysis, 0.0, grading, even))
    assert structure.sheet.surface.area == pytest.approx(task.area, rel=1e-3)
    uncut = Structure.uncut(surface, own.statics.thickness)
    assert quick(task, structure).compliance < most * quick(task, uncut).compliance
