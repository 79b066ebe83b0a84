"""Bars whose stripes miss each other where they meet: on a plate with two posts, where the straight bar is known."""

import numpy as np
import pytest

from dsfab.slicing import Sheet, Tidy, cut, material_area, straight_bars
from dsfab.surface.corner_field import CornerField
from dsfab.surface.topology import manifold_faults
from tests.test_slicing_stubs import FRAME, HALF, HIGH, LONG, PLATE, blank_face, material, parts

LOW, AT, STEP = 1.45, 2.25, 0.25
LEFT, RIGHT = 1.1, 3.9
"""Where the two posts, .2 wide, end towards each other."""


def sheet_of(rise: float, snap: float = 0.0) -> Sheet:
    """A stripe .3 wide from the left, that goes on higher by `rise` behind one column of faces; one of these is blank,
    so that it is two stripes that meet in a node."""
    x, y, _ = PLATE.V.T
    z = y - LOW - rise * np.clip((x - AT) / STEP, 0, 1)
    band = np.stack([z + HALF, z - HALF], axis=1)
    stripe = CornerField(band, np.ones((PLATE.m, 3)), np.zeros((PLATE.m, 3)), blank_face(AT + 0.2, 1.5))
    d = np.full(PLATE.n, 0.1)
    fields = [-np.minimum(y, HIGH - y), stripe, np.stack([x + d, x - d], axis=1)]
    levels = [[-FRAME], [0.0], [LEFT - 0.1, RIGHT + 0.1]]
    tidy = Tidy((False, True, True), (None,) * 3, np.zeros(PLATE.n, dtype=bool))
    sheet = cut(PLATE, fields, levels, snap, tidy)
    assert material_area(PLATE, fields, levels, snap, tidy) == pytest.approx(material(sheet))
    assert sheet.surface.area == pytest.approx(PLATE.area)
    assert not manifold_faults(sheet.surface.F, sheet.surface.edges, sheet.surface.n)
    assert parts(sheet) == 1
    return sheet


def outline(sheet: Sheet, rise: float) -> np.ndarray:
    """(k,) metres by which corners of the bar lie above the middle of the straight one between the posts."""
    surface = sheet.surface
    x, y, _ = surface.V[np.unique(surface.F[sheet.material])].T
    bar = (x > LEFT) & (x < RIGHT) & (y > 2 * FRAME) & (y < HIGH - 2 * FRAME)
    return y[bar] - LOW - rise * (x[bar] - LEFT) / (RIGHT - LEFT)


@pytest.mark.parametrize("rise", [0.2, -0.2])
def test_a_bar_with_a_jog_becomes_straight_between_its_posts(rise, monkeypatch):
    sheet = sheet_of(rise)
    assert sheet.stubs == 1
    off = outline(sheet, rise)
    edge = straight_bars.SNAP * 2 * HALF
    assert np.abs(off).max() <= HALF + edge
    area = 2 * FRAME * LONG + 2 * 0.2 * (HIGH - 2 * FRAME) + 2 * HALF * (LONG - 0.4)
    assert material(sheet) == pytest.approx(area, abs=edge * (RIGHT - LEFT))
    monkeypatch.setattr(straight_bars, "ASKEW", 9.0)
    plain = sheet_of(rise)
    assert plain.stubs == 0
    assert np.abs(outline(plain, rise)).max() > HALF + 0.08


def test_a_bar_that_is_straight_but_for_less_than_is_seen_stays():
    sheet = sheet_of(0.03)
    assert sheet.stubs == 0


def test_a_member_that_bends_stays(monkeypatch):
    """It leaves the straight line by more than it may: what is far from it is not a jog."""
    monkeypatch.setattr(straight_bars, "FAR", 0.3)
    assert sheet_of(0.2).stubs == 0


def test_a_bar_that_would_lose_most_of_itself_stays(monkeypatch):
    monkeypatch.setattr(straight_bars, "LARGER", 1.0)
    assert sheet_of(0.2).stubs == 0
