"""The editor as a person uses it: a real browser, real mouse events, and the pixels that come of it."""

import json
import time
import urllib.request
from itertools import pairwise

import numpy as np
import pytest

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.design import draft
from dsfab.preset.file import load_preset
from tests.app.editor_page import (
    READY,
    SEEN,
    SIZE,
    page_of,
    place_of,
    seen_by_both,
    share_measured,
    solved,
    type_into,
    until,
)
from tests.app.editor_server import serving
from tests.browser import browser
from tests.presets import DOME_MODES

EDGE = 1.0
"""Metres, of the triangles' edges."""


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, {"surface.edge": EDGE}), ("dome",))) as made:
        yield made


@pytest.fixture(scope="module")
def tab(sharp_tab):
    return sharp_tab


pytestmark = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")

CUT = "dsfab.viewer.sheet.geometry !== dsfab.viewer.sheet.live"


@pytest.fixture(autouse=True)
def fresh(request):
    """Every test begins with the preset as it is."""
    if "tab" in request.fixturenames:
        tab = request.getfixturevalue("tab")
        tab.run(
            "dsfab.opened(dsfab.start); dsfab.views.view({layers: ['loads'], colour: 'plain'}); dsfab.views.look('iso')"
        )
        solved(tab)


def choose(tab, kind):
    """What acts where something was picked."""
    at = "document.getElementById('add-kind')"
    tab.run(f"{at}.value = '{kind}'; {at}.dispatchEvent(new Event('change'))")


@pytest.mark.slow
def test_a_slider_changes_the_picture_in_one_frame(tab):
    before = tab.run(SEEN)
    type_into(tab, "pattern-width-solid_fraction", "0.7")
    more = tab.run(SEEN)  # before the server could answer
    assert more > 1.2 * before
    estimate = float(tab.run("document.getElementById('f-share').textContent").split()[1])
    assert estimate == pytest.approx(70, abs=1)
    solved(tab)
    assert share_measured(tab) == pytest.approx(70, abs=0.2)
    assert tab.run(SEEN) == pytest.approx(more, rel=0.01)  # what the server made of it looks the same


def test_measured_values_appear_even_if_they_arrive_before_the_picture(tab):
    tab.run(
        "window.plainFetch = window.fetch; window.fetch = async (path, ...more) => {"
        "if (path.startsWith('/api/model')) while (dsfab.told?.draft !== window.wanted) "
        "await new Promise(done => setTimeout(done, 20)); return plainFetch(path, ...more); };"
        "window.wanted = dsfab.model.facts.draft + 1"
    )
    type_into(tab, "pattern-width-solid_fraction", "0.6")
    until(tab, "dsfab.told?.draft === wanted && dsfab.done === dsfab.work.latest.solve")
    assert share_measured(tab) == pytest.approx(60, abs=0.2)
    tab.run("window.fetch = window.plainFetch")


def test_arrow_keys_move_a_slider(tab):
    before = tab.run(SEEN)
    tab.run("document.getElementById('pattern-major-frequency-slider').focus()")
    for _ in range(8):
        tab.call(
            "Input.dispatchKeyEvent", type="keyDown", key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39
        )
        tab.call("Input.dispatchKeyEvent", type="keyUp", key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39)
    assert tab.run("dsfab.state.get('pattern.major.frequency')") == pytest.approx(7.8)
    assert tab.run(SEEN) != before


@pytest.mark.slow
def test_undo_and_redo(tab):
    before = tab.run(SEEN)
    type_into(tab, "pattern-major-frequency", "15")
    after = tab.run(SEEN)
    assert after != before
    tab.run("document.activeElement.blur()")
    tab.call("Input.dispatchKeyEvent", type="keyDown", key="z", modifiers=2)
    assert tab.run("dsfab.state.changes") == {}
    solved(tab)
    assert tab.run(SEEN) == before
    tab.run("document.getElementById('redo').click()")
    assert tab.run("dsfab.state.changes") == {"pattern.major.frequency": 15}


