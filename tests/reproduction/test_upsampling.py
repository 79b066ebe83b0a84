"""The paper's cut by upsampling, beside the exact one: on a plate all of it is known."""

import numpy as np
import pytest

from dsfab.pattern import Stripes
from dsfab.reproduction import upsampling
from dsfab.reproduction.upsampling import StripedField, compare_cuts, lines_through
from tests.shapes import grid


def striped(surface, *families):
    """Stripes straight across the directions given, each with its frequency, phase and threshold."""
    return [StripedField(Stripes(*how), surface.V[:, :2] @ along) for along, how in families]


ACROSS = ((1.0, 0.37), (4.0, 0.1, 0.3))


def test_lines_through_triangles_are_counted():
    """On two triangles of 1 x 1 with two stripes: 4 edges along x through each, and 2 along y more."""
    plate = grid(1, 1, 1.0, 1.0)
    assert lines_through(plate, striped(plate, ((1.0, 0.0), (2.0, 0.3)))).tolist() == [4, 4]
    both = striped(plate, ((1.0, 0.0), (2.0, 0.3)), ((0.0, 1.0), (1.0, 0.5)))
    assert lines_through(plate, both).tolist() == [6, 6]


def test_upsampling_ends_when_lines_are_alone_and_approaches_the_exact_cut():
    plate = grid(5, 3, 1.0, 0.6)
    made = compare_cuts(plate, striped(plate, ACROSS), rounds=9)
    crowded = [one.crowded for one in made.upsampled]
    assert crowded[-1] == 0
    assert 1 < len(crowded) < 9  # one family: lines are parallel, and apart
    wrong = [one.wrong for one in made.upsampled]
    assert wrong[0] > 0.05
    assert wrong[-1] < 0.25 * wrong[0]
    triangles = [one.triangles for one in made.upsampled]
    assert triangles == sorted(triangles)
    assert made.exact < triangles[-1]


def test_division_leaves_the_surface_whole():
    plate = grid(5, 3, 1.0, 0.6)
    families = striped(plate, ACROSS, ((-0.4, 1.0), (3.0,)))
    crowded = np.arange(plate.m) % 7 == 2
    for _ in range(3):
        plate, families = upsampling.division(plate, families, crowded)
        crowded = np.arange(plate.m) % 5 == 1
    assert plate.area == pytest.approx(0.6, rel=1e-12)
    assert len(plate.loops) == 1  # no corner on a side
    assert families[0].x == pytest.approx(plate.V[:, :2] @ ACROSS[0], abs=1e-12)


def test_repeated_upsampling_resolves_crossing_families():
    plate = grid(4, 4, 1.0, 1.0)
    made = compare_cuts(plate, striped(plate, ((1.0, 0.1), (2.0,)), ((-0.1, 1.0), (2.0,))), rounds=4)
    assert len(made.upsampled) == 5
    assert made.upsampled[-1].crowded > 0
    assert made.upsampled[-1].wrong < 0.02
