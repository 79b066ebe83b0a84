"""One field integrated over directions on faces: closed forms, and what happens where no signs agree."""

import numpy as np
import pytest

from dsfab.reproduction.earlier_methods import (
    consistent_directions,
    integrated_field,
    typical_slope,
    weakest_directions,
)
from tests.shapes import grid, square


@pytest.fixture(scope="module")
def panel():
    return square()


def with_random_signs(direction, seed=0):
    """Each with a sign by chance."""
    return direction * np.random.default_rng(seed).choice([-1.0, 1.0], len(direction))[:, None]


def test_signs_that_agree_are_found_again(panel):
    straight = np.tile([0.6, 0.8, 0.0], (panel.m, 1))
    found = consistent_directions(panel, with_random_signs(straight))
    assert np.array_equal(found, straight) or np.array_equal(found, -straight)


def test_a_constant_direction_is_integrated_to_a_linear_field(panel):
    straight = np.tile([0.6, 0.8, 0.0], (panel.m, 1))
    field = integrated_field(panel, with_random_signs(straight), np.ones(panel.m, dtype=bool))
    told = panel.V @ straight[0]
    slope = np.sign((field - field.mean()) @ (told - told.mean()))
    assert np.ptp(slope * field - told) < 1e-6
    assert typical_slope(panel, field) == pytest.approx(1.0, abs=1e-6)


def test_radial_directions_are_integrated_to_the_distance():
    """|x| off a centre outside the plate, at second order: a third of the error with edges half as long."""
    errors = []
    for cells in (12, 24):
        surface = grid(cells, cells, 2.0, 2.0)
        centre = surface.V.min(axis=0) - [1.0, 1.0, 0.0]
        radial = surface.centroids - centre
        radial /= np.linalg.norm(radial, axis=1, keepdims=True)
        field = integrated_field(surface, with_random_signs(radial), np.ones(surface.m, dtype=bool))
        told = np.linalg.norm(surface.V - centre, axis=1)
        errors.append(min(np.ptp(field - told), np.ptp(-field - told)))
    assert errors[0] < 0.01
    assert errors[1] < errors[0] / 3


def test_the_integrated_field_is_flat_near_a_half_turn_singularity(panel):
    """A singularity of index 1/2: along some ray two neighbours disagree whatever the signs, so the field is not steep
    everywhere."""
    x, y, _ = (panel.centroids - panel.V.mean(axis=0) - [0.013, 0.007, 0.0]).T
    half = np.arctan2(y, x) / 2
    turning = np.stack([np.cos(half), np.sin(half), 0 * half], axis=1)
    found = consistent_directions(panel, with_random_signs(turning))
    i, j = panel.edges.pairs.T // 3
    assert (np.einsum("ek,ek->e", found[i], found[j]) < 0).sum() > 3
    field = integrated_field(panel, turning, np.ones(panel.m, dtype=bool))
    assert typical_slope(panel, field) < 0.95


def test_stripes_lie_across_the_direction_of_least_conductivity():
    """r along x, 1 along y, nothing along the normal z."""
    assert np.abs(weakest_directions(np.diag([100.0, 1.0, 0.0])[None])) == pytest.approx(np.array([[0.0, 1.0, 0.0]]))
