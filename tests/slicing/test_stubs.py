"""Stubs that meet past their last crossings: on a plate of five rows between two kept edges, where areas are known."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dsfab.design import draft
from dsfab.design.pattern_measures import measured_pattern
from dsfab.preset.file import with_overrides
from dsfab.preset.proposal import preset_for
from dsfab.slicing import Tidy, material_area, tidied_sheet
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.finishing.stubs import LARGE, LARGER
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import manifold_faults
from tests.meshes import mesh_file
from tests.own_meshes import OWN
from tests.slicing.posts import FRAME, HALF, HIGH, LONG, PLATE, STEP, blank_face, material, parts


def stripe(y: float, blank: np.ndarray) -> CornerField:
    """One along a height, .3 wide, but for blank faces (m,)."""
    z = PLATE.V[:, 1] - y
    return CornerField(np.stack([z + HALF, z - HALF], axis=1), np.ones((PLATE.m, 3)), np.zeros((PLATE.m, 3)), blank)


def sheet_of(posts: list[float], y: float, at: float, more: tuple = (), kept_edges: bool = True) -> Sheet:
    """Two edges and what else is kept, a stripe that is broken at one face, and posts across it, .2 wide."""
    x, d = PLATE.V[:, 0], np.full(PLATE.n, 0.1)
    edge = np.minimum(PLATE.V[:, 1], HIGH - PLATE.V[:, 1])
    fields = [
        -edge - (0 if kept_edges else LONG),
        *more,
        stripe(y, blank_face(at, y)),
        np.stack([x + d, x - d], axis=1),
    ]
    levels = [[-FRAME], *([0.0] for _ in more), [0.0], posts]
    striped = (False, *(False for _ in more), True, True)
    tidy = Tidy(striped, (None,) * len(striped), np.zeros(PLATE.n, dtype=bool))
    sheet = tidied_sheet(PLATE, fields, levels, 0, tidy)
    assert material_area(PLATE, fields, levels, 0, tidy) == pytest.approx(material(sheet))
    assert sheet.surface.area == pytest.approx(PLATE.area)
    assert not manifold_faults(sheet.surface.F, sheet.surface.edges, sheet.surface.n)
    assert parts(sheet) == 1
    return sheet


def whole(posts: list[float]) -> float:
    """Area of both edges, the posts and the stripe, nothing missing."""
    return 2 * FRAME * LONG + 0.2 * len(posts) * (HIGH - 2 * FRAME) + 2 * HALF * (LONG - 0.2 * len(posts))


def test_a_bar_across_one_opening_is_cut_off_at_both_members():
    """Without it an opening is .8 x 2.8, and most are .8 x 1.25: 1.3 times as large."""
    posts = [1.0, 2.0, 3.0, 4.0]
    sheet = sheet_of(posts, 1.5, 2.45)
    assert sheet.stubs == 1
    assert material(sheet) == pytest.approx(whole(posts) - 2 * HALF * 0.8, abs=1e-9)
    x, y, _ = sheet.surface.centroids[sheet.material].T
    assert not ((x > 2.1) & (x < 2.9) & (y > FRAME) & (y < HIGH - FRAME)).any()


def test_a_stub_stays_if_its_removal_opens_a_large_gap():
    posts = [1.0, 4.0]
    sheet = sheet_of(posts, 1.5, 2.45)
    assert sheet.stubs == 0
    assert material(sheet) == pytest.approx(whole(posts), abs=1e-9)


def test_a_stub_that_parts_an_eyelet_is_removed(monkeypatch):
    """Without it an opening is 1.3 x 2.8, over twice the size of most; it parts one of 1.97 from one of .53 height."""
    posts = [1.0, 2.5, 3.5, 4.4]
    sheet = sheet_of(posts, 2.22, 1.7)
    assert sheet.stubs == 1
    assert material(sheet) == pytest.approx(whole(posts) - 2 * HALF * 1.3, abs=1e-9)
    monkeypatch.setattr("dsfab.slicing.finishing.stubs.EYELET", 0.0)
    assert sheet_of(posts, 2.22, 1.7).stubs == 0


def test_a_bar_between_two_good_openings_stays(monkeypatch):
    """Both halves are larger than most, though the opening without it would be no larger than is allowed."""
    posts = [1.0, 2.0, 3.0, 4.18]
    sheet = sheet_of(posts, 1.5, 3.45)
    assert sheet.stubs == 0
    assert material(sheet) == pytest.approx(whole(posts), abs=1e-9)
    monkeypatch.setattr("dsfab.slicing.finishing.stubs.GOOD", 9.0)
    assert sheet_of(posts, 1.5, 3.45).stubs == 1


def test_a_bar_that_holds_the_sheet_together_stays():
    """Posts without the edges hang on the stripe alone."""
    assert sheet_of([1.0, 2.0, 3.0, 4.0], 1.5, 2.45, kept_edges=False).stubs == 0


def test_no_end_is_made():
    """A tongue that is kept comes from the right, past a post, and the stripe goes on from it: cut off there the tongue
    would end in the air. The openings alone would allow it: without the tongue the stripe goes."""
    y, d = PLATE.V[:, 1] - 1.5, np.where(PLATE.V[:, 0] < 2.9, -4 * HALF, HALF)
    tongue = np.stack([y + d, y - d], axis=1)
    posts = [1.0, 2.2, 3.4, 4.2]
    assert [sheet_of(posts, 1.5, 2.7, more).stubs for more in ((tongue,), ())] == [0, 1]


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0.5, 1.4), min_size=3, max_size=6), st.floats(1.36, 1.64), st.integers(2, 17))
def test_a_bar_between_two_posts_is_removed_as_a_whole_or_not_at_all(steps, y, column):
    """Posts anywhere, the node in any face of the middle row: the sheet is one piece, and the bar between two posts is
    gone from one to the other, or is all there."""
    posts = [float(p) for p in np.cumsum(steps) if p < LONG - 0.4]
    middle = STEP * (column + 0.5)
    assume(all(abs(p - middle) > 0.25 for p in posts))  # the face is free of posts
    sheet = sheet_of(posts, y, middle + 0.07)
    sides = np.array([-0.1, *posts, LONG + 0.1])
    k = int(np.searchsorted(sides, middle))
    bar = 2 * HALF * (sides[k] - sides[k - 1] - 0.2)
    assert material(sheet) == pytest.approx(whole(posts) - sheet.stubs * bar, abs=1e-3)  # thin corners stay


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least", "gone"), [("roof", 1, (4.23, 3.15)), ("terrain", 5, (26.9, 9.15))])
def test_hooks_of_imported_surfaces_are_removed_without_new_defects(name, least, gone, tmp_path, monkeypatch, request):
    """A hook under a member of the roof; and an ear of two stubs that overlap at the rim of a terrain."""
    monkeypatch.setattr("dsfab.slicing.cutting.halving.GAIN", np.inf)  # with less crowded lines both have fewer
    if name == "roof":
        request.getfixturevalue("rough_shares")  # its hook stays; the ear of the terrain moves with its share
    mesh = mesh_file("roof_with_opening.obj") if name == "roof" else OWN["terrain"](tmp_path)
    made = draft(with_overrides(preset_for(mesh), {"pattern.major.spacing": 0.3} if name == "roof" else {}))
    found = []
    for large, larger in ((0.0, 0.0), (LARGE, LARGER)):
        monkeypatch.setattr("dsfab.slicing.finishing.stubs.LARGE", large)
        monkeypatch.setattr("dsfab.slicing.finishing.stubs.LARGER", larger)
        sheet = tidied_sheet(
            made.surface, made.pattern.fields, made.pattern.levels, made.preset.slicing.snap, made.pattern.tidy
        )
        solid = sheet.subset().surface
        away = np.linalg.norm(solid.centroids[:, :2] - gone, axis=1).min() / made.preset.pattern.major.spacing
        found.append((sheet.stubs, parts(sheet), measured_pattern(made, False, sheet).dead_ends, away))
    (_, pieces_before, ends_before, near), (stubs, pieces_after, ends_after, far) = found
    assert stubs >= least
    assert pieces_before == pieces_after == 1
    assert ends_after <= ends_before
    assert near < 0.1 < 0.3 < far


@pytest.mark.parametrize(("gap", "count"), [(0.3, 0), (0.4, 1)])
def test_a_bar_across_a_narrow_opening_stays_if_the_opening_without_it_is_small(gap, count):
    """Without the bar the opening is 0.55 or 0.72 times as large as most."""
    middle, half = 2.375, gap / 2 + 0.1
    posts = [middle - half - 1, middle - half, middle + half, middle + half + 1]
    assert sheet_of(posts, 1.5, 2.45).stubs == count
