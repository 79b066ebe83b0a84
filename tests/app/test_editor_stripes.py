"""The editor with evenly spaced stripes: what the page gets, shows at once, and leaves to the server."""

import json
import tomllib

import numpy as np
import pytest
from scipy.ndimage import binary_opening

from dsfab.app.editor.controls import controls
from dsfab.app.editor.drafts import (
    cut_sheet_arrays,
    draft_model,
    pack_message,
    pattern_widths,
    sheet_figures,
    tidied_cut,
)
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import OpenedPreset
from dsfab.design import draft
from dsfab.preset.file import load_preset, with_overrides
from tests.app.editor_page import READY, SEEN, seen_by_both, share_measured, solved, type_into, until
from tests.app.editor_server import COARSE, serving, unpacked, wait
from tests.browser import browser
from tests.presets import DOME_MODES

pytestmark = pytest.mark.slow

EVEN = {"pattern.method": "stripes", "pattern.major.frequency": 0, "pattern.minor.frequency": 0}
SPACED = {**EVEN, "pattern.major.spacing": 1.6, "pattern.minor.spacing": 0.8}
DOME = {"surface.edge": 0.7, **SPACED}


@pytest.fixture(scope="module")
def dome():
    return draft(load_preset(DOME_MODES, DOME))


def test_the_page_gets_the_chart_and_the_uncut_vertices(dome):
    facts, arrays = unpacked(pack_message(*draft_model(dome)))
    chart, surface = dome.pattern.even.chart, dome.surface
    assert chart.surface.n > surface.n
    np.testing.assert_array_equal(arrays["F"], chart.surface.F)
    np.testing.assert_allclose(arrays["V"] + facts["centre"], chart.surface.V, atol=1e-5)
    np.testing.assert_allclose(arrays["uncut"] + facts["centre"], surface.V, atol=1e-5)
    np.testing.assert_allclose(np.concatenate([arrays["major"], arrays["minor"]]).T, chart.z, atol=1e-5)
    for name, columns in (("kept", 2), ("along", 2), ("u", 3), ("normals", 3)):
        assert arrays[name].shape == (chart.surface.n, columns), name
    assert arrays["stress"].shape == (chart.surface.n,)
    np.testing.assert_allclose(np.linalg.norm(arrays["normals"], axis=1), 1, atol=1e-5)
    assert arrays["loops"].max() < surface.n
    assert sum(facts["loops"]) == len(arrays["loops"]) == len(surface.loops[0])
    whole = unpacked(pack_message(*draft_model(draft(load_preset(DOME_MODES, {"surface.edge": 0.7})))))[1]
    assert "uncut" not in whole
    for name in ("points", "spread", "supports", "reactions"):
        np.testing.assert_array_equal(arrays[name], whole[name])


def test_the_page_receives_the_widths_of_both_sides_of_a_line(dome):
    """Width over spacing here: d = lines per metre x width / 2 in the periods of each side, where no stripes touch."""
    facts, arrays = unpacked(pack_message(*pattern_widths(dome)))
    assert facts["method"] == "stripes"
    assert facts["mode"] == [1, 1]
    reached = arrays["slope"] * facts["factor"] * facts["member"] / 2
    free = (reached < 0.45) & (arrays["half"] < 0.5)
    assert free.mean() > 0.8
    error = np.abs(reached * arrays["shares"] - arrays["half"])[free]
    assert np.percentile(error, 95) < 0.01 * 0.5
    assert len(np.unique(np.round(arrays["shares"], 3))) > 2
    assert not arrays["half"][dome.pattern.even.chart.scale == 0].any()


def test_each_control_names_the_pattern_method_that_uses_its_key(dome):
    table = {control["key"]: control for control in controls(dome.preset, dome.surface)}
    assert table["pattern.method"]["choices"] == ("modes", "stripes", "auto")
    assert {key for key, control in table.items() if control["method"] == "stripes"} == {
        "pattern.crowding",
        "pattern.forces",
        "pattern.halve",
        "pattern.symmetry",
        "pattern.rotate",
        "pattern.weight_rounds",
    }
    assert table["pattern.families"]["choices"] == ("both", "major", "minor")
    assert not table["pattern.families"]["method"]
    assert {key.split(".")[-1] for key, control in table.items() if control["method"] == "modes"} == {
        "symmetry",
        "mode",
        "frequency",
        "phase",
    }
    apart = table["pattern.major.spacing"]
    assert apart["instead"] == pytest.approx(np.sqrt(dome.surface.area) / 12)
    assert not apart["method"]


