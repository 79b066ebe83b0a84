"""Measures of a pattern: closed forms on plates and a fan, then the presets, told wherever a design is."""

import json

import numpy as np
import pytest

from dsfab import load_preset
from dsfab.app.build import Files, PictureFlags, build
from dsfab.app.build_page import Output
from dsfab.app.editor.drafts import sheet_figures, tidied_cut
from dsfab.app.listing import inspect
from dsfab.app.options import Source
from dsfab.design import Design, draft, run
from dsfab.design.pattern_measures import cut_error, symmetry_error
from dsfab.diffusion.symmetry import checked_symmetry
from dsfab.report.compliance.tables import pattern_table
from dsfab.report.design.inspection import quality_facts, quality_lines
from dsfab.report.html_pages import CaptionNumbers
from dsfab.slicing import cut
from dsfab.slicing.measures.pattern_quality import pattern_quality
from dsfab.study.comparison import comparison
from dsfab.study.sweeps import METRICS
from dsfab.surface import Surface
from tests.pattern.plain_stripes import drawn
from tests.presets import DOME_MODES
from tests.shapes import square

EVEN = {
    "pattern.method": "stripes",
    "pattern.major.frequency": 0.0,
    "pattern.major.spacing": 1.1,
    "pattern.minor.frequency": 0.0,
    "pattern.minor.spacing": 0.55,
}


def measured(made, angle=0.0):
    """Under tension along x, turned by an angle, and compression across it: major members should run along x."""
    m = made.surface.m
    e = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0]])
    return pattern_quality(made, np.tile([2.0, -1.0], (m, 1)), np.broadcast_to(e, (m, 2, 3)), np.ones(m))


def test_straight_stripes_have_their_spacing_openings_and_right_angles():
    surface = square()
    x, y, _ = surface.V.T
    found = measured(drawn(surface, (y / 0.31 + 0.2, x / 0.43 + 0.1), (0.1, 0.2)))
    assert found.major.spacing == pytest.approx((0.31,) * 3)
    assert found.minor.spacing == pytest.approx((0.43,) * 3)
    assert found.major.opening == pytest.approx((0.8 * 0.31,) * 3)
    assert found.minor.opening == pytest.approx((0.6 * 0.43,) * 3)
    assert (found.evenness, found.dead_ends, found.slits) == (pytest.approx(1), 0, 0)
    assert found.crossing_angle == pytest.approx(90)
    assert (found.major.deviation, found.minor.deviation) == pytest.approx((0, 0), abs=1e-5)
    start = "no dead ends, no slits, members 0.0 degrees off the stress direction, crossing at 90"
    assert found.summary.startswith(start)


def test_kept_regions_do_not_count_in_the_quality_of_stripes():
    surface = square()
    x, y, _ = surface.V.T
    z = y / 0.31, np.where(x < 0, x / 0.2, x / 0.4)
    whole, half = (measured(drawn(surface, z, 0.1, kept=kept)) for kept in (None, 0.01 - x))
    assert whole.minor.spacing == pytest.approx((0.2, 0.2, 0.4))
    assert half.minor.spacing == pytest.approx((0.4, 0.4, 0.4))


def test_members_off_the_stress_are_off_by_their_angle():
    surface = square()
    x, y, _ = surface.V.T
    z = y / 0.3, (np.cos(0.3) * x + np.sin(0.3) * y) / 0.4
    found = measured(drawn(surface, z, 0.1), angle=0.2)
    assert found.major.deviation == pytest.approx(np.degrees(0.2))
    assert found.minor.deviation == pytest.approx(np.degrees(0.1))
    assert found.deviation == pytest.approx(np.degrees(0.2))
    assert found.crossing_angle == pytest.approx(90 - np.degrees(0.3))
    far = measured(drawn(surface, z, 0.1), angle=0.8)
    assert (far.major.off, far.minor.off) == pytest.approx((1, 0))


def test_a_fan_has_the_spacings_of_its_radii():
    """Radial members 1/40 of a turn apart between radii 1 and 2, whose square is even over the area."""
    flat = square(80, 0.5)
    radius, turn = 1.5 + flat.V[:, 0], (np.pi / 2) * flat.V[:, 1]
    surface = Surface(np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], axis=1), flat.F)
    made = drawn(surface, (radius / 0.2, turn * 40 / (2 * np.pi)), 0.1)
    e = surface.centroids / np.linalg.norm(surface.centroids, axis=1, keepdims=True)
    across = np.cross([0.0, 0.0, 1.0], e)
    direction = np.stack([across, e], axis=1)
    found = pattern_quality(made, np.ones((surface.m, 2)), direction, np.ones(surface.m))
    wanted = np.sqrt(1 + 3 * np.array([0.05, 0.5, 0.95])) * 2 * np.pi / 40
    assert found.minor.spacing == pytest.approx(tuple(wanted), rel=5e-3)
    assert found.minor.evenness == pytest.approx(wanted[2] / wanted[0], rel=5e-3)
    assert found.major.spacing == pytest.approx((0.2,) * 3, rel=1e-3)
    assert found.major.dead + found.minor.dead == 0


