"""`[pattern] forces = "optimal"`: the sheet of varying thickness by closed forms, and what is drawn along it."""

from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import PatternError, PresetError
from dsfab.design import Design
from dsfab.design.even_stripes import even_stripes, optimal_statics, same_stripes
from dsfab.design.output.archive import even_arrays, even_stripes_from
from dsfab.design.stripe_pattern import stripe_stresses
from dsfab.statics import Material, SheetModel, varying_thickness
from dsfab.surface import LoadCase, Surface
from tests.shapes import grid

LENGTH, WIDTH, THICKNESS, PULL = 2.0, 0.5, 0.01, 4.0
STRIPES = {"surface.edge": 0.1, "pattern.method": "stripes", "pattern.major.spacing": 0.2, "pattern.minor.spacing": 0.2}


def bar(cells: int) -> tuple[SheetModel, LoadCase]:
    """A strip that hangs from its left end and is pulled along itself by 4 N/m2 everywhere; it does not contract."""
    surface = grid(4 * cells, cells, LENGTH, WIDTH)
    fixed = np.repeat((surface.V[:, 0] < 1e-9)[:, None], 3, axis=1)
    force = PULL * surface.vertex_areas[:, None] * [1.0, 0.0, 0.0]
    return SheetModel(surface, Material(1e9, 0.0), THICKNESS), LoadCase(fixed, force, np.ones(surface.n, dtype=bool))


def test_a_hanging_bar_is_as_thick_as_its_force_is_large():
    """N = q (L - x), so a thickness of 2 s (1 - x / L) at a share s; 3 / (4 s) of the whole bar's compliance."""
    off = []
    for cells in (5, 10):
        sheet, load = bar(cells)
        whole = varying_thickness(sheet, [load], np.ones(1), 1 - 1e-9).compliance
        for share in (0.3, 0.5):
            found = varying_thickness(sheet, [load], np.ones(1), share)
            x = sheet.surface.centroids[:, 0]
            off.append(np.abs(found.thickness - 2 * share * (1 - x / LENGTH)).max())
            assert sheet.surface.areas @ found.thickness == pytest.approx(share * sheet.surface.area, rel=1e-5)
            assert found.compliance / whole == pytest.approx(0.75 / share, rel=0.01)
    assert max(off[2:]) < 0.03
    assert max(off[2:]) < 0.7 * max(off[:2])


def test_optimal_forces_of_a_determinate_bar_equal_those_of_statics():
    """A bar is determinate: N_x = q (L - x), nothing across."""
    sheet, load = bar(8)
    (N,) = varying_thickness(sheet, [load], np.ones(1), 0.4).forces
    expected = PULL * (LENGTH - sheet.surface.centroids[:, 0])
    assert np.abs(N[:, 0, 0] - expected).max() < 0.06 * expected.max()
    rest = np.abs(N).reshape(-1, 9)[:, 1:].max()
    assert rest < 0.03 * expected.max()


def test_two_loads_are_weighed_and_a_shell_has_forces_in_its_faces():
    sheet, load = bar(4)
    turned = replace(load, force=-2 * load.force)
    one = varying_thickness(sheet, [load], np.array([5.0]), 0.4)
    both = varying_thickness(sheet, [load, turned], np.ones(2), 0.4)
    assert both.compliance == pytest.approx(one.compliance, rel=1e-6)
    assert both.forces[1] == pytest.approx(-2 * both.forces[0], abs=1e-9)
    V = sheet.surface.V.copy()
    V[:, 2] = 0.3 * V[:, 1] ** 2
    bent = Surface(V, sheet.surface.F)
    down = LoadCase(load.fixed, np.array([0.0, 0.0, -1.0]) * bent.vertex_areas[:, None], load.loaded)
    (N,) = varying_thickness(replace(sheet, surface=bent), [down], np.ones(1), 0.4).forces
    assert np.abs(np.einsum("mij,mj->mi", N, bent.normals)).max() < 1e-9 * np.abs(N).max()


@pytest.fixture(scope="module")
def asked():
    return dsfab.load_preset("cantilever", {**STRIPES, "pattern.forces": "optimal"})


def test_stripes_and_widths_follow_the_optimal_forces(asked):
    made = Design.from_preset(asked)
    surface, uncut = made.surface, even_stripes(asked.with_pattern(forces="uncut"), made.surface, made.statics)
    best = even_stripes(asked, surface, made.statics)
    assert uncut.forces is None
    assert best.forces is not None
    assert np.abs(best.phases[0].value - uncut.phases[0].value).max() > 0.1  # they run elsewhere
    sizes, plain = (stripe_stresses(surface, made.diffusion, even) for even in (best, uncut))
    corner = np.linalg.norm(surface.V[:, :2] - [1.0, 0.5], axis=1) < 0.2  # beyond the load nothing is carried
    assert sizes[corner].max() < 0.3 * plain[corner].max()
    again = even_stripes_from(surface, even_arrays(best))
    assert again is not None
    assert np.array_equal(again.forces, best.forces)


def test_another_solid_fraction_changes_the_stripes_only_for_optimal_forces(asked):
    more = asked.pattern.width.model_copy(update={"solid_fraction": 0.6})
    for forces, same in (("optimal", False), ("uncut", True)):
        before = asked.pattern.model_copy(update={"forces": forces})
        assert same_stripes(before, before.model_copy(update={"width": more})) is same


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"pattern.method": "modes"}, "forces has no effect on method = 'modes'"),
        ({"pattern.width.solid_fraction": 0.0}, "forces = 'optimal' needs the share of material"),
        ({"pattern.forces": "best"}, "pattern.forces = 'best'"),
    ],
)
def test_optimal_forces_refuse_incompatible_options(changes, says):
    with pytest.raises(PresetError) as refused:
        dsfab.load_preset("cantilever", {**STRIPES, "pattern.forces": "optimal", **changes})
    assert says in str(refused.value)


def test_optimal_forces_are_refused_together_with_layers_in_bending():
    keys = {"surface.edge": 1.0, "pattern.forces": "optimal", "statics.stress": "layers"}
    made = Design.from_preset(dsfab.load_preset("slab", keys))
    statics = made.statics
    with pytest.raises(PatternError, match=r'this pattern follows bending; set pattern\.forces = "uncut"'):
        optimal_statics(made.preset, made.surface, statics)
