"""Where outlines cross, and where they are too far off the mesh."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import dsfab
from dsfab.design.output.files import curved_design
from dsfab.export.cad.step.shared.skins import SmoothLimits
from dsfab.export.cad.step.smooth.build import SmoothPlan, astray, rebuild_until_sound
from dsfab.export.cad.step.smooth.edges import SmoothEdge
from dsfab.export.cad.step.smooth.solid import SmoothPiece, SmoothSkin, crossings
from dsfab.export.cad.step.strategies import prepare
from dsfab.export.part import part_of
from dsfab.export.splines import Spline, segment_spline
from tests.designs import sliced
from tests.presets import DOME_MODES


def outline(*corners):
    """A piece of one skin, its outline through corners of a plane, 10 above it."""
    edges, n = [], len(corners)
    for i in range(n):
        a, b = (np.array(corners[j % n], dtype=float) for j in (i, i + 1))
        upper, lower = (segment_spline(np.append(a, z), np.append(b, z)) for z in (10.0, 0.0))
        edges.append(SmoothEdge(i, (i + 1) % n, upper, lower, {0: segment_spline(a, b)}, 0.0, True))
    return SmoothPiece(edges=edges, skins=[SmoothSkin(0, (tuple((i, True) for i in range(n)),))])


def test_an_outline_that_does_not_cross_itself_has_no_place():
    assert crossings(outline((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))).shape == (0, 3)
    assert crossings(outline((0, 0), (1, 0), (2, 0), (2, 1))).shape == (0, 3)  # straight on


def test_the_place_where_an_outline_crosses_itself():
    found = crossings(outline((0, 0), (1, 1), (1, 0), (0, 0.9)))
    assert len(found) == 2  # a chord of each
    assert found[:, 2] == pytest.approx(10)
    assert np.linalg.norm(found[:, :2] - 0.9 / 1.9, axis=1).max() < 0.1


@pytest.mark.parametrize("ahead", [(True, True), (False, True), (True, False)])
@pytest.mark.parametrize("hook", [-0.03, 0.03])
def test_two_curves_that_cross_just_before_their_end_are_separated(ahead, hook):
    """A leaf with its tip at the origin; with a hook below the axis its upper side arrives from below."""
    above = np.array([[10, 1], [7, 1], [0.6, hook], [0, 0]])
    below = np.array([[0, 0], [0.6, -hook], [7, -1], [10, -1]])
    edges, knots = [], np.r_[[0.0] * 4, [1.0] * 4]
    for i, (poles, way) in enumerate(zip((above, below), ahead, strict=True)):
        poles = poles[:: 1 if way else -1]
        upper, lower = (Spline(knots, np.c_[poles, np.full(4, z)], 3) for z in (10.0, 0.0))
        edges.append(SmoothEdge(i, i + 1, upper, lower, {0: Spline(knots, poles, 3)}, 0.0, True))
    closing = outline((10, -1), (10, 1)).edges[0]
    loop = ((0, ahead[0]), (1, ahead[1]), (2, True))
    found = crossings(SmoothPiece(edges=[*edges, closing], skins=[SmoothSkin(0, (loop,))]))
    assert found.tolist() == ([[0, 0, 10], [0, 0, 10]] if hook < 0 else [])


def test_corners_of_the_mesh_that_are_farther_from_an_edge_than_the_solid_may_be():
    """A millimetre is allowed, and the mesh's chord error: half of one to the left of x = 50."""
    lower, upper = (segment_spline(np.array([0.0, 0, z]), np.array([100.0, 0, z])) for z in (0, 50))
    piece = SmoothPiece(edges=[SmoothEdge(0, 1, upper, lower, {}, 0.0, True)])
    V = np.array([[-9.0, -9, 0], [50, -9, 0], [50, 9, 0], [-9, 9, 0], [120, -9, 0], [120, 9, 0]])
    F = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    limits = SmoothLimits(20.0, 1.0, V, F, np.array([0.5, 0.5, 0, 0]), np.zeros(4))
    corners = np.array([[20, 1.4, 0], [20, 1.6, 0], [70, 1.1, 0], [70, 0.9, 0], [100.9, 0, 0], [101.1, 0, 0]])
    assert astray(piece, corners, limits).tolist() == corners[[1, 2, 5]].tolist()


@pytest.mark.slow
def test_seams_that_cross_at_a_corner_of_the_domes_charts_are_followed_more_closely():
    """OCCT made no triangles of that skin, and said of no edge that it was the reason."""
    design = sliced(dsfab.load_preset(DOME_MODES))
    built = plan_of(design)
    piece, level = built.model.pieces[0], {}
    assert 1 <= len(crossings(piece)) <= 4
    rebuild_until_sound(built, 0, level)
    assert len(crossings(built.model.pieces[0])) == 0
    assert 1 <= len(level) <= 8
    assert len(built.model.pieces[0].edges) == len(piece.edges)


def plan_of(design):
    part = replace(prepare(part_of(design.solid, "dome", 10**6)), curved=partial(curved_design, design))
    plan = SmoothPlan(part)
    return plan.build(next(plan.layouts()))


@pytest.mark.parametrize(("past", "crosses"), [(5e-10, False), (2e-9, True)])
def test_a_corner_crosses_a_side_if_it_lies_more_than_rounding_past_it(past, crosses):
    """Each chord of the side is 1 long."""
    piece = outline((0, 0), (16, 0), (16, 5), (8.5, -past), (0, 5))
    assert (len(crossings(piece)) > 0) == crosses