def test_a_family_that_is_not_drawn_has_no_width_in_the_page():
    made = draft(load_preset(DOME_MODES, {**DOME, "pattern.families": "minor"}))
    arrays = unpacked(pack_message(*pattern_widths(made)))[1]
    assert not arrays["half"][:, 0].any()
    assert not arrays["shares"][:, 0].any()
    assert arrays["half"][:, 1].max() > 0.05


def test_a_saved_preset_keeps_its_guides():
    """No control shows them: a change of anything else leaves them as the preset has them."""
    guides = [
        {"curve": [[0, 0, 4], [3, 1, 3]], "reach": 1.5, "weight": 3.0},
        {"at": {"pick": "side", "axis": "x", "end": "max", "depth": 2}, "direction": [0, 0, 1], "family": "minor"},
    ]
    given = OpenedPreset(load_preset(DOME_MODES, {**DOME, "pattern.guide": guides}), ("dome",))
    saved = tomllib.loads(given.toml({"pattern.rotate": 10.0, "pattern.keep": 0.5}))["pattern"]
    assert saved["rotate"] == 10
    assert [guide["family"] for guide in saved["guide"]] == ["major", "minor"]
    assert with_overrides(given.preset, {"pattern.guide": saved["guide"]}).pattern == given.preset.pattern


@pytest.mark.slow
def test_a_change_of_widths_sends_no_mesh_again():
    preset = load_preset(DOME_MODES, {**COARSE, **SPACED, "pattern.minor.spacing": 0.8})
    with Session(OpenedPreset(preset, ("dome",))) as session:
        wait(session.jobs, session.ask_solve({}))
        wait(session.jobs, session.ask_solve({"pattern.width.solid_fraction": 0.5}))
        first = unpacked(session.model(0))[0]["version"]
        assert first == 1
        facts, arrays = unpacked(session.model(first))
        assert not facts["whole"]
        assert set(arrays) == {"half", "slope", "shares"}
        wait(session.jobs, session.ask_solve({"pattern.major.spacing": 0.9}))
        facts, arrays = unpacked(session.model(first))
        assert facts["whole"]
        assert "V" in arrays
        wait(session.jobs, session.ask_solve({"pattern.method": "modes", "pattern.major.frequency": 8.0,
                                             "pattern.major.spacing": 0.0}))  # fmt: skip
        facts, arrays = unpacked(session.model(facts["version"]))
        assert facts["whole"]
        assert facts["method"] == "modes"


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, DOME), ("dome",))) as made:
        yield made


@pytest.fixture
def page(sharp_tab):
    """Every test begins with the preset as it is."""
    sharp_tab.run(
        "if (Object.keys(dsfab.state.changes).length) dsfab.opened(dsfab.start);"
        "dsfab.views.view({layers: ['loads'], colour: 'plain'}); dsfab.views.look('iso')"
    )
    solved(sharp_tab)
    return sharp_tab


def alike(ours, theirs):
    """Whether masks differ in single pixels only, in one of a hundred along the edges: as with stripes on modes."""
    differ = ours != theirs
    edges = (theirs[1:] != theirs[:-1]).sum() + (theirs[:, 1:] != theirs[:, :-1]).sum()
    return differ.sum() < 0.012 * edges and not binary_opening(differ, np.ones((2, 2))).any()


seen_in_a_page = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")


@seen_in_a_page
def test_the_browser_and_the_previewer_draw_the_same_stripes(page, dome):
    ours, theirs = seen_by_both(page, dome)
    assert alike(ours, theirs)


@seen_in_a_page
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width.solid_fraction", 0.5),
        pytest.param("rim", 0.8, marks=pytest.mark.slow),
        pytest.param("width", {"rule": "plain", "solid_fraction": 0.0}, marks=pytest.mark.slow),
    ],
)
def test_widths_follow_in_the_same_frame(page, key, value):
    before = page.run(SEEN)
    page.run("window.asked = dsfab.work.ask; dsfab.work.ask = () => {}; 1")  # the server is not asked
    changes = {f"pattern.{key}.{part}": one for part, one in value.items()} if isinstance(value, dict) else {
        f"pattern.{key}": value}  # fmt: skip
    page.run(f"dsfab.state.set({json.dumps(changes)})")
    live = page.run(f"({READY}) && {SEEN}")
    assert abs(live - before) > 0.01 * before
    page.run("dsfab.work.ask = window.asked; dsfab.solve()")
    solved(page)
    assert page.run(SEEN) == pytest.approx(live, rel=0.03)  # openings close as a whole once it is solved


