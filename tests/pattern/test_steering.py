"""Stripes that follow a person too: guides, `rotate`, and one family alone."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dsfab
from dsfab import design
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design.design import Design
from dsfab.design.directions import keeps_guides, keeps_orientation
from dsfab.design.even_stripes import even_stripes
from dsfab.design.output.archive import design_lines, read_archive, write_archive
from dsfab.design.stripe_pattern import pattern_step, stripe_stresses
from dsfab.diffusion import symmetry_of
from dsfab.pattern import Frames, Guidance, Guide, relative_stresses
from dsfab.preset.file import load_preset, preset_toml, with_overrides
from dsfab.report.compliance.tables import pattern_table
from dsfab.report.design.inspection import quality_facts, quality_lines
from dsfab.report.html_pages import CaptionNumbers
from dsfab.results import Log, PatternResult, StressedSurface
from dsfab.slicing import material_area
from dsfab.slicing.measures.pattern_quality import pattern_quality
from dsfab.study.baselines import ComparisonTask
from dsfab.study.baselines.structures import isotropic
from dsfab.study.sweeps.metrics import metric_value
from dsfab.surface import All, Ball, LoadCase, Surface
from tests.canopy import canopy
from tests.designs import sliced
from tests.pattern.loaded_cases import TURN, Case, difference
from tests.pattern.loaded_cases import case as zoo_case
from tests.pattern.plain_stripes import drawn
from tests.pattern.pulled_plates import pulled, stressed, towards
from tests.presets import DOME_MODES
from tests.shapes import grid, moebius, square

CLEAR = 1 / (1 + 0.3 / np.sqrt(2))
"""Confidence under tension s along one axis: D = s, reference s / sqrt 2."""


def degrees(given: Case, family: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(k,) directions of the stripes on the faces that have a phase, 0 to 180 from x; and the faces."""
    phase = given.even.phases[family]
    faces = np.flatnonzero(~phase.singular)
    g = phase.gradients(given.surface)[faces]
    return np.degrees(np.arctan2(g[:, 1], g[:, 0]) + np.pi / 2) % 180, faces


def off(found: np.ndarray, angle: float) -> float:
    """The largest difference, degrees; a half turn is none."""
    return float(np.abs((found - angle + 90) % 180 - 90).max())


EVERYWHERE = {"at": {"pick": "all"}, "direction": towards(30), "weight": 1e6}


# --- closed forms on a plate in uniform tension


def test_without_a_guide_stripes_run_along_the_tension():
    assert off(degrees(pulled())[0], 0) < 0.5
    assert off(degrees(pulled(), 1)[0], 90) < 0.5


@pytest.mark.parametrize("family", ["major", "minor"])
def test_a_heavy_guide_is_obeyed(family):
    given = pulled(guide=[{**EVERYWHERE, "family": family}])
    turned = 0 if family == "major" else 90
    assert off(degrees(given)[0], 30 + turned) < 0.5
    assert off(degrees(given, 1)[0], 120 + turned) < 0.5


def test_a_curve_guides_along_itself():
    """A straight one at 30 degrees that reaches far; and its points may be many, doubled, and the other way round."""
    middle, along = np.array([1.5, 1.5, 0.0]), np.array(towards(30))
    ends = [(middle + t * along).tolist() for t in (-3.0, 3.0)]
    given = pulled(guide=[{"curve": ends, "reach": 20.0, "weight": 1e6}])
    assert off(degrees(given)[0], 30) < 0.5
    gently = pulled(guide=[{"curve": ends, "reach": 20.0, "weight": 1.0}])
    many = [(middle + t * along).tolist() for t in (3.0, 3.0, 1.0, 0.3, -0.2, -2.0, -3.0)]
    other = pulled(guide=[{"curve": many, "reach": 20.0, "weight": 1.0}])
    assert np.abs(other.even.phases[0].value - gently.even.phases[0].value).max() < 1e-6


def test_weight_is_counted_in_clear_stress():
    """z^2 = c + w e^{2 i 60}: with w = c stripes run halfway between, with w = 2 c at 45 degrees."""
    for share in (1.0, 2.0):
        given = pulled(guide=[{"at": {"pick": "all"}, "direction": towards(60), "weight": share * CLEAR}])
        expected = np.degrees(np.angle(1 + share * np.exp(2j * np.radians(60)))) / 2
        assert off(degrees(given)[0], expected) < 0.5