def test_a_changed_load_marks_the_picture_as_outdated_until_the_solution(tab):
    version = tab.run("dsfab.model.facts.version")
    tab.run("dsfab.state.set({'diffusion.r': 5})")
    assert tab.run("document.querySelector('#picture').classList.contains('outdated')")
    solved(tab)
    assert tab.run("dsfab.model.facts.version") > version


@pytest.mark.slow
def test_the_mouse_turns_the_picture_and_nothing_is_drawn_at_rest(tab):
    before = tab.run("dsfab.viewer.eye.numbers")
    x, y = place_of(tab, 0, 0, 0)
    tab.drag(x, y, y + 60)
    after = tab.run("dsfab.viewer.eye.numbers")
    assert after[2] > before[2]  # seen from higher up
    assert after[3:6] == before[3:6]
    # what the server still sends, a sheet as it is cut, is drawn when it comes: rest is a while without a frame
    until(tab, "new Promise(done => { const frames = dsfab.viewer.frames; "
               "setTimeout(() => done(dsfab.viewer.frames === frames), 700); })")  # fmt: skip


@pytest.mark.slow
def test_parallel_keeps_the_size(tab):
    before = tab.run(SEEN)
    tab.run("document.getElementById('parallel').click()")
    assert tab.run("dsfab.viewer.eye.camera.isOrthographicCamera")
    assert tab.run(SEEN) == pytest.approx(before, rel=0.1)
    tab.run("document.getElementById('parallel').click()")
    assert tab.run(SEEN) == pytest.approx(before, rel=0.002)


@pytest.mark.slow
def test_a_section_hides_half_of_the_sheet(tab):
    tab.run("dsfab.views.look('top'); dsfab.views.view({layers: ['sheet']})")
    before = tab.run(SEEN)
    tab.run("dsfab.views.view({section: ['x', 0]})")
    assert tab.run(SEEN) == pytest.approx(before / 2, rel=0.05)


def test_a_picked_support_starts_a_new_solution(tab):
    tab.run("document.getElementById('loads').open = true; document.querySelector('[data-way=spot]').click()")
    tab.run("dsfab.views.view({layers: ['sheet']})")
    highest = "Math.max(...dsfab.model.arrays.supports.filter((_, i) => i % 3 === 2))"
    low = tab.run(highest)
    x, y = place_of(tab, 0.1, -2.0, 1.3)
    tab.click(x, y)
    assert "1 vertices" in tab.run("document.getElementById('load-list').innerText")
    choose(tab, "support")
    tab.run("document.getElementById('add').click()")
    listed = tab.run("dsfab.state.changes['surface.support']")
    assert [support["at"]["pick"] for support in listed] == ["boundary", "nearest"]
    x, y, z = listed[1]["at"]["points"][0]
    assert z > 1  # on the dome, in metres of the preset
    solved(tab)
    assert tab.run(highest) > low + 1


@pytest.mark.slow
def test_a_lasso_becomes_a_force(tab):
    tab.run("document.getElementById('loads').open = true; document.querySelector('[data-way=lasso]').click()")
    x, y = place_of(tab, 0, 0, 2)
    corners = [(x - 40, y - 30), (x + 40, y - 30), (x + 40, y + 30), (x - 40, y + 30), (x - 40, y - 30)]
    eye = tab.run("dsfab.viewer.eye.numbers")
    tab.mouse("mousePressed", *corners[0])
    for (x0, y0), (x1, y1) in pairwise(corners):
        for t in (0.25, 0.5, 0.75, 1):
            tab.mouse("mouseMoved", x0 + t * (x1 - x0), y0 + t * (y1 - y0))
    tab.mouse("mouseReleased", *corners[-1])
    assert tab.run("dsfab.viewer.eye.numbers") == eye  # it does not turn meanwhile
    choose(tab, "force")
    tab.run("document.getElementById('add').click()")
    load = tab.run("dsfab.state.changes['surface.load'].at(-1)")
    assert load["force"] == [0, 0, -10000]
    assert len(load["at"]["indices"]) > 3
    solved(tab)


