"""The previewer: its picture is that of the exact cut, a broken shader is found out, and geometry is made once."""

import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from dsfab.app import bench_preview
from dsfab.core.errors import DsfabError, PatternError, PresetError
from dsfab.design import Design, draft, run
from dsfab.preset.file import load_preset, with_overrides
from dsfab.render import scene as scene_module
from dsfab.render import shader
from dsfab.render.colouring import band_limit, diverging_colours, stress_label
from dsfab.render.light import QUICK
from dsfab.render.marks import reaction_arrows
from dsfab.render.previewer import TRIAL_SIZE, Previewer
from dsfab.render.scene import Body
from dsfab.render.view import named_side
from tests.app.preview_pictures import MOST, SIZE, difference, exact
from tests.presets import DOME_MODES, GLOBE_MODES


@pytest.fixture(scope="module")
def dome() -> Design:
    return draft(load_preset(DOME_MODES, {"surface.edge": 0.5, "pattern.width": {}}))


RULES = {
    "plain": {},
    "constant": {"pattern.width.rule": "constant", "pattern.width.member": 0.2},
    "graded": {"pattern.width.rule": "graded", "pattern.width.q": 1.0},
    "rim and bounds": {"pattern.rim": 0.6, "pattern.keep": 0.0, "pattern.width.min_width": 0.25},
    "share": {"pattern.width.solid_fraction": 0.45},
}


@pytest.mark.parametrize("rule", RULES)
def test_the_shader_agrees_with_the_exact_cut(dome: Design, rule: str) -> None:
    made = draft(with_overrides(dome.preset, RULES[rule]), earlier=dome)
    with Previewer(made, marks=False) as previewer:
        assert difference(made, previewer) < MOST
        whole = exact(previewer, made.surface)
        assert previewer.mask(SIZE).sum() < 0.98 * whole.sum()  # something was left away


def test_modes_and_phases_that_were_chosen_are_drawn() -> None:
    auto = {"pattern.major.mode": "auto", "pattern.minor.phase": "auto", "diffusion.modes": 2, "surface.edge": 0.1}
    made = draft(load_preset("cantilever", {**auto, "pattern.width": {}}))
    with Previewer(made, marks=False) as previewer:
        assert difference(made, previewer) < 2 * MOST  # what is kept is drawn by values at vertices, on large faces
        chosen = previewer.mask(SIZE)
        settled = made.preset.with_modes(made.pattern.mode, made.pattern.phase)
        previewer.display(settled)
        assert np.array_equal(previewer.mask(SIZE), chosen)
        previewer.set({"pattern.minor.phase": (made.pattern.phase[1] + 0.4) % 1})
        assert (previewer.mask(SIZE) != chosen).mean() > 0.01


def test_a_closed_surface_agrees_too() -> None:
    made = draft(load_preset(GLOBE_MODES, {"pattern.width": {"rule": "graded"}, "pattern.rim": 0.1}))
    with Previewer(made, marks=False, view="20,30") as previewer:
        assert difference(made, previewer) < MOST


CHANGES = [
    {"pattern.major.frequency": 11.5, "pattern.minor.phase": 0.37},
    {"pattern.minor.threshold": -0.4, "pattern.keep": 0.0},
    {"pattern.rim": 0.8},
    {"pattern.major.mode": 3},
    {"pattern.width.rule": "constant", "pattern.width.member": 0.18},
    {"pattern.width.rule": "plain", "pattern.major.frequency": 5.0},
    {"diffusion.r": 10.0},
]


@pytest.mark.slow
def test_a_changed_previewer_draws_the_same_picture_as_a_new_one(dome: Design) -> None:
    preset = dome.preset
    with Previewer(dome, marks=False) as previewer:
        actors = list(previewer._scene.actors)
        points = [actor.GetMapper().GetInput().GetPoints().GetMTime() for actor in actors]
        for changes in CHANGES:
            preset = with_overrides(preset, changes)
            previewer.set(changes)
            assert previewer.preset == preset
            with Previewer(draft(preset), marks=False) as fresh:
                assert np.array_equal(previewer.mask(SIZE), fresh.mask(SIZE)), changes
        assert previewer._scene.actors == actors
        assert [actor.GetMapper().GetInput().GetPoints().GetMTime() for actor in actors] == points