def test_a_tilted_direction_counts_with_its_tangent_part():
    """At 60 degrees to the plate a direction of length 1 leaves 1/2 on it, the square of which is 1/4."""
    tilted = [*(0.5 * np.array(towards(60))[:2]).tolist(), np.sqrt(0.75)]
    given = pulled(guide=[{"at": {"pick": "all"}, "direction": tilted, "weight": 4 * CLEAR}])
    assert off(degrees(given)[0], 30) < 0.5


def test_a_guide_acts_within_its_reach():
    """Beyond its reach the field comes back within the smoothing length, the spacing."""
    curve = [[x, 0.4 + 0.6 * x, 0.0] for x in (-0.5, 0.5, 1.0)]
    found, faces = degrees(pulled(guide=[{"curve": curve, "reach": 0.5, "weight": 100}]))
    start, along = np.array(curve[0]), np.array([1.0, 0.6, 0.0]) / np.hypot(1, 0.6)
    to = pulled().surface.centroids[faces] - start
    away = np.linalg.norm(to - np.clip(to @ along, 0, 1.75)[:, None] * along, axis=1)
    assert off(found[away < 0.15], np.degrees(np.arctan(0.6))) < 6
    assert off(found[away > 1.5], 0) < 7


def test_left_out_a_reach_is_the_smaller_spacing():
    curve = {"curve": [[0.5, 0.5, 0.0], [2.0, 2.0, 0.0]], "weight": 50}
    given = pulled(guide=[curve], **{"major.spacing": 0.6, "minor.spacing": 0.3})
    same = pulled(guide=[{**curve, "reach": 0.3}], **{"major.spacing": 0.6, "minor.spacing": 0.3})
    assert np.array_equal(given.even.phases[0].value, same.even.phases[0].value)
    alone = pulled(guide=[curve], families="major", **{"major.spacing": 0.6, "minor.spacing": 0.3})
    wide = pulled(guide=[{**curve, "reach": 0.6}], families="major", **{"major.spacing": 0.6, "minor.spacing": 0.9})
    assert np.array_equal(alone.even.phases[0].value, wide.even.phases[0].value)  # of those that are drawn


def test_a_bent_guide_prefers_no_side():
    """Points whose nearest is the corner of a right angle see both pieces, which cancel: what is left is the stress."""
    frames = Frames.for_surface(pulled().surface)
    bent = Guide(curve=((0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)), reach=1.0)
    (found,) = Guidance.from_guides(frames, (bent,), 1.0)
    V = frames.surface.V
    beyond = (V[:, 0] > 1.01) & (V[:, 1] > 1.01)
    assert found.weight[beyond].max() < 1e-9
    assert found.weight[~beyond].max() > 0.9


@pytest.mark.parametrize("angle", [45, -30, 20, 135])
def test_both_families_are_turned(angle):
    given = pulled(rotate=angle)
    assert off(degrees(given)[0], angle) < 0.5
    assert off(degrees(given, 1)[0], angle + 90) < 0.5


def test_a_quarter_turn_lets_the_families_change_places():
    spacings = {"major.spacing": 0.5, "minor.spacing": 0.3}
    plain = pulled(**spacings)
    turned = pulled(rotate=90, **{"major.spacing": 0.3, "minor.spacing": 0.5})
    for k in (0, 1):
        z, other = (np.cos(2 * np.pi * one.even.phases[j].value) for one, j in ((plain, k), (turned, 1 - k)))
        assert np.abs(z - other).max() < 1e-6


def test_the_sense_of_turning_is_that_of_the_normals():
    given = pulled(rotate=30)
    flipped = replace(pulled(), surface=Surface(given.surface.V, given.surface.F[:, ::-1]))
    flipped.__dict__["statics"] = given.statics
    flipped.more["pattern.rotate"] = 30
    assert off(degrees(flipped)[0], -30) < 0.5


def test_a_guide_is_not_turned():
    assert off(degrees(pulled(rotate=45, guide=[EVERYWHERE]))[0], 30) < 0.5


