"""Stress as numbers: corners and ends of supports, what most of the area keeps to, and a peak that does not settle."""

import numpy as np
import pytest

import dsfab
from dsfab.statics import Material, SheetModel, sheet_stress, solve_statics
from dsfab.study.sweeps.metrics import ABOUT, metric_value
from dsfab.study.verdict.estimates import (
    extreme,
    inward_corners,
    off_corners,
    quantile,
    rib_width,
    stress_extremes,
    support_ends,
)
from dsfab.surface import LoadCase
from tests.shapes import grid, l_shape


def pulled(cells: int):
    """The bracket held along its foot, its arm pushed down: von Mises' stress and the others."""
    surface = l_shape(cells, 1.0, 0.5)
    load = LoadCase.build(
        surface,
        [dsfab.Support(dsfab.Side("y", "max"), hold="xyz")],
        [dsfab.Line(dsfab.Side("x", "max"), per_metre=(0.0, -1e3, 0.0))],
    )
    sheet = SheetModel(surface, Material(1e9, 0.3), 0.01)
    answer = solve_statics(sheet, load, dsfab.statics.elements_of("stress").in_plane)
    return stress_extremes(surface, sheet_stress(sheet, answer.elements, answer), load.supported)


def test_only_the_corner_that_bends_inwards_counts_and_ends_of_supports():
    surface = l_shape(8, 1.0, 0.5)
    assert surface.V[inward_corners(surface)] == pytest.approx(np.array([[0.5, 0.5, 0.0]]))
    held = surface.V[:, 1] > 1 - 1e-9
    assert len(support_ends(surface, held)) == 2
    assert len(inward_corners(grid(4, 4, 1.0, 1.0))) == 0
    assert rib_width(surface) == pytest.approx(2 * 0.75 / 4)
    far = off_corners(surface, held)
    away = np.linalg.norm(surface.centroids - [0.5, 0.5, 0.0], axis=1)
    assert not far[away < 0.05 * surface.size].any()
    assert far[(away > 0.2) & (surface.centroids[:, 1] < 0.8)].all()
    assert off_corners(grid(4, 4, 1.0, 1.0), np.zeros(25, dtype=bool)).all()


def test_the_peak_at_a_corner_grows_with_every_finer_mesh_and_the_two_numbers_settle():
    found = [pulled(cells)["stress"] for cells in (16, 32, 64)]
    peak, most, away = (np.array([getattr(one, name) for one in found]) for name in ("value", "quantile", "settled"))
    assert (peak[1:] / peak[:-1] > 1.2).all()
    assert abs(most[2] / most[1] - 1) < 0.12  # 15 faces of the coarser mesh are 1 % of the area
    assert abs(away[2] / away[1] - 1) < 0.05
    assert found[-1].place[:2] == pytest.approx((0.5, 0.5), abs=0.03)
    assert found[-1].away < found[-1].value
    three = pulled(16)
    assert set(three) == {"stress", "tension", "compression"}
    assert all(one.quantile <= one.value and one.value > 0 for one in three.values())


def test_quantiles_of_stress_are_weighted_by_area():
    assert quantile(np.array([3.0, 1.0, 2.0]), np.array([1.0, 98.0, 1.0])) == 2.0
    assert quantile(np.array([3.0, 1.0, 2.0]), np.array([5.0, 90.0, 5.0])) == 3.0
    plain = extreme(grid(1, 1, 1.0, 1.0), np.array([1.0, 2.0]))
    assert (plain.value, plain.away, plain.settled) == (2.0, None, 2.0)
    near = extreme(grid(1, 1, 1.0, 1.0), np.array([1.0, 2.0]), np.array([True, False]))
    assert (near.away, near.settled) == (1.0, 1.0)


def test_a_sweep_measures_the_stress_of_most_of_the_area():
    design = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.15}))
    found = metric_value("stress", design)
    thicker = dsfab.revise(design, dsfab.load_preset("cantilever", {"surface.edge": 0.15, "statics.thickness": 0.02}))
    assert found == pytest.approx(2 * metric_value("stress", thicker), rel=1e-6)
    assert "99 % of the area" in ABOUT["stress"].says
