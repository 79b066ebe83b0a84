"""Pattern: the wave, its levels, the share of material, and the regions that are kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.core.errors import PatternError
from dsfab.pattern import Stripes, distance_to_boundary, distance_to_vertices
from dsfab.pattern.stripes import GLSL, wave
from tests.shapes import ZOO, grid, sphere


def test_the_wave_has_period_one_and_range_one_and_starts_at_its_top():
    t = np.linspace(-3, 3, 6001)
    p = wave(t)
    assert wave(np.array([0.0, 0.25, 0.5, 0.75, 1.0])) == pytest.approx([1, 0, -1, 0, 1])
    assert np.allclose(wave(t + 1), p)
    assert (p.min(), p.max()) == (-1, 1)
    assert np.abs(np.diff(p) / np.diff(t)) == pytest.approx(4)
    # the shader's line is the same formula; Python reads it once the GLSL names are given
    body = GLSL.partition("return ")[2].partition(";")[0]
    shader = eval(body, {"abs": np.abs, "fract": lambda x: x - np.floor(x), "t": t})
    assert np.array_equal(shader, p)


@given(
    threshold=st.floats(-0.99, 0.99),
    phase=st.floats(-3, 3),
    frequency=st.floats(0.1, 50),
    low=st.floats(-5, 5),
    span=st.floats(0, 4),
)
@settings(deadline=None, derandomize=True, max_examples=60)
def test_an_odd_number_of_levels_lies_below_material_and_only_there(threshold, phase, frequency, low, span):
    stripes = Stripes(frequency, phase, threshold)
    x = np.linspace(low, low + span, 400)
    levels = stripes.levels(x)
    assert np.all(np.diff(levels) > 0)
    clear = np.abs(x[:, None] - levels).min(axis=1) > 1e-9 * (1 + np.abs(x))
    below = np.searchsorted(levels, x)
    assert np.array_equal((below % 2 == 1)[clear], (stripes.value(x) > 0)[clear])


@pytest.mark.parametrize("threshold", [-0.9, 0.0, 0.4, 0.99])
@pytest.mark.parametrize(("frequency", "phase"), [(1.0, 0.0), (7.0, 0.3), (0.2, -4.6)])
def test_levels_cover_the_range_of_the_field_with_a_small_margin(frequency, phase, threshold):
    """Two edges to a period, one whole stripe beyond each end at least, and two of them at most."""
    x = np.linspace(3.0, 8.0, 11)
    levels, period = Stripes(frequency, phase, threshold).levels(x), 1 / frequency
    assert np.diff(levels[::2]) == pytest.approx(period)
    half = period * (1 - threshold) / 4
    assert np.diff(levels)[::2] == pytest.approx(2 * half)
    middles = frequency * (levels[::2] + half) + phase
    assert middles == pytest.approx(np.round(middles), abs=1e-9)
    assert 3.0 - 2 * period < levels[0] + half <= 3.0 - period * (1 - 1e-9)
    assert 8.0 + period * (1 - 1e-9) <= levels[-1] - half < 8.0 + 2 * period


def test_stripes_that_touch_have_one_edge_below_everything_and_none_have_none():
    x = np.linspace(-3.0, 8.0, 11)
    assert Stripes(2.0, 0.3, -1.0).levels(x) == pytest.approx([-3.5])
    assert Stripes(2.0, 0.3, 1.0).levels(x).shape == (0,)


@pytest.mark.parametrize("threshold", [-1, -0.5, 0, 0.3, 1])
def test_share_of_material_is_half_of_one_minus_the_threshold(threshold):
    t = (np.arange(200_000) + 0.5) / 200_000
    levels = Stripes(7, 0.1, threshold).levels(t)
    kept = np.searchsorted(levels, t) % 2 == 1
    assert kept.mean() == pytest.approx((1 - threshold) / 2, abs=1e-4)


def test_a_constant_field_is_all_material_or_all_void():
    x = np.full(10, 0.37)
    assert Stripes(1.0, -0.37).levels(x).searchsorted(0.37) % 2 == 1
    assert Stripes(1.0, -0.37 + 0.5).levels(x).searchsorted(0.37) % 2 == 0


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ((0,), "frequency"),
        ((-2,), "frequency"),
        ((np.inf,), "frequency"),
        ((1, np.nan), "phase"),
        ((1, 0, 1.2), "threshold"),
        ((1, 0, -1.01), "threshold"),
    ],
)
def test_impossible_stripes_are_refused(values, says):
    with pytest.raises(PatternError, match=says):
        Stripes(*values)


def test_the_distance_to_vertices_includes_their_faces_and_edges():
    plate = grid(10, 10, 1.0, 1.0)
    x, y = plate.V[:, 0], plate.V[:, 1]
    patch = (x < 0.31) & (y < 0.31)
    closed_form = np.hypot(np.maximum(x - 0.3, 0), np.maximum(y - 0.3, 0))
    assert np.abs(distance_to_vertices(plate, patch) - closed_form).max() < 1e-12
    edge = (x < 0.01) & (y < 0.51)
    assert np.abs(distance_to_vertices(plate, edge) - np.hypot(x, np.maximum(y - 0.5, 0))).max() < 1e-12
    one = np.arange(plate.n) == 60
    assert np.abs(distance_to_vertices(plate, one) - np.linalg.norm(plate.V - plate.V[60], axis=1)).max() < 1e-12
    assert np.all(np.isinf(distance_to_vertices(plate, np.zeros(plate.n, bool))))


def test_distance_to_boundary_of_a_plate_and_of_a_closed_surface():
    plate = grid(10, 10, 1.0, 1.0)
    x, y = plate.V[:, 0], plate.V[:, 1]
    assert np.abs(distance_to_boundary(plate) - np.minimum.reduce([x, y, 1 - x, 1 - y])).max() < 1e-12
    assert np.all(np.isinf(distance_to_boundary(sphere())))
    assert distance_to_boundary(ZOO["dome"]()).min() == 0