def test_a_guide_without_weight_is_none():
    plain, none = pulled(), pulled(guide=[{**EVERYWHERE, "weight": 0}])
    for k in (0, 1):
        for part in ("value", "sign", "shift", "singular"):
            assert getattr(plain.even.phases[k], part).tobytes() == getattr(none.even.phases[k], part).tobytes()
    assert plain.even.slope.tobytes() == none.even.slope.tobytes()
    assert none.even.steered is None


# --- turned, grown, symmetric


STEERS = {
    "curve": {"pattern.guide": [{"curve": [[-3, -3, 2.0], [0, -1, 4.0], [4, 2, 2.0]], "reach": 2.0, "weight": 20}]},
    "region": {
        "pattern.guide": [
            {
                "at": {"pick": "ball", "center": [2, 1, 3], "radius": 2.5},
                "direction": [1, 2, 0],
                "family": "minor",
                "weight": 5,
            }
        ]
    },
    "rotate": {"pattern.rotate": 30.0},
}


def moved(more: dict, turn: np.ndarray, shift: np.ndarray, scale: float) -> dict:
    """The same keys for a design that is turned, shifted and grown."""
    if "pattern.guide" not in more:
        return more
    (guide,) = more["pattern.guide"]

    def place(point):
        return (scale * (turn @ np.array(point)) + shift).tolist()

    if "curve" in guide:
        guide = guide | {"curve": [place(point) for point in guide["curve"]], "reach": scale * guide["reach"]}
    else:
        ball = guide["at"] | {"center": place(guide["at"]["center"]), "radius": scale * guide["at"]["radius"]}
        guide = guide | {"at": ball, "direction": (turn @ np.array(guide["direction"])).tolist()}
    return {"pattern.guide": [guide]}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(STEERS))
def test_guides_turn_and_scale_with_the_design(name):
    given = replace(zoo_case("dome"), more=STEERS[name])
    assert difference(given, zoo_case("dome")) > 0.1  # it does steer
    shift = np.array([3.0, -2.0, 1.0])
    for turn, scale in ((TURN, 1.0), (np.eye(3), 40.0), (TURN, 0.1)):
        surface = Surface(scale * given.surface.V @ turn.T + shift, given.surface.F)
        load = LoadCase(given.load.fixed, given.load.force @ turn.T * scale**2, given.load.loaded)
        spacing = given.spacing[0] * scale, given.spacing[1] * scale
        other = Case(surface, load, spacing, moved(given.more, turn, shift, scale))
        assert difference(given, other) < 1e-5, scale


def test_a_rotation_keeps_its_sense_in_some_symmetries_only():
    """A plate's own plane is a mirror that leaves the sense alone; half a turn about a line in it is not."""
    surface = grid(8, 8, 2.0, 2.0)
    for words, same in ((["x"], False), (["z"], True), (["rot:2:x"], False), (["rot:2:z"], True)):
        symmetry = symmetry_of(surface, words)
        assert keeps_orientation(surface, symmetry).tolist() == [True, same], words


def test_guides_are_compared_with_their_images():
    """Along x through the middle: the same in both mirrors. To one side: in one of them. At 45 degrees: in none."""
    surface = grid(16, 16, 2.0, 2.0)
    frames = Frames.for_surface(surface)

    def same(*guides: Guide) -> list[list[bool]]:
        asked = Guidance.from_guides(frames, guides, 0.5)
        return [bool(keeps_guides(frames, symmetry_of(surface, [axis]), asked)[1]) for axis in ("x", "y")]

    def curve(*points: tuple[float, float]) -> Guide:
        return Guide(curve=tuple((x, y, 0.0) for x, y in points))

    assert same(curve((0.0, 1.0), (2.0, 1.0))) == [True, True]
    assert same(curve((0.0, 1.5), (2.0, 1.5))) == [True, False]
    assert same(curve((0.0, 1.5), (2.0, 1.5)), curve((0.0, 0.5), (2.0, 0.5))) == [True, True]
    assert same(curve((0.0, 0.0), (2.0, 2.0))) == [False, False]
    diagonal = Guide(at=All(), direction=(1.0, 1.0, 0.0))
    assert same(diagonal) == [False, False]
    assert same(diagonal, replace(diagonal, direction=(1.0, -1.0, 0.0))) == [True, True]  # and nothing is asked
    small = Guide(at=Ball((1.5, 1.5, 0.0), 0.3), direction=(1.0, 0.0, 0.0))
    assert same(curve((0.0, 1.0), (2.0, 1.0)), small) == [False, False]


