"""Necks of openings: two members that nearly touch become one there, and nothing else changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.slicing.finishing.least_widths import REACH, bridged_gaps, bridged_necks, narrow_gaps
from dsfab.slicing.finishing.openings import openings_of
from dsfab.slicing.measures.widths import features
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic
from tests.shapes import grid, jittered
from tests.slicing.bridges import check_bridged
from tests.slicing.laws import material_area
from tests.slicing.striped_balls import openings, striped_ball
from tests.slicing.stripes import dumbbell

WIDTH = 0.05


@pytest.mark.parametrize("half", [0.004, 0.012, 0.02])
def test_a_narrow_passage_is_bridged_and_rounded_from_both_sides(half):
    """Once, or at both ends where that leaves a blind alley, which is filled."""
    plate = grid(40, 40, 1.0, 1.0)
    sheet = dumbbell(plate, half)
    done, count = bridged_necks(sheet, WIDTH)
    assert 1 <= count <= 2
    assert openings_of(done).count == 2 == openings_of(sheet).count + 1
    gain, long = material_area(done) - material_area(sheet), WIDTH if count == 1 else 0.2
    assert 1.99 * half * WIDTH < gain < 2 * half * long + count * 2 * REACH * WIDTH**2  # the passage widens at its ends
    check_bridged(plate, sheet, done)
    rounded, _ = rounded_corners(done, WIDTH / 2)
    gap = features(rounded, rounded.material, [""] * 2).gap
    assert gap.size > 0.95 * WIDTH


@pytest.mark.parametrize("half", [0.026, 0.05, 0.1])
def test_a_wide_passage_is_left_alone(half):
    sheet = dumbbell(grid(40, 40, 1.0, 1.0), half)
    done, count = bridged_necks(sheet, WIDTH)
    assert count == 0
    assert done is sheet


def test_tips_are_no_necks_and_openings_without_room_are_filled():
    plate = grid(40, 40, 1.0, 1.0)
    x, y = plate.V[:, :2].T
    wedge = cut(plate, [x, -x, np.abs(y - 0.5) - 0.2 * (x - 0.2)], [[0.8], [-0.21], [0.0]], snap=0)
    same, count = bridged_necks(wedge, WIDTH)
    assert count == 0
    assert same is wedge
    slit = cut(plate, [np.maximum(np.abs(x - 0.5) - 0.3, np.abs(y - 0.5) - 0.02)], [[0.0]], snap=0)
    done, count = bridged_necks(slit, WIDTH)
    assert count == 0
    assert done.material.all()


@pytest.mark.parametrize(("half", "end"), [(0.015, 0.0), (0.024, 0.0), (0.024, 0.004)])
def test_a_blind_alley_is_shut_and_filled(half, end):
    """A long passage that leads nowhere, as wide at its end or less."""
    plate = grid(50, 50, 1.0, 1.0)
    x, y = plate.V[:, :2].T - 0.5
    room = np.maximum(np.abs(x + 0.25) - 0.15, np.abs(y) - 0.15)
    alley = np.maximum(np.abs(x - 0.1) - 0.25, np.abs(y) - half + end * (x + 0.1) / 0.45)
    sheet = cut(plate, [np.minimum(room, alley)], [[0.0]], snap=0)
    done, count = bridged_necks(sheet, WIDTH)
    assert count == 1
    assert openings_of(done).count == 1
    check_bridged(plate, sheet, done)
    rounded, _ = rounded_corners(done, WIDTH / 2)
    assert features(rounded, rounded.material, [""] * 2).gap.size > 0.95 * WIDTH
    assert material_area(rounded) < 1 - 0.3**2 + 2 * 0.02 * WIDTH + WIDTH**2  # the room stays


def folded_opening(half: float) -> tuple[Surface, Sheet]:
    """A plate folded back onto itself but for ten degrees, with an opening in which a passage, 2 `half` wide, leads
    around the fold: seen from above it lies within a room of the same opening."""
    flat = grid(60, 40, 1.0, 1.0)
    x, y, _ = flat.V.T
    over = np.maximum(x - 0.6, 0)
    turn = np.radians(170)
    plate = Surface(np.c_[np.minimum(x, 0.6) + over * np.cos(turn), y, over * np.sin(turn)], flat.F)
    rooms = [np.maximum(np.abs(x - at) - wide, np.abs(y - 0.5) - 0.2) for at, wide in ((0.31, 0.21), (0.88, 0.06))]
    passage = np.maximum(np.abs(x - 0.7) - 0.2, np.abs(y - 0.5) - half)
    return plate, cut(plate, [np.minimum(np.minimum(*rooms), passage)], [[0.0]], snap=0)


@pytest.mark.parametrize("half", [0.01, 0.02])
def test_a_narrow_passage_around_a_fold_is_bridged(half):
    plate, sheet = folded_opening(half)
    assert bridged_necks(sheet, WIDTH)[1] == 0  # flat, it is not seen
    gaps = narrow_gaps(sheet, 0.9 * WIDTH, 2 * WIDTH)
    assert np.linalg.norm(gaps[:, 1] - gaps[:, 0], axis=1) == pytest.approx(2 * half, rel=1e-6)
    done, count = bridged_gaps(sheet, sheet, 0.9 * WIDTH, WIDTH)
    assert count >= 1
    assert openings_of(done).count >= 2
    check_bridged(plate, sheet, done)
    same, none = bridged_gaps(sheet, sheet, 1.9 * half, WIDTH)
    assert none == 0
    assert same is sheet


def test_gaps_of_a_rounded_sheet_are_bridged_in_the_sheet_before():
    plate = grid(40, 40, 1.0, 1.0)
    sheet = dumbbell(plate, 0.02)
    rounded, _ = rounded_corners(sheet, WIDTH / 2)
    done, count = bridged_gaps(sheet, rounded, 0.9 * WIDTH, WIDTH)
    assert count >= 1
    check_bridged(plate, sheet, done)
    again, _ = rounded_corners(done, WIDTH / 2)
    assert not len(narrow_gaps(again, 0.9 * WIDTH, WIDTH))


def test_a_sheet_without_openings_is_unchanged():
    plate = grid(8, 8, 1.0, 1.0)
    for level in (-1.0, 2.0):
        sheet = cut(plate, [plate.V[:, 0]], [[level]])
        assert bridged_necks(sheet, 0.1) == (sheet, 0)
        assert bridged_gaps(sheet, sheet, 0.1, 0.1) == (sheet, 0)


def test_a_pocket_behind_a_bridged_neck_is_filled():
    """A square of 6 cm that a passage joins to a large opening: a hole of its own there would be good for nothing."""
    plate = grid(50, 50, 1.0, 1.0)
    x, y = plate.V[:, :2].T - 0.5
    large = np.maximum(np.abs(x + 0.15) - 0.15, np.abs(y) - 0.15)
    small = np.maximum(np.abs(x - 0.13) - 0.03, np.abs(y) - 0.03)
    passage = np.maximum(np.abs(x - 0.05) - 0.08, np.abs(y) - 0.01)
    sheet = cut(plate, [np.minimum(np.minimum(large, small), passage)], [[0.0]], snap=0)
    done, count = bridged_necks(sheet, WIDTH)
    assert count == 1
    assert openings_of(done).count == 1
    check_bridged(plate, sheet, done)


def test_an_island_is_joined_to_the_members_around_it():
    plate = grid(50, 50, 1.0, 1.0)
    x, y = plate.V[:, :2].T - 0.5
    ring = np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.3, 0.1 - np.maximum(np.abs(x - 0.18), np.abs(y)))
    sheet = cut(plate, [ring], [[0.0]], snap=0)  # a block that stands 2 cm off the right side of the opening
    assert sheet.subset().surface.pieces[0] == 2
    done, count = bridged_necks(sheet, WIDTH)
    assert count >= 1
    assert done.subset().surface.pieces[0] == 1
    check_bridged(plate, sheet, done)


@settings(max_examples=30, deadline=None)
@given(half=st.floats(1e-3, 0.06), far=st.floats(0.02, 0.15), width=st.floats(5e-3, 0.1), seed=st.integers(0, 1000))
def test_laws_on_random_dumbbells(half, far, width, seed):
    plate = jittered(grid(23, 23, 1.0, 1.0), seed=seed)
    sheet = resolve_pinches(dumbbell(plate, half, far), 1e-3).sheet
    done, count = bridged_necks(sheet, width)
    check_bridged(plate, sheet, done)
    if not count and done is not sheet:  # all filled, or nothing
        assert material_area(done) > material_area(sheet)


@settings(max_examples=20, deadline=None)
@given(frequency=st.floats(2, 9), level=st.floats(-0.6, 0.6), width=st.floats(0.01, 0.2), seed=st.integers(0, 100))
def test_laws_on_a_ball_with_curved_stripes(frequency, level, width, seed):
    ball, sheet = striped_ball(frequency, level, seed)
    check_bridged(ball, sheet, bridged_necks(sheet, width)[0])


def test_bridges_join_in_edges_never_in_points():
    sheet = openings(grid(17, 17, 1.0, 1.0))
    assert bridged_necks(sheet, 0.1)[0] is sheet
    assert euler_characteristic(sheet.subset().surface.F, sheet.subset().surface.edges) == 1 - 9
