"""Openings of a cut sheet: which are slits, what fills them, and which close as a whole."""

import numpy as np
import pytest

from dsfab import load_preset
from dsfab.design.pattern_measures import largest_filling
from dsfab.slicing import Sheet, Tidy, cut, filled_slits, openings_of, tidied_sheet
from dsfab.slicing.finishing import openings
from dsfab.slicing.finishing.openings import CRUMB, NARROWER, filled_crumbs, filled_openings, with_filled
from dsfab.surface import Surface
from tests.designs import sliced
from tests.meshes import mesh_file
from tests.presets import DOME_MODES, GLOBE_MODES
from tests.shapes import square


def grid_of(surface: Surface, d: float, closed=None) -> Sheet:
    """4 members .1 wide along x, half a metre apart, and 8 along y a quarter metre apart, of half-width d."""
    x, y, _ = surface.V.T
    fields = [np.stack([z + w, z - w], axis=1) for z, w in ((y / 0.5 + 0.5, 0.1), (x / 0.25 + 0.5, d))]
    anchor = np.zeros(surface.n, dtype=bool)
    tidy = None if closed is None else Tidy((True, True), (None, None), anchor, (None, closed))
    return tidied_sheet(surface, fields, [np.arange(-6.0, 8.0)] * 2, 0, tidy)


@pytest.mark.parametrize("d", [0.24, 0.28, 0.4])
def test_slits_are_openings_narrower_than_the_members_beside(d):
    """7 times 5 openings between two members, of (1 - 2 d) to 2 d, those at the edge of the plate cut open."""
    cells = grid_of(square(), d)
    found = openings_of(cells)
    wide = (1 - 2 * d) / (2 * d)
    inner = np.abs(found.centroids[:, 0]) < 0.9
    assert inner.sum() == 35
    assert found.narrowness[inner] == pytest.approx(wide, rel=1e-6)
    assert np.isinf(found.narrowness[~inner]).all()  # no member on the other side
    slits = 35 * (wide < NARROWER)
    assert found.slits.sum() == slits
    both = [found.slits_between(cells.family == k) for k in (0, 1)]
    assert [count for count, _ in both] == [0, slits]
    assert (both[0][1], both[1][1]) == (0, pytest.approx(float(slits > 0)))


def test_slits_are_filled_and_nothing_else():
    """Members are twice as wide on the right of the plate: the openings there are narrower than they are."""
    surface = square()
    cells = grid_of(surface, np.where(surface.V[:, 0] > 0.3, 0.3, 0.15))
    slits = openings_of(cells).slits
    filled, count = filled_slits(cells, "crowded")
    assert 5 < count == slits.sum() < 20
    left = with_filled(cells, slits)
    assert (filled.material == left.material).all()
    assert (filled.family[cells.material] == cells.family[cells.material]).all()
    assert filled_slits(filled) == (filled, 0)
    for alike in (0.2, 0.3, 0.4):  # of so much material no opening can be wide: none is filled
        open_ = grid_of(surface, alike)
        assert filled_slits(open_, "crowded") == (open_, 0)
    whole = Sheet(surface, np.arange(surface.m), np.zeros(surface.m), cut(surface, [surface.V[:, 0]], [[]]).weights)
    assert openings_of(whole) is None


def test_filled_openings_side_by_side_are_found():
    """Openings .5 by .25 m: six on the right of the plate that hang together, and two far from them."""
    before = grid_of(square(), 0.1)
    every = openings_of(before)
    x, y = every.centroids[:, 0], every.centroids[:, 1]
    some = (x > 0.4) & (x < 0.9) & (np.abs(y) < 0.6)
    far = (x < -0.6) & (np.abs(y) > 0.4)
    assert largest_filling(before, before, 0.6) is None
    found = largest_filling(before, with_filled(before, some | far), 0.6)
    assert found.openings == some.sum() == 6 > far.sum() / 2 > 0
    assert found.place == pytest.approx(every.centroids[some].mean(axis=0), abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("given", "told"), [({"pattern.rotate": 45, "surface.edge": 0.4}, True), ({}, False)])
def test_filled_openings_give_a_note_with_their_place(given, told):
    """Around the crown of a dome, where stripes turned by 45 degrees come together in spirals."""
    made = built("dome", **given)
    assert any("side by side around (0, 0, 3.9" in note.text for note in made.notes) == told


def test_crowded_openings_close_as_a_whole_by_the_mean_of_their_members():
    """Where x > .1 in the mean: all openings right of that are material, those left of it as they were."""
    surface = square()
    plain, closed = grid_of(surface, 0.2), grid_of(surface, 0.2, surface.V[:, 0] - 0.1)
    right = closed.surface.centroids[:, 0] > 0.125
    assert closed.material[right].all()
    area = [
        float(one.surface.areas[one.material & (one.surface.centroids[:, 0] < 0.1)].sum()) for one in (plain, closed)
    ]
    assert area[0] == pytest.approx(area[1], rel=1e-9)