@pytest.mark.slow
def test_springs_and_lines_in_a_case_of_their_own(tab):
    tab.run("document.getElementById('loads').open = true; document.querySelector('[data-way=edge]').click()")
    tab.run("dsfab.views.view({layers: ['sheet']})")
    x, y = place_of(tab, *tab.run("[...dsfab.model.arrays.V.subarray(3 * dsfab.model.arrays.loops[0]).slice(0, 3)]"))
    cx, cy = place_of(tab, 0, 0, 0)
    tab.click(x + 0.04 * (cx - x), y + 0.04 * (cy - y))
    choose(tab, "line")
    tab.run("document.getElementById('add-case').value = 'parapet'; document.getElementById('add').click()")
    load = tab.run("dsfab.state.changes['surface.load'].at(-1)")
    picked = {"pick": "boundary", "loop": 0}
    assert load == {"at": picked, "kind": "line", "per_metre": [0, 0, -1000], "case": "parapet"}
    tab.run("dsfab.loads.picked = {picker: {pick: 'boundary', loop: 0}, places: [0, 0, 0], list: [0]};"
            "dsfab.loads.refresh()")  # fmt: skip
    choose(tab, "spring")
    tab.run("document.getElementById('add-way').value = 'vertically'; document.getElementById('add').click()")
    assert tab.run("dsfab.state.changes['surface.support'].at(-1)") == {"at": picked, "spring": [0, 0, 1e6]}
    assert "parapet" in tab.run("document.getElementById('load-list').innerText")
    side = "{at: {pick: 'side', axis: 'x', end: 'min', depth: 1}, hold: 'xy'}"
    tab.run(f"dsfab.state.set({{'surface.support': [dsfab.state.preset.surface.support.at(-1), {side}]}})")
    solved(tab)
    assert tab.run("document.getElementById('notice').hidden"), tab.run("document.getElementById('notice').textContent")
    sunk = tab.run("dsfab.model.facts.limits.displacement")
    type_into(tab, "support-0", "2000000")
    solved(tab)
    assert tab.run("dsfab.model.facts.limits.displacement") < 0.7 * sunk  # it stands on springs


@pytest.mark.slow
def test_the_reason_of_a_refused_build_is_visible_without_a_click(tab):
    """It stood among the notes, which are closed."""
    seen = "(box => !box.hidden && box.checkVisibility() && box.textContent)(document.getElementById('refused'))"
    assert tab.run(seen) is False
    before = tab.run("(({thickness, young}) => [thickness, young])(dsfab.state.preset.statics)")
    tab.run("dsfab.state.set({'statics.thickness': 1e-3, 'statics.young': 1e8})")
    solved(tab)
    assert tab.run(seen).startswith("Build refuses this: the sheet would move by ")
    tab.run("dsfab.state.set({{'statics.thickness': {}, 'statics.young': {}}})".format(*before))
    solved(tab)
    assert tab.run(seen) is False


@pytest.mark.slow
def test_fingers_turn_move_and_zoom(tab):
    """One finger turns, two move and zoom, as on a telephone."""

    def touch(kind, *places):
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(places)]
        tab.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def distance(eye):
        return np.linalg.norm(np.array(eye[:3]) - eye[3:6])

    tab.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    try:
        eye = "dsfab.viewer.eye.numbers"
        x, y = place_of(tab, 0, 0, 0)
        start = tab.run(eye)
        touch("touchStart", (x, y))
        for step in range(1, 7):
            touch("touchMove", (x + 10 * step, y))
        touch("touchEnd")
        turned = tab.run(eye)
        assert turned[3:6] == start[3:6]  # about the same place
        assert distance(turned) == pytest.approx(distance(start), rel=1e-3)
        assert abs(np.arctan2(turned[1], turned[0]) - np.arctan2(start[1], start[0])) > 0.2
        touch("touchStart", (x - 30, y), (x + 30, y))
        for step in range(1, 7):
            touch("touchMove", (x - 30 - 5 * step, y), (x + 30 + 5 * step, y))
        touch("touchEnd")
        near = tab.run(eye)
        assert distance(near) < 0.8 * distance(turned)
        touch("touchStart", (x - 30, y), (x + 30, y))
        for step in range(1, 7):
            touch("touchMove", (x - 30, y + 8 * step), (x + 30, y + 8 * step))
        touch("touchEnd")
        moved = tab.run(eye)
        assert distance(moved) == pytest.approx(distance(near), rel=0.02)
        assert np.linalg.norm(np.array(moved[3:6]) - near[3:6]) > 0.3
    finally:
        tab.call("Emulation.setTouchEmulationEnabled", enabled=False)


