"""The thinnest wall of solids with flat faces, where it is known."""

import numpy as np
import pytest

from dsfab.thickening import Solid
from dsfab.thickening.wall_thickness import thinnest_wall
from tests.shapes import grid
from tests.thickening.thick_solids import made


def wedge(degrees: float) -> Solid:
    """A block of 1 x 1 m, .1 m high on the side x = 0, whose top rises from there at an angle."""
    block = made(grid(1, 1, 1.0, 1.0), 0.1)
    V = np.array(block.V)
    V[:, 2] += np.where(V[:, 2] > 0, np.tan(np.radians(degrees)) * V[:, 0], 0.0)
    return Solid(V, block.F, 0, 1)


@pytest.mark.parametrize(("degrees", "is_wall"), [(17.0, True), (24.0, False)])
def test_faces_are_a_wall_if_they_are_parallel_within_twenty_degrees(degrees, is_wall):
    assert (thinnest_wall(wedge(degrees)) is not None) == is_wall


def test_a_wall_that_tapers_is_measured_at_its_thin_side():
    """Its thickness grows from .1 by .268 m; the line starts two hundredths of the way from a corner to a centre."""
    assert thinnest_wall(wedge(15.0)).thickness == pytest.approx(0.1 * np.cos(np.radians(15)), rel=0.04)


@pytest.mark.parametrize(("kink", "is_wall"), [(0.0007, False), (0.0015, True)])
def test_faces_within_a_thousandth_of_a_radian_are_one_facet_of_a_tip(kink, is_wall):
    """A tip of 1 x 1 m, .1 m high at its end, whose top has a kink halfway. Behind the kink it is .05 m thick."""
    P = np.array([[0, 0], [1, 0], [1, 0.1 + 0.5 * kink], [0.5, 0.05]])
    V = np.array([[x, y, z] for y in (0.0, 1.0) for x, z in P])
    ends = [(0, 1, 3), (1, 2, 3), (4, 7, 5), (5, 7, 6)]
    sides = [f for i in range(4) for f in ((i, i + 4, (i + 1) % 4), ((i + 1) % 4, i + 4, (i + 1) % 4 + 4))]
    assert (thinnest_wall(Solid(V, np.array(ends + sides), 0, 1)) is not None) == is_wall