SMALL = {"surface.edge": 0.7, "pattern.method": "stripes", "pattern.major.spacing": 1.4, "pattern.minor.spacing": 1.1}


@cache
def drafted_with(pattern: str) -> Design:
    """The small dome with keys of [pattern], as JSON; what comes before the pattern is made once."""
    keys = {f"pattern.{key}": value for key, value in json.loads(pattern).items()}
    before = drafted_with("{}") if keys else None
    known = {name: getattr(before, name) for name in ("surface", "statics", "diffusion") if before}
    return Design.from_results(load_preset(DOME_MODES, SMALL | keys), **known).until("pattern")


def drafted(**more):
    return drafted_with(json.dumps(more))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "order", "told"),
    [
        ({}, 4, ""),
        ({"rotate": 45}, 2, "4 symmetric images, but the pattern has only 2, because of rotate = 45"),
        ({"rotate": 90}, 4, ""),
        ({"guide": [{"curve": [[2, 1, 3], [3, 2, 2.5]], "reach": 1.5}]}, 1, "pattern has only 1, because of guides"),
        (
            {"rotate": 20, "guide": [{"curve": [[2, 1, 3], [3, 2, 2.5]], "reach": 1.5}]},
            1,
            "the pattern has only 1, because of rotate = 20 and guides",
        ),
    ],
)
def test_guides_reduce_the_symmetry_and_the_note_names_the_rest(more, order, told):
    made = drafted(**more)
    symmetry = made.pattern.even.symmetry
    assert (symmetry.order if symmetry else 1) == order
    notes = [note.text for note in made.notes if note.text.startswith("surface, supports")]
    assert [told in note for note in notes] == [True] * bool(told)
    if order > 1:
        assert made.quality().symmetry_error < 0.02


# --- what is refused


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"guide": [{"curve": [[0, 0, 4]]}]}, r"pattern\.guide\.0: the key curve needs at least two different points"),
        ({"guide": [{"curve": [[0, 0, 4], [0, 0, 4]]}]}, "two different points"),
        (
            {"guide": [{"curve": [[0, 0, 9], [1, 0, 9]]}]},
            r"pattern\.guide\.0: the curve is 5 m from the nearest vertex",
        ),
        ({"guide": [{"curve": [[0, 0, 3], [0, 0, 5]], "reach": 0.6}]}, "the curve is perpendicular to the surface"),
        ({"guide": [{"curve": [[0, 0, float("nan")], [1, 0, 4]]}]}, r"guide\.0\.curve\.0\.2 = nan: .* finite number"),
        (
            {"guide": [{"at": {"pick": "ball", "center": [0, 0, 4], "radius": 0.5}, "direction": [0, 0, 1]}]},
            "the direction is perpendicular to the surface",
        ),
        (
            {"guide": [{"at": {"pick": "ball", "center": [0, 0, 9], "radius": 0.5}, "direction": [1, 0, 0]}]},
            r"pattern\.guide\.0: pick = 'ball' .* picks no vertex",
        ),
        ({"guide": [{"at": {"pick": "all"}}]}, "needs a direction that is not zero"),
        ({"guide": [{"at": {"pick": "all"}, "direction": [0, 0, 0]}]}, "needs a direction that is not zero"),
        ({"guide": [{"at": {"pick": "all"}, "direction": [1, 0, 0], "reach": 1.0}]}, "reach is for a curve"),
        ({"guide": [{"curve": [[0, 0, 4], [1, 0, 4]], "direction": [1, 0, 0]}]}, "its own directions"),
        ({"guide": [{"weight": 2.0}]}, "give either curve"),
        ({"guide": [{"curve": [[0, 0, 4], [1, 0, 4]], "wieght": 1}]}, "did you mean weight"),
        ({"guide": [{"curve": [[0, 0, 4], [1, 0, 4]], "weight": -1}]}, r"weight = -1: .* greater than or equal to 0"),
        ({"guide": [{"curve": [[0, 0, 4], [1, 0, 4]]}], "method": "modes"}, "guide has no effect on method = 'modes'"),
        ({"rotate": 45, "method": "modes"}, "rotate has no effect on method = 'modes'"),
        ({"rotate": float("nan")}, r"pattern\.rotate = nan"),
        ({"families": "one"}, r"pattern\.families = 'one'"),
    ],
)
def test_invalid_guides_are_refused_in_one_sentence(more, told):
    with pytest.raises(DsfabError, match=told) as refused:
        drafted(**more)
    assert "\n" not in str(refused.value)


