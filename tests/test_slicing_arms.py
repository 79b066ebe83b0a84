"""Arms of places on sheets whose shape is known: a strip, its tip, a crossing, a hairpin, the middle of a plate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab.slicing.arms import arms
from dsfab.surface import Surface
from tests.zoo import grid, jittered


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
    found = arms(sheet, np.array(place, dtype=float), 0.6)
    if expected is None:  # both ways of a bend lead back
        assert len(found) == 2
        assert found[0] @ found[1] < 0
        found = arms(sheet, np.array(place, dtype=float), 0.95)
        assert found[0] @ found[1] > 0.3
        return
    assert len(found) == len(expected)
    for direction in expected:
        assert np.linalg.norm(found - direction, axis=1).min(initial=np.inf) < 0.15


def test_arms_turn_with_the_sheet():
    R = Rotation.from_rotvec([0.3, 1.1, -0.7]).as_matrix()
    sheet = Surface(CROSS.V @ R.T, CROSS.F)
    before, after = arms(CROSS, np.array([2.0, 2, 0]), 0.6), arms(sheet, R @ [2.0, 2, 0], 0.6)
    assert np.abs(before @ R.T - after).max() < 1e-9


def test_another_member_that_passes_near_is_no_arm():
    two = shape(lambda x, y: (np.abs(y - 2) < 0.25) & (x < 3) | (x > 3.2) & (x < 3.5))
    assert len(arms(two, np.array([2.95, 2, 0]), 0.6)) == 1