@pytest.mark.parametrize("step", [0.0, 0.013])  # lines through vertices, and beside them
def test_each_line_that_stops_between_members_is_a_loose_end(step):
    surface = square()
    x, y, _ = surface.V.T
    centre = surface.centroids
    known = np.ones((surface.m, 2), dtype=bool)
    known[:, 1] = centre[:, 1] < 0.25  # members along y end where y is .25
    z = (y - 0.25 + step) / 0.5, (x + step) / 0.25
    beside, on = (measured(drawn(surface, (z[0] + off, z[1]), 0.12, known)) for off in (0.5, 0.0))
    lines = int((np.abs(np.arange(-8, 9) * 0.25 - step) < 1 - 1e-9).sum()) + 2 * (step == 0)
    assert (len(beside.minor.dead_ends.loose), len(beside.minor.dead_ends.turns)) == (lines - 2 * (step == 0), 0)
    assert beside.minor.dead_ends.loose[:, 1] == pytest.approx(0.25)
    assert on.dead_ends == 0  # the member along x at .25 is there
    kept = measured(drawn(surface, (z[0] + 0.5, z[1]), 0.12, known, kept=0.05 - np.abs(y - 0.25)))
    assert kept.dead_ends == 0


@pytest.mark.parametrize("cells", [23, 24, 40])
def test_a_line_that_turns_back_is_a_turn_and_a_closed_one_two(cells):
    surface = square(cells)
    x, y, _ = surface.V.T
    nothing = np.full(surface.n, 0.4)  # the other family has no line
    arches = measured(drawn(surface, (nothing, (y + 2 * x**2) / 0.37), 0.1))
    inside = [k for k in range(-9, 9) if -1 < 0.37 * k < 1]
    assert len(arches.minor.dead_ends.turns) == len(inside)
    assert np.sort(arches.minor.dead_ends.turns[:, 1]) == pytest.approx(0.37 * np.array(inside), abs=0.02)
    loops = measured(drawn(surface, (nothing, np.hypot(x - 0.02, y) / 0.3), 0.1))
    assert len(loops.minor.dead_ends.turns) == 2 * 3
    assert len(loops.minor.dead_ends.loose) == 0


def test_a_sharp_turn_is_one_and_one_on_a_crossing_member_is_none():
    surface = square()
    x, y, _ = surface.V.T
    z = (y + 4 * np.abs(x)) / 0.4  # off the stress by 14 degrees only
    assert len(measured(drawn(surface, (y * 0 + 0.4, z), 0.1)).minor.dead_ends.turns) == 5
    assert measured(drawn(surface, (y / 0.4, z), 0.1)).dead_ends == 0


def test_lines_go_on_where_the_chart_is_cut_open():
    """The plate cut along x = 0, its right part with both phases turned over and shifted."""
    flat = square()
    x, y, _ = flat.V.T
    right = flat.centroids[:, 0] > 0
    F = np.where(right[:, None], flat.F + flat.n, flat.F)
    used, F = np.unique(F, return_inverse=True)
    surface = Surface(np.concatenate([flat.V, flat.V])[used], F.reshape(-1, 3))
    z = y / 0.31 + 0.2, x / 0.4 + 0.5  # no member along the cut
    both = [np.concatenate([one, 3 - one])[used] for one in z]
    cut, whole = measured(drawn(surface, both, 0.1)), measured(drawn(flat, z, 0.1))
    assert cut.dead_ends == whole.dead_ends == 0
    assert cut.major.spacing == pytest.approx(whole.major.spacing)
    apart = measured(drawn(surface, [np.concatenate([z[0], z[0] + 0.5])[used], both[1]], 0.1))
    assert len(apart.major.dead_ends.loose) == 7 + 6  # at the cut, from both sides


def test_openings_narrower_than_members_are_counted_bay_by_bay():
    surface = square()
    x, y, _ = surface.V.T
    z = y / 0.5 + 0.5, x / 0.25 + 0.5  # 4 lines along x, 8 along y
    wide, narrow = (measured(drawn(surface, z, (0.1, d))) for d in (0.24, 0.26))
    assert (wide.slits, wide.minor.slit_share) == (0, 0.0)
    assert (narrow.slits, narrow.major.slits) == (8 * 5, 0)
    assert narrow.minor.slit_share == pytest.approx(1)
    filled = measured(drawn(surface, z, (0.1, 0.5)))
    assert (filled.slits, filled.minor.opening) == (0, (0.0, 0.0, 0.0))


def test_material_that_is_shifted_differs_from_its_mirror_image():
    surface = square(60)
    x = surface.V[:, 0]
    mirror = checked_symmetry(surface, np.stack([np.eye(3), np.diag([-1.0, 1.0, 1.0])]), [], "x")
    straight = drawn(surface, (0 * x + 0.5, x / 0.4), (0.0, 0.15))
    assert symmetry_error(surface, straight, mirror) == 0
    moved = drawn(surface, (0 * x + 0.5, x / 0.4 + 0.05), (0.0, 0.15))  # from its image by a tenth of a period
    assert symmetry_error(surface, moved, mirror) == pytest.approx(0.2, abs=0.02)


