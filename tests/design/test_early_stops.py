"""Supports and loads have names, are listed, and a design that cannot be built stops after the statics."""

import json
import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab import Boundary, Force, Line, Nearest, Preset, Pressure, SelfWeight, Side, Snow, Support, Wind, load_preset
from dsfab.app.cli import main
from dsfab.app.editor.workspace import open_preset
from dsfab.app.options import Source
from dsfab.core.errors import DsfabError, PresetError, StaticsError, SurfaceError
from dsfab.core.messages import direction_phrase, force
from dsfab.design import Design, draft, run
from dsfab.preset.file import preset_from, preset_toml
from dsfab.report.design import facts as design_facts
from dsfab.report.design import inspection
from dsfab.report.design.inspection import load_facts, load_lines
from dsfab.statics import load_entries, support_entries
from dsfab.surface import All, Box, Surface, Vertices, load_names, support_names
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, sphere, zoo


def test_names_of_loads_and_supports_survive_and_unnamed_ones_get_a_default():
    preset = load_preset("snow_vault", {"surface.support.0.name": "Kämpfer", "surface.load.1.name": "snow, all over"})
    assert preset_from(tomllib.loads(preset_toml(preset))) == preset
    assert support_names((*preset.surface.support, Support(Boundary()))) == ["Kämpfer", "support 2"]
    assert load_names(preset.surface.load) == ["self weight", "snow, all over", "snow 1", "snow 2"]
    assert load_names([SelfWeight(), Snow(800.0), Force(Nearest(((0, 0, 0),)), (0, 0, 1), name="lamp")]) == [
        "self weight",
        "snow",
        "lamp",
    ]


def test_a_preset_without_names_is_written_without_names():
    values = tomllib.loads(preset_toml(load_preset("snow_vault")))
    assert not any("name" in entry for key in ("support", "load") for entry in values["surface"][key])


@pytest.mark.parametrize("name", ["x" * 41, "two\nlines", " inner", "<b>"])
def test_a_name_that_breaks_a_table_is_refused(name):
    with pytest.raises(PresetError, match=r"surface\.support\.0\.name: .* must be up to 40 letters"):
        load_preset("dome", {"surface.support.0.name": name})
    with pytest.raises(PresetError, match="must be up to 40 letters"):
        Preset(surface=load_preset("dome").surface, statics={"thickness": 0.1}, loads=[SelfWeight(name=name)])


# --- the lists of supports and loads

PLATE = grid(8, 2, 2.0, 0.5)
"""2 x 0.5 m, flat."""


def design_of_plate(supports, loads, **statics):
    """A design of the plate: timber, 20 mm."""
    given = {"thickness": 0.02, "material": "GL24h", **statics}
    return Design.from_preset(Preset(surface=PLATE, supports=supports, loads=loads, statics=given))


def test_the_entry_of_a_support_lists_its_directions_and_its_share_of_the_load():
    """A line of 30 N at a quarter of the span of a bridge: three quarters of it go to the near end."""
    ends = Support(Side("x", "min"), name="near"), Support(Side("x", "max"), hold="z", spring=(5.0, 0, 0))
    design = design_of_plate(ends, [Line(Box((0.5, 0, 0), (0.5, 0.5, 0)), (0, 0, -60.0), "all")])
    answers = {name: case.equilibrium for name, case in design.statics.cases.items()}
    near, far = support_entries(PLATE, ends, answers)
    assert (near.name, near.vertices, near.holds) == ("near", 3, "xyz")
    assert (far.name, far.vertices, far.holds) == ("support 2", 3, "z, spring x")
    assert (near.length, far.length, near.area) == (pytest.approx(0.5), pytest.approx(0.5), 0)
    assert_allclose(far.place, [2, 0.25, 0])
    assert_allclose(near.reaction["load"], [0, 0, 22.5], atol=1e-6)
    assert near.share["load"] == pytest.approx(0.75, abs=0.01)
    assert near.share["load"] + far.share["load"] == pytest.approx(1)


