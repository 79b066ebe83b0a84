"""The paper's figures in three ways: what is measured of each, and the webs and beams that captions speak of."""

import shlex
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.design import draft
from dsfab.preset.file import load_preset, parse_override, with_overrides
from dsfab.reproduction.captions import Web, finding, links, loaded_patches, nearby, web
from dsfab.reproduction.drawing import PaperPicture
from dsfab.reproduction.figures import FigurePictures, RenditionPicture
from dsfab.reproduction.page import COLUMNS, rendition_facts, rendition_section
from dsfab.reproduction.published import FIGURES
from dsfab.reproduction.renditions import LETTER, Rendition, departures, measured_rendition, renditions
from tests.shapes import grid


@pytest.fixture(scope="module")
def panel():
    """2 x 2, its middle at (0, 0), loaded there and held along its boundary: vertices, marks, x and y."""
    surface = grid(60, 60, 2.0, 2.0)
    x, y = (surface.V - surface.V.mean(axis=0))[:, :2].T
    held = np.zeros(surface.n, dtype=bool)
    held[surface.edges.ends[surface.edges.boundary]] = True
    return SimpleNamespace(surface=surface, x=x, y=y, load=np.hypot(x, y) < 0.05, held=held)


def test_known_rings_and_spokes_are_counted_correctly(panel):
    """Circles r = (k - .2) / 6 and lines x = (j - .5) / 8: a circle meets each line within its radius twice."""
    rings, lines = 6 * np.hypot(panel.x, panel.y) + 0.2, 8 * panel.x + 0.5
    found = web(panel.surface, np.column_stack([rings, lines]), panel.load, panel.held)
    radii = (np.arange(1, 7) - 0.2) / 6
    j = (np.arange(-20, 21) - 0.5) / 8
    assert found.family == "major"
    assert found.crossed == tuple(int(2 * (np.abs(j) < r).sum()) for r in radii)
    assert found.is_web
    assert f"crossed by {min(found.crossed)} to {max(found.crossed)} spokes" in found.sentence
    assert Web("minor", (10, 10)).sentence.endswith("each crossed by 10 spokes")
    other = web(panel.surface, np.column_stack([lines, rings]), panel.load, panel.held)
    assert (other.family, other.crossed) == ("minor", found.crossed)


def test_there_is_no_web_without_closed_lines_or_without_spokes(panel):
    straight = np.column_stack([8 * panel.x + 0.5, 8 * panel.y + 0.5])
    none = web(panel.surface, straight, panel.load, panel.held)
    assert none == Web()
    assert none.sentence.startswith("no web here, because no line")
    bare = web(
        panel.surface,
        np.column_stack([6 * np.hypot(panel.x, panel.y) + 0.2, 0.4 + 0 * panel.x]),
        panel.load,
        panel.held,
    )
    assert bare.crossed == (0,) * 6
    assert not bare.is_web
    assert "0 of 6 rings" in bare.sentence


def test_a_ring_round_the_support_as_well_is_none(panel):
    """Held close beside the load: a circle that has both inside parts nothing."""
    held = np.hypot(panel.x - 0.4, panel.y) < 0.04
    rings = 6 * np.hypot(panel.x, panel.y) + 0.2
    found = web(panel.surface, np.column_stack([rings, 8 * panel.x + 0.5]), panel.load, held)
    assert len(found.crossed) == 2  # radii 0.13 and 0.3; the next, 0.47, goes round both


def test_links_are_the_lines_that_run_from_one_place_to_another(panel):
    phases = np.column_stack([8 * panel.y + 0.5, 8 * panel.x + 0.5])
    left, right = panel.x < -0.99, panel.x > 0.99
    assert links(panel.surface, phases, left, right) == (16, 0)
    assert links(panel.surface, phases, left, nearby(panel.surface, panel.load, 3)) == (2, 0)
    broken = np.column_stack([8 * panel.y + 0.5 + 40 * (panel.x > 0), 8 * panel.x + 0.5])
    assert links(panel.surface, broken, left, right) == (0, 0)