def test_a_surface_with_one_side_turns_by_quarters_only():
    strip = moebius(60, 8)
    load = LoadCase(np.zeros((strip.n, 3), bool), np.zeros((strip.n, 3)), np.zeros(strip.n, bool))
    sigma = np.repeat(np.diag([2e6, 1e6, 0.0])[None], strip.m, axis=0)
    for angle in (45.0, 90.0):
        given = Case(strip, load, (0.5, 0.5), {"pattern.rotate": angle, "pattern.symmetry": "none"})
        statics = stressed(given, sigma)
        if angle == 90:
            assert even_stripes(given.preset, strip, statics).steered is not None
            continue
        with pytest.raises(
            PatternError,
            match=r"pattern\.rotate = 45 is impossible, because left and right are not "
            r"defined on a one-sided surface",
        ):
            even_stripes(given.preset, strip, statics)


# --- one family alone


def share(given: Case) -> float:
    pattern = pattern_of(given)
    return material_area(given.surface, pattern.fields, pattern.levels) / given.surface.area


def pattern_of(given: Case) -> PatternResult:
    stressed_surface = StressedSurface(given.surface, given.statics, None)
    return pattern_step(given.preset, stressed_surface, Log(None), even=given.even)


@pytest.mark.parametrize("families", ["both", "major", "minor"])
def test_stripes_of_one_family_are_half_the_material(families):
    """Threshold 1/2: a quarter of each spacing is material, 1 - (3/4)^2 of the area where two families cross."""
    given = pulled(families=families)
    assert share(given) == pytest.approx(7 / 16 if families == "both" else 1 / 4, rel=0.02)
    made = pattern_of(given)
    assert set(made.names) == ({"major", "minor"} if families == "both" else {families})
    other = {"major": "minor", "minor": "major"}
    if families != "both":
        assert not made.half_width(other[families]).any()
        assert made.half_width(families).max() == pytest.approx(1 / 8)


def test_keys_of_an_omitted_family_are_not_checked():
    wrong = {"minor.spacing": 1e-3}
    with pytest.raises(PatternError, match="too fine"):
        _ = pulled(**wrong).even
    even = pulled(families="major", **wrong).even
    assert even.phases[1].singular.all()
    assert not even.chart.scale[:, 1].any()


@pytest.fixture(scope="module")
def ribs():
    """Ribs between a ring at the foot and a disc at the crown, turned and guided."""
    guide = {"curve": [[1, 1, 3.5], [4, 3, 2.0]], "reach": 1.5, "weight": 5.0}
    return dsfab.run(
        load_preset(DOME_MODES, {**SMALL, "pattern.families": "minor", "pattern.rotate": 20, "pattern.guide": [guide]})
    )


def test_one_family_is_built_drawn_and_measured(ribs):
    assert ribs.sheet.surface.area / ribs.surface.area == pytest.approx(0.4, abs=1e-3)
    assert {line.layer for line in design_lines(ribs)} >= {"centre-minor", "edges-minor"}
    assert not any("major" in line.layer for line in design_lines(ribs))
    found = ribs.quality()
    assert (found.major.drawn, found.minor.drawn) == (False, True)
    assert (found.evenness, found.deviation) == (found.minor.evenness, found.minor.deviation)
    assert "stress direction turned by 20" in found.summary
    assert "crossing" not in found.summary
    told = list(quality_lines(quality_facts(found)))
    assert [line.split()[0] for line in told[1:]] == ["minor"]
    table = pattern_table(found, CaptionNumbers())
    assert table.head == ("Measure", "Minor members")
    assert {len(row) for row in table.rows} == {2}
    member = float(next(n.text.split()[2] for n in ribs.notes if n.text.startswith("members are"))) / 1e3  # told in mm
    assert (
        0.6 * member < metric_value("min_width", Design.from_preset(ribs.preset)) < 1.05 * member
    )  # thinner where they crowd
    assert ribs.pattern.tidy.closed == (None, None)


