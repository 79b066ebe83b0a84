"""Answers of the statics in pictures: colours, bars and captions, exaggerated shapes, and what is refused."""

import numpy as np
import pytest

from dsfab import load_preset
from dsfab.core.errors import DsfabError
from dsfab.design import Design, draft
from dsfab.render.colouring import (
    EXAGGERATION,
    STATICS_RESULTS,
    YIELD_COLOUR,
    answer_colouring,
    energy_label,
    face_colouring,
    force_label,
    preset_with_mode,
    rising_colours,
)
from dsfab.render.lettering import PAPER
from dsfab.render.light import QUICK
from dsfab.render.marks import crosses
from dsfab.render.previewer import TRIAL_SIZE, Previewer
from tests.presets import DOME_MODES

SMALL = {"surface.edge": 0.7, "diffusion.modes": 5, "statics.bending": "midedge"}


def made(**changes) -> Design:
    return draft(load_preset(DOME_MODES, {**SMALL, **{f"statics.{key}": value for key, value in changes.items()}}))


@pytest.fixture(scope="module")
def dome() -> Design:
    return made(strength=20e6, frequencies=1, buckling=1)


@pytest.mark.parametrize("show", ["vonmises", "energy"])
def test_the_most_stressed_faces_are_darkest(dome, show):
    shown = answer_colouring(dome, show)
    value = {"vonmises": dome.statics.answers.stress.largest, "energy": dome.statics.answers.stress.energy}[show]
    order = np.argsort(value)
    light = shown.face.astype(int).sum(axis=1)[order]
    assert (np.diff(light) <= 2).all()  # but for rounding to bytes
    assert light[0] > light[-1] + 300
    assert shown.bar.names[1] == "and more"
    assert np.percentile(value, 98) <= shown.bar.limit * (1 + 1e-9) < 1.26 * np.percentile(value, 98)
    assert shown.V is None
    assert "hybrid+hhj" in shown.words


def test_utilisation_is_a_percentage_and_faces_beyond_the_strength_stand_out(dome):
    shown, stress = answer_colouring(dome, "utilisation"), dome.statics.answers.stress
    assert f"largest {stress.peak.stress / 20e6:.0%}" in shown.words
    assert shown.bar.labels[2].endswith("%")
    assert not (shown.face == YIELD_COLOUR).all(axis=1).any()
    weak = made(strength=float(np.median(stress.largest)))
    beyond = (answer_colouring(weak, "utilisation").face == YIELD_COLOUR).all(axis=1)
    assert np.array_equal(beyond, weak.statics.answers.stress.largest > weak.preset.statics.strength)
    assert 0.4 < beyond.mean() < 0.6


def test_shapes_are_exaggerated_to_a_share_of_the_size(dome):
    V, size = dome.surface.V, dome.surface.size
    moved = answer_colouring(dome, "displacement")
    u = dome.statics.answers.equilibrium.u
    factor = np.linalg.norm(moved.V - V, axis=1).max() / np.linalg.norm(u, axis=1).max()
    assert np.allclose(moved.V - V, factor * u)
    assert 0.4 * EXAGGERATION < np.linalg.norm(moved.V - V, axis=1).max() / size <= EXAGGERATION
    assert f"drawn {factor:,.0f} times as large" in moved.words
    for show in ("buckling", "frequency"):
        mode = answer_colouring(dome, show)
        assert np.linalg.norm(mode.V - V, axis=1).max() == pytest.approx(EXAGGERATION * size)
        assert "exaggerated" in mode.words
    down = answer_colouring(dome, "buckling").V - V
    assert np.einsum("ni,ni->", down, dome.load.force) > 0  # the way the load pushes
    assert f"{dome.statics.answers.buckling.factor[0]:.3g} x the load" in answer_colouring(dome, "buckling").words