@pytest.mark.parametrize(
    ("at", "length", "area"),
    [
        (Boundary(), 5.0, None),  # ears of the mesh are held wholly: some area
        (Side("x", "min", depth=0.25), 1.0, 0.125),
        (Box((0.5, 0, 0), (0.5, 0.5, 0)), 0.5, 0.0),
        (Box((0, 0.25, 0), (2, 0.25, 0)), 2.0, 0.0),
        (All(), 5.0, 1.0),
        (Vertices((4,)), 0.0, 0.0),
    ],
)
def test_the_entry_of_a_support_measures_its_length_and_its_area(at, length, area):
    (entry,) = support_entries(PLATE, [Support(at)])
    assert entry.length == pytest.approx(length)
    if area is not None:
        assert entry.area == pytest.approx(area)
    assert not entry.share


@zoo
def test_the_shares_of_all_supports_sum_to_one(name):
    surface = ZOO[name]()
    half = surface.n // 2
    parts = (tuple(range(half)), tuple(range(half, surface.n)))
    supports = [Support(Vertices(part[: max(3, half // 2)])) for part in parts]
    design = Design.from_preset(
        Preset(surface=surface, supports=supports, loads=[SelfWeight()], statics={"thickness": surface.size / 200})
    )
    entries = support_entries(surface, supports, {"load": design.statics.cases["load"].equilibrium})
    assert sum(entry.share["load"] for entry in entries) == pytest.approx(1)
    total = np.sum([entry.reaction["load"] for entry in entries], axis=0)
    assert_allclose(total, -design.load.force.sum(axis=0), atol=1e-5 * np.abs(design.load.force).sum())


def test_the_entry_of_a_load_lists_its_sum_and_its_place():
    slope = Surface(np.c_[PLATE.V[:, :2], PLATE.V[:, 0]], PLATE.F)  # at 45 degrees
    loads = [
        Snow(800.0, name="white"),
        SelfWeight(),
        Line(Side("x", "max"), (0, 0, -60.0), case="rail"),
        Force(Nearest(((2, 0, 2), (2, 0.5, 2))), (30.0, 0, 0)),
        Wind(500.0, (1, 0, 0)),
    ]
    snow, weight, line, point, wind = load_entries(slope, loads, 100.0)
    assert (snow.name, snow.kind, snow.area) == ("white", "snow", pytest.approx(np.sqrt(2)))
    assert_allclose(snow.force, [0, 0, -800])
    assert_allclose(weight.force, [0, 0, -100 * np.sqrt(2)])
    assert (line.case, line.length, line.area) == ("rail", pytest.approx(0.5), 0)
    assert_allclose(line.force, [0, 0, -30])
    assert (point.vertices, point.length, point.area) == (2, 0, 0)
    assert_allclose(point.force, [30, 0, 0])
    assert_allclose(wind.force, 500 * 0.8 * np.array([1, 0, -1]) / np.sqrt(2))


def test_pressure_all_around_cancels_out_and_says_so():
    ball = sphere(2)
    (entry,) = load_entries(ball, [Pressure(100.0)], 0.0)
    assert np.abs(entry.force).max() < 1e-9
    assert entry.total == pytest.approx(100 * ball.area, rel=0.05)
    preset = Preset(surface=ball, supports=[Support(Side("z", "min", 0.5))], loads=[Pressure(100.0)], statics=THIN)
    lines = list(load_lines(load_facts(Design.from_preset(preset))))
    assert lines[3].split() == ["pressure", "0", "N", "cancels", "out", f"{ball.area:.3g}", "m2"]


THIN = {"thickness": 0.02}


def test_the_tables_of_supports_and_loads_are_aligned():
    facts = json.loads(json.dumps(load_facts(Design.from_preset(load_preset("snow_vault", {"surface.edge": 0.8})))))
    lines = list(load_lines(facts))
    assert lines[0].split() == ["support", "vertices", "along", "holds"]
    assert lines[2].split() == ["load", "case", "uncut", "sheet", "towards", "on"]
    assert [line.split()[-4] for line in lines[3:]] == ["kN"] * 4
    assert len({len(line) for line in lines[:2]}) == 1
    assert len({len(line) for line in lines[2:]}) == 1
    assert [entry["name"] for entry in facts["loads"]] == ["self weight", "snow 1", "snow 2", "snow 3"]


def test_forces_and_directions_in_words():
    said = [force(x) for x in (0.12, 830, 999.6, 12_440, 999_600, 3.1e6)]
    assert said == ["0.12 N", "830 N", "1 kN", "12.4 kN", "1 MN", "3.1 MN"]
    pointed = [direction_phrase(v) for v in ((0, 0, -3), (0, 0, 1), (-2, 0, 0.01), (0, 5, 0), (3, 0, -4))]
    assert pointed == ["down", "up", "-x", "+y", "(0.6, 0, -0.8)"]


def test_inspect_shows_the_tables_even_of_a_refused_design(capsys):
    assert main(["inspect", DOME_MODES, "--set", "surface.edge=1", "--set", 'surface.support.0.hold="z"']) == 1
    said = capsys.readouterr()
    assert [line.split()[0] for line in said.out.splitlines()] == ["support", "support", "load", *["self", "force"]]
    assert "can move along" in said.err


def test_inspect_of_a_folder_shows_the_built_preset(capsys, tmp_path):
    changed = ["--set", "surface.edge=1", "--set", 'surface.support.0.name="ring beam"', "--format", "stl"]
    assert main(["build", DOME_MODES, *changed, "--verbose", "--no-picture", "-o", str(tmp_path / "o")]) == 0
    built = capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "o")]) == 0
    shown = capsys.readouterr().out
    row = next(line for line in shown.splitlines() if line.startswith("ring beam"))
    assert row in built
    pushes = [line for line in shown.splitlines() if line.startswith("ring beam")][1]
    assert pushes in built


# --- stopping before the cut


def refusal(supports, loads, surface=PLATE, **statics):
    """The sentence that refuses to build a plate, told before it is cut; nothing but statics.check helps."""
    given = {"thickness": 0.02, "material": "GL24h", **statics}
    preset = Preset(surface=surface, supports=supports, loads=loads, statics=given, pattern={"method": "stripes"})
    with pytest.raises(DsfabError) as caught:
        run(preset)
    said = str(caught.value)
    assert said.endswith(" (statics.check = false switches this check off)")
    assert "\n" not in said
    free = preset.model_copy(update={"statics": preset.statics.model_copy(update={"check": False})})
    notes = [note.text for note in Design.from_preset(free).until("statics").notes]
    assert said.rpartition(" (statics")[0] in notes
    return said


def test_a_sheet_that_moves_by_over_a_tenth_of_its_span_is_not_cut():
    """A plate strip on two edges under p: 5 p L^4 / (384 E h^3 / 12); 0.2 m, a tenth of 2 m, at a known p."""
    sides, E, h = [Support(Side("x", end)) for end in ("min", "max")], 11e9, 0.02
    limit = 0.2 * 384 * E * h**3 / 12 / (5 * 2**4)
    own = {"poisson": 0.0, "young": E, "material": None, "bending": "midedge"}
    loads = [Snow(1.3 * limit, case="blizzard"), Snow(0.3 * limit, case="flurry")]
    said = refusal(sides, loads, **own)
    assert said.startswith("the sheet would move by 2")
    assert "under blizzard at (1, " in said
    assert "over a tenth of its span of 2 m: increase statics.thickness" in said
    given = {**own, "thickness": h}
    made = Design.from_preset(Preset(surface=PLATE, supports=sides, loads=[Snow(0.9 * limit)], statics=given))
    assert not made.statics.objections
    assert made.statics.equilibrium.largest_displacement == pytest.approx(0.18, rel=0.05)


def test_the_stop_comes_before_anything_is_drawn_or_cut():
    begun = []
    soft = load_preset(DOME_MODES, {"surface.edge": 1.0, "statics.young": 1e6})
    with pytest.raises(StaticsError, match="over a tenth of its span of 12 m"):
        run(soft, lambda stage, doing: begun.append(stage))
    assert begun == ["surface", "statics"]
    with pytest.raises(StaticsError, match="over a tenth of its span"):
        _ = Design.from_preset(soft).sheet
    drawn = draft(soft)  # for people to look at
    assert any("over a tenth of its span" in note.text for note in drawn.notes)


def test_a_sheet_that_stands_on_one_vertex_is_not_cut():
    middle = int(np.linalg.norm(PLATE.V - [1, 0.25, 0], axis=1).argmin())
    supports = [Support(Vertices((middle,)), name="mast"), Support(Boundary(), spring=(10.0, 10.0, 10.0))]
    said = refusal(supports, [SelfWeight()])
    assert said.startswith(
        "100% of the sum of all reactions acts on one vertex, at (1, 0.25, 0) m (mast), but a sheet cannot"
    )


def test_supports_at_one_or_two_points_that_carry_load_give_a_note():
    """Corners of a plate; the last one only keeps it from turning."""
    corners = [Support(Nearest(((0, 0, 0), (0, 0.5, 0))), "xyz"), Support(Nearest(((2, 0, 0),)), "z", name="post")]
    design = design_of_plate([*corners, Support(Side("x", "max"), "y")], [SelfWeight()])
    notes = [note.text for note in design.until("slicing").notes if "holds only" in note.text]
    assert len(notes) == 2
    assert notes[0].startswith("support 1 holds only 2 vertices, at (0, 0.25, 0) m, and carries up to ")
    assert notes[1].startswith("post holds only 1 vertex, at (2, 0, 0) m")


@pytest.mark.parametrize(("share", "count"), [(0.04, 0), (0.06, 1)])
def test_a_post_may_carry_up_to_a_twentieth_of_the_reaction_without_a_note(share, count):
    """It stands at the far end; a load at an eighth of the span gives it an eighth, a load at the near end nothing."""
    post = Support(Nearest(((2, 0.25, 0),)), "z", name="post")
    loads = [
        Line(Box((0.25 * k, 0, 0), (0.25 * k, 0.5, 0)), (0, 0, -60 * part), "all")
        for k, part in enumerate((1 - 8 * share, 8 * share))
    ]
    design = design_of_plate([Support(Side("x", "min")), post], loads)
    assert sum("post holds only 1 vertex" in note.text for note in design.until("statics").notes) == count


@pytest.mark.parametrize("what", ["support", "load"])
def test_a_point_far_off_the_surface_holds_and_loads_nothing(what):
    far = Nearest(((1, 0.25, 0.6),))
    supports = [Support(Side("x", "min", 0.3)), *([Support(far, name="it")] if what == "support" else [])]
    loads = [Force(far, (0, 0, -9), name="it") if what == "load" else SelfWeight()]
    assert refusal(supports, loads).startswith(
        "it is at (1, 0.25, 0.6) m, 600 mm away from the nearest vertex of the surf"
    )
    near = [Force(Nearest(((1, 0.25, 0.45),)), (0, 0, -9))]
    assert not design_of_plate(supports[:1], near).statics.objections


@pytest.mark.parametrize(("load", "says"), [
    (Snow(800.0, name="white"), "white acts parallel to its faces, and puts only 0."),
    (Wind(800.0, (1, 0, 0)), "wind acts parallel to its faces, and puts only 0."),
])  # fmt: skip
def test_snow_and_wind_that_run_along_every_face_act_on_nothing(load, says):
    rough = np.random.default_rng(0).normal(0, 1e-5, PLATE.n)
    wall = Surface(np.c_[PLATE.V[:, 0], rough, PLATE.V[:, 1]], PLATE.F)
    said = refusal([Support(Side("z", "min", 0.3))], [SelfWeight(), load], wall)
    assert said.startswith(says)
    assert "on 1 m2: change the direction of the load, or pick other faces" in said


@pytest.mark.parametrize(("winds", "count"), [([1], 1), ([1, -1], 0)])
def test_one_wind_on_a_wall_needs_the_opposite_wind_as_a_case(winds, count):
    wall = Surface(PLATE.V[:, [0, 2, 1]], PLATE.F)
    loads = [Wind(800.0, (0, sign, 0), case=f"wind {k}") for k, sign in enumerate(winds)]
    given = {"thickness": 0.02, "material": "GL24h", "check": False}
    preset = Preset(surface=wall, supports=[Support(Side("z", "min", 0.3))], loads=loads, statics=given)
    notes = Design.from_preset(preset).until("statics").notes
    assert sum("add a case with the opposite wind" in note.text for note in notes) == count


@pytest.mark.parametrize(("lean", "count"), [(0.7e-3, 1), (1.4e-3, 0)])
def test_snow_on_a_wall_counts_as_a_load_if_the_wall_leans_by_over_a_thousandth(lean, count):
    wall = Surface(np.c_[PLATE.V[:, 0], lean * PLATE.V[:, 1], PLATE.V[:, 1]], PLATE.F)
    given = {"thickness": 0.02, "material": "GL24h", "check": False}
    preset = Preset(
        surface=wall, supports=[Support(Side("z", "min", 0.3))], loads=[SelfWeight(), Snow(800.0)], statics=given
    )
    notes = Design.from_preset(preset).until("statics").notes
    assert sum("snow acts parallel to its faces" in note.text for note in notes) == count


def test_a_load_on_supported_vertices_gives_a_note():
    loads = [SelfWeight(), Line(Side("x", "min"), (0, 0, -60.0), name="sill")]
    notes = [note.text for note in design_of_plate([Support(Side("x", "min", 0.3))], loads).until("statics").notes]
    assert any(note.startswith("sill acts only on supports") for note in notes)


@pytest.mark.parametrize(("indices", "says"), [
    ((0,), r"can turn about .*: the supports hold only 1 vertex, at \[0\.0, 0\.0, 0\.0\] m; pick more vertices"),
    ((0, 24), r"can turn about .*: the supports hold only 2 vertices, at \[0\.0, 0\.0, 0\.0\] and \[2\.0, "),
])  # fmt: skip
def test_a_surface_held_at_one_or_two_points_is_refused_with_advice(indices, says):
    with pytest.raises(StaticsError, match=says) as caught:
        _ = design_of_plate([Support(Vertices(indices))], [SelfWeight()]).statics
    assert str(caught.value).count("turn about x") <= 1


def test_a_build_computes_load_facts_once_and_prints_the_written_files(monkeypatch, tmp_path, capsys):
    asked, one = [], inspection.load_facts
    for module in (inspection, design_facts):
        monkeypatch.setattr(module, "load_facts", lambda *given: asked.append(given) or one(*given))
    words = ["--set", "surface.edge=1.2", "--format", "stl", "--no-preview", "-o", str(tmp_path / "out")]
    assert main(["build", DOME_MODES, "--verbose", *words]) == 0
    said = capsys.readouterr().out.split("\n")
    lines = list(load_lines(json.loads((tmp_path / "out" / "design.json").read_text())))
    assert len(lines) == 5
    assert said[said.index(lines[0]) :][:5] == lines
    assert len(asked) == 1


def test_swapped_units_are_refused_or_give_a_note():
    dome = {"surface.edge": 1.0}
    with pytest.raises(SurfaceError, match="which is impossible"):
        run(load_preset(DOME_MODES, {**dome, "statics.thickness": 60.0}))
    mm = load_preset(DOME_MODES, dome).surface.build()
    given = {"supports": [Support(Boundary())], "loads": [SelfWeight()]}
    with pytest.raises(SurfaceError, match="which is impossible"):
        run(Preset(surface=(1000 * mm.V, mm.F), statics={"thickness": 0.06}, **given))
    made = Design.from_preset(Preset(surface=(1000 * mm.V, mm.F), statics={"thickness": 60.0}, **given))
    _ = made.statics
    assert "the surface is 17.4 km large: check its unit" in [note.text for note in made.notes]


def test_the_editor_opens_a_preset_on_a_mesh_and_its_command_names_both(tmp_path):
    file = tmp_path / "plate.obj"
    file.write_text("v 0 0 0\nv 4000 0 0\nv 0 4000 0\nf 1 2 3\n")
    opened = open_preset("roof", Source(("statics.thickness=0.1",), file, "mm"))
    assert opened.preset.surface.build().area == pytest.approx(8)
    words = ("roof", "--set", "statics.thickness=0.1", "--mesh", str(file), "--unit", "mm")
    assert opened.words == words
    with pytest.raises(PresetError, match="name two meshes; leave one of the meshes out"):
        open_preset(str(file), Source(mesh=file))


@pytest.mark.parametrize("words", [["--set", "statics.thickness=0.1"], ["--mesh", "a.obj"], ["-o", "a.png"]])
def test_inspect_of_a_mesh_refuses_options_of_presets(capsys, tmp_path, words):
    file = tmp_path / "plate.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert main(["inspect", str(file), *words]) == 1
    assert "works with a preset or a folder of results, not with a mesh file" in capsys.readouterr().err