def test_the_archive_and_the_preset_give_the_same_design_back(ribs, tmp_path):
    path = tmp_path / "again.toml"
    path.write_text(preset_toml(ribs.preset))
    assert load_preset(path) == ribs.preset
    write_archive(ribs, tmp_path)
    back = read_archive(tmp_path, ribs.preset)
    assert back is not None
    assert back.pattern.names == ribs.pattern.names
    for one, two in zip(back.pattern.fields, ribs.pattern.fields, strict=True):
        assert getattr(one, "x", one).tobytes() == getattr(two, "x", two).tobytes()
    for k in (0, 1):
        assert np.array_equal(back.pattern.even.phases[k].value, ribs.pattern.even.phases[k].value)
        assert np.array_equal(back.pattern.even.phases[k].singular, ribs.pattern.even.phases[k].singular)
    lines = [(line.id, line.points.tobytes()) for line in design_lines(ribs)]
    assert [(line.id, line.points.tobytes()) for line in design_lines(back)] == lines
    other = with_overrides(ribs.preset, {"pattern.rotate": 21})
    assert read_archive(tmp_path, other) is None


@pytest.mark.slow
def test_another_angle_guide_or_family_makes_stripes_anew(ribs):
    wider = design.draft(with_overrides(ribs.preset, {"pattern.width.solid_fraction": 0.5}), earlier=ribs)
    assert wider.pattern.even is ribs.pattern.even
    assert [n.text for n in wider.notes if "guides" in n.text and "symmetric images" in n.text]
    guide = ribs.preset.pattern.guide[0]
    for change in ({"pattern.rotate": 40}, {"pattern.families": "major"}, {"pattern.guide.0.weight": 2 * guide.weight}):
        preset = with_overrides(ribs.preset, change)
        made, fresh = design.draft(preset, earlier=ribs), even_stripes(preset, ribs.surface, ribs.statics)
        assert made.pattern.even is not ribs.pattern.even
        k = 0 if "pattern.families" in change else 1
        assert not np.array_equal(made.pattern.even.phases[k].value, ribs.pattern.even.phases[k].value)
        assert np.array_equal(made.pattern.even.phases[k].value, fresh.phases[k].value)


def test_members_of_one_family_have_no_loose_ends():
    """On a canopy on four feet, members of the major family ended freely beside an opening and at a singular point."""
    pattern = {"families": "major", "keep": 0.4, "rim": 0.25, "major": {"spacing": 1.2}, "method": "stripes"}
    low = dsfab.Side(axis="z", end="min", depth=0.75)
    preset = dsfab.Preset(
        surface=canopy(0.6),
        supports=[dsfab.Support(low)],
        loads=[dsfab.SelfWeight()],
        statics={"thickness": 0.12},
        pattern={**pattern, "width": {"rule": "constant", "solid_fraction": 0.45}},
    )
    assert sliced(preset.with_pattern(tidy=False)).quality(symmetry=False).dead_ends > 3
    assert sliced(preset).quality(symmetry=False).dead_ends == 0


def test_rings_without_crossings_are_refused_with_advice():
    alone = "stripes of the major family alone do not cross; set pattern.rim, or draw both families"
    rings = SMALL | {"pattern.families": "major"}
    made = dsfab.run(load_preset(DOME_MODES, rings))
    assert any(note.text.startswith("5 of 6 pieces") and alone in note.text for note in made.notes)
    with pytest.raises(PatternError, match=rf"pieces reach no support, the largest .* m: {alone}"):
        dsfab.run(load_preset(DOME_MODES, rings | {"slicing.loose": "refuse"}))


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["plain", "constant", "graded", "stressed"])
def test_one_family_on_modes_by_every_width_rule(rule):
    asked = {
        "surface.edge": 0.6,
        "pattern.families": "minor",
        "pattern.width": {"rule": rule, "solid_fraction": 0.4, "steps": 2},
        "pattern.major.mode": "auto",
    }
    made = dsfab.run(load_preset(DOME_MODES, asked))
    assert made.pattern.choice is None  # nothing that is drawn is auto
    assert "major" not in made.pattern.names
    assert made.sheet.surface.area / made.surface.area == pytest.approx(0.4, abs=2e-3)
    assert not any(line.family == "major" for line in design_lines(made))
    found = made.quality()
    assert (found.major.drawn, found.major.spacing, found.minor.drawn) == (False, (0.0, 0.0, 0.0), True)


