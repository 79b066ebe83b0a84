"""What is narrower than a workshop makes: tips, slits and thin members, cured by material alone."""

import numpy as np
import pytest

from dsfab.slicing import Sheet, cut, resolve_pinches, with_least_widths
from dsfab.slicing.measures.widths import Features, features
from dsfab.surface import Surface
from tests.shapes import grid, jittered
from tests.slicing.bridges import check_bridged
from tests.slicing.laws import material_area

GAP, MEMBER = 0.02, 0.04
HALF_ANGLE = np.radians(4)


def plates():
    plate = grid(40, 40, 1.0, 1.0)
    return [plate, jittered(plate, seed=0), jittered(plate, seed=1)]


def found(sheet: Sheet) -> Features:
    return features(sheet, sheet.material, [""] * 2, tips=True)


def opening(plate: Surface, inside: np.ndarray) -> Sheet:
    """The plate without what is under 0."""
    return cut(plate, [inside], [[0.0]], snap=0)


def void(sheet: Sheet) -> np.ndarray:
    """(2, k) x and y of the vertices of openings."""
    cells = sheet.surface.F[~sheet.material]
    return sheet.surface.V[np.unique(cells)][:, :2].T


def area_of_void(sheet: Sheet, beyond: float, above: float = 0.0) -> float:
    """Square metres of openings at x and y over these, cell by cell."""
    x, y = sheet.surface.centroids[:, :2].T
    return sheet.surface.areas[~sheet.material & (x > beyond) & (y > above)].sum()


def cured(plate: Surface, sheet: Sheet, gap: float, member: float):
    """The sheet with these widths, which is sound and has no point contacts."""
    done = with_least_widths(sheet, gap, member)
    check_bridged(plate, sheet, done.cells)
    assert resolve_pinches(done.cells, 0.01, "join").pinches == 0
    again = with_least_widths(done.cells, gap, member)
    assert again.cells is done.cells
    return done


@pytest.mark.parametrize("plate", plates())
def test_a_tip_is_filled_up_to_its_mouth(plate):
    """A wedge of 8 degrees, 0.6 m long: what is narrower than 20 mm is a triangle of a seventh of a metre."""
    x, y = plate.V[:, :2].T
    sheet = opening(plate, np.maximum(np.abs(y - 0.5) - (x - 0.2) * np.tan(HALF_ANGLE), x - 0.8))
    assert found(sheet).gap.size < 0.1 * GAP
    done = cured(plate, sheet, GAP, 0.0)
    assert (done.filled, done.widened) == (0, 0)
    assert found(done.cells).gap.size >= 0.999 * GAP
    mouth = 0.2 + GAP / (2 * np.tan(HALF_ANGLE))
    assert mouth - 0.01 < void(done.cells)[0].min() < mouth + 0.05
    assert area_of_void(done.cells, mouth + 0.05) == pytest.approx(area_of_void(sheet, mouth + 0.05), rel=1e-9)


@pytest.mark.parametrize("plate", plates())
def test_a_slit_closes_only_along_its_narrow_part(plate):
    """An hourglass, 4 mm wide in its middle and 6 cm at both ends, and a slit of 15 mm that closes altogether."""
    x, y = plate.V[:, :2].T - 0.5
    hourglass = np.maximum(np.abs(y - 0.2) - 0.002 - 0.1 * np.abs(x), np.abs(x) - 0.3)
    slit = np.maximum(np.abs(y + 0.2) - 0.0075, np.abs(x) - 0.3)
    sheet = opening(plate, np.minimum(hourglass, slit))
    done = cured(plate, sheet, GAP, 0.0)
    assert done.bridged > 0
    assert found(done.cells).gap.size >= 0.999 * GAP
    x, y = void(done.cells) - 0.5
    assert (y > 0.1).all()
    assert 0.07 < np.abs(x).min() < 0.12
    assert area_of_void(done.cells, 0.65) == pytest.approx(area_of_void(sheet, 0.65, above=0.5), rel=1e-9)


@pytest.mark.parametrize("plate", plates())
def test_members_are_widened_also_beside_the_edge_of_the_surface(plate):
    """Between two openings a waist of 1 cm, and 15 mm between one of them and the edge; most are wider."""
    x, y = plate.V[:, :2].T - 0.5
    round_ = (0.2 - np.hypot(x + 0.28, y)), (0.19 - np.hypot(x - 0.12, y)), (0.1 - np.hypot(x - 0.385, y - 0.3))
    sheet = opening(plate, -np.maximum.reduce(round_))
    assert found(sheet).member.size < 0.5 * MEMBER
    done = cured(plate, sheet, 0.0, MEMBER)
    assert done.widened >= 3
    assert found(done.cells).member.size >= 0.999 * MEMBER
    assert material_area(done.cells) - material_area(sheet) < 0.01


def test_openings_beside_wider_members_keep_the_width_of_a_neck():
    """A passage of 3 cm between two rooms is bridged, but only where another place of the sheet had to be cured."""
    plate, neck = plates()[1], 0.04
    x, y = plate.V[:, :2].T - 0.5
    rooms = np.hypot(np.abs(x) - 0.2, y - 0.1) - 0.14
    passage = np.minimum(rooms, np.maximum(np.abs(y - 0.1) - 0.015, np.abs(x) - 0.2))
    alone = opening(plate, passage)
    assert with_least_widths(alone, GAP, MEMBER, neck=neck).cells is alone
    waist = np.maximum(np.abs(x + 0.2) - 0.15, np.abs(y + 0.2) - 0.148)  # a member of 12 mm below a room
    sheet = opening(plate, np.minimum(passage, waist))
    done = with_least_widths(sheet, GAP, MEMBER, neck=neck)
    check_bridged(plate, sheet, done.cells)
    assert done.widened > 0
    assert done.necks > 0
    assert found(done.cells).gap.size >= 0.999 * neck
    assert found(with_least_widths(sheet, GAP, MEMBER).cells).gap.size < 0.9 * neck


def test_openings_that_are_wide_enough_stay():
    plate = plates()[1]
    x, y = plate.V[:, :2].T - 0.5
    sheet = opening(plate, np.maximum(np.abs(np.abs(x) - 0.2) - 0.1, np.abs(y) - 0.3))
    assert with_least_widths(sheet, GAP, MEMBER) == (sheet, 0, 0, 0, 0, 0)
    narrow = opening(plate, np.maximum(np.abs(np.abs(x) - 0.008) - 0.004, np.abs(y) - 0.3))
    assert with_least_widths(narrow, 0.0, 0.0) == (narrow, 0, 0, 0, 0, 0)
    speck = opening(plate, np.hypot(x, y) - 0.009)
    assert with_least_widths(speck, GAP, 0.0).cells.material.all()
    whole = cut(plate, [plate.V[:, 0]], [[-1.0]])
    assert with_least_widths(whole, GAP, MEMBER) == (whole, 0, 0, 0, 0, 0)