@seen_in_a_page
@pytest.mark.slow
@pytest.mark.parametrize("rule", ["graded", "constant"])
def test_the_browser_widens_stripes_as_the_server_does(page, rule):
    """At every vertex of the chart, on either side of a line; both copies solve for the share by themselves."""
    page.run(f"dsfab.state.set({json.dumps({'pattern.width.rule': rule, 'pattern.width.q': 0.5})})")
    solved(page)
    exact = np.array(page.run("[...dsfab.model.arrays.half]"))
    script = """(async () => {
        const { drawn } = await import('/static/pattern.js');
        const { facts, arrays } = dsfab.model;
        const wanted = structuredClone(facts.pattern);
        wanted.width.solid_fraction += 1e-9;  // so that it is not the server's own
        return [...drawn(wanted, { facts, arrays }, dsfab.sampler).half]; })()"""
    live = np.array(page.run(script))
    free = exact < 0.45
    assert free.mean() > 0.7
    near = 95 if rule == "graded" else 98  # where an opening closes a factor that is off counts 15 times
    assert np.percentile(np.abs(live - exact)[free], near) < 0.01
    assert np.abs(live - exact)[free].mean() < 0.005  # the share of the sheet has what fills its slits


@seen_in_a_page
@pytest.mark.slow
def test_only_the_server_knows_where_other_stripes_run(page):
    before = page.run(SEEN)
    page.run("window.asked = dsfab.work.ask; dsfab.work.ask = () => {}; 1")
    type_into(page, "pattern-major-spacing", "0.8")
    outdated = "document.querySelector('#picture').classList.contains('outdated')"
    assert page.run(outdated)
    assert page.run(SEEN) == before
    page.run("dsfab.work.ask = window.asked; dsfab.solve()")
    solved(page)
    assert not page.run(outdated)
    assert page.run(SEEN) != before
    ours, theirs = seen_by_both(page, draft(load_preset(DOME_MODES, {**DOME, "pattern.major.spacing": 0.8})))
    assert alike(ours, theirs)


@seen_in_a_page
@pytest.mark.slow
def test_the_browser_and_the_previewer_draw_the_same_single_family(page):
    """On modes in the same frame: the other one has no width; evenly spaced it is another pattern, which is made."""
    alone = {"pattern.families": "minor", "pattern.rotate": 15}
    page.run(f"dsfab.state.set({json.dumps(alone)})")
    solved(page)
    ours, theirs = seen_by_both(page, draft(load_preset(DOME_MODES, {**DOME, **alone})))
    assert alike(ours, theirs)
    idle = "[...document.querySelectorAll('#groups .row.idle')].map((row) => row.querySelector('label').htmlFor)"
    assert {"pattern-halve", "pattern-major-spacing"} <= set(page.run(idle))
    modes = {"pattern.method": "modes", "pattern.families": "both", "pattern.rotate": 0}
    modes |= {"pattern.width.rule": "plain", "pattern.width.solid_fraction": 0.0}
    modes |= {f"pattern.{name}.{key}": value for name in ("major", "minor")
              for key, value in (("frequency", 6.0), ("spacing", 0.0))}  # fmt: skip
    page.run(f"dsfab.state.set({json.dumps(modes)})")
    solved(page)
    before = page.run(SEEN)
    page.run("window.asked = dsfab.work.ask; dsfab.work.ask = () => {}; 1")
    page.run("dsfab.state.set({'pattern.families': 'minor'})")
    live = page.run(f"({READY}) && {SEEN}")
    assert live < 0.8 * before
    page.run("dsfab.work.ask = window.asked; dsfab.solve()")
    solved(page)
    assert page.run(SEEN) == pytest.approx(live, rel=0.03)  # openings close as a whole once it is solved


@seen_in_a_page
@pytest.mark.slow
def test_the_page_shows_the_controls_of_the_chosen_method(page):
    shown = "[...document.querySelectorAll('#groups .row label')].filter(e => e.offsetParent).map(e => e.htmlFor)"
    open_ = "document.querySelectorAll('#groups details').forEach(e => e.open = true)"
    page.run(open_)
    even = set(page.run(shown))
    assert {"pattern-halve", "pattern-symmetry", "pattern-rotate", "pattern-major-spacing"} <= even
    assert not {"pattern-major-mode", "pattern-minor-frequency", "pattern-major-phase"} & even
    assert page.run("document.querySelector('#colour [value=major]').hidden")
    chosen = "(() => { const e = document.getElementById('pattern-method'); e.value = '%s'; " \
             "e.dispatchEvent(new Event('change')); })()"  # fmt: skip
    page.run(chosen % "modes")
    solved(page)
    page.run(open_)
    modes = set(page.run(shown))
    assert not {"pattern-halve", "pattern-symmetry", "pattern-rotate"} & modes
    assert {"pattern-major-mode", "pattern-minor-frequency", "pattern-major-phase"} <= modes
    assert not page.run("document.querySelector('#colour [value=major]').hidden")
    page.run(chosen % "stripes")
    solved(page)
    before = page.run(SEEN)
    page.run("document.getElementById('pattern-halve').click()")
    assert page.run("dsfab.state.changes") == {"pattern.halve": False}
    solved(page)
    assert page.run(SEEN) != before


