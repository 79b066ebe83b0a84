"""Evenly spaced stripes as they are drawn: what is seen is what is cut, and light shows no seam of the chart."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dsfab.app.cli import main
from dsfab.app.preview import picture_names
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design import Design, draft
from dsfab.preset.file import load_preset, with_overrides
from dsfab.render.design_picture import structure_drawing
from dsfab.render.previewer import Previewer
from dsfab.render.scene import shading
from dsfab.render.striped_mesh import StripedMesh, needs_only_settings
from tests.app.preview_pictures import MOST, SIZE, difference, exact
from tests.presets import DOME_MODES, GLOBE_MODES

EVEN = {"pattern.method": "stripes", "pattern.major.frequency": 0, "pattern.minor.frequency": 0}
DOME = {**EVEN, "surface.edge": 0.5, "pattern.major.spacing": 1.1, "pattern.minor.spacing": 0.55}


@pytest.fixture(scope="module")
def dome() -> Design:
    return draft(load_preset(DOME_MODES, DOME))


@pytest.fixture(scope="module")
def globe() -> Design:
    both = {"pattern.major.spacing": 0.2, "pattern.minor.spacing": 0.2}
    return draft(load_preset(GLOBE_MODES, {**EVEN, **both}))


RULES = {
    "plain": {"pattern.width": {}},
    "constant": {"pattern.width": {"rule": "constant", "member": 0.2}},
    "graded": {"pattern.width": {"rule": "graded", "q": 1.0}},
    "rim and bounds": {"pattern.rim": 0.6, "pattern.width": {"min_width": 0.25}},
    "share": {"pattern.width": {"rule": "constant", "solid_fraction": 0.45}},
    "not halved": {"pattern.halve": False, "pattern.tidy": False},
}


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_the_shader_of_stripes_agrees_with_the_exact_cut(dome: Design, rule: str) -> None:
    made = draft(with_overrides(dome.preset, RULES[rule]), earlier=dome)
    assert made.pattern.even
    assert len(set(made.pattern.even.chart.scale.ravel())) > 2 or rule == "not halved"  # some are halved
    with Previewer(made, marks=False) as previewer:
        nodes = rule == "not halved"  # faces without a phase are void here; the cut makes nodes of some
        assert difference(made, previewer) < (5 if nodes else 1) * MOST
        assert previewer.mask(SIZE).sum() < 0.98 * exact(previewer, made.surface).sum()


def test_a_closed_surface_agrees_too(globe: Design) -> None:
    """Some faces have no phase: void here, and nodes in the cut where members meet in them."""
    assert any(phase.singular.any() for phase in globe.pattern.even.phases)
    with Previewer(globe, marks=False, view="20,30") as previewer:
        assert difference(globe, previewer) < 5 * MOST


CHANGES = [
    {"pattern.rim": 0.8},
    {"pattern.width": {"rule": "constant", "member": 0.18}},
    {"pattern.major.spacing": 0.9},
    {"pattern.halve": False},
    {"pattern.keep": 0.0},
    {"pattern.method": "modes", "pattern.major.spacing": 0.0, "pattern.major.frequency": 8.0},
    {"pattern.method": "stripes", "pattern.major.spacing": 1.2, "pattern.major.frequency": 0.0},
]


@pytest.mark.slow
def test_a_changed_previewer_draws_the_same_stripes_as_a_new_one(dome: Design) -> None:
    preset = dome.preset
    with Previewer(dome, marks=False) as previewer:
        for changes in CHANGES:
            preset = with_overrides(preset, changes)
            previewer.set(changes)
            with Previewer(draft(preset), marks=False) as fresh:
                assert np.array_equal(previewer.mask(SIZE), fresh.mask(SIZE)), changes
                assert len(previewer._scene.actors) == 1


def test_a_reach_alone_is_a_number(dome: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = draft(with_overrides(dome.preset, {"pattern.width": {}}), earlier=dome)

    def never(*_: object, **__: object) -> Design:
        raise AssertionError("drafted again")

    with Previewer(plain, marks=False) as previewer:
        before = previewer.mask(SIZE).sum()
        monkeypatch.setattr("dsfab.render.previewer.draft", never)
        previewer.set({"pattern.rim": 1.0})
        assert previewer.mask(SIZE).sum() > 1.02 * before
        for changes in ({"pattern.minor.spacing": 0.6}, {"pattern.halve": False}, {"pattern.major.threshold": 0.2}):
            with pytest.raises(AssertionError, match="drafted again"):
                previewer.set(changes)
    assert needs_only_settings(plain.preset, with_overrides(plain.preset, {"pattern.keep": 0.9}))
    assert not needs_only_settings(
        dome.preset, with_overrides(dome.preset, {"pattern.keep": 0.9})
    )  # a share is solved for


def words(path: Path, *more: str) -> list[str]:
    sets = [text for key, value in DOME.items() for text in ("--set", f"{key}={value}")]
    return ["preview", DOME_MODES, *sets, "--size", "160x120", "--layers", "none", "-o", str(path), *more]


@pytest.mark.slow
def test_preview_shows_the_built_design_or_the_uncut_design_if_no_cut_is_possible(
    dome: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Loose ends are none in the structure; a design that cannot be cut is seen all the same, and told."""
    monkeypatch.setattr("dsfab.render.previewer.Previewers.draft_for", lambda *_: dome)
    built = dome.until("thickening")
    path = tmp_path / "dome.png"
    assert main(words(path, "-q")) == 0
    shown = np.asarray(Image.open(path))
    assert np.array_equal(shown, structure_drawing(built, marks=(), size=(160, 120)).render())

    def uncut(design: Design, stage: str) -> Design:
        raise PatternError("a piece reaches no support")

    monkeypatch.setattr(Design, "until", uncut)
    capsys.readouterr()
    assert main(words(path)) == 0
    why = "because dsfab could not cut the sheet: a piece reaches no support"
    assert f"shows the uncut sheet with its pattern, {why}" in capsys.readouterr().err
    assert not np.array_equal(np.asarray(Image.open(path)), shown)


