"""Arms of places on sheets whose shape is known: a strip, its tip, a crossing, a hairpin, the middle of a plate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab.slicing.measures.pattern_quality import arms
from dsfab.surface import Surface
from tests.shapes import grid, jittered


def shape(where) -> Surface:
    """The faces of a plate of 4 x 4 m whose middles are where it says."""
    plate = jittered(grid(80, 80, 4.0, 4.0))
    F = plate.F[where(*plate.centroids.T[:2])]
    used = np.unique(F)
    return Surface(plate.V[used], np.searchsorted(used, F))


STRIP = shape(lambda x, y: (np.abs(y - 2) < 0.25) & (x < 3))
CROSS = shape(lambda x, y: (np.abs(y - 2) < 0.25) | (np.abs(x - 2) < 0.25))
HAIRPIN = shape(
    lambda x, y: (
        (np.abs(np.abs(y - 2) - 0.5) < 0.25) & (x < 2) | (np.abs(np.hypot(x - 2, y - 2) - 0.5) < 0.25) & (x >= 2)
    )
)
PLATE = shape(lambda x, y: x < 9)


@pytest.mark.parametrize(
    ("sheet", "place", "expected"),
    [
        (STRIP, (1.5, 2, 0), [(1, 0, 0), (-1, 0, 0)]),
        (STRIP, (2.95, 2, 0), [(-1, 0, 0)]),
        (CROSS, (2, 2, 0), [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]),
        (PLATE, (2, 2, 0), [(0, 0, 0), (0, 0, 0)]),
        (PLATE, (0, 2, 0), [(1, 0, 0)]),
        (HAIRPIN, (2.5, 2, 0), None),
        (STRIP, (1.5, 2, 9), []),
    ],
)
def test_arms_are_where_the_sheet_goes_on(sheet, place, expected):
    found = arms(sheet, np.array(place, dtype=float), 0.6).direction
    if expected is None:  # both ways of a bend lead back
        assert len(found) == 2
        assert found[0] @ found[1] < 0
        found = arms(sheet, np.array(place, dtype=float), 0.95).direction
        assert found[0] @ found[1] > 0.3
        return
    assert len(found) == len(expected)
    for direction in expected:
        assert np.linalg.norm(found - direction, axis=1).min(initial=np.inf) < 0.15


def test_arms_turn_with_the_sheet():
    R = Rotation.from_rotvec([0.3, 1.1, -0.7]).as_matrix()
    sheet = Surface(CROSS.V @ R.T, CROSS.F)
    before, after = arms(CROSS, np.array([2.0, 2, 0]), 0.6), arms(sheet, R @ [2.0, 2, 0], 0.6)
    assert np.abs(before.direction @ R.T - after.direction).max() < 1e-9
    assert np.abs(before.normal @ R.T - after.normal).max() < 1e-9
    assert np.abs(before.width - after.width).max() < 1e-9


def test_another_member_that_passes_near_is_no_arm():
    two = shape(lambda x, y: (np.abs(y - 2) < 0.25) & (x < 3) | (x > 3.2) & (x < 3.5))
    assert len(arms(two, np.array([2.95, 2, 0]), 0.6).width) == 1


def test_an_arm_is_as_wide_as_the_strip_and_a_quarter_of_a_plate_as_wide_as_its_arc():
    tip = arms(STRIP, np.array([2.95, 2, 0]), 0.8)
    assert tip.width == pytest.approx([0.5], abs=0.1)
    assert tip.is_tip(0.5)
    edge = arms(PLATE, np.array([0.0, 2, 0]), 0.6)
    assert edge.width == pytest.approx([0.6 * np.pi], rel=0.05)
    assert not edge.is_tip(0.5)
    assert not arms(CROSS, np.array([2.0, 2, 0]), 0.6).is_tip(0.5)
    assert arms(STRIP, np.array([1.5, 2, 9]), 0.6).is_tip(0.5)


def test_faces_larger_than_the_ball_are_looked_into():
    """Two triangles, 4 m long and .5 m wide: no vertex is within 1 m of the middle."""
    long = Surface(np.array([[0, 0, 0], [4, 0, 0], [4, 0.5, 0], [0, 0.5, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found = arms(long, np.array([2, 0.25, 0]), 1.0)
    assert np.sort(found.direction[:, 0]) == pytest.approx([-1, 1], abs=0.1)
    assert not found.is_tip(0.5)


@pytest.mark.parametrize("fold", [0, 60, 120, 170])
def test_arms_continue_straight_across_a_fold_and_turn_back_beside_it(fold):
    """Folded about x = 1.5, whatever the angle: unfolded, the arms of a strip point away from each other."""

    def folded(flat: Surface) -> Surface:
        x, y, _ = flat.V.T
        a = np.radians(fold)
        over = np.maximum(x - 1.5, 0)
        V = np.c_[np.minimum(x, 1.5) + over * np.cos(a), y, -over * np.sin(a)]
        return Surface(V, flat.F)

    strip = grid(40, 6, 3.0, 0.5)
    assert not arms(folded(strip), np.array([1.5, 0.25, 0]), 0.6).is_hairpin(0.5)
    flat = grid(60, 40, 3.0, 2.0)
    x, y, _ = flat.centroids.T
    two_legs = (np.abs(np.abs(y - 1) - 0.5) < 0.2) & (x < 1.2) | (np.hypot(x - 1.2, y - 1) < 0.7) & (x >= 1.2)
    bend = Surface(flat.V, flat.F[two_legs & ~((np.hypot(x - 1.2, y - 1) < 0.3) & (x >= 1.2))])
    assert arms(folded(bend), np.array([1.5, 1.0, 0]), 0.9).is_hairpin(0.4)
