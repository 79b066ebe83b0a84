"""Lines traced along directions: closed forms, distances, and ends."""

import numpy as np
import pytest

from dsfab.reproduction.earlier_methods import ribbons, stress_lines
from tests.shapes import grid

APART = 0.25


@pytest.fixture(scope="module")
def panel():
    """2 x 2 about its middle."""
    return grid(24, 24, 2.0, 2.0)


def middle(surface):
    return (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2


def test_lines_along_one_direction_are_straight_end_on_the_boundary_and_keep_their_distance(panel):
    straight = np.tile([0.6, 0.8, 0.0], (panel.m, 1)) * np.random.default_rng(1).choice([-1.0, 1.0], panel.m)[:, None]
    lines = stress_lines(panel, straight, np.ones(panel.m, dtype=bool), APART)
    offsets = []
    for line in lines:
        across = line.points @ [0.8, -0.6, 0.0]
        assert np.ptp(across) < 1e-9
        assert line.loose == 0
        offsets.append(across.mean())
    gaps = np.diff(np.sort(offsets))
    assert len(lines) > 5
    assert gaps.min() > APART / 2
    assert gaps.max() < 2.1 * APART


def test_lines_round_a_point_close(panel):
    """Circles: their radius is kept, and they come round."""
    x, y, _ = (panel.centroids - middle(panel) - [0.011, 0.007, 0.0]).T
    r = np.hypot(x, y)
    lines = stress_lines(panel, np.stack([-y / r, x / r, 0 * r], axis=1), (r > 0.2) & (r < 0.95), APART)
    closed = [line for line in lines if np.array_equal(line.points[0], line.points[-1])]
    assert len(closed) >= 2
    for line in closed:
        far = np.linalg.norm(line.points - middle(panel) - [0.011, 0.007, 0.0], axis=1)
        assert np.ptp(far) < 0.01
        assert line.length == pytest.approx(2 * np.pi * far.mean(), rel=0.01)
        assert line.loose == 0


def test_lines_that_run_together_end_inside(panel):
    """Rays towards a corner: the nearer, the fewer."""
    rays = panel.centroids - panel.V.min(axis=0) + [0.05, 0.05, 0.0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    lines = stress_lines(panel, rays, np.ones(panel.m, dtype=bool), APART)
    assert sum(line.loose for line in lines) >= 3


def test_no_line_enters_a_face_without_a_direction(panel):
    clear = panel.centroids[:, 0] < middle(panel)[0]
    straight = np.tile([1.0, 0.0, 0.0], (panel.m, 1))
    lines = stress_lines(panel, straight, clear, APART)
    assert all(clear[list(line.faces)].all() for line in lines)
    assert all(line.loose == 1 for line in lines)


def test_a_line_is_drawn_as_a_band_of_its_length_and_width(panel):
    straight = np.tile([1.0, 0.0, 0.0], (panel.m, 1))
    lines = stress_lines(panel, straight, np.ones(panel.m, dtype=bool), APART)[:1]
    V, F = ribbons(panel, lines, 0.02, 0.01)
    sides = V[F]
    areas = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(0.02 * lines[0].length, rel=1e-6)
    assert np.abs(V[:, 2] - panel.V[0, 2]) == pytest.approx(0.01)