def test_openings_that_are_alike_close_alike():
    """Those around x = 0 are .02 and less from where openings close: of one column, all of them do or none."""
    surface = square()
    x, y, _ = surface.V.T
    closed = grid_of(surface, 0.2, x + 0.02 * np.sign(y))
    void = openings_of(closed)
    assert (np.abs(void.centroids[:, 0]) < 0.05).sum() in (0, 5)


@pytest.mark.parametrize(("radius", "count"), [(0.12, 0), (0.05, 1)])
def test_an_opening_with_a_long_tip_is_not_as_small_as_its_tip_is_narrow(radius, count):
    """An equilateral triangle with a slit .04 m wide at a corner, whose walls alone are opposite to each other.

    4 area / perimeter is .177 m, or .088 around a small triangle, which is little more than the slit's.
    """
    surface = square(60, 0.5)
    x, y, _ = surface.V.T
    sides = [np.cos(a) * (x + 0.2) + np.sin(a) * y - radius for a in np.radians([60, 180, 300])]
    slit = np.max([-0.2 - x, x - 2 * radius - 0.2, np.abs(y) - 0.02], axis=0)
    cells = cut(surface, [np.minimum(np.max(sides, axis=0), slit)], [[0.0]], 0)
    found = openings_of(cells)
    assert found.hydraulic_diameters == pytest.approx([0.177 if radius > 0.1 else 0.088], rel=0.05)
    assert filled_openings(cells, 0.06)[1] == count


def test_few_walls_more_or_less_make_no_other_opening():
    """A slit that widens to a triangle, in a ring of .05 m, gets longer: on the mesh its walls are opposite to each
    other on 18 to 32 % of all, up and down, and it was 1, 1, 2.5 and 1 times as wide as the ring.
    """
    surface = square(60, 0.5)
    x, y, _ = surface.V.T
    triangle = np.max([np.cos(a) * (x + 0.2) + np.sin(a) * y - 0.05 for a in np.radians([60, 180, 300])], axis=0)

    def narrowness(length: float) -> float:
        slit = np.max([-0.2 - x, x + 0.2 - length, np.abs(y) - 0.02], axis=0)
        f = np.minimum(triangle, slit)
        found = openings_of(cut(surface, [np.stack([f, f - 0.05], axis=1)], [[0.0]], 0))
        return float(found.narrowness[np.isfinite(found.hydraulic_diameters)].item())

    judged = np.array([narrowness(length) for length in (0.12, 0.14, 0.16, 0.18)])
    assert np.abs(np.diff(judged)).max() < 0.03
    assert judged == pytest.approx(0.985, abs=0.02)


@pytest.mark.parametrize("left", [0.02, 0.03, 0.06])
def test_crumbs_are_openings_far_smaller_than_most(left):
    """A broad member leaves so many metres of the .15 of one column of openings, which are .4 long."""
    surface = square()
    x, y, _ = surface.V.T
    across = (left, 0.15)
    size = [4 * 0.4 * width / (2 * (0.4 + width)) for width in across]
    bands = [(y / 0.5 + 0.5, 0.1), (x / 0.25 + 0.5, 0.2), (x + left / 2 + 0.01, 0.085 - left / 2)]
    fields = [np.stack([z + w, z - w], axis=1) for z, w in bands]
    cells = cut(surface, fields, [np.arange(-6.0, 8.0), np.arange(-6.0, 8.0), np.zeros(1)], 0)
    found = openings_of(cells)
    crumbs = (np.abs(found.centroids[:, 0]) < 0.1) & np.isfinite(found.hydraulic_diameters)
    assert found.hydraulic_diameters[crumbs] == pytest.approx(size[0], rel=1e-6)
    filled, count = filled_crumbs(cells)
    small = size[0] < CRUMB * size[1]
    assert count == (crumbs.sum() if small else 0)
    assert count == (3 if small else 0)
    gain = float(filled.surface.areas[filled.material].sum() - cells.surface.areas[cells.material].sum())
    assert gain == pytest.approx(3 * 0.4 * left if small else 0, rel=1e-6)
    assert filled_crumbs(filled) == (filled, 0)


@pytest.mark.parametrize(("member", "count"), [(0.02, 0), (0.025, 0), (0.035, 3), (0.06, 3)])
def test_small_openings_between_thin_members_are_no_crumbs(member, count):
    """Of a column .08 m wide, a quarter of the others' size: 4 to 1.3 times as wide as members; 2.5 is the limit."""
    surface = square()
    x, y, _ = surface.V.T
    side = 0.04 + member / 2
    bands = [(y / 0.5 + 0.5, member), (x / 0.5 + 0.5, member), (x - side, member / 2), (x + side, member / 2)]
    fields = [np.stack([z + w, z - w], axis=1) for z, w in bands]
    lines = np.arange(-3.0, 4.0)
    cells = cut(surface, fields, [lines, lines[np.abs(lines - 0.5) > 1], np.zeros(1), np.zeros(1)], 0)
    assert filled_crumbs(cells)[1] == count


