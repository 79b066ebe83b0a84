"""Loose ends of stripes: taken off as far as the member that they cross last, on a plate where areas are known."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.slicing import Tidy, material_area, tidied_sheet
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.surface import Surface
from dsfab.surface.topology import manifold_faults
from tests.zoo import grid

ENDS_AT = 0.75


@pytest.fixture(scope="module")
def plate() -> Surface:
    return grid(40, 40, 1.0, 1.0)


def fields(plate: Surface, ends_at: float = ENDS_AT) -> tuple[list, list]:
    """A stripe .2 wide from the left edge to x = ends_at, where it is blunt, and two across it, .1 wide."""
    x, y = plate.V[:, 0] / np.ptp(plate.V[:, 0]), plate.V[:, 1] / np.ptp(plate.V[:, 1])
    d = np.where(x <= ends_at, 0.1, -0.1)
    across = np.full(plate.n, 0.05)
    return [np.stack([y + d, y - d], axis=1), np.stack([x + across, x - across], axis=1)], [[0.5], [0.25, 0.5]]


def tidy(plate: Surface, astray: np.ndarray | None) -> Tidy:
    return Tidy((True, True), (astray, None), np.zeros(plate.n, dtype=bool))


def near(plate: Surface, low: float, high: float) -> np.ndarray:
    """(m,) faces between two shares of the plate's length."""
    x = plate.centroids[:, 0] / np.ptp(plate.V[:, 0])
    return np.asarray((x > low) & (x < high))


def test_an_end_in_the_air_is_taken_off_to_the_last_crossing(plate):
    drawn, levels = fields(plate)
    loose = tidy(plate, near(plate, 0.74, 0.8))
    sheet = tidied_sheet(plate, drawn, levels, 0, loose)
    x = sheet.surface.centroids[sheet.material][:, 0] / np.ptp(plate.V[:, 0])
    assert x.max() < 0.55
    kept = sheet.surface.areas[sheet.material].sum() / plate.area
    assert kept == pytest.approx(2 * 0.1 + 0.2 * 0.55 - 2 * 0.1 * 0.2, abs=1e-9)
    assert material_area(plate, drawn, levels, 0, loose) / plate.area == pytest.approx(kept)
    assert not manifold_faults(sheet.surface.F, sheet.surface.edges, sheet.surface.n)


def test_without_it_the_end_stays(plate):
    drawn, levels = fields(plate)
    assert material_area(plate, drawn, levels, 0) / plate.area > 0.27 + 0.2 * 0.19


def test_what_reaches_the_boundary_stays(plate):
    drawn, levels = fields(plate, ends_at=2.0)
    whole = material_area(plate, drawn, levels, 0)
    assert material_area(plate, drawn, levels, 0, tidy(plate, near(plate, 0.95, 1.0))) == pytest.approx(whole)


def test_a_part_that_runs_astray_is_taken_off_though_both_its_ends_are_held(plate):
    drawn, levels = fields(plate, ends_at=2.0)
    between = tidy(plate, near(plate, 0.3, 0.45))
    kept = material_area(plate, drawn, levels, 0, between) / plate.area
    assert kept == pytest.approx(2 * 0.1 + 0.2 * 0.85 - 2 * 0.1 * 0.2, abs=1e-9)


def test_a_support_holds_an_end(plate):
    drawn, levels = fields(plate)
    x, y = plate.V[:, 0] / np.ptp(plate.V[:, 0]), plate.V[:, 1] / np.ptp(plate.V[:, 1])
    anchor = (np.abs(x - 0.7) < 1e-9) & (np.abs(y - 0.5) < 1e-9)
    assert anchor.sum() == 1
    held = Tidy((True, True), (near(plate, 0.74, 0.8), None), anchor)
    assert material_area(plate, drawn, levels, 0, held) == pytest.approx(material_area(plate, drawn, levels, 0))


def test_a_crossing_whose_other_member_has_gone_holds_no_end(plate):
    """A wedge comes down into the stripe's end, and above it goes astray: what is left of it hangs on the end itself,
    on two of its three sides."""
    drawn, levels = fields(plate)
    x, y = plate.V[:, 0] / np.ptp(plate.V[:, 0]), plate.V[:, 1] / np.ptp(plate.V[:, 1])
    wedge = y - 0.525 - np.abs(x - 0.65)
    above = plate.centroids[:, 1] / np.ptp(plate.V[:, 1]) > 0.6
    loose = Tidy((True, True, True), (near(plate, 0.74, 0.8), None, above), np.zeros(plate.n, dtype=bool))
    kept = material_area(plate, [*drawn, wedge], [*levels, [0.0]], 0, loose) / plate.area
    assert kept == pytest.approx(2 * 0.1 + 0.2 * 0.55 - 2 * 0.1 * 0.2, abs=1e-9)


def test_an_end_that_touches_two_others_beside_each_other_is_held_in_one_place(plate):
    """A stripe ends in the corner between two that end there as well: each has the other on one of its sides."""
    x, y = plate.V[:, 0] / np.ptp(plate.V[:, 0]), plate.V[:, 1] / np.ptp(plate.V[:, 1])
    frame = np.minimum(x, y)  # kept along two edges of the plate, and a square bite in its corner is the other part
    along = (x + y) / 2
    d = np.where(along < 0.45, 0.08, -0.08)
    stub, square = np.stack([x - y + d, x - y - d], axis=1), np.maximum(x, y)
    blunt = np.abs(plate.centroids[:, :2].sum(axis=1) / 2 / np.ptp(plate.V[:, 0]) - 0.45) < 0.05
    drawn, levels = [-square, -frame, stub], [[-0.15], [-0.1], [0.0]]
    loose = Tidy((True, False, True), (None, None, blunt), np.zeros(plate.n, dtype=bool))
    whole, kept = (material_area(plate, drawn, levels, 0, tidy) for tidy in (None, loose))
    assert kept == pytest.approx((1 - 0.9**2 + 0.05**2) * plate.area, abs=1e-6)
    assert whole > kept * 1.2


def test_a_stripe_that_meets_another_before_a_singular_point_is_divided_as_one_that_meets_it():
    """Where both overlap it belongs to both: later members are to divide it as well, so that it has crossings."""
    strip = grid(6, 1, 6.0, 1.0)
    square = strip.V[strip.F].mean(axis=1)[:, 0].astype(int)
    family, also = np.where(square < 3, 0, 1), np.where(square == 2, 1, -1)
    mesh = replace(PolygonMesh.from_surface(strip), family=family, also=also)
    tidy = Tidy((True, True), (None, None), np.zeros(strip.n, dtype=bool))
    assert np.array_equal(tidy.divided_again(mesh, 1, square == 1), square >= 2)
    assert not tidy.divided_again(mesh, 1, square == 0).any()