@pytest.mark.slow
def test_a_reload_restores_everything(tab, server):
    type_into(tab, "pattern-major-frequency", "11")
    tab.run("dsfab.views.look('front'); dsfab.views.view({colour: 'stress'})")
    solved(tab)
    tab.run("new Promise(done => setTimeout(done, 300))")
    before, eye = tab.run(SEEN), tab.run("dsfab.viewer.eye.numbers")
    tab.run("window.before = true")
    tab.call("Page.reload")
    until(tab, "!window.before && " + READY)  # not the page that goes
    solved(tab)
    assert tab.run("dsfab.state.changes") == {"pattern.major.frequency": 11}
    assert tab.run("document.getElementById('colour').value") == "stress"
    assert tab.run("dsfab.viewer.eye.numbers") == pytest.approx(eye)
    assert tab.run(SEEN) == pytest.approx(before, rel=1e-3)


@pytest.mark.slow
def test_build_and_download_a_solid(tab, tmp_path, no_pictures):
    import trimesh

    few = "'pattern.major.frequency': 4, 'pattern.minor.frequency': 4, 'export.step': 'tessellated'"
    tab.run(f"dsfab.state.set({{{few}}})")  # faces take the time
    solved(tab)
    tab.run("document.getElementById('build').click()")
    until(tab, "document.querySelectorAll('#built a').length > 0")
    names = tab.run("[...document.querySelectorAll('#built a')].map(a => a.download)")
    assert names[:3] == [f"dome_modes.{suffix}" for suffix in ("stl", "3mf", "step")]
    link = tab.run("document.querySelector('#built a').href")
    path = tmp_path / tab.run("document.querySelector('#built a').download")
    path.write_bytes(urllib.request.urlopen(link).read())
    assert path.suffix == ".stl"
    assert trimesh.load(path).is_volume


def test_a_build_can_be_cancelled(tab, monkeypatch):
    def endless(request, folder, progress):
        while True:
            progress("thickening", "for ever")
            time.sleep(0.01)

    monkeypatch.setattr("dsfab.app.editor.building.build_in_process", endless)
    tab.run("document.getElementById('build').click()")
    until(tab, "document.getElementById('status').textContent === 'thickening: for ever'")  # figures may come first
    assert not tab.run("document.getElementById('cancel').hidden")
    tab.run("document.getElementById('cancel').click()")
    until(tab, "document.getElementById('built').textContent.startsWith('Cancelled')")
    assert tab.run("document.getElementById('progress').hidden")


def test_an_invalid_value_shows_a_notice_and_undo_restores_the_former_value(tab):
    type_into(tab, "diffusion-r", "0.5")
    said = until(tab, "document.getElementById('notice').textContent")
    assert "diffusion.r" in said
    tab.run("document.getElementById('undo').click()")
    solved(tab)
    assert tab.run("document.getElementById('notice').hidden")


@pytest.mark.slow
def test_a_load_twice_as_large_moves_the_sheet_twice_as_far(tab):
    tab.run("dsfab.state.set({'surface.load': [dsfab.state.get('surface.load')[1]]})")
    solved(tab)
    before = tab.run("dsfab.model.facts.limits.displacement")
    type_into(tab, "load-0", "100000")
    solved(tab)
    assert tab.run("dsfab.model.facts.limits.displacement") == pytest.approx(2 * before, rel=1e-6)


def test_the_page_shows_the_command_of_the_design(tab):
    type_into(tab, "pattern-minor-frequency", "12")
    tab.run("document.getElementById('copy').click()")
    told = until(tab, "document.querySelector('#command code')?.textContent")
    assert told == "dsfab build dome --set pattern.minor.frequency=12"


