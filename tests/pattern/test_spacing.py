"""Spacing in metres: the middles of the stripes lie as far apart as asked, measured along the lines themselves."""

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import PatternError, PresetError
from dsfab.design import draft
from dsfab.pattern import Stripes, frequency_for
from dsfab.preset.file import preset_toml
from dsfab.surface import Surface
from tests.shapes import grid, jittered, tube

SMALL = {"surface.edge": 0.08, "pattern.major": {"spacing": 0.07, "phase": 0.3}, "pattern.minor": {"spacing": 0.11}}


def line_length(surface: Surface, z: np.ndarray) -> float:
    """Metres of the lines z = k, k integer: in each face a straight piece between the two edges that it crosses."""
    total = 0.0
    for k in range(int(np.floor(z.min())), int(np.ceil(z.max())) + 1):
        value, V = (z - k - 1e-9)[surface.F], surface.V[surface.F]
        points, crossed = [], []
        for i, j in ((0, 1), (1, 2), (2, 0)):
            crossed.append(value[:, i] * value[:, j] < 0)
            share = value[:, i] / np.where(crossed[-1], value[:, i] - value[:, j], 1)
            points.append(V[:, i] + share[:, None] * (V[:, j] - V[:, i]))
        for a, b in ((0, 1), (1, 2), (2, 0)):
            both = crossed[a] & crossed[b]
            total += np.linalg.norm(points[a][both] - points[b][both], axis=1).sum()
    return total


@pytest.mark.parametrize("spacing", [0.05, 0.13])
def test_stripes_on_a_linear_mode_have_the_requested_spacing(spacing):
    plate = jittered(grid(20, 12, 2.0, 1.0))
    assert frequency_for(plate, plate.V @ [3.0, 4.0, 0.0], spacing) == pytest.approx(1 / (5 * spacing), rel=1e-12)


def test_the_mean_spacing_is_area_over_the_length_of_the_middles():
    """Modes that flatten: cos on the plate, and a tilted mode on the cylinder; over four phases."""
    plate, pipe = jittered(grid(48, 24, 2.0, 1.0)), tube(48, 24)
    angle = np.arctan2(pipe.V[:, 1], pipe.V[:, 0])
    cases = [(plate, np.cos(np.pi * plate.V[:, 0] / 2)), (pipe, np.cos(np.pi * pipe.V[:, 2] / 2) + 0.5 * np.sin(angle))]
    for surface, x in cases:
        for spacing in (0.06, 0.15):
            f = frequency_for(surface, x, spacing)
            lengths = [line_length(surface, Stripes(f, phase).phases(x)) for phase in (0, 0.25, 0.5, 0.75)]
            assert surface.area / np.mean(lengths) == pytest.approx(spacing, rel=0.02)
            assert surface.area / np.array(lengths) == pytest.approx(np.full(4, spacing), rel=0.1)


def test_a_design_has_the_requested_spacing_and_reports_the_frequency():
    made = draft(dsfab.load_preset("cantilever", {**SMALL, "surface.edge": 0.04}))
    for k, (name, spacing) in enumerate((("major", 0.07), ("minor", 0.11))):
        x = getattr(made.diffusion, name).mode(1)
        f = made.pattern.frequency[k]
        assert made.surface.area / line_length(made.surface, f * x + [0.3, 0.0][k]) == pytest.approx(spacing, rel=0.1)
        told = f"the spacing of {spacing:g} m means that the frequency of the {name} stripes is {f:.4g}"
        assert told in [note.text for note in made.notes if note.stage == "pattern"]


def test_spacing_is_a_frequency_that_is_solved_for():
    solved = draft(dsfab.load_preset("cantilever", SMALL))
    written = {f"pattern.{name}.spacing": 0 for name in ("major", "minor")}
    written |= {f"pattern.{n}.frequency": f for n, f in zip(("major", "minor"), solved.pattern.frequency, strict=True)}
    again = draft(dsfab.load_preset("cantilever", SMALL | written))
    for a, b in zip(solved.pattern.fields, again.pattern.fields, strict=True):
        assert np.array_equal(getattr(a, "x", a), getattr(b, "x", b))
    assert again.pattern.frequency == solved.pattern.frequency


@pytest.mark.parametrize(
    "family", [{"spacing": 0.1, "frequency": 8.0}, {"frequency": 0.0}, {"spacing": 0.0, "frequency": 0}]
)
def test_frequency_and_spacing_exclude_each_other(family):
    with pytest.raises(PresetError, match=r"pattern\.major: give either frequency or spacing; leave the other key out"):
        dsfab.load_preset("cantilever", {"pattern.major": family})


def test_a_preset_with_spacing_survives_being_written_and_read(tmp_path):
    preset = dsfab.load_preset("cantilever", SMALL)
    (tmp_path / "again.toml").write_text(preset_toml(preset))
    assert dsfab.load_preset(tmp_path / "again.toml") == preset


def test_a_constant_mode_has_no_spacing():
    plate = grid(3, 3, 1.0, 1.0)
    with pytest.raises(PatternError, match="the mode of the stripes must not be constant"):
        frequency_for(plate, np.ones(plate.n), 0.1)


@pytest.mark.slow
def test_a_frequency_of_evenly_spaced_stripes_is_said_to_have_no_effect():
    asked = {"surface.edge": 0.9, "pattern.method": "stripes"}
    both = {"pattern.major": {"frequency": 12.0}, "pattern.minor": {"spacing": 1.1}}
    told, silent = (
        [note.text for note in draft(dsfab.load_preset("dome", changes)).notes if "frequency" in note.text]
        for changes in ({**asked, **both}, {**asked, "pattern.major": {}, "pattern.minor": {"frequency": 8.0}})
    )
    assert len(told) == 1
    assert told[0].startswith("pattern.major.frequency = 12 has no effect on evenly spaced stripes, which are ")
    assert told[0].endswith(" m apart: set pattern.major.spacing instead")
    assert not silent
