"""Bars whose stripes miss each other where they meet: on a plate with two posts, where the straight bar is known."""

import numpy as np
import pytest

from dsfab.slicing import Sheet, Tidy, material_area, tidied_sheet
from dsfab.slicing.cutting.cells import Cells
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.finishing import straight_bars
from dsfab.slicing.finishing.straight_bars import FairBar
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import manifold_faults
from tests.slicing.posts import FRAME, HALF, HIGH, LONG, PLATE, blank_face, material, parts

LOW, AT, STEP = 1.45, 2.25, 0.25
LEFT, RIGHT = 1.1, 3.9
"""Where the two posts, .2 wide, end towards each other."""


def sheet_of(
    rise: float, blank: tuple[float, float] = (AT + 0.2, 1.5), widest: float = HALF, narrowest: float = HALF
) -> Sheet:
    """A stripe from the left, that goes on higher by `rise` behind one column of faces; one of these is blank, so that
    it is two stripes that meet in a node, or passes by. Its half-width is `narrowest` at the posts."""
    x, y, _ = PLATE.V.T
    z = y - LOW - rise * np.clip((x - AT) / STEP, 0, 1)
    half = np.where((x > 1.3) & (x < 3.7), widest, narrowest)
    band = np.stack([z + half, z - half], axis=1)
    stripe = CornerField(band, np.ones((PLATE.m, 3)), np.zeros((PLATE.m, 3)), blank_face(*blank))
    d = np.full(PLATE.n, 0.1)
    fields = [-np.minimum(y, HIGH - y), stripe, np.stack([x + d, x - d], axis=1)]
    levels = [[-FRAME], [0.0], [LEFT - 0.1, RIGHT + 0.1]]
    tidy = Tidy((False, True, True), (None,) * 3, np.zeros(PLATE.n, dtype=bool))
    sheet = tidied_sheet(PLATE, fields, levels, 0.0, tidy)
    assert material_area(PLATE, fields, levels, 0.0, tidy) == pytest.approx(material(sheet))
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


@pytest.mark.parametrize(("rise", "count"), [(0.75, 1), (1.05, 0)])
def test_a_member_that_bends_by_more_than_one_and_a_half_widths_stays(rise, count):
    """What is so far from the straight line is not a jog; its outline is off by 5 / 3 of the rise, in widths."""
    assert sheet_of(rise).stubs == count


@pytest.mark.parametrize(("half", "count"), [(0.14, 1), (0.19, 0)])
def test_a_bar_that_would_lose_most_of_itself_stays(half, count):
    """It is .12 m wide at both posts, as the straight one is, and over twice as wide between them."""
    assert sheet_of(0.06, widest=half, narrowest=0.06).stubs == count


BESIDE = (AT + 0.2, 1.85)
"""In the row of faces above the stripe."""


@pytest.mark.parametrize("rise", [0.2, -0.2])
def test_a_stripe_that_is_thrown_aside_by_a_singular_point_gets_an_even_bow(rise, monkeypatch):
    sheet = sheet_of(rise, blank=BESIDE)
    assert sheet.stubs == 1
    monkeypatch.setattr(straight_bars, "UNEVEN", 9.0)
    jog = sheet_of(rise, blank=BESIDE)
    assert jog.stubs == 0
    steepest = [steepness(each) for each in (sheet, jog)]
    assert steepest[1] == pytest.approx(abs(rise) / STEP)
    assert steepest[0] < 0.4 * steepest[1]


def test_a_stripe_beside_a_singular_point_that_is_even_stays():
    assert sheet_of(0.03, blank=BESIDE).stubs == 0


def test_a_jog_that_no_singular_point_explains_stays():
    assert sheet_of(0.2, blank=(0.2, 2.7)).stubs == 0


def steepness(sheet: Sheet) -> float:
    """How steep the bar's walls are at most between the posts, of pieces that are longer than a few millimetres."""
    surface, found = sheet.surface, []
    for f, other in zip(*(side // 3 for side in surface.edges.pairs.T), strict=True):
        if sheet.material[f] != sheet.material[other]:
            a, b = surface.V[np.intersect1d(surface.F[f], surface.F[other])]
            low, high = sorted((a[0], b[0]))
            if low > LEFT + 0.1 and high < RIGHT - 0.1 and min(a[1], b[1]) > 1 and high - low > 0.02:
                found.append(abs((b[1] - a[1]) / (b[0] - a[0])))
    return max(found)


def test_the_bow_of_a_bar_is_that_of_its_walls():
    """A cubic through both ends, in quads between two posts, seen from above and from the other side."""
    t = np.linspace(0, 1, 41)
    middle = t * (1 - t) * (0.3 - 0.8 * t)
    X = np.concatenate([np.stack([2 * t, middle + side, 0 * t], axis=1) for side in (-0.05, 0.05)])
    X = np.vstack([X, [[-1, -1, 0], [-1, 1, 0], [3, -1, 0], [3, 1, 0]]])
    quads = [[k, k + 1, k + 42, k + 41] for k in range(40)]
    posts = [[82, 0, 41, 83], [40, 84, 85, 81]]
    open_ = [[82, 84, *range(40, -1, -1)], [83, *range(41, 82), 85]]
    polygons = [*quads, *posts, *open_]
    for corners, sign in ((polygons, 1), ([polygon[::-1] for polygon in polygons], -1)):
        sizes = [len(polygon) for polygon in corners]
        cells = Cells(np.cumsum([0, *sizes]), np.concatenate(corners))
        count = len(corners)
        family = np.array([0] * 40 + [1] * 2 + [-1] * 2)
        mesh = PolygonMesh.from_cells(np.zeros((0, 3), int), cells, X, None, np.zeros(count, int), family)
        bar = FairBar.straight(mesh, family == 0).with_bow(mesh)
        assert bar.half == pytest.approx((0.05, 0.05), rel=0.01)
        ahead = sign * (1 if bar.ends[1][0] > bar.ends[0][0] else -1)
        a, b = bar.bow if bar.ends[1][0] > bar.ends[0][0] else (sum(bar.bow), -bar.bow[1])
        assert (ahead * a, ahead * b) == pytest.approx((0.3, -0.8), abs=0.01)
        assert bar.deviation(mesh) < 0.05