@pytest.mark.slow
def test_the_browser_widens_stripes_as_the_server_does(tab):
    """Both copies of the rule for widths, at every vertex, for every rule."""
    for changes in (
        {"pattern.width.rule": "graded", "pattern.width.q": 0.5},
        {"pattern.width.rule": "constant", "pattern.width.solid_fraction": 0, "pattern.width.member": 0.2},
        {"pattern.width.rule": "plain", "pattern.width.min_gap": 0.2, "pattern.width.max_width": 0.25},
    ):
        tab.run(f"dsfab.state.set({json.dumps(changes)})")
        solved(tab)
        exact = np.array(tab.run("[...dsfab.model.arrays.half]"))
        script = """(async () => {
            const { drawn } = await import('/static/pattern.js');
            const model = { facts: { ...dsfab.model.facts, pattern: null }, arrays: dsfab.model.arrays };
            return [...drawn(dsfab.state.preset.pattern, model, dsfab.sampler).half]; })()"""
        live = np.array(tab.run(script))
        assert np.abs(live - exact).max() < 0.02, changes
        assert np.abs(live - exact).mean() < 0.004, changes


@pytest.mark.slow
def test_every_control_has_a_name_and_every_text_is_readable(tab):
    nameless = tab.run("""[...document.querySelectorAll('input, select, button, progress, a, canvas, img')].filter(e =>
        !e.closest('[hidden]') && !(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim() || e.alt
        || e.getAttribute('aria-hidden'))).map(e => e.outerHTML)""")
    assert nameless == []
    twice = tab.run("(() => { const ids = [...document.querySelectorAll('[id]')].map(e => e.id);"
                    "return ids.filter((id, i) => ids.indexOf(id) !== i); })()")  # fmt: skip
    assert twice == []
    assert tab.run(CLIPPED) == []
    for theme in ("light", "dark"):
        tab.run(f"document.documentElement.dataset.theme = '{theme}'")
        faint = tab.run(CONTRAST)
        assert faint == [], theme
    assert tab.run("document.documentElement.lang") == "en"


CLIPPED = """(() => {
    const shut = [...document.querySelectorAll('details:not([open])')];
    shut.forEach((e) => { e.open = true; });
    const labels = [...document.querySelectorAll('label')];
    const cut = labels.filter((e) => e.clientWidth > 1 && e.scrollWidth > e.clientWidth).map((e) => e.textContent);
    shut.forEach((e) => { e.open = false; });
    return cut; })()"""
"""Labels of all groups that are wider than their place; the ones for screen readers alone have none."""


CONTRAST = """(() => {
    const part = (c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
    const bright = ([r, g, b]) => 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
    const behind = (e) => { for (; e; e = e.parentElement) { const c = numbers(getComputedStyle(e).backgroundColor);
        if (c.length === 3 || c[3] === 1) return c; } return [255, 255, 255]; };
    const faint = [];
    for (const e of document.querySelectorAll('label, summary, button, dt, dd, option, p, figcaption, .unit')) {
        const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!own || !e.offsetParent || e.disabled || e.closest('.idle')) continue;
        const [a, b] = [bright(numbers(getComputedStyle(e).color)), bright(behind(e))];
        const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        if (ratio < 4.5) faint.push([e.textContent, ratio]);
    }
    return faint; })()"""
"""Texts under 4.5 to 1 against what is behind them (WCAG 2.2, 1.4.3); controls without effect may be fainter."""


@pytest.mark.slow
def test_the_page_fits_a_telephone(tab):
    tab.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=2, mobile=True)
    try:
        assert tab.run("document.documentElement.scrollWidth <= 390")
        assert tab.run("document.getElementById('canvas').clientHeight") > 300
        assert tab.run("document.getElementById('panel').clientHeight") > 300
        small = tab.run(
            "[...document.querySelectorAll('.row')].filter(e => e.offsetParent && e.clientHeight < 36).length"
        )
        assert small == 0
    finally:
        tab.call("Emulation.setDeviceMetricsOverride", width=SIZE[0], height=SIZE[1], deviceScaleFactor=1, mobile=False)


