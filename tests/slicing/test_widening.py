"""Members that are narrow at a place are widened there, and nothing else changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.slicing.finishing.least_widths import narrow_members, widened_members
from dsfab.slicing.measures.widths import crossings, features
from dsfab.surface import Surface
from tests.shapes import grid, jittered, quartered
from tests.slicing.bridges import check_bridged
from tests.slicing.laws import material_area
from tests.slicing.striped_balls import striped_ball

WIDTH, USUAL = 0.05, 0.12


def rise(y: np.ndarray, long: float = 0.25) -> np.ndarray:
    """From 0 to 1, flat at both ends."""
    return (1 - np.cos(np.pi * np.minimum(np.abs(y) / long, 1))) / 2


def waisted(plate: Surface, waist: float) -> Sheet:
    """A unit plate with two openings and a member of 12 cm between them, that is `waist` metres wide at its middle."""
    x, y = plate.V[:, :2].T - 0.5
    half = (waist + (USUAL - waist) * rise(y)) / 2
    return cut(plate, [np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.35, half - np.abs(x))], [[0.0]], snap=0)


def widened(sheet: Sheet, radius: float = 0.02) -> tuple[Sheet, Sheet, int]:
    """After as many calls as it takes; the same rounded; and the places."""
    total = 0
    for _ in range(6):
        rounded, _ = rounded_corners(sheet, radius)
        sheet, count = widened_members(sheet, rounded, WIDTH)
        if not count:
            break
        total += count
    return sheet, rounded, total


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "waist"), [(None, 0.01), (0, 0.01), (0, 0.02), (1, 0.04)])
def test_a_waist_reaches_the_requested_width(waist, seed):
    plate = grid(40, 40, 1.0, 1.0) if seed is None else jittered(grid(40, 40, 1.0, 1.0), seed=seed)
    sheet = waisted(plate, waist)
    before = features(sheet, sheet.material, [""] * 2)
    assert before.member.size < 0.9 * WIDTH
    done, rounded, count = widened(sheet)
    assert 1 <= count <= 12
    assert features(rounded, rounded.material, [""] * 2).member.size >= 0.99 * WIDTH
    check_bridged(plate, sheet, done)
    gain = material_area(done) - material_area(sheet)
    assert 0 < gain < 1.1 * (WIDTH - waist) * 0.3


def test_members_that_are_wide_enough_or_evenly_narrow_stay():
    plate = grid(40, 40, 1.0, 1.0)
    wide = waisted(plate, 0.06)
    assert widened_members(wide, wide, WIDTH) == (wide, 0)
    x, y = plate.V[:, :2].T - 0.5
    thin = cut(plate, [np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.35, 0.01 - np.abs(x))], [[0.0]], snap=0)
    assert widened_members(thin, thin, WIDTH) == (thin, 0)
    for level in (-1.0, 2.0):
        whole = cut(plate, [plate.V[:, 0]], [[level]])
        assert widened_members(whole, whole, WIDTH) == (whole, 0)


def test_the_end_of_a_member_stays():
    """A bar of 4 cm that reaches into an opening: both of its sides are walls of that, a short way apart."""
    plate = grid(60, 60, 1.0, 1.0)
    x, y = plate.V[:, :2].T - 0.5
    long = np.maximum(np.abs(x) - 0.02, np.abs(y + 0.35) - 0.1)
    frame = np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.35, -long)
    others = np.minimum(np.abs(np.abs(x) - 0.2) - 0.05, 1)  # wide members beside it
    sheet = cut(plate, [np.maximum(frame, -others)], [[0.0]], snap=0)
    assert features(sheet, sheet.material, [""] * 2).member.size == pytest.approx(0.04, rel=0.05)
    assert widened_members(sheet, sheet, WIDTH) == (sheet, 0)


def test_narrow_places_are_separate_and_sorted_by_width():
    plate = grid(60, 60, 1.0, 1.0)
    x, y = plate.V[:, :2].T - 0.5
    waists = [0.02 + 0.1 * rise(y - at, 0.18) + more for at, more in ((0.2, 0.01), (-0.2, 0.0))]
    half = np.minimum(*waists) / 2
    sheet = cut(plate, [np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.35, half - np.abs(x))], [[0.0]], snap=0)
    found = narrow_members(sheet, WIDTH, 0.1)
    assert found.mean(axis=1)[:, 1] - 0.5 == pytest.approx([-0.2, 0.2], abs=0.02)
    width = np.linalg.norm(found[:, 1] - found[:, 0], axis=1)
    assert width[0] < width[1] < WIDTH


@settings(max_examples=20, deadline=None)
@given(frequency=st.floats(2, 9), level=st.floats(-0.6, 0.6), width=st.floats(0.01, 0.2), seed=st.integers(0, 100))
def test_laws_on_a_ball_with_curved_stripes(frequency, level, width, seed):
    ball, sheet = striped_ball(frequency, level, seed)
    done, _ = widened_members(sheet, sheet, width)
    check_bridged(ball, sheet, resolve_pinches(done, 1e-3).sheet if done is not sheet else done)


@pytest.mark.parametrize(("degrees", "is_tip"), [(1.2, False), (1.8, True)])
def test_a_member_that_tapers_by_over_one_and_a_half_degrees_ends_in_a_tip(degrees, is_tip):
    """A tip has no least width; a long member whose walls are nearly parallel has one."""
    half = np.tan(np.radians(degrees / 2))
    wedge = quartered(quartered(Surface([[0, 0, 0], [1, -half, 0], [1, half, 0]], [[0, 1, 2]])))
    assert (len(crossings(wedge, wedge.edges.boundary).width) == 0) == is_tip