def test_few_openings_give_no_usual_size(monkeypatch):
    cells = grid_of(square(), 0.2)
    assert filled_crumbs(cells) == (cells, 0)
    monkeypatch.setattr(openings, "CRUMB", 5.0)  # all of them
    assert filled_crumbs(cells)[1] > 0
    monkeypatch.setattr(openings, "SEVERAL", 1000)
    assert filled_crumbs(cells) == (cells, 0)


@pytest.mark.slow
def test_the_crown_of_one_family_has_no_holes():
    """Four holes of a sixth of the others stood where its meridians meet, beside the disc that is kept there."""
    coarse = {"surface.edge": 0.4, "pattern.families": "minor", "pattern.minor.spacing": 0.8}
    made = built("dome", **coarse)
    sizes = openings_of(made.slicing.cells).hydraulic_diameters
    assert sizes.min() > 0.35 * np.median(sizes)
    said = built("dome", **coarse, **{"slicing.min_opening": 0.01, "pattern.tidy": False})  # what is said counts
    sizes = openings_of(said.slicing.cells).hydraulic_diameters
    assert sizes.min() < 0.35 * np.median(sizes)


def built(name, **given):
    """Metric and sheet of a preset."""
    return sliced(load_preset(name, given))


@pytest.mark.slow
def test_the_crown_of_a_sphere_closes_as_a_whole():
    """It had 18 ragged holes, of which two counted as slits: openings that closed from one end."""
    made = built("sphere_graded")
    quality = made.quality(symmetry=False)
    assert (quality.dead_ends, quality.slits) == (0, 0)
    top = openings_of(made.slicing.cells).centroids[:, 2]
    assert top.max() < 0.8
    assert made.sheet.surface.area / made.surface.area == pytest.approx(0.5, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "edge", "slits"), [("cantilever", 0.06, 20), pytest.param(DOME_MODES, 0.28, 29, marks=pytest.mark.slow)]
)
def test_tidied_modes_have_neither_slits_nor_dead_ends_and_keep_their_share(name, edge, slits):
    """As many openings as that were narrower than the members beside them; of the globe, see the next test."""
    made = built(name, **{"surface.edge": edge, "pattern.tidy": True})
    quality = made.quality(symmetry=False)
    assert (quality.dead_ends, quality.slits) == (0, 0)
    assert made.sheet.surface.area / made.surface.area == pytest.approx(
        made.preset.pattern.width.solid_fraction, abs=2e-3
    )
    drawn = openings_of(tidied_sheet(made.surface, *made.pattern.cut_inputs[:2], 0.05, made.pattern.tidy))
    assert drawn.slits.sum() > slits / 2


@pytest.mark.slow
def test_tips_that_are_filled_leave_no_slits():
    """What is left of four openings is narrower than the members beside."""
    made = built(GLOBE_MODES, **{"surface.edge": 0.1, "pattern.tidy": True, "pattern.workshop": True})
    quality = made.quality(symmetry=False)
    assert (quality.dead_ends, quality.slits) == (0, 0)
    (told,) = [note.text for note in made.notes if "(slicing.min_gap, min_member)" in note.text]
    assert "4 openings that became narrower than the members beside them were filled" in told
    assert made.sheet.surface.area / made.surface.area == pytest.approx(0.45, abs=2e-3)


COARSER = {"barrel_vault": 0.3, "dome": 0.4, "globe": 0.09, "snow_vault": 0.35, "tower": 0.8}
"""Metres, of the triangles' edges."""


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["constant", "graded"])
@pytest.mark.parametrize("name", COARSER)
def test_no_preset_has_a_slit_or_a_dead_end_by_any_width(name, rule):
    """By its own rule as design/test_pipeline.py makes it, by the other on a coarser mesh."""
    own = load_preset(name).pattern.width.rule == rule
    changes = {} if own else {"pattern.width.rule": rule, "surface.edge": COARSER[name]}
    quality = built(name, **changes).quality(symmetry=False)
    assert (quality.dead_ends, quality.slits) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "given"),
    [
        ("barrel_vault.obj", {}),
        ("Botanic.obj", {"statics.thickness": 0.1}),
        ("canopy_quad.obj", {"surface.refine": 0.15}),
        ("hypar.obj", {"surface.refine": 0.15}),
        ("roof_with_opening.obj", {"surface.refine": 0.15}),
        ("shell_tube.obj", {"surface.refine": 0.2}),
    ],
)
def test_no_roof_has_a_slit_or_a_dead_end(file, given):
    """design/test_pipeline.py makes solids of three of them."""
    made = sliced(load_preset("roof", given, mesh=mesh_file(file)))
    quality = made.quality(symmetry=False)
    assert (quality.dead_ends, quality.slits) == (0, 0)
    assert made.sheet.surface.area / made.surface.area == pytest.approx(0.5, abs=5e-3)