def test_auto_chooses_only_for_the_drawn_families():
    asked = {"surface.edge": 0.9, "pattern.families": "minor"}
    asked |= {f"pattern.{name}.phase": "auto" for name in ("major", "minor")}
    found = design.draft(load_preset(DOME_MODES, asked)).pattern.choice.candidates
    assert len(found) < 12
    assert {one.phase[0] for one in found} == {0.0}


# --- measures, widths and methods


@pytest.mark.slow
def test_deviation_is_from_where_stripes_were_to_run():
    found = drafted(rotate=45).quality()
    assert found.turned == 45
    assert found.deviation < 20  # and over 30 off the stress itself
    assert drafted().quality().turned == 0


def test_members_may_turn_back_along_guides():
    """Rings in a plate that is pulled one way come along the tension and go back."""
    surface = square()
    rings = drawn(surface, (4 * np.hypot(*surface.V[:, :2].T), np.full(surface.n, 0.5)), 0.2)
    directions = np.broadcast_to(np.eye(3)[None, :2], (surface.m, 2, 3))
    given = np.ones((surface.m, 2)), directions, np.ones(surface.m)
    assert pattern_quality(rings, *given).dead_ends > 3
    assert pattern_quality(rings, *given, guided=np.ones(surface.m, dtype=bool)).dead_ends == 0


@pytest.mark.slow
def test_widths_follow_the_stress_along_the_stripes():
    plain, turned = drafted(), drafted(rotate=90)
    both = [stripe_stresses(made.surface, made.diffusion, made.pattern.even) for made in (plain, turned)]
    own = relative_stresses(plain.surface, plain.diffusion.tensors.principal)
    assert both[0] == pytest.approx(plain.pattern.even.symmetry.mean(own))  # at all images of a point
    away = np.linalg.norm(plain.surface.V[:, :2], axis=1) > 1.5  # from the crown, where the field is smoother than it
    assert np.abs(both[1] - both[0][:, ::-1])[away].max() < 0.05
    assert np.abs(both[1] - both[0])[away].max() > 0.5
    half = stripe_stresses(plain.surface, plain.diffusion, drafted(rotate=45).pattern.even)
    assert np.abs(half[:, 0] / half[:, 1] - 1)[away].max() < 0.35


@pytest.mark.slow
def test_auto_omits_modes_if_guides_or_families_exclude_them():
    for more in ({"rotate": 45}, {"families": "minor"}):
        made = drafted(method="auto", width={"rule": "plain"}, **more)
        note = next(note.text for note in made.notes if note.text.startswith("pattern.method = 'auto' chose"))
        assert ("modes" in note) == ("rotate" not in more)
        assert ("halved" in note) == ("rotate" in more)


@pytest.mark.slow
def test_competitors_on_modes_know_nothing_of_guides():
    made = drafted(rotate=45, guide=[{"at": {"pick": "all"}, "direction": [1, 0, 0]}])
    given = ComparisonTask.from_design(made, 60.0).on_modes
    assert (given.pattern.rotate, given.pattern.guide, given.pattern.method) == (0.0, (), "modes")
    assert with_overrides(given, {"pattern.width.solid_fraction": 0.3}).pattern.method == "modes"
    assert [one.says for one in isotropic(ComparisonTask.from_design(made, 60.0))][:2] == ["modes 1, 1", "modes 1, 2"]
    ribs = ComparisonTask.from_design(drafted(families="minor"), 60.0)
    assert [one.says for one in isotropic(ribs)] == ["modes 1, 1", "modes 1, 2", "modes 1, 3"]
