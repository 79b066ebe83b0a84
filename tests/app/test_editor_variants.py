"""The editor's tray: variants are kept with their picture and figures, named, compared, and gone back to."""

import pytest

from dsfab.app.editor import workspace
from dsfab.app.editor.page import HANDLERS
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import KeptVariant, OpenedPreset, VariantTray, differences, open_preset
from dsfab.core.errors import DsfabError, PresetError
from dsfab.preset.file import load_preset, with_overrides
from tests.app.editor_page import READY, SEEN, page_of, solved, until
from tests.app.editor_server import COARSE, COARSELY, serving
from tests.browser import browser
from tests.presets import DOME_MODES

seen_in_a_page = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")
WIDE = {"pattern.width.solid_fraction": 0.6}


@pytest.fixture
def opened():
    return open_preset(DOME_MODES, COARSELY)


def test_variants_are_kept_in_order_and_named(opened):
    kept = VariantTray()
    kept.keep(KeptVariant("", opened, {}, "data:image/jpeg;base64,AA==", {"share": 0.4, "mass": 3.0, "other": 1.0}))
    kept.keep(KeptVariant("  wide \n bands ", opened, WIDE))
    assert [(one["number"], one["name"]) for one in kept.records()] == [(1, "Variant 1"), (2, "wide bands")]
    first = kept.records()[0]["figures"]
    assert first == {"share": 0.4, "mass": 3.0, **dict.fromkeys(("area", "pieces", "narrowest", "compliance"))}
    kept.rename(1, "thin")
    kept.rename(2, " ")
    assert [one["name"] for one in kept.records()] == ["thin", "wide bands"]
    assert kept[2].preset.pattern.width.solid_fraction == 0.6
    kept.drop(1)
    kept.keep(KeptVariant("", opened, {}))
    assert [one["name"] for one in kept.records()] == ["wide bands", "Variant 3"]  # numbers are not given twice
    for act in (kept.drop, lambda number: kept.rename(number, "x"), kept.__getitem__):
        with pytest.raises(DsfabError, match="does not exist any more"):
            act(1)


def test_an_invalid_variant_is_refused(opened, monkeypatch):
    kept = VariantTray()
    with pytest.raises(PresetError, match="threshold"):
        kept.keep(KeptVariant("", opened, {"pattern.major.threshold": 7}))
    for picture in ("http://elsewhere/", "javascript:1", "data:image/png;base64," + "A" * workspace.LARGEST):
        with pytest.raises(DsfabError, match="keep the variant again"):
            kept.keep(KeptVariant("", opened, {}, picture))
    monkeypatch.setattr(workspace, "MAX_VARIANTS", 1)
    kept.keep(KeptVariant("", opened, {}))
    with pytest.raises(DsfabError, match="already holds 1 variants"):
        kept.keep(KeptVariant("", opened, {}))


def test_variants_list_the_keys_in_which_they_differ():
    one = load_preset(DOME_MODES, COARSE)
    other = with_overrides(
        one, {**WIDE, "name": "other", "statics.thickness": 0.1, "surface.load": [{"kind": "self_weight"}]}
    )
    told = {key: (a, b) for key, a, b in differences(one, other)}
    assert set(told) == {"pattern.width.solid_fraction", "statics.thickness", "surface.load"}
    assert told["statics.thickness"] == (one.statics.thickness, 0.1)
    assert [len(loads) for loads in told["surface.load"]] == [2, 1]
    assert differences(one, one) == []


def test_a_variant_of_another_surface_is_gone_back_to(opened):
    with Session(opened) as session:
        given = {"name": "first", "picture": "", "figures": {}, "changes": WIDE}
        assert [one["name"] for one in HANDLERS["keep"](session, given)["variants"]] == ["first"]
        here = HANDLERS["open"](session, {"variant": 1})
        assert (here["opening"], here["changes"]) == (1, WIDE)  # the same one: nothing is opened anew
        session.open_preset("dome")
        there = HANDLERS["open"](session, {"variant": 1})
        assert (there["opening"], there["changes"]) == (3, WIDE)
        assert session.current_preset is opened
        told = HANDLERS["compare"](session, {"variants": [1], "changes": {}})["differences"]
        assert [key for key, *_ in told] == ["pattern.width.solid_fraction"]
        with pytest.raises(DsfabError, match="one or two"):
            HANDLERS["compare"](session, {"variants": [1, 1, 1], "changes": {}})
        assert HANDLERS["drop"](session, {"variant": 1}) == {"variants": []}


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, COARSE), ("dome",))) as made:
        yield made


@seen_in_a_page
@pytest.mark.slow
def test_keep_name_compare_and_go_back(server, tmp_path):
    cards = "document.querySelectorAll('#variants li').length"
    with page_of(server, tmp_path) as tab:
        tab.open(server.address, READY)
        solved(tab)
        assert tab.run("document.getElementById('tray').hidden")
        tab.run("document.getElementById('keep').click()")
        until(tab, f"{cards} === 1")
        few = tab.run(SEEN)
        tab.run("dsfab.state.set({'pattern.width.solid_fraction': 0.7}); document.getElementById('keep').click()")
        until(tab, f"{cards} === 2")  # once it is measured
        solved(tab)
        assert tab.run(SEEN) > 1.2 * few
        assert tab.run("[...document.querySelectorAll('#variants p')].map(e => e.textContent.split(' %')[0])") == [
            "40",
            "70",
        ]
        name = "document.querySelector('#variants li:last-child input[type=text]')"
        tab.run(f"{name}.value = 'wide'; {name}.dispatchEvent(new Event('change'))")
        until(tab, "dsfab.tray.variants[1].name === 'wide'")
        tab.run("document.querySelectorAll('[data-variant]').forEach(e => e.click())")
        tab.run("document.getElementById('compare').click()")
        until(tab, "document.getElementById('comparing').open")
        told = tab.run("document.querySelector('#side-by-side table').innerText")
        assert "Variant 1\twide" in told
        assert "40.0 %\t70.0 %" in told
        assert "pattern.width.solid_fraction\t0.4\t0.7" in told
        wide = tab.run("[...document.querySelectorAll('#side-by-side img')].map(e => e.naturalWidth)")
        assert min(wide) > 400
        tab.run("document.querySelector('#comparing button').click()")
        tab.run("document.querySelector('#variants .thumb').click()")
        until(tab, "Object.keys(dsfab.state.changes).length === 0")
        solved(tab)
        assert tab.run(SEEN) == pytest.approx(few, rel=0.01)
        tab.run("document.getElementById('undo').click()")
        assert tab.run("dsfab.state.changes") == {"pattern.width.solid_fraction": 0.7}
        tab.call("Page.reload")
        until(tab, READY)
        assert tab.run(cards) == 2
        tab.run("document.querySelector('#variants .remove').click()")
        until(tab, f"{cards} === 1")
        tab.run("document.querySelector('[data-variant]').click()")
        assert tab.run("document.getElementById('compare').textContent") == "Compare with now"
        assert tab.errors == []
