"""The editor as an architect meets it: from a mesh of their own to the files of a build, in at most twelve actions.

A roof that no preset knows is opened, made of timber, loaded with snow, and built. Every click, choice, file and word
that is typed counts, and so does scrolling. After each of them there is a screenshot in the test's folder, to look at.
"""

import json
from contextlib import contextmanager
from pathlib import Path

import pytest
import trimesh

from dsfab.app.editor.workspace import OpenedPreset, Outputs
from dsfab.export import write
from dsfab.preset.file import load_preset
from tests.app.editor_page import READY, SEEN, page_of, solved, until
from tests.app.editor_server import COARSE, serving
from tests.browser import browser
from tests.canopy import canopy
from tests.presets import DOME_MODES

pytestmark = [pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed"), pytest.mark.slow]

MOST = 12
SIZE = (1280, 800)


class Hand:
    """A person at the page: what they do is done by the mouse and the keyboard, counted and pictured."""

    def __init__(self, tab, folder: Path):
        self.tab, self.folder, self.done = tab, folder, []

    @contextmanager
    def action(self, what):
        yield
        self.tab.run("new Promise(done => setTimeout(done, 150))")
        self.done.append(what)
        self.tab.picture(self.folder / f"{len(self.done):02d}-{what.replace(' ', '-')}.png")

    def click(self, selector, what):
        """Where it is seen; what is not is scrolled to first, which is an action of its own."""
        at = f"document.querySelector({json.dumps(selector)})"
        box = f"const r = {at}.getBoundingClientRect(), [x, y] = [r.left + r.width / 2, r.top + r.height / 2];"
        hidden = f"(() => {{ {box} return !{at}.contains(document.elementFromPoint(x, y)); }})()"
        if self.tab.run(hidden):
            with self.action(f"scroll to {what}"):
                self.tab.run(f"{at}.scrollIntoView({{ block: 'center' }})")
        assert not self.tab.run(hidden), f"{what} cannot be clicked"
        with self.action(what):
            self.tab.click(*self.tab.run(f"(() => {{ {box} return [x, y]; }})()"))

    def choose(self, selector, value, what):
        """An entry of a list, which a browser without a screen does not open."""
        at = f"document.querySelector({json.dumps(selector)})"
        with self.action(what):
            self.tab.run(
                f"{at}.value = {json.dumps(value)}; {at}.dispatchEvent(new Event('change', {{ bubbles: true }}))"
            )
            assert self.tab.run(f"{at}.value") == value

    def file(self, path, what):
        """In the dialog that Open has opened."""
        with self.action(what):
            node = self.tab.call("Runtime.evaluate", expression="document.getElementById('file')")["result"]["objectId"]
            self.tab.call("DOM.setFileInputFiles", files=[str(path)], objectId=node)


def test_a_canopy_is_built_in_twelve_actions(tmp_path, no_pictures, coarse_proposals):
    mesh, outputs = write(canopy(0.5), tmp_path / "canopy.obj"), Outputs(tmp_path / "outputs", "outputs")
    with (
        serving(OpenedPreset(load_preset(DOME_MODES, COARSE)), outputs) as server,
        page_of(server, tmp_path / "browser", size=SIZE) as tab,
    ):
        tab.open(server.address, READY)
        hand = Hand(tab, tmp_path)
        hand.click("#open", "open")
        hand.file(mesh, "choose the mesh")
        until(tab, "document.getElementById('ask').open")
        hand.choose("#ask-unit", "mm", "its unit")
        hand.click("#ask button.main", "yes")
        until(tab, "dsfab.start.title === 'canopy' && " + READY)
        solved(tab)
        hand.click("[data-name='sheet and material'] summary", "show the material")
        hand.choose("#statics-material", "GL24h", "timber")
        hand.click("#loads summary", "show the loads")
        assert tab.run("document.getElementById('weather-snow').checked")  # a roof carries snow from the start
        solved(tab)
        assert tab.run(SEEN) > 20_000
        # a STEP file takes most of the time: app/test_editor_page.py has one built
        tab.run("document.querySelector('#formats [value=step]').click()")
        hand.click("#build", "build")
        until(tab, "document.querySelectorAll('#built a').length > 0")
        tab.picture(tmp_path / "built.png")
        assert len(hand.done) <= MOST, hand.done
        assert tab.run("document.getElementById('notice').hidden"), tab.run(
            "document.getElementById('notice').textContent"
        )
        assert tab.errors == []
    folder = outputs.home / "canopy"
    solid = trimesh.load(folder / "canopy.stl")
    assert solid.is_volume
    assert solid.extents[:2] == pytest.approx([16_000, 12_000], rel=0.03)  # millimetres
    assert json.loads((folder / "design.json").read_text())
    built = load_preset(folder / "preset.toml")
    assert built.statics.material == "GL24h"
    assert {"snow", "self_weight"} <= {load.kind for load in built.surface.load}
