"""Slabs: what members follow where a flat sheet only bends."""

import numpy as np
import pytest

import dsfab
from dsfab.design import draft
from dsfab.preset.file import load_preset
from dsfab.surface import Surface
from dsfab.surface.shapes import plate
from tests.shapes import grid

LOWER_SIDE = "the sheet is flat and bends: the pattern follows the stress at its lower side"
THICK, PRESSURE = 0.05, 1000.0


def slab(surface, *loads, **statics):
    return dsfab.Preset(
        surface=surface,
        supports=[dsfab.Support(dsfab.Boundary())],
        loads=loads or [dsfab.Pressure(PRESSURE)],
        statics={"thickness": THICK, "young": 30e9, "density": 2500.0, **statics},
        pattern={"method": "stripes", "major": {"spacing": 0.6}, "minor": {"spacing": 0.6}},
    )


def at_the_middle(design):
    """Mean stress, Pa, of the faces around the middle, as a matrix of the plane."""
    surface = design.surface
    near = np.linalg.norm(surface.centroids - surface.V.mean(axis=0), axis=1) < 0.15
    return design.statics.sigma[near].mean(axis=0)[:2, :2]


@pytest.mark.parametrize("bending", ["hinge", "midedge", "hhj"])
def test_a_slab_three_times_as_long_as_wide_is_pulled_across(bending):
    """Simply supported under an even pressure, nu = 0.3: M = 0.1189 and 0.0406 q a^2 in the middle of 1:3
    [Timoshenko and Woinowsky-Krieger 1959, table 8]; stress is 6 M / h^2."""
    design = draft(slab(grid(48, 16, 6.0, 2.0), bending=bending))
    short, long = (6 * factor * PRESSURE * 2.0**2 / THICK**2 for factor in (0.1189, 0.0406))
    stress = np.abs(at_the_middle(design))
    assert stress[1, 1] == pytest.approx(short, rel=0.03)
    assert stress[0, 0] == pytest.approx(long, rel=0.08)
    assert stress[0, 1] < 0.02 * short
    assert LOWER_SIDE in [note.text for note in design.notes]


def test_upward_normals_are_pulled_below():
    """Weight presses a slab down: its lower side is in tension whichever way loads came in."""
    surface = grid(24, 24, 3.0, 3.0)
    assert surface.normals[0, 2] > 0
    sigma = at_the_middle(draft(slab(surface, dsfab.SelfWeight())))
    assert np.linalg.eigvalsh(sigma).min() > 0
    turned = Surface(surface.V, surface.F[:, ::-1])
    assert np.linalg.eigvalsh(at_the_middle(draft(slab(turned, dsfab.SelfWeight())))).max() < 0


def test_cases_and_combinations_bend_too():
    preset = slab(grid(16, 16, 2.0, 2.0), dsfab.SelfWeight(case="dead"), dsfab.Pressure(PRESSURE, case="wind"))
    design = draft(preset)
    assert all(np.abs(case.sigma).max() > 0 for case in design.statics.cases.values())
    together = sum(case.sigma for case in design.statics.cases.values())
    np.testing.assert_allclose(together, design.statics.sigma, atol=1e-6 * np.abs(together).max())


def test_sheets_that_are_loaded_in_their_plane_follow_their_middle():
    design = draft(load_preset("cantilever", {"surface.edge": 0.1}))
    assert LOWER_SIDE not in [note.text for note in design.notes]


def test_a_slab_becomes_a_structure():
    design = dsfab.run(slab(plate(edge=0.1), dsfab.SelfWeight()))
    assert design.solid.pieces == 1
