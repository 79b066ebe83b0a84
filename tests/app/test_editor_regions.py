"""Places in the editor: numbers to write for every region, and handles to drag along the surface."""

import numpy as np
import pytest

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.preset.file import load_preset
from tests.app.editor_page import READY, page_of, place_of, solved, type_into, until
from tests.app.editor_server import COARSE, serving
from tests.browser import browser
from tests.presets import DOME_MODES

pytestmark = [pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed"), pytest.mark.slow]

BALL = {"pick": "ball", "center": [0.0, 3.0, 3.3], "radius": 1.6}
BOX = {"pick": "box", "min": [-4.0, -4.0, 0.5], "max": [-1.0, -1.0, 5.0]}
GIVEN = {
    **COARSE,
    "surface.support": [{"at": {"pick": "boundary"}}, {"at": BALL}],
    "surface.load": [
        {"kind": "self_weight"},
        {"kind": "force", "force": [0.0, 0.0, -1e4], "at": {"pick": "nearest", "points": [[2.0, 0.0, 3.5]]}},
        {"kind": "pressure", "pressure": 500.0, "at": BOX},
    ],
    "pattern.method": "stripes",
    "pattern.major.frequency": 0,
    "pattern.minor.frequency": 0,
    "pattern.guide": [{"curve": [[0.0, 0.0, 4.0], [3.0, 1.0, 3.0]]}],
}


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, GIVEN))) as made:
        yield made


@pytest.fixture(scope="module")
def page(server, tmp_path_factory):
    with page_of(server, tmp_path_factory.mktemp("regions")) as tab:
        tab.open(server.address, READY)
        yield tab


@pytest.fixture
def tab(page):
    """Every test begins with the preset as it is, and with all handles."""
    page.run("dsfab.opened(dsfab.start); for (const id of ['loads', 'guides']) document.getElementById(id).open = true")
    solved(page)
    return page


HANDLES = "[...document.querySelectorAll('.handle')].map(e => e.dataset.handle).join()"


def place(identifier):
    """An expression: where a handle is in the window."""
    at = f"document.querySelector('[data-handle=\"{identifier}\"]').getBoundingClientRect()"
    return f"(() => {{ const r = {at}; return [r.left + r.width / 2, r.top + r.height / 2]; }})()"


def handle(tab, identifier):
    return tab.run(place(identifier))


def drag(tab, identifier, x, y):
    """Pull a handle to a place in the window, in a few steps as a hand does."""
    a, b = handle(tab, identifier)
    tab.mouse("mousePressed", a, b)
    for step in range(1, 6):
        tab.mouse("mouseMoved", a + (x - a) * step / 5, b + (y - b) * step / 5)
    tab.mouse("mouseReleased", x, y)


def test_every_place_has_its_numbers(tab, server):
    fields = set(tab.run("[...document.querySelectorAll('.row.place input')].map(e => e.id)"))
    assert {"surface-support-1-at-center-z", "surface-support-1-at-radius", "surface-load-1-at-points-0-x"} <= fields
    assert {"surface-load-2-at-min-y", "pattern-guide-0-curve-1-x"} <= fields
    type_into(tab, "surface-support-1-at-center-x", "0,5")
    type_into(tab, "surface-support-1-at-radius", "1.8")
    type_into(tab, "pattern-guide-0-curve-1-z", "3.25")
    now = server.session.current_preset.preset_with(tab.run("dsfab.state.changes"))
    assert now.surface.support[1].at.center == (0.5, 3, 3.3)
    assert now.surface.support[1].at.radius == 1.8
    assert now.pattern.guide[0].curve[1] == (3, 1, 3.25)
    solved(tab)
    before = tab.run("dsfab.state.changes")
    for wrong in ("", "x", "-1", "0"):
        type_into(tab, "surface-support-1-at-radius", wrong)
        assert tab.run("document.getElementById('surface-support-1-at-radius').value") == "1.8"
    assert tab.run("dsfab.state.changes") == before


def test_a_handle_is_dragged_along_the_surface_and_is_one_step_of_undo(tab, server):
    target = place_of(tab, 2.0, -2.0, 1.4)
    eye = tab.run("dsfab.viewer.eye.numbers")
    drag(tab, "surface.support.1.at.center", *target)
    assert tab.run("dsfab.viewer.eye.numbers") == eye  # the picture does not turn
    at = tab.run("dsfab.state.get('surface.support.1.at')")
    assert at["radius"] == 1.6
    surface = server.session.current_preset.preset.surface.build()
    assert np.linalg.norm(surface.V - np.array(at["center"]), axis=1).min() < 0.8  # on it, within an edge of a vertex
    assert np.hypot(*np.subtract(handle(tab, "surface.support.1.at.center"), target)) < 1.5
    assert len(tab.run("dsfab.state.past")) == 1
    solved(tab)
    tab.run("document.getElementById('undo').click()")
    assert tab.run("dsfab.state.changes") == {}
    solved(tab)


def test_a_radius_is_pulled(tab):
    x, y = handle(tab, "surface.support.1.at.center")
    drag(tab, "surface.support.1.at.center", *place_of(tab, 0.0, 0.5, 2.0))
    x, y = handle(tab, "surface.support.1.at.radius")
    before = tab.run("dsfab.state.get('surface.support.1.at.radius')")
    drag(tab, "surface.support.1.at.radius", x + 60, y + 20)
    assert tab.run("dsfab.state.get('surface.support.1.at.radius')") > 1.2 * before


def test_a_box_is_moved_as_a_whole_and_a_point_by_keys(tab):
    drag(tab, "surface.load.2.at.middle", *place_of(tab, 2.0, -2.0, 1.4))
    at = tab.run("dsfab.state.get('surface.load.2.at')")
    np.testing.assert_allclose(np.subtract(at["max"], at["min"]), [3, 3, 4.5], atol=1e-4)
    assert at["min"] != BOX["min"]
    before = tab.run("dsfab.state.get('surface.load.1.at.points')")
    tab.run("document.querySelector('[data-handle=\"surface.load.1.at.points.0\"]').focus()")
    tab.key("ArrowLeft")
    tab.key("ArrowLeft")
    after = tab.run("dsfab.state.get('surface.load.1.at.points')")
    assert after != before
    assert len(tab.run("dsfab.state.past")) == 3


def test_handles_follow_the_eye_and_go_with_their_list(tab):
    _, before = handle(tab, "surface.load.1.at.points.0")
    tab.run("dsfab.views.look('top')")
    until(tab, f"{place('surface.load.1.at.points.0')}[1] !== {before}")
    tab.run("document.getElementById('loads').open = false")
    left = ["pattern.guide.0.curve.0", "pattern.guide.0.curve.1"]
    until(tab, f"{HANDLES} === '{','.join(left)}'")
    tab.run("document.querySelector('[aria-label=\"Remove guide 1\"]').click()")
    assert tab.run(HANDLES) == ""
    tab.run("dsfab.views.look('iso')")


def test_nothing_went_wrong(page):
    assert page.errors == []