def test_material_of_a_cut_that_is_shifted_differs_from_its_mirror_image():
    """A strip of width w whose middle is off the mirror by a: 4 a of the side are on one side of it only."""
    surface = square(12)
    mirror = checked_symmetry(surface, np.stack([np.eye(3), np.diag([-1.0, 1.0, 1.0])]), [], "x")
    for a, w in ((0.0, 0.6), (0.03, 0.6), (0.03, 0.5)):
        cells = cut(surface, [surface.V[:, 0]], [np.array([a - w / 2, a + w / 2])], snap=0.0)
        assert cut_error(surface, cells, mirror) == pytest.approx(4 * a / 2, abs=0.01 if a else 0)


def test_nothing_drawn_is_no_mistake():
    surface = square(6)
    none = np.full(surface.n, 0.5)
    for d in (0.0, 0.2):
        found = measured(drawn(surface, (none, none), d))
        assert (found.dead_ends, found.slits, found.crossing_angle) == (0, 0, 90.0)
        assert json.dumps(quality_facts(found), allow_nan=False)
        assert len(list(quality_lines(quality_facts(found)))) == (3 if d else 1)


@pytest.fixture(scope="module")
def modes():
    return draft(load_preset(DOME_MODES))


@pytest.fixture(scope="module")
def even():
    return draft(load_preset(DOME_MODES, EVEN))


def test_the_dome_on_modes_has_houses_and_slits(modes):
    """Looked at: six meridians turn back around each of three radii, but those that do it on a ring."""
    found = modes.quality()
    assert len(found.minor.dead_ends.loose) == found.major.dead == 0
    radii = np.linalg.norm(found.minor.dead_ends.turns[:, :2], axis=1)
    assert ((radii > 0.5) & (radii < 1.5)).sum() == 18
    assert 2 <= (radii > 3.4).sum() <= 6
    assert found.evenness > 10
    assert found.slits > 10
    assert found.symmetry_error is None


def test_the_dome_of_even_stripes_is_even(even):
    found = even.quality()
    assert found.major.evenness < 1.1
    assert found.minor.evenness < 2.2
    assert Design.from_preset(even.preset, even).until("slicing").quality(symmetry=False).slits == 0
    assert found.deviation < 2.5
    assert found.crossing_angle > 75
    assert 0 <= found.symmetry_error < 0.02
    assert found.major.opening[1] == pytest.approx(found.major.spacing[1] - 0.13, abs=0.02)  # members of .13 m


def test_measures_are_metrics_of_sweeps(modes, even):
    for made in (modes, even):
        found = made.quality()
        told = {name: METRICS[name](made) for name in ("evenness", "dead_ends", "slits", "deviation", "crossing_angle")}
        assert told == {name: getattr(found, name) for name in told}
    assert METRICS["symmetry_error"](even) == even.quality().symmetry_error
    assert METRICS["symmetry_error"](modes) < 0.05


def test_even_stripes_have_their_width():
    wide = {**EVEN, "pattern.width": {"rule": "constant", "member": 0.2}}
    assert METRICS["min_width"](draft(load_preset(DOME_MODES, wide))) == pytest.approx(0.2, rel=0.1)


def test_build_and_inspect_report_the_same_openings(tmp_path, capsys):
    folder = tmp_path / "out"
    few = ("surface.edge=0.8", "pattern.keep=0.5")
    page = {"pictures": PictureFlags(False), "output": Output(verbose=True)}
    assert build(DOME_MODES, source=Source(few), files=Files(folder, "stl"), **page) == 0
    told = capsys.readouterr().out.split("\n")
    facts = json.loads((folder / "design.json").read_text())["pattern"]
    lines = list(quality_lines(facts))
    assert all(line in told for line in lines)
    assert lines[1].startswith("hoops (major, ")
    assert list(facts["minor"]["clear_opening_m"]) == ["5%", "50%", "95%"]
    assert inspect(folder) == 0
    assert set(lines) <= set(capsys.readouterr().out.split("\n"))


def test_reports_and_editor_show_the_quality_of_stripes(modes):
    compared = comparison(run(load_preset(DOME_MODES, {"surface.edge": 0.8, "pattern.keep": 0.5})), against=())
    assert compared.pattern is not None
    table = pattern_table(compared.pattern, CaptionNumbers())
    assert [len(row) for row in table.rows] == [3] * 7
    assert table.rows[3] == ("Dead ends", "0", str(compared.pattern.dead_ends))
    assert table.note.startswith("Members cross at ")
    told = sheet_figures(modes, *tidied_cut(modes))["pattern"]
    found = modes.quality()
    assert told["dead_ends"] == found.dead_ends > 0
    assert told["openings"] == [found.minor.opening[0], found.minor.opening[2]]