def test_patches_of_the_load_are_its_connected_parts(panel):
    two = (np.hypot(panel.x - 0.5, panel.y) < 0.2) | (np.hypot(panel.x + 0.5, panel.y) < 0.1)
    found = loaded_patches(panel.surface, two)
    assert [bool(panel.x[one].mean() > 0) for one in found] == [True, False]
    assert np.array_equal(np.logical_or.reduce(found), two)


@pytest.fixture(scope="module")
def bar():
    return renditions(draft(load_preset("hanging_bar", {"surface.edge": 0.08})))


def test_a_figure_is_made_to_the_letter_by_its_preset_and_with_stripes(bar):
    letter, shipped, stripes = bar
    assert [one.name for one in bar] == ["letter", "preset", "stripes"]
    assert letter.design.preset.diffusion.labelling == "magnitude"
    assert letter.design.preset.statics.law == "stvk"
    assert not letter.departures
    assert len(shipped.departures) == 2
    assert len(stripes.departures) == 3
    assert shipped.share > 0.6
    assert stripes.share == pytest.approx(0.5, abs=0.01)  # over half they are no lattice
    for one in bar:
        assert not one.refused
        assert one.over_uncut > 1  # nothing is stiffer than the uncut sheet
        # in its plane a sheet of share s is 1 / s as soft
        assert one.over_uncut / one.over_thinner == pytest.approx(1 / one.share, rel=1e-6)
        assert one.carried == pytest.approx(1.0)
    assert stripes.evenness < shipped.evenness


def test_the_command_of_a_rendition_reproduces_it(bar):
    for one in bar:
        words = shlex.split(one.command)
        changes = dict(parse_override(text) for text in words[1::2])
        assert set(words[::2]) <= {"--set"}
        assert with_overrides(load_preset("hanging_bar", {"surface.edge": 0.08}), changes) == one.design.preset


@pytest.mark.parametrize("figure", FIGURES, ids=lambda one: one.preset)
def test_the_departures_of_each_preset_from_the_paper_are_listed(figure):
    """The paper keeps nothing; five presets do. To the letter none departs."""
    preset = load_preset(figure.preset)
    told = departures(preset)
    assert any("kept around" in one for one in told) == bool(preset.pattern.keep)
    assert not departures(with_overrides(preset, dict(LETTER)))


def test_loads_on_loose_pieces_are_not_carried():
    """With the paper's labels the sphere falls apart where it is pressed."""
    letter = measured_rendition("letter", draft(load_preset("sphere", {"surface.edge": 0.1})), LETTER)
    assert letter.loose
    assert letter.carried < 0.01
    assert letter.over_uncut == np.inf
    assert rendition_facts(letter)[3] == "not carried"
    told = FigurePictures(FIGURES[15], ways=(RenditionPicture(letter, PaperPicture("", "", "")),))
    assert letter.uncarried
    assert f"not carried: {letter.uncarried}." in rendition_section(told, 1.0)
    assert finding("web", letter).endswith("; the design carries 0% of the load")


def test_a_refused_rendition_has_an_empty_row_and_no_claim():
    none = Rendition("stripes", {}, refused="no stress")
    assert finding("web", none) == ""
    assert rendition_facts(none) == ("none", *[""] * (len(COLUMNS) - 1))


def test_findings_of_a_grid_and_of_a_beam_are_measured(bar):
    even = Rendition("preset", {}, design=bar[1].design, crossing=80.0, evenness=1.5)
    assert finding("grid", even).startswith("a grid: ")
    crooked = Rendition("preset", {}, design=bar[1].design, crossing=20.0, evenness=1.5)
    assert finding("grid", crooked).startswith("no even grid here, because members cross at 20 ")
    assert finding("beam", bar[1]) == (
        "no beam here, because no line of either family runs without a break from the load to the supports"
    )