def test_the_browser_and_the_previewer_draw_the_same_mask(tab):
    """The mask of WebGL against that of VTK, from the same eye: under 0.2 % of its pixels differ."""
    changes = {"pattern.width.rule": "plain", "pattern.width.solid_fraction": 0.0, "pattern.keep": 0.2}
    tab.run(f"dsfab.state.set({json.dumps(changes)})")
    solved(tab)
    ours, theirs = seen_by_both(tab, draft(load_preset(DOME_MODES, {"surface.edge": EDGE, **changes})))
    assert (ours != theirs).sum() < 0.002 * theirs.sum()


VARIANTS = """(() => {
    const { sheet, renderer } = dsfab.viewer;
    const names = ['VARY', 'KEEP', 'SECTION', 'VALUE', 'FAMILY', 'MOVE', 'CREASE', 'SOFT', 'WHOLE', 'MASK'];
    const [before, none, all] = [{ ...sheet.flags }, {}, {}];
    for (const name of names) [none[name], all[name]] = [false, true];
    const wrong = [];
    for (const base of [none, { ...all, WHOLE: false }, all])
        for (const name of ['', ...names]) {
            sheet.want(name ? { ...base, [name]: !base[name] } : base);
            dsfab.viewer.draw();
            for (const { diagnostics } of renderer.info.programs) if (diagnostics) wrong.push([name, diagnostics]);
        }
    sheet.want({ ...none, ...before });
    return [wrong, sheet.materials.size]; })()"""


@pytest.mark.slow
def test_every_variant_of_the_shader_compiles(tab):
    wrong, count = tab.run(VARIANTS)
    assert wrong == []
    assert count > 25


@pytest.mark.slow
def test_light_on_a_crease_is_that_of_its_faces(tab):
    """By vertices where all is smooth; the shader for creases gives nearly the same colours there."""
    until(tab, CUT)  # else its answer may change the sheet between the two pictures
    script = """(() => { const { viewer } = dsfab, { gl, canvas } = viewer;
        viewer.sheet.uncut(); // triangles of the cut sheet are small: few of their pixels differ
        const bytes = () => { viewer.draw(); const out = new Uint8Array(4 * canvas.width * canvas.height);
            gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, out); return out; };
        viewer.sheet.want({ CREASE: false }); const a = bytes();
        viewer.sheet.want({ CREASE: true }); const b = bytes();
        viewer.sheet.want({ CREASE: dsfab.model.facts.creased });
        let [most, other] = [0, 0];
        for (let i = 0; i < a.length; i += 1) {
            const away = Math.abs(a[i] - b[i]);
            other += away > 0;
            most += away > 12;
        }
        return [other, most]; })()"""
    other, far = tab.run(script)
    assert other > 1000  # they are two shaders
    assert far < 0.02 * other


@pytest.mark.slow
def test_stripes_cost_little_more_than_the_plain_mesh(tab):
    """The least of many frames, drawn in turns: of more where a busy machine disturbs those of one kind.

    tests/benchmarks/editor_frames.py measures larger meshes.
    """
    from tests.benchmarks.editor_frames import MEASURE

    least = {}
    for _ in range(6):
        told = tab.run(MEASURE.replace("ROUNDS", "12"))
        least = {name: min(told[name][1], least.get(name, np.inf)) for name in told if name != "triangles"}
        if all(least[f"stripes{what}"] < 1.3 * least[f"plain{what}"] for what in ("", "All")):
            return
    pytest.fail(f"milliseconds of frames: {least}")


def test_the_page_makes_no_error_and_no_foreign_request(tab, server):
    home = server.address.split("?")[0]
    assert [error for error in tab.errors if "422" not in error] == []  # refusals of a test above
    assert [url for url in tab.requests if not url.startswith((home, "data:", "blob:"))] == []


@pytest.mark.slow
def test_without_webgl_the_server_draws(server, tmp_path):
    with page_of(server, tmp_path, ("--disable-3d-apis",)) as tab:
        tab.open(server.address, "!!(window.dsfab && document.getElementById('drawn').src)")
        assert "server draws the picture" in tab.run("document.getElementById('notice').textContent")
        assert tab.run("document.getElementById('drawn').naturalWidth") > 300
        before = tab.run("document.getElementById('drawn').src")
        type_into(tab, "pattern-major-frequency", "14")
        until(tab, f"document.getElementById('drawn').src !== {json.dumps(before)}")