@seen_in_a_page
@pytest.mark.slow
def test_picking_returns_a_vertex_of_the_uncut_surface(page, dome):
    """The vertex next to a place, one of the free edge, and a ball, all counted on the surface that presets mean."""
    centre = np.array(page.run("dsfab.model.facts.centre"))
    V = dome.surface.V - centre
    at = dome.surface.n // 2
    near = page.run(f"dsfab.picking.nearest({{x: {V[at, 0]}, y: {V[at, 1]}, z: {V[at, 2]}}})")
    assert near == at
    loop = dome.surface.loops[0]
    assert page.run("[...dsfab.model.arrays.loops]") == list(loop)
    places = np.array(page.run("dsfab.picking.places([...dsfab.model.arrays.loops])")).reshape(-1, 3)
    np.testing.assert_allclose(places, V[loop], atol=1e-4)
    ball = page.run(f"dsfab.picking.within({{x: {V[at, 0]}, y: {V[at, 1]}, z: {V[at, 2]}}}, 1.5)")
    assert ball == np.flatnonzero(np.linalg.norm(V - V[at], axis=1) <= 1.5).tolist()


@seen_in_a_page
@pytest.mark.slow
def test_the_measured_share_is_the_requested_share(page):
    assert share_measured(page) == pytest.approx(40, abs=0.3)
    assert with_overrides(load_preset(DOME_MODES), DOME).pattern.width.solid_fraction == 0.4


LOOSE = {"surface.edge": 0.5, **EVEN, "pattern.major.spacing": 0.7, "pattern.minor.spacing": 0.7}


@pytest.fixture(scope="module")
def loose():
    """A dome whose stripes, as they are drawn, have loose ends."""
    made = draft(load_preset(DOME_MODES, LOOSE))
    return made, *tidied_cut(made)


def test_the_figures_are_those_of_the_tidied_sheet(loose):
    made, cut, notes = loose
    assert made.quality(symmetry=False).dead_ends > 0
    assert sheet_figures(made, cut, notes)["pattern"]["dead_ends"] == 0


def test_the_page_gets_the_sheet_that_is_built(loose):
    made, cut, _ = loose
    arrays = unpacked(pack_message({}, cut_sheet_arrays(made, cut.sheet)))[1]
    sheet, chart = cut.sheet.surface, made.pattern.even.chart.surface
    middle = (made.surface.V.min(axis=0) + made.surface.V.max(axis=0)) / 2
    F = arrays["F"].reshape(-1, 3)
    np.testing.assert_allclose(arrays["V"][F] + middle, sheet.V[sheet.F], atol=1e-5)
    on_it = np.einsum("ki,kij->kj", arrays["shares"], chart.V[arrays["corners"]])
    np.testing.assert_allclose(on_it, arrays["V"] + middle, atol=1e-5)
    assert len(arrays["E"]) == (sheet.edges.count == 1).sum()
    names = np.array(["major", "minor", "kept"])[np.round(arrays["tint"][F]).astype(int)]
    assert (names == names[:, :1]).all()
    assert set(names[:, 0]) == {"major", "minor", "kept"}
    drawn = np.array([name if name in ("major", "minor") else "kept" for name in made.pattern.names])
    assert (names[:, 0] == drawn[cut.sheet.family]).all()


CUT = "!!dsfab.viewer.sheet.cut && !dsfab.stale"


