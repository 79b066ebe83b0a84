"""Members in the editor: what the server says of them, and what a person sees under the mouse."""

import json

import numpy as np
import pytest

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.core.errors import StaticsError
from dsfab.design import draft
from dsfab.preset.file import load_preset
from dsfab.render import member_places
from tests.app.editor_page import place_of, solved, until
from tests.app.editor_server import serving
from tests.browser import browser
from tests.presets import DOME_MODES

STEEL = {"surface.edge": 0.7, "statics.material": "S235"}
pytestmark = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, STEEL), ("dome",))) as made:
        yield made


@pytest.fixture(scope="module")
def made():
    return draft(load_preset(DOME_MODES, STEEL))


def test_the_page_receives_names_sizes_and_axes_of_members(made):
    told = json.loads(json.dumps(member_places(made), allow_nan=False))
    graph = made.members
    assert [one["id"] for one in told["members"]] == [member.id for member in graph.members]
    middle = (made.surface.V.min(axis=0) + made.surface.V.max(axis=0)) / 2
    for one, member in zip(told["members"], graph.members, strict=True):
        places = np.reshape(one["places"], (-1, 3)) + middle
        assert one["utilisation"] is None
        if member.axis:
            assert (one["length"], one["width"]) == (member.length, member.mean_width)
            assert np.abs(places[[0, -1]] - member.axis.P[[0, -1]]).max() < 1e-3
            assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < one["reach"] * 2
    rings = [one for one in told["members"] if one["id"].startswith("A")]
    radius = np.linalg.norm(made.surface.V - made.surface.V.mean(axis=0), axis=1).max()
    assert all(0.5 / radius < one["curvature"] < 20 / radius for one in rings)
    of = np.array([member.id for member in graph.members])[told["nearest"]]
    assert len(of) == made.surface.n
    assert set(of) <= set(graph.by_id)


@pytest.mark.slow
def test_members_have_a_utilisation_if_a_strength_is_set(made):
    told = member_places(made, judged=True)
    full = made.member_utilisation.by_member
    assert {one["id"]: one["utilisation"] for one in told["members"] if one["utilisation"] is not None} == full
    with pytest.raises(StaticsError, match="strength"):
        member_places(draft(load_preset(DOME_MODES, {"surface.edge": 1.2})), judged=True)


@pytest.mark.slow
def test_a_member_is_named_under_the_mouse_and_members_have_colours(sharp_tab):
    tab, sign = sharp_tab, "document.getElementById('member')"
    solved(tab)

    def over(x, y):
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    over(450, 280)
    until(tab, "dsfab.members.known")
    script = "dsfab.members.known.members.map(m => [m.id, m.length, m.width, m.places, m.reach])"
    told = tab.run(script)
    towards = np.array(tab.run("dsfab.model.facts.towards"))
    seen = 0
    for name, length, _, places, _ in told:
        P = np.reshape(places, (-1, 3))
        if not length or len(P) < 8:
            continue
        at = P[len(P) // 2 :][np.argmax(P[len(P) // 2 :] @ towards)]
        near = [x[0] for x in told if np.linalg.norm(np.reshape(x[3], (-1, 3)) - at, axis=1).min() < 1.3 * x[4]]
        if near != [name] or at @ towards < 0.6 * np.max([np.max(np.reshape(x[3], (-1, 3)) @ towards) for x in told]):
            continue  # it crosses another one there, or is seen from behind
        over(*place_of(tab, *at))
        words = until(tab, f"!{sign}.hidden && {sign}.textContent")
        assert words.startswith(f"{name} · ")
        assert f"{float(f'{length:.3g}'):g} m long" in words
        assert words.endswith("wide")
        seen += 1
    assert seen >= 3
    over(2, 2)
    assert until(tab, f"{sign}.hidden")
    for choice, title in (("length", "length of members"), ("curvature", "largest"), ("utilisation", "used of")):
        tab.run(f"dsfab.views.view({{colour: '{choice}'}})")
        until(tab, f"document.getElementById('legend-title').textContent.startsWith('{title}')")
    assert tab.errors == []