def test_a_field_that_was_not_computed_is_refused_with_the_key_to_set(dome):
    plain = made()
    with pytest.raises(DsfabError, match="utilisation needs a strength"):
        answer_colouring(plain, "utilisation")
    for show, key in (("buckling", "buckling"), ("frequency", "frequencies")):
        with pytest.raises(DsfabError, match=f"ask for it with --set statics.{key}=1"):
            answer_colouring(plain, show)
        assert getattr(preset_with_mode(plain.preset, show).statics, key) == 1
    assert preset_with_mode(dome.preset, "buckling") is dome.preset
    assert preset_with_mode(plain.preset, "vonmises") is plain.preset
    light = draft(load_preset("cantilever", {"surface.edge": 0.1, "statics.density": 0.0, "statics.frequencies": 1}))
    with pytest.raises(
        DsfabError,
        match=r"no mode shape of frequency was computed: no natural frequencies: .* a "
        r"density",
    ):
        answer_colouring(light, "frequency")


@pytest.mark.parametrize("show", STATICS_RESULTS)
def test_every_answer_is_drawn_on_the_whole_sheet(dome, show):
    with Previewer(dome, show=show, marks=False) as previewer:
        assert np.ptp(previewer.picture(TRIAL_SIZE, quality=QUICK).reshape(-1, 3).astype(int), axis=0).min() > 50
        before = previewer.mask(TRIAL_SIZE)
        previewer.set(
            {"pattern.major.threshold": 0.9, "pattern.width.solid_fraction": 0.0, "pattern.width.rule": "plain"}
        )
        assert np.array_equal(previewer.mask(TRIAL_SIZE), before)


def test_other_statics_recolour_fields_and_are_refused_for_shapes(dome):
    with Previewer(dome, show="vonmises", marks=False) as previewer:
        limit, words = previewer._bar.limit, previewer._caption()
        previewer.set({"statics.thickness": 0.12})
        assert previewer._bar.limit < 0.9 * limit
        assert previewer._caption() != words
    with Previewer(dome, show="displacement", marks=False) as previewer:
        assert not previewer.can_display(made(thickness=0.12).preset)
        with pytest.raises(DsfabError, match="another shape of displacement: make a new Previewer"):
            previewer.set({"statics.thickness": 0.12})


def test_labels_and_ramp():
    assert [energy_label(x) for x in (0.0, 2.5e-5, 0.04, 12.0, 3100.0, 4e6)] == [
        "0 uJ/m2",
        "25 uJ/m2",
        "40 mJ/m2",
        "12 J/m2",
        "3.1 kJ/m2",
        "4 MJ/m2",
    ]
    colours = rising_colours(np.linspace(-0.5, 1.5, 9)).astype(int).sum(axis=1)
    assert (np.diff(colours) <= 2).all()
    assert colours[0] == colours[2]


def test_directions_of_combined_cases_have_no_sign():
    """A sum of sizes of stresses is positive both ways: in the colour of tension all would look pulled."""
    vault = draft(load_preset("snow_vault", {"surface.edge": 0.8, "pattern.keep": 0.9}))
    assert vault.preset.combines
    colours = {tuple(row) for row in crosses(vault, PAPER).colour.tolist()}
    assert colours == {PAPER.tints[0], PAPER.tints[1]}
    told = face_colouring(vault, "directions", PAPER)
    assert told.bar is None
    assert "combined load cases: red bars" in told.words
    dome = draft(load_preset(DOME_MODES, {"surface.edge": 0.9}))
    assert {tuple(row) for row in crosses(dome, PAPER).colour.tolist()} == {PAPER.tension, PAPER.compression}
    assert face_colouring(dome, "directions", PAPER).bar is not None


@pytest.mark.parametrize(
    ("newtons", "told"), [(999.9, "1 kN"), (350.2, "350 N"), (1.234e6, "1.23 MN"), (0.25, "250 mN")]
)
def test_labels_of_forces_have_three_digits_and_a_fitting_unit(newtons, told):
    assert force_label(newtons) == told
