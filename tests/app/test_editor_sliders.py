"""A slider of the editor is answered at once: few tries for a factor, and no solving while it is held."""

import json

import numpy as np
import pytest

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.preset.file import load_preset
from tests.app.editor_page import READY, page_of, share_measured, solved
from tests.app.editor_server import COARSE, serving
from tests.browser import browser
from tests.presets import DOME_MODES

pytestmark = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")

BOUNDED = {
    "pattern.method": "stripes",
    "pattern.major.frequency": 0,
    "pattern.minor.frequency": 0,
    "pattern.width.rule": "graded",
    "pattern.width.min_width": 0.05,
    "pattern.width.max_width": 0.6,
}


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    with (
        serving(OpenedPreset(load_preset(DOME_MODES, {**COARSE, **BOUNDED}))) as server,
        page_of(server, tmp_path_factory.mktemp("sliders")) as tab,
    ):
        tab.open(server.address, READY)
        solved(tab)
        yield tab


def test_medians_are_those_of_numpy(tab):
    random = np.random.default_rng(1)
    lists = [random.normal(size=n).round(1).tolist() for n in (1, 2, 3, 4, 10, 101, 1000)]
    lists += [[0.0] * 9, list(range(50)), list(range(51))[::-1], [1.0, 1.0, 0.0, 0.0]]
    script = f"(async () => {{ const {{ median }} = await import('/static/widths.js');" \
             f"return {json.dumps(lists)}.map((list) => median(Float64Array.from(list))); }})()"  # fmt: skip
    np.testing.assert_allclose(tab.run(script), [np.median(values) for values in lists])


@pytest.mark.parametrize(
    ("share", "wanted", "factor"),
    [
        ("(x) => Math.min(x / 3, 1)", 0.5, 1.5),
        ("(x) => 1 - Math.exp(-x)", 0.9, -np.log(0.1)),
        ("(x) => x * x / (1 + x * x)", 0.9, 3),
        ("(x) => Math.floor(1000 * x) / 4000", 0.1, 0.4),  # in steps, as points are counted
    ],
)
def test_a_factor_is_found_in_few_tries(tab, share, wanted, factor):
    script = f"""(async () => {{ const {{ solved }} = await import('/static/widths.js'); let count = 0;
        const counted = (x) => {{ count += 1; return ({share})(x); }};
        return [[0.02, 1, 40].map((start) => solved(counted, {wanted}, start, 5e-5)), count / 3]; }})()"""
    found, count = tab.run(script)
    np.testing.assert_allclose(found, factor, rtol=2e-3)
    assert count < 22


def test_shares_that_cannot_be_end_at_their_bounds(tab):
    script = """(async () => { const { solved } = await import('/static/widths.js');
        return [solved((x) => 0.3, 0.5, 1, 1e-5), solved((x) => 0.7, 0.5, 1, 1e-5)]; })()"""
    most, least = tab.run(script)
    assert most > 1e6
    assert least < 1e-6


@pytest.mark.slow
def test_a_held_slider_asks_the_page_alone(tab):
    """A dozen places of a slider: each is drawn after a few tries, and the server hears of the last one only."""
    script = """(async () => {
        const slider = document.getElementById('pattern-width-solid_fraction-slider'), { sampler, work } = dsfab;
        let [tries, asked] = [0, 0];
        const [share, ask] = [sampler.share, work.ask];
        sampler.share = (...given) => { tries += 1; return share.apply(sampler, given); };
        work.ask = (...given) => { asked += 1; return ask.apply(work, given); };
        for (let i = 0; i < 12; i += 1) {
            slider.value = 0.26 + 0.02 * i;
            slider.dispatchEvent(new Event('input'));
            await new Promise((done) => setTimeout(done, 130));
        }
        const held = asked;
        slider.dispatchEvent(new Event('change'));
        await new Promise((done) => setTimeout(done, 400));
        delete sampler.share;
        work.ask = ask;
        return [tries / 12, held, asked]; })()"""
    tries, held, asked = tab.run(script)
    assert tries < 14
    assert (held, asked) == (0, 1)
    solved(tab)
    assert share_measured(tab) == pytest.approx(48, abs=1)
    assert tab.errors == []