def test_light_shows_no_seam(globe: Design) -> None:
    """Each vertex of the chart, on whichever side of a seam, has the normal of the sphere to within a face's turn."""
    mesh = StripedMesh.from_design(globe)
    assert mesh.even
    chart = mesh.surface
    given = shading(globe.surface.V, globe.surface.F)
    normals = mesh.at_corners(given)
    place = np.round(chart.V[chart.F].reshape(-1, 3) / 1e-9).astype(np.int64)
    _, spot = np.unique(place, axis=0, return_inverse=True)
    spread = np.zeros((spot.max() + 1, 3))
    for k in range(3):
        most, least = np.full(len(spread), -2.0), np.full(len(spread), 2.0)
        np.maximum.at(most, spot.ravel(), normals.reshape(-1, 3)[:, k])
        np.minimum.at(least, spot.ravel(), normals.reshape(-1, 3)[:, k])
        spread[:, k] = most - least
    assert np.bincount(spot.ravel()).max() > 6  # more than one side was looked at
    assert spread.max() < 1e-6
    own = shading(chart.V, chart.F)  # what a seam would look like: its sides, each by itself
    assert np.abs(own - normals).max() > 0.02
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)


def test_division_of_faces_does_not_change_the_lighting(dome: Design) -> None:
    """The picture of normals, bytes, is that of the uncut surface but for rounding."""
    seen = []
    for made in (dome, draft(load_preset(DOME_MODES, {"surface.edge": 0.5}))):
        with Previewer(made, show="loads", marks=False) as previewer:
            pixels = previewer._scene.pixels(previewer._view(SIZE, True), *SIZE)
            seen.append((np.isfinite(pixels.depth), pixels.normal.astype(int)))
    (hit, one), (also, two) = seen
    both = hit & also
    assert both.mean() > 0.2
    assert np.percentile(np.abs(one - two)[both], 99.9) <= 1


def test_a_design_without_modes_refuses_to_show_a_mode(dome: Design) -> None:
    with pytest.raises(DsfabError, match=r"needs pattern.method = 'modes'"):
        Previewer(dome, show="major_mode")
    assert "major_mode" not in picture_names("all", dome.preset)
    assert "minor_mode" in picture_names("modes", dome.preset)  # who asks is told why not


@pytest.mark.slow
@pytest.mark.parametrize("show", ["loads", "displacement", "directions", "vonmises"])
def test_the_whole_sheet_is_whole(dome: Design, show: str) -> None:
    on_modes = draft(load_preset(DOME_MODES, {"surface.edge": 0.5}))
    with Previewer(dome, show=show) as striped, Previewer(on_modes, show=show) as plain:
        one, two = striped.mask(SIZE), plain.mask(SIZE)
        assert (one != two).sum() <= 2e-4 * two.sum()


def test_families_together_make_the_structure(dome: Design) -> None:
    masks = {}
    for show in ("structure", "major", "minor"):
        with Previewer(dome, show=show, marks=False, view="top") as previewer:
            masks[show] = previewer.mask(SIZE)
    assert np.array_equal(masks["structure"], masks["major"] | masks["minor"])
    assert max(masks["major"].sum(), masks["minor"].sum()) < 0.9 * masks["structure"].sum()