def test_numbers_are_changed_without_drafting_again(dome: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> Design:
        raise AssertionError("drafted again")

    with Previewer(dome) as previewer:
        before = previewer.mask(SIZE)
        monkeypatch.setattr("dsfab.render.previewer.draft", never)
        previewer.set({"pattern.major.frequency": 12.0, "pattern.minor.threshold": 0.6, "pattern.keep": 0.5})
        assert (previewer.mask(SIZE) != before).any()
        previewer.set({"slicing.snap": 0.1, "export.formats": ["stl"]})  # not seen before the cut
        with pytest.raises(AssertionError, match="drafted again"):
            previewer.set({"pattern.major.mode": 2})


def test_threshold_one_is_empty_and_minus_one_is_the_whole_silhouette(dome: Design) -> None:
    both = {"pattern.keep": 0.0, "pattern.major.threshold": 1.0, "pattern.minor.threshold": 1.0}
    with Previewer(dome, marks=False) as previewer:
        previewer.set({"pattern.major.threshold": -1.0})
        assert np.array_equal(previewer.mask(SIZE), exact(previewer, dome.surface))
        previewer.set(both)
        assert not previewer.mask(SIZE).any()
        with pytest.raises(PatternError, match="leaves no material"):
            previewer.picture(SIZE)


def test_a_design_without_material_shows_an_empty_picture_beside_marks(
    dome: Design, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a frame of its own."""
    both = {"pattern.keep": 0.0, "pattern.major.threshold": 1.0, "pattern.minor.threshold": 1.0}
    with Previewer(dome) as previewer:
        monkeypatch.setattr(Previewer, "mask", None)
        previewer.picture(SIZE)
        previewer.set(both)
        with pytest.raises(PatternError, match="leaves no material"):
            previewer.picture(SIZE)


@pytest.mark.parametrize(
    ("name", "broken"),
    [
        ("a tag that does not exist", (("//VTK::NoSuchTag::Impl", "discard;"),)),
        ("no discard", shader.ShaderProgram().fragment()[:1]),
        ("all discarded", (*shader.ShaderProgram().fragment()[:1], ("//VTK::Clip::Impl", "  discard;\n"))),
    ],
)
def test_a_shader_that_does_not_work_is_never_drawn(
    dome: Design, monkeypatch: pytest.MonkeyPatch, name: str, broken: tuple[tuple[str, str], ...]
) -> None:
    monkeypatch.setattr(shader.ShaderProgram, "fragment", lambda self: broken)
    with pytest.raises(DsfabError, match="does not run the preview's shader") as refusal:
        Previewer(dome)
    assert "pixels of a surface" in str(refusal.value), name


def test_a_wrong_shader_language_is_found_by_its_pixels(
    dome: Design, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    tag = "//VTK::Clip::Impl"
    wrong = (*shader.ShaderProgram().fragment()[:1], (tag, "  this is no GLSL;\n"))
    monkeypatch.setattr(shader.ShaderProgram, "fragment", lambda self: wrong)
    with pytest.raises(DsfabError, match="does not run the preview's shader"):
        Previewer(dome)
    capfd.readouterr()  # the driver's own complaint


def test_families_are_shown_one_at_a_time_and_together_make_the_structure(dome: Design) -> None:
    masks = {}
    for show in ("structure", "major", "minor"):
        with Previewer(dome, show=show, marks=False, view="top") as previewer:  # from above nothing hides anything
            masks[show] = previewer.mask(SIZE)
    assert np.array_equal(masks["structure"], masks["major"] | masks["minor"])
    assert masks["major"].sum() < masks["structure"].sum()
    assert masks["minor"].sum() < masks["structure"].sum()


def test_loads_are_shown_on_the_whole_surface(dome: Design) -> None:
    with Previewer(dome, show="loads") as previewer:
        assert np.array_equal(previewer.mask(SIZE), exact(previewer, dome.surface))
        assert len(previewer._stage.bodies) == 4  # with arrows, cones and a person


def test_a_picture_is_the_same_twice_and_changes_with_the_pattern(dome: Design) -> None:
    with Previewer(dome) as previewer:
        one, two = (previewer.picture(TRIAL_SIZE, quality=QUICK) for _ in range(2))
        previewer.set({"pattern.major.frequency": 15.0})
        three = previewer.picture(TRIAL_SIZE, quality=QUICK)
    assert one.shape == (TRIAL_SIZE[1], TRIAL_SIZE[0], 3)
    assert one.dtype == np.uint8
    assert np.array_equal(one, two)
    assert (one != three).any()


def test_stress_is_coloured_by_sign_and_again_for_other_loads(dome: Design) -> None:
    with Previewer(dome, show="stress", marks=False) as previewer:
        part = previewer._shader._parts[0]["mesh"]
        before = vtk_to_numpy(part.GetCellData().GetArray("colour")).copy()
        blue = before[:, 2].astype(int) > before[:, 0]
        assert blue[dome.diffusion.tensors.principal.max(axis=1) < 0].mean() > 0.9  # pressed both ways
        limit = previewer._bar.limit
        previewer.set({"statics.thickness": 0.12})
        assert previewer._bar.limit < 0.9 * limit
        assert previewer.picture(SIZE, quality=QUICK).shape == (360, 480, 3)


def test_a_finished_design_can_be_previewed_too() -> None:
    design = run(load_preset(DOME_MODES, {"surface.edge": 0.9}))
    with Previewer(design, marks=False) as previewer:
        assert previewer.mask(SIZE).any()
        assert previewer._repr_png_().startswith(b"\x89PNG")


def test_another_surface_is_refused_and_the_old_preset_stays(dome: Design) -> None:
    with Previewer(dome) as previewer:
        before = previewer.mask(SIZE)
        for changes, error in (
            ({"surface.edge": 0.6}, DsfabError),
            ({"pattern.major.mode": 40}, PatternError),
            ({"pattern.major.frequencies": 4}, PresetError),
        ):
            with pytest.raises(error):
                previewer.set(changes)
        assert previewer.preset == dome.preset
        assert np.array_equal(previewer.mask(SIZE), before)


def test_another_thread_is_refused_in_a_sentence(dome: Design) -> None:
    told: list[str] = []

    def draw() -> None:
        try:
            previewer.picture(TRIAL_SIZE)
        except DsfabError as error:
            told.append(str(error))

    with Previewer(dome) as previewer:
        thread = threading.Thread(target=draw)
        thread.start()
        thread.join()
    assert len(told) == 1
    assert "in each thread" in told[0]


@pytest.mark.parametrize("name", ["iso", "top", "front", "side", "30,20", "-45,-10"])
def test_a_view_is_a_frame_of_unit_vectors(dome: Design, name: str) -> None:
    side = named_side(dome.surface.V, np.array([0.0, 0.0, 1.0]), name)
    assert np.linalg.norm(side.towards) == pytest.approx(1)
    assert np.linalg.norm(np.cross(side.up, side.towards)) > 0.8
    wanted = {"top": 1.0, "30,20": np.sin(np.radians(20)), "-45,-10": -np.sin(np.radians(10))}
    if name in wanted:
        assert side.towards[2] == pytest.approx(wanted[name])


@pytest.mark.parametrize("name", ["diagonal", "30", "30,20,10", "nan,3", "10,95", ""])
def test_an_unknown_view_is_refused(dome: Design, name: str) -> None:
    with pytest.raises(DsfabError, match="is not known; use iso"):
        Previewer(dome, view=name)


def test_an_unknown_picture_name_is_refused(dome: Design) -> None:
    with pytest.raises(DsfabError, match="'beauty' is not known; use one of structure, stress"):
        Previewer(dome, show="beauty")


def test_tension_is_red_and_compression_blue() -> None:
    colours = diverging_colours(np.array([-2.0, -1.0, 0.0, 1.0, 2.0])).astype(int)
    assert (colours[0] == colours[1]).all()
    assert (colours[3] == colours[4]).all()
    assert colours[1, 2] > colours[1, 0] + 60
    assert colours[3, 0] > colours[3, 2] + 60
    assert np.ptp(colours[2]) < 15
    assert [stress_label(x) for x in (0.0, 350.0, 1.24e6, -2e9, 4.1e3)] == [
        "0 Pa",
        "350 Pa",
        "1.24 MPa",
        "-2 GPa",
        "4.1 kPa",
    ]


PLAIN = shader.StripeSettings((3.0, 2.0), (0.1, 0.2), (0.2, 0.1))
NEEDS = {
    "plain": (PLAIN, ("modes",)),
    "widths": (replace(PLAIN, half_width=(0.2, shader.BY_VERTEX)), ("modes", "widths")),
    "widths of what is hidden": (replace(PLAIN, half_width=(0.2, shader.BY_VERTEX), shown=(1.0, 0.0)), ("modes",)),
    "kept": (replace(PLAIN, reach=(0.3, shader.NO_REACH)), ("modes", "kept")),
    "all": (shader.StripeSettings(half_width=2 * (shader.BY_VERTEX,), reach=(0.1, 0.2)), shader.FIELDS),
}


@pytest.mark.parametrize("name", NEEDS)
def test_the_shader_receives_only_the_fields_that_the_pattern_reads(name: str) -> None:
    """Software rendering pays for each number per triangle and for each uniform per pixel."""
    settings, fields = NEEDS[name]
    stripes = shader.StripeShader(np.zeros((3, 6)))
    stripes.set(settings)
    vertex = "".join(text for _, text in stripes.program.vertex())
    fragment = "".join(text for _, text in stripes.program.fragment())
    assert set(re.findall(r"in vec2 (\w+)MC;", vertex)) == set(fields)
    handed = re.findall(r"in (vec\d \w+);", fragment)
    assert handed == ["vec4 dsStripes", "vec2 dsReached"][: 2 if "kept" in fields else 1]
    assert handed == re.findall(r"out (vec\d \w+);", vertex)
    assert not re.search(r"ds(Frequency|Phase|HalfWidth|Drawn|Reach|Shown)\b", fragment)


def test_a_shader_goes_through_all_its_programs_and_back(dome: Design) -> None:
    """The picture belongs to the numbers, whichever program drew before."""
    with Previewer(dome, marks=False) as previewer:
        seen = []
        for settings in (PLAIN, NEEDS["all"][0], NEEDS["kept"][0], NEEDS["widths"][0], PLAIN):
            previewer._shader.set(settings)
            seen.append(previewer.mask(TRIAL_SIZE))
        assert np.array_equal(seen[0], seen[-1])
        assert min((seen[0] != other).sum() for other in seen[1:-1]) > 10


def test_corners_that_are_split_take_their_values_along() -> None:
    """A cube of 8 vertices is drawn with 24 corners: each has the field of the vertex it comes from."""
    V = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    F = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    )  # fmt: skip
    stripes = shader.StripeShader(np.column_stack([V, V]))
    body = Body(V, F, np.zeros(3, dtype=np.uint8), casts=True, shader=stripes)
    with scene_module.Scene([body], np.zeros(3), 1.0):
        mesh = stripes._parts[0]["mesh"]
        points = vtk_to_numpy(mesh.GetPoints().GetData())
        given = [vtk_to_numpy(mesh.GetPointData().GetArray(name)) for name in shader.FIELDS]
        assert len(points) == 24
        assert np.allclose(np.hstack(given), np.hstack([points, points]))


def test_walls_are_seen_beside_members_and_nowhere_else(dome: Design) -> None:
    """What is added to an infinitely thin sheet lies within half the thickness of it, and none for lamps and masks."""
    made = draft(with_overrides(dome.preset, {"statics.thickness": 0.4}), earlier=dome)
    with Previewer(made, marks=False) as previewer:
        view, scene, shader_ = previewer._view(SIZE, True), previewer._scene, previewer._shader
        thin = scene.mask(view, *SIZE)
        seen = np.isfinite(scene.pixels(view, *SIZE).depth)
        again = scene.mask(view, *SIZE)
        assert np.array_equal(thin, again)
        assert 1.1 * thin.sum() < seen.sum() < 2.5 * thin.sum()
        shader_.set(shader.ALL_MATERIAL)
        whole = scene.mask(view, *SIZE)
        assert np.array_equal(np.isfinite(scene.pixels(view, *SIZE).depth), whole)  # no wall without an opening
        assert not (seen & ~whole).any()
        shader_.set(shader.NO_MATERIAL)
        assert not np.isfinite(scene.pixels(view, *SIZE).depth).any()


def test_families_have_their_colours_and_a_legend(dome: Design) -> None:
    with Previewer(dome, show="families", marks=False, view="top") as previewer:
        view = previewer._view(SIZE, True)
        colour = previewer._scene.pixels(view, *SIZE).colour.astype(int)
        assert [name for name, _ in previewer._swatches] == ["major", "minor", "kept"]
        masks = [np.abs(colour - np.array(tint)).max(axis=2) <= 2 for tint in previewer._palette.tints]
    with Previewer(dome, show="major", marks=False, view="top") as previewer:
        major = previewer.mask(SIZE)
    assert all(mask.sum() > 200 for mask in masks[:2])
    assert (masks[0] & ~major).sum() < 0.1 * masks[0].sum()  # faces lie half the thickness above the middle
    assert not (masks[1] & masks[0]).any()


def test_an_unknown_layer_and_ground_are_refused(dome: Design) -> None:
    with pytest.raises(DsfabError, match="layer 'birds' is not known"):
        Previewer(dome, marks=["loads", "birds"])
    with pytest.raises(DsfabError, match="ground 'lawn' is not known"):
        Previewer(dome, ground="lawn")


def test_a_notebook_shows_designs_and_drafts_and_warns_where_nothing_can_be_drawn(
    dome: Design, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert dome._repr_png_().startswith(b"\x89PNG")

    def cannot(*_: object, **__: object) -> None:
        raise DsfabError("pictures cannot be drawn on this machine")

    monkeypatch.setattr("dsfab.render.design_picture.Previewer", cannot)
    with pytest.warns(UserWarning, match="cannot be drawn"):
        assert dome._repr_png_() is None


@pytest.mark.parametrize(("limit", "end", "bands"), [(1.0, 1.0, 5), (97.0, 100.0, 5), (4.1, 5.0, 5), (0.0, 1.0, 4)])
def test_bands_are_round(limit: float, end: float, bands: int) -> None:
    assert band_limit(limit) == (pytest.approx(end), bands)


def test_banded_colours_are_steps_from_end_to_end() -> None:
    smooth, steps = (diverging_colours(np.linspace(-1, 1, 400), bands) for bands in (0, 8))
    assert len(np.unique(steps, axis=0)) == 8
    assert len(np.unique(smooth, axis=0)) > 100
    assert (steps[[0, -1]] == smooth[[0, -1]]).all()
    assert not (steps[199] == steps[200]).all()  # tension and compression do not share a band


def test_arrows_of_reactions_act_at_the_supports(dome: Design) -> None:
    surface, load = dome.surface, dome.load
    reaction = dome.statics.equilibrium.reaction
    V, F = reaction_arrows(surface, load, reaction, 10.0)
    low = V[:, 2].min()
    assert len(F) > 0
    assert low < surface.V[:, 2].min() - 0.2  # they come from below
    down, _ = reaction_arrows(surface, load, -reaction, 10.0)
    assert down[:, 2].min() < surface.V[:, 2].min()
    assert len(reaction_arrows(surface, load, 0 * reaction, 10.0)[1]) == 0


def test_the_bench_of_frame_rates_names_the_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_preview, "SECONDS", 0.0)
    monkeypatch.setattr(bench_preview, "PIXELS", (160, 120))
    row = bench_preview.measure(2_000)
    assert abs(row["triangles"] - 2_000) < 200
    assert row["renderer"] != "unknown"
    assert min(row[kind] for kind in (*bench_preview.KINDS, "change_ms", "over_clock", "over_cpu")) > 0
    assert 20 < row["peak_mb"] < 1e5
    text = bench_preview.rates_table([row, {**row, "renderer": "NVIDIA H100"}])
    assert "hardware: NVIDIA H100" in text
    V, F, fields = bench_preview.wavy_torus(2_000)
    assert fields.shape == (len(V), 6)
    assert len(V) - len(F) // 2 == 0  # Euler: V - E + F = 0 on a torus, 2 E = 3 F