@seen_in_a_page
@pytest.mark.slow
def test_at_rest_the_page_shows_the_sheet_that_is_built(page):
    """Seen from above: material where the server's sheet has it, and openings where it has none."""
    round_ = {**SPACED, "pattern.minor.spacing": 1.1, "pattern.fillet": 0.25}
    page.run(f"dsfab.state.set({json.dumps(round_)})")
    page.run("dsfab.views.look('top'); dsfab.views.view({layers: []})")
    solved(page)
    until(page, CUT)
    made = draft(load_preset(DOME_MODES, {**DOME, **round_}))
    cells = tidied_cut(made)[0].cells
    middle = np.array(page.run("dsfab.model.facts.centre"))
    large = cells.surface.areas > np.median(cells.surface.areas)
    places = cells.surface.V[cells.surface.F].mean(axis=1)[large] - middle
    seen = """((places) => { const { width, height, seen } = dsfab.viewer.mask(%s), { camera } = dsfab.viewer.eye;
        return places.map((at) => { const p = camera.position.clone().fromArray(at).project(camera);
        return seen[Math.floor((p.y + 1) / 2 * height) * width + Math.floor((p.x + 1) / 2 * width)]; }); })(%s)"""
    told = json.dumps(places.round(5).tolist())
    shown, live = (np.array(page.run(seen % (how, told))) != cells.material[large] for how in ("false", "true"))
    assert shown.mean() < 0.01  # beside edges, by less than a pixel
    assert live.mean() > 3 * shown.mean()  # as they are drawn
    opening = places[~cells.material[large]][0].tolist()
    pointed = f"""(() => {{ const c = document.getElementById('canvas'), {{ camera }} = dsfab.viewer.eye;
        const p = camera.position.clone().fromArray({opening}).project(camera);
        const at = {{ offsetX: (p.x + 1) / 2 * c.clientWidth, offsetY: (1 - p.y) / 2 * c.clientHeight }};
        return dsfab.picking.hit(at) !== null; }})()"""
    assert page.run(pointed)  # an opening is a place of the surface, too


@seen_in_a_page
def test_a_change_shows_stripes_again_and_rest_the_sheet(page):
    until(page, CUT)
    page.run("window.asked = dsfab.work.ask; dsfab.work.ask = () => {}; 1")
    page.run("dsfab.state.set({'pattern.width.solid_fraction': 0.5})")
    assert page.run("dsfab.viewer.sheet.geometry === dsfab.viewer.sheet.live")
    page.run("dsfab.work.ask = window.asked; dsfab.solve()")
    solved(page)
    until(page, CUT)
    assert page.run("dsfab.viewer.sheet.geometry !== dsfab.viewer.sheet.live")
    page.run("dsfab.views.view({layers: ['sheet']})")
    assert page.run("dsfab.viewer.sheet.geometry === dsfab.viewer.sheet.live")  # the uncut one is asked for


@seen_in_a_page
def test_the_sheet_has_the_values_of_the_surface(page):
    """Colours and displacements of the surface, where the sheet's vertices lie on it."""
    until(page, CUT)
    page.run("dsfab.views.view({colour: 'stress'})")
    value = np.array(page.run("[...dsfab.viewer.sheet.cut.geometry.getAttribute('value').array]"))
    stress = np.array(page.run("[...dsfab.model.arrays.stress]"))
    corners = np.array(page.run("[...dsfab.viewer.sheet.cut.arrays.corners]")).reshape(-1, 3)
    assert (value >= stress[corners].min(axis=1) - 1e-3 * np.abs(stress).max()).all()
    assert (value <= stress[corners].max(axis=1) + 1e-3 * np.abs(stress).max()).all()
    assert np.ptp(value) > 0.5 * np.ptp(stress)


@seen_in_a_page
def test_nothing_went_wrong(page):
    until(page, READY)
    assert page.errors == []


LINES = """(() => { const { viewer } = dsfab, { gl, canvas } = viewer, { outline } = viewer.sheet, w = canvas.width;
    const bytes = () => { viewer.draw(); const out = new Uint8Array(4 * w * canvas.height);
        gl.readPixels(0, 0, w, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, out); return out; };
    outline.visible = false; const plain = bytes();
    outline.visible = true; const lined = bytes();
    const apart = (a, i, b, j) => Math.max(...[0, 1, 2].map((c) => Math.abs(a[i + c] - b[j + c])));
    const around = [-2, -1, 0, 1, 2].flatMap((x) => [-2, -1, 0, 1, 2].map((y) => 4 * (x + w * y)));
    let [drawn, inside] = [0, 0];
    for (let i = 8 * w + 8; i < plain.length - 8 * w - 8; i += 4) {
        if (apart(plain, i, lined, i) < 16) continue;
        drawn += 1;
        inside += around.every((j) => apart(plain, i, plain, i + j) < 8);
    }
    return drawn && [drawn, inside]; })()  // 0 until there are lines"""


@seen_in_a_page
def test_no_line_is_seen_through_the_sheet(page):
    """Outlines behind the crown stood on it: a line is drawn where the sheet ends, not where all around is sheet."""
    until(page, CUT)
    page.run("dsfab.views.view({layers: [], colour: 'plain'}); dsfab.views.look('iso')")
    drawn, inside = until(page, LINES)
    assert inside < 0.001 * drawn
