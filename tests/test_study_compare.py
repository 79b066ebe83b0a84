"""Comparison: loads handed to the cut sheet with their resultant, competitors of the same mass under the same loads."""

import re
from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.errors import StaticsError
from dsfab.pipeline.handover import lost_load, sheet_load
from dsfab.slicing import cut
from dsfab.statics import solve_statics
from dsfab.surface import LoadCase
from tests.zoo import grid

CHANGES = {"surface.edge": 0.06}


@pytest.fixture(scope="module")
def cantilever():
    return dsfab.run(dsfab.load_preset("cantilever", CHANGES))


@pytest.fixture(scope="module")
def compared(cantilever):
    return dsfab.compare(cantilever, pairs=((1, 1), (1, 2), (2, 1)))


def test_handed_over_loads_keep_their_resultant_and_supports_hold_what_is_left(cantilever):
    load = sheet_load(cantilever.surface, cantilever.sheet, cantilever.load)
    assert load.force.sum(axis=0) == pytest.approx(cantilever.load.force.sum(axis=0), rel=1e-12)
    held = cantilever.sheet.surface.V[load.held]
    assert len(held) > 3
    assert held[:, 0] == pytest.approx(-1.0)
    everywhere = LoadCase(cantilever.load.fixed, np.ones((cantilever.surface.n, 3)), cantilever.load.loaded)
    spread = sheet_load(cantilever.surface, cantilever.sheet, everywhere)
    assert spread.force.sum(axis=0) == pytest.approx([cantilever.surface.n] * 3, rel=1e-12)


def test_a_load_far_from_all_material_is_refused_and_so_is_a_sheet_without_supports():
    plate = grid(10, 10, 1.0, 1.0)
    x = plate.V[:, 0]
    fixed = np.repeat((x < 0.01)[:, None], 3, axis=1)
    force = np.zeros((plate.n, 3))
    force[x > 0.99, 1] = 1.0
    left = cut(plate, [x], [[-1.0, 0.55]]).kept()
    with pytest.raises(StaticsError, match=r"finds no material within 0\.45"):
        sheet_load(plate, left, LoadCase(fixed, force, x > 0.99))
    right = cut(plate, [x], [[0.55]]).kept()
    with pytest.raises(StaticsError, match="no supported vertex is left"):
        sheet_load(plate, right, LoadCase(fixed, force, x > 0.99))


def test_a_load_on_a_piece_that_reaches_no_support_is_lost_and_told_by_build_and_compare():
    """Thin stripes that pass the disc around the load: its own piece is dropped, however near the rest is."""
    thin = {"threshold": 0.8, "frequency": 4.0}
    pattern = {"keep": 0.05, "major": thin, "minor": thin}
    design = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.08, "pattern": pattern}))
    told = [note.text for note in design.notes if note.stage == "slicing"]
    says = r"load at \[.*\] m \(1e\+03 N\) stands on a piece that reaches no support"
    assert any(re.search(says + ": nothing carries it; set pattern.rim", text) for text in told)
    assert not any("removed material" in text for text in told)
    with pytest.raises(StaticsError, match=says):
        dsfab.compare(design, pairs=())


def test_only_concentrated_loads_are_lost_with_a_piece_and_only_more_than_a_hundredth_of_them():
    plate = grid(10, 10, 1.0, 1.0)
    x = plate.V[:, 0]
    drawn = cut(plate, [x], [[-1.0, 0.35, 0.65]]).kept()
    left = drawn.kept(drawn.surface.centroids[:, 0] < 0.5)
    load = LoadCase(np.repeat((x < 0.01)[:, None], 3, axis=1), np.ones((plate.n, 3)), x > 0.99)
    assert lost_load(plate, drawn, left, [replace(load, loaded=x > 2), load]).startswith("the load at [1.0, ")
    assert lost_load(plate, drawn, drawn, [load]) == ""
    assert lost_load(plate, drawn, left, [replace(load, loaded=x > 2)]) == ""
    assert lost_load(plate, left, left, [load]) == ""  # cut away, not dropped: `sheet_load` hands it over
    weak = load.force * np.where(x > 0.99, 1e-4, 1)[:, None]
    assert lost_load(plate, drawn, left, [replace(load, force=weak, loaded=(x > 0.99) | (x < 0.01))]) == ""


def test_a_complete_sheet_cut_into_cells_is_as_stiff_as_the_uncut_one(cantilever):
    """Slivers of the cut cost conditioning, not accuracy."""
    surface, statics = cantilever.surface, cantilever.preset.statics
    cells = cut(surface, cantilever.pattern.fields, cantilever.pattern.levels, 0.05)
    whole = cells.kept(np.ones(cells.surface.m, dtype=bool))
    values = [
        solve_statics(s, statics.material, load, statics.thickness, membrane="quadratic", bending="midedge").compliance
        for s, load in ((surface, cantilever.load), (whole.surface, sheet_load(surface, whole, cantilever.load)))
    ]
    assert values[1] == pytest.approx(values[0], rel=0.01)


def test_competitors_have_the_same_mass_and_full_is_the_stiffest(cantilever, compared):
    design = compared.design
    assert design.mass == pytest.approx(cantilever.mass, rel=0.01)
    assert compared.thinner.mass == pytest.approx(design.mass)
    for rival in compared.carried:
        assert rival.mass == pytest.approx(design.mass, rel=0.01)
    assert compared.full.mass > design.mass
    assert compared.full.compliance < min(design.compliance, *(c.compliance for c in compared.carried))
    assert len(compared.isotropic) == 3


def test_in_the_plane_a_thinner_sheet_is_softer_by_its_share_of_the_thickness(compared):
    share = compared.thinner.mass / compared.full.mass
    assert compared.thinner.compliance * share == pytest.approx(compared.full.compliance, rel=1e-6)


def test_the_cantilever_is_stiffer_than_structures_that_do_not_know_the_stress(compared):
    assert compared.gain > 1.2
    assert compared.median_gain >= compared.gain


def test_competitors_that_fall_apart_are_told_and_do_not_count():
    sphere = dsfab.run(dsfab.load_preset("globe", {"surface.edge": 0.12}))
    compared = dsfab.compare(sphere, pairs=((1, 1), (1, 2), (2, 2)))
    broken = [rival for rival in compared.isotropic if rival.error]
    assert broken
    assert all("reach no support" in rival.error or "no material" in rival.error for rival in broken)
    assert not set(broken) & set(compared.carried)
