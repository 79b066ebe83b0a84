"""What holds a bare surface, its unit, its vertical axis and its loads: `tests.own_roofs` has what is meant."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import PresetError
from dsfab.preset.proposal import MeshWishes, propose
from dsfab.preset.proposal.judgement import choice, judgement, likely_units
from dsfab.preset.proposal.readings import readings
from dsfab.preset.proposal.shape import Shape
from dsfab.surface import Boundary, Surface
from dsfab.surface.shapes import dome, sphere
from tests.own_roofs import MEANT, TWELVE, cupola, pavilion, wall
from tests.shapes import grid

AXES = {"z": 1.0, "y": 0.7}
QUICK = (
    "platform roof", "spiral ramp", "hall on four columns", "ceiling", "oval ring", "cupola", "vault", "groin",
    "pavilion on a slope", "sail", "hills", "umbrella", "slab", "wall", "tower", "footbridge",
)  # fmt: skip
RARE = ("short hanging roof", "walls and columns", "mast tent", "J-shelter")


def is_as_meant(surface, meant, up="z"):
    best = choice(surface, AXES, "m").best
    return best.up == up and best.reading.kind == meant.kind and best.reading.word in meant.words.split()


@pytest.mark.parametrize("name", QUICK)
def test_what_holds_a_surface_is_what_its_architect_means(name):
    assert is_as_meant(MEANT[name].surface, MEANT[name])


@pytest.mark.parametrize("name", RARE)
def test_what_holds_a_rare_surface_is_what_its_architect_means(name):
    assert is_as_meant(TWELVE[name].surface, TWELVE[name])


@pytest.mark.slow
def test_of_all_surfaces_at_most_one_in_twenty_is_read_otherwise():
    others = {name: meant for name, meant in {**MEANT, **TWELVE}.items() if name not in QUICK + RARE}  # these are right
    wrong = [name for name, meant in others.items() if not is_as_meant(meant.surface, meant)]
    assert len(wrong) <= 2, wrong


def turned_and_noisy(surface):
    c, s = np.cos(0.64), np.sin(0.64)
    noise = np.random.default_rng(5).normal(0, 5e-4 * surface.size, surface.V.shape)
    return Surface(surface.V @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + noise, surface.F)


@pytest.mark.slow
def test_readings_do_not_depend_on_the_mesh():
    """At most one of 16 decisions changes if vertices are turned about the vertical axis and moved by chance."""
    wrong = [name for name in QUICK if not is_as_meant(turned_and_noisy(MEANT[name].surface), MEANT[name])]
    assert len(wrong) <= 1, wrong


def test_supports_of_the_preset_are_the_places_of_the_reading():
    """The mesh of the preset is another one, whose edges are shorter than those of the coarse shape."""
    proposal = propose(MEANT["hall on four columns"].surface)
    surface = proposal.preset.surface.build()
    for support, place in zip(proposal.preset.surface.support, proposal.plan.stands, strict=True):
        held = surface.V[support.at.vertices(surface)]
        away = np.linalg.norm(held[:, None] - place.points[None], axis=2)
        assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1.5 * surface.mean_edge


def test_the_user_names_what_holds_a_surface():
    surface = MEANT["groin"].surface
    assert [place.name for place in propose(surface, wishes=MeshWishes("edge")).plan.stands] == ["base ring"]
    low = propose(surface, wishes=MeshWishes("0.5", built_in=True))
    assert len(low.plan.stands) == 4
    assert max(place.points[:, 2].max() for place in low.plan.stands) <= surface.V[:, 2].min() + 0.5
    assert all(support.clamp for support in low.preset.surface.support)
    for word in ("loops", "-1", "nan"):
        with pytest.raises(PresetError, match=f"--stand {word}: the surface has no place of this kind; use feet, "):
            propose(surface, wishes=MeshWishes(word))


def test_a_sheet_that_is_supported_everywhere_has_a_score():
    """Places may cover a small sheet, of whose span nothing remains."""
    roof = Shape(grid(4, 4, 2.0, 2.0))
    reading = readings(roof)[0]
    place = replace(reading.places[0], loop=None, is_loop=False, length=0.0, radius=10.0)
    everywhere = replace(reading, places=(place,))
    assert everywhere.vertices(roof.surface).all()
    assert judgement(roof, everywhere).figures["used"] < 1


def test_without_any_way_of_support_the_message_blames_no_option():
    with pytest.raises(
        PresetError, match="no plausible way to support the surface; choose with --stand: a height in metres above"
    ):
        choice(MEANT["groin"].surface, {}, "m")
    with pytest.raises(
        PresetError, match="--stand feet: the surface has no place of this kind; use a height in metres above"
    ):
        choice(MEANT["groin"].surface, {}, "m", "feet")


@pytest.mark.parametrize(
    ("name", "built_in"), [("slab", False), ("cupola", False), ("wall", True), ("oval ring", False)]
)
def test_a_sheet_that_its_edge_surrounds_is_not_built_in(name, built_in):
    """Walls below a floor let it turn; a slab that is built in moves by a third only, which is not on the safe side."""
    assert propose(MEANT[name].surface).plan.built_in == built_in


@pytest.mark.parametrize(("length", "count"), [(9.0, 1), (13.5, 2), (20.5, 3)])
def test_columns_below_a_flat_roof_are_six_to_nine_metres_apart(length, count):
    roof = Shape(grid(40, 12, length, 6.0))
    (columns,) = (reading for reading in readings(roof) if reading.word == "columns")
    assert len(columns.places) == count


def test_a_sheet_that_nothing_plausible_holds_is_refused():
    chosen = choice(MEANT["groin"].surface, {"z": 1.0}, "m")
    refuted = replace(chosen, ranking=tuple(replace(each, score=0.0) for each in chosen.ranking))
    with pytest.raises(PresetError, match=r"no plausible way to support the surface; dsfab tried feet \(z up\): "):
        refuted.require_plausible()


def test_a_close_runner_up_is_a_question_with_its_option():
    (question,) = propose(TWELVE["walls and columns"].surface).questions
    assert question.endswith("add --stand loops")
    assert not propose(MEANT["groin"].surface).questions


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        pytest.param("m", 1.0, marks=pytest.mark.slow),
        pytest.param("mm", 0.001, marks=pytest.mark.slow),
        ("cm", 0.01),
        ("ft", 0.3048),
    ],
)
def test_the_unit_makes_a_plausible_building(tmp_path, unit, metres):
    """A shell of 18 m; in feet (59 of them) it may also be one of 59 m, which is a question."""
    surface = pavilion(4, 9, 4.4).surface
    lines = [f"v {x / metres:.9g} {y / metres:.9g} {z / metres:.9g}" for x, y, z in surface.V]
    path = tmp_path / "shell.obj"
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in surface.F + 1]))
    proposal = propose(path)
    chosen = proposal.given.choice
    assert unit in (chosen.unit, chosen.rival_unit)
    assert (unit == "ft") == any("--unit" in question for question in proposal.questions)
    path.write_text("# units: ft\n" + path.read_text())
    declared = propose(path)
    assert (declared.given.keys["unit"], declared.given.choice.units) == ("ft", ())


def test_headroom_speaks_against_a_building_that_is_too_low():
    tall, low = (
        dict(likely_units(Shape(each)))
        for each in (
            Surface(MEANT["wall"].surface.V, MEANT["wall"].surface.F),
            Surface(MEANT["wall"].surface.V * 0.3, MEANT["wall"].surface.F),
        )
    )
    assert tall["m"] > 0.9
    assert low["m"] < tall["m"]


def test_loads_follow_the_kind_of_surface():
    kinds = {name: list(propose(MEANT[name].surface).plan.loads) for name in ("groin", "slab", "ceiling", "tower")}
    assert kinds == {"groin": ["snow"], "slab": ["people"], "ceiling": ["services"], "tower": ["wind"]}
    assert not propose(sphere(edge=0.4)).plan.loads


def test_a_printed_model_has_no_snow():
    small = propose(Surface(cupola(9, 4.5).surface.V / 10, cupola(9, 4.5).surface.F))
    assert (small.plan.size.material, dict(small.plan.loads)) == ("PLA", {})
    assert propose(cupola(9, 4.5).surface).plan.size.material == "GL24h"


def test_the_user_names_loads_with_their_values():
    proposal = propose(dome(edge=0.8), wishes=MeshWishes(loads=("snow=1.2", "wind")))
    assert dict(proposal.plan.loads) == {"snow": 1200.0, "wind": 500.0}
    assert {load.case for load in proposal.preset.surface.load} == {"load", "wind", "wind_back"}
    assert not propose(dome(edge=0.8), wishes=MeshWishes(loads=("none",))).plan.loads
    unknown, number = "--load hail is not known; use snow", "is not a positive number"
    for texts, words in (
        (["hail"], unknown),
        (["snow=much"], number),
        (["snow=-1"], number),
        (["snow", "none"], "none"),
    ):
        with pytest.raises(PresetError, match=words):
            propose(dome(edge=0.8), wishes=MeshWishes(loads=tuple(texts)))


def test_a_part_of_an_edge_survives_another_mesh():
    """From one corner of a wall past its middle to the other: its base, and not its top."""
    surface = wall(10, 4, 0.4, door=False).surface
    picker = Boundary(points=((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (10.0, 0.0, 0.0)))
    held = surface.V[picker.vertices(surface)]
    assert held[:, 2].max() < 1e-9
    assert np.ptp(held[:, 0]) == pytest.approx(10)
    assert Boundary(points=((5.0, 0.0, 0.0),)).vertices(surface).sum() == len(surface.loops[0])
    with pytest.raises(ValueError, match="one point for a whole loop, three points for a part"):
        Boundary(points=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))


def test_one_line_is_built_in_and_a_whole_ring_is_not():
    """A sheet that rises from one edge would turn about it; the ring of a dome cannot."""
    for meant, built_in in ((TWELVE["J-shelter"], True), (MEANT["cupola"], False)):
        preset = propose(meant.surface).preset
        assert all(support.clamp == built_in for support in preset.surface.support)
        assert preset.statics.bending == ("midedge" if built_in else "hinge")


def test_options_for_a_mesh_are_refused_for_a_preset(capsys):
    assert main(["build", "dome", "--stand", "feet"]) == 1
    assert "need a mesh file" in capsys.readouterr().err
