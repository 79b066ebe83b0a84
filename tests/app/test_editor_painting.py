"""Regions by hand in the editor: strokes of a brush and balls become solid parts, openings and bands."""

import tomllib

import numpy as np
import pytest

from dsfab.app.editor.workspace import OpenedPreset, open_preset
from dsfab.core.errors import PresetError
from dsfab.preset.file import load_preset
from tests.app.editor_page import SEEN, place_of, solved, until
from tests.app.editor_server import COARSE, COARSELY, serving
from tests.browser import browser
from tests.presets import DOME_MODES

seen_in_a_page = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")
DRAWN = {"pick": "curve", "file": "/etc/hostname"}


def test_the_page_names_no_drawing_here(tmp_path):
    now = open_preset(DOME_MODES, COARSELY)
    for changes in (
        {"pattern.region": [{"at": DRAWN, "do": "void"}]},
        {"surface.support": [{"at": DRAWN}]},
        {"surface.load.1.at": DRAWN},
    ):
        with pytest.raises(PresetError, match="the page cannot add the drawing hostname"):
            now.preset_with(changes)
    drawn = 'region = [{ at = { pick = "curve", file = "/etc/hostname" }, do = "void" }]'
    text = now.toml({}).replace("region = []", drawn)
    assert drawn in text
    with pytest.raises(PresetError, match="dsfab edit FILE"):
        now.open_toml(text)
    named = open_preset(
        DOME_MODES, COARSELY.with_overrides('pattern.region=[{at={pick="curve",file="/etc/hostname"},do="void"}]')
    )
    assert named.preset_with({"pattern.keep": 0.5}).pattern.region[0].at.file.name == "hostname"  # the person's own


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, {**COARSE, "pattern.keep": 0.0}))) as made:
        yield made


@pytest.fixture
def tab(sharp_tab):
    """Every test begins with the preset as it is, and with the form."""
    sharp_tab.run("dsfab.opened(dsfab.start); document.getElementById('guides').open = true")
    solved(sharp_tab)
    return sharp_tab


def stroke(tab, start, end, steps=12):
    """Pull the mouse from a place of the view to another one."""
    (x0, y0), (x1, y1) = place_of(tab, *start), place_of(tab, *end)
    tab.mouse("mousePressed", x0, y0)
    for step in range(1, steps + 1):
        tab.mouse("mouseMoved", x0 + (x1 - x0) * step / steps, y0 + (y1 - y0) * step / steps)
    tab.mouse("mouseReleased", x1, y1)


def form(tab, identifier, value):
    at = f"document.getElementById('{identifier}')"
    tab.run(f"{at}.value = '{value}'; {at}.dispatchEvent(new Event('change'))")


LEFT, RIGHT, LOW = (-1.5, -3.0, 0.9), (1.5, -3.0, 0.9), (1.5, -4.5, -0.6)


@seen_in_a_page
def test_a_quick_stroke_has_no_gaps(tab):
    """The pointer comes to the end at once, as a quick hand's does: 3 m, with a brush of half a metre."""
    form(tab, "paint-do", "keep")
    form(tab, "paint-radius", "0.5")
    tab.run("document.getElementById('paint-brush').click()")
    stroke(tab, LEFT, RIGHT, steps=1)
    tab.run("document.getElementById('paint-brush').click()")
    points = np.array(tab.run("dsfab.state.changes['pattern.region'][0].at.points"))
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert apart.sum() > 2.5
    assert apart.max() <= 0.25 + 1e-6


@seen_in_a_page
@pytest.mark.slow
def test_an_opening_is_painted(tab, server):
    area = tab.run("dsfab.model.facts.area")
    eye = tab.run("dsfab.viewer.eye.numbers")
    form(tab, "paint-do", "void")
    form(tab, "paint-radius", "0.5")
    tab.run("document.getElementById('paint-brush').click()")
    stroke(tab, LEFT, RIGHT)
    assert tab.run("dsfab.viewer.eye.numbers") == eye  # the picture does not turn
    assert tab.run("document.getElementById('picture').classList.contains('outdated')")  # no picture of before
    stroke(tab, RIGHT, LOW)  # more of the same region
    tab.run("document.getElementById('paint-brush').click()")
    listed = tab.run("dsfab.state.changes['pattern.region']")
    assert [(one["do"], one["at"]["pick"], one["at"]["radius"]) for one in listed] == [("void", "brush", 0.5)]
    points = np.array(listed[0]["at"]["points"])
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert len(points) > 12
    assert np.median(apart) < 0.5
    solved(tab)
    assert tab.run("document.getElementById('notice').textContent") == ""
    assert tab.run("dsfab.model.facts.area") < area - 3
    preset = server.session.current_preset.preset_with(tab.run("dsfab.state.changes"))
    saved = tomllib.loads(server.session.current_preset.toml(tab.run("dsfab.state.changes")))
    assert len(saved["pattern"]["region"][0]["at"]["points"]) == len(preset.pattern.region[0].at.points) == len(points)
    tab.run("document.getElementById('undo').click()")
    assert len(tab.run("dsfab.state.changes['pattern.region'][0].at.points")) < len(points)
    tab.run("document.querySelector('[aria-label=\"Remove region 1\"]').click()")
    solved(tab)
    assert tab.run("dsfab.model.facts.area") == pytest.approx(area)


@seen_in_a_page
@pytest.mark.slow
def test_a_painted_ball_is_solid_in_the_picture(tab):
    before = tab.run(SEEN)
    form(tab, "paint-do", "keep")
    tab.run("document.getElementById('paint-region').click()")
    stroke(tab, (0.0, -3.0, 0.9), (1.4, -3.0, 0.9))
    region = tab.run("dsfab.state.changes['pattern.region'][0]")
    assert (region["do"], region["at"]["pick"]) == ("keep", "ball")
    solved(tab)
    assert tab.run("document.getElementById('notice').textContent") == ""
    assert tab.run(SEEN) > 1.02 * before
    assert tab.run("document.querySelector('[data-handle=\"pattern.region.0.at.radius\"]') !== null")
    more = tab.run(SEEN)
    tab.run("dsfab.state.set({'pattern.region.0.do': 'rim'})")
    solved(tab)
    assert before < tab.run(SEEN) < more


@seen_in_a_page
@pytest.mark.slow
def test_picked_vertices_become_nearest_points_where_regions_cut_the_mesh(tab):
    tab.run("dsfab.state.set({'pattern.region': [{at: {pick: 'ball', center: [0, 0, 4], radius: 1}, do: 'keep'}]})")
    solved(tab)
    picked = tab.run("dsfab.picking.lasting({pick: 'vertices', indices: [1, 2]}, [1, 2])")
    assert picked["pick"] == "nearest"
    assert len(picked["points"]) == 2
    tab.run("document.getElementById('undo').click()")
    solved(tab)
    assert tab.run("dsfab.picking.lasting({pick: 'boundary', loop: 0}, [1])") == {"pick": "boundary", "loop": 0}


@seen_in_a_page
@pytest.mark.slow
def test_pointing_at_a_load_ends_painting(tab):
    tab.run("document.getElementById('loads').open = true; document.getElementById('paint-brush').click()")
    tab.run("document.querySelector('[data-way=spot]').click()")
    assert tab.run("document.getElementById('paint-brush').ariaPressed") == "false"
    assert tab.run("document.querySelector('[data-way=spot]').ariaPressed") == "true"
    tab.run("document.activeElement.blur()")
    tab.key("Escape")
    until(tab, "!document.getElementById('picture').classList.contains('picking')")
    assert tab.errors == []
