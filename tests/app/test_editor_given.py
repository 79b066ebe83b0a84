"""The editor's controls of what is given: material, loads as switches, mesh, symmetry and the workshop's limits."""

import pytest

from dsfab.app.editor.controls import controls
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import OpenedPreset, open_preset
from dsfab.core.materials import KEYS, MATERIALS
from dsfab.preset.file import load_preset
from dsfab.preset.model import Fabrication
from tests.app.editor_page import READY, page_of, solved, type_into, until
from tests.app.editor_server import COARSE, COARSELY, served_changes, serving
from tests.browser import browser
from tests.presets import DOME_MODES

seen_in_a_page = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")


def test_every_limit_of_the_workshop_has_a_control():
    preset = load_preset(DOME_MODES, COARSE)
    listed = {control["key"]: control for control in controls(preset, preset.surface.build())}
    assert {f"fabrication.{key}" for key in Fabrication.model_fields} <= set(listed)
    assert {"surface.refine", "surface.smooth", "diffusion.symmetry", "pattern.symmetry", "statics.strength"} <= set(
        listed
    )
    assert listed["statics.material"]["choices"] == tuple(MATERIALS)
    for key in ("surface.refine", "fabrication.min_gap"):
        assert (listed[key]["word"], listed[key]["worth"]) == ("off", 0)
        assert 0 < listed[key]["low"] < listed[key]["high"]


def test_the_page_receives_the_values_of_each_material():
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        told = session.start()["materials"]
    assert {name: {key: one[key] for key in KEYS} for name, one in told.items()} == {
        name: one.values for name, one in MATERIALS.items()
    }
    assert "19.2 MPa" in told["GL24h"]["says"]


def test_a_cleared_value_is_passed_to_the_command_line_by_a_file():
    assert open_preset(DOME_MODES, COARSELY.with_overrides("fabrication.bed=[1,1,1]")).command(
        {"fabrication.bed": None}
    )[1]


@pytest.fixture(scope="module")
def server():
    with serving(OpenedPreset(load_preset(DOME_MODES, COARSE), (DOME_MODES, "--set", "surface.edge=1.2"))) as made:
        yield made


@pytest.fixture(scope="module")
def tab(server, tmp_path_factory):
    with page_of(server, tmp_path_factory.mktemp("given")) as tab:
        tab.open(server.address, READY)
        tab.run("document.querySelectorAll('#panel details').forEach(e => e.open = true)")
        yield tab


@pytest.fixture(autouse=True)
def fresh(request):
    """Every test begins with the preset as it is."""
    if "tab" in request.fixturenames:
        tab = request.getfixturevalue("tab")
        tab.run("dsfab.opened(dsfab.start)")
        solved(tab)


def choose(tab, identifier, value):
    at = f"document.getElementById('{identifier}')"
    tab.run(f"{at}.value = '{value}'; {at}.dispatchEvent(new Event('change'))")


def shown(tab, server):
    """The preset that the page shows, as the server and as the page itself have it; they must be the same."""
    changes = tab.run("dsfab.state.changes")
    preset = server.session.current_preset.preset_with(changes)
    command, save = server.session.current_preset.command(changes)
    if not save:
        assert load_preset(*served_changes(command)) == preset
    page = tab.run("dsfab.state.preset.statics")
    assert {key: page[key] for key in KEYS} == {key: getattr(preset.statics, key) for key in KEYS}
    return preset


@seen_in_a_page
@pytest.mark.slow
def test_a_chosen_material_fills_its_values_and_the_page_marks_changed_ones(tab, server):
    choose(tab, "statics-material", "GL24h")
    assert tab.run("dsfab.state.changes") == {"statics.material": "GL24h"}
    assert tab.run("document.getElementById('statics-young').value") == "1.15e10"
    assert shown(tab, server).statics.strength == 12.3e6
    type_into(tab, "statics-density", "500")
    assert tab.run("document.getElementById('statics-material-own').textContent") == "your own density"
    assert shown(tab, server).statics.material_words == "GL24h, but for density"
    type_into(tab, "statics-density", "7850")  # that of the preset below: it is own all the same
    assert shown(tab, server).statics.density == 7850
    choose(tab, "statics-material", "S355")  # takes the place of all of them
    assert tab.run("dsfab.state.changes") == {"statics.material": "S355"}
    assert tab.run("document.getElementById('statics-material-own').hidden")
    choose(tab, "statics-material", "")
    assert shown(tab, server).statics.material is None
    assert shown(tab, server).statics.strength == 355e6
    solved(tab)
    assert tab.run("document.getElementById('notice').hidden")


@seen_in_a_page
@pytest.mark.slow
def test_snow_wind_and_weight_are_switches(tab, server):
    def kinds():
        return [load.kind for load in shown(tab, server).surface.load]

    assert kinds() == ["self_weight", "force"]
    tab.run("document.getElementById('weather-snow').click()")
    type_into(tab, "weather-snow-size", "1200")
    tab.run("document.getElementById('weather-wind').click()")
    choose(tab, "weather-wind-way", "−y")
    assert kinds() == ["self_weight", "force", "snow", "wind"]
    snow, wind = shown(tab, server).surface.load[2:]
    assert (snow.pressure, snow.case) == (1200, "load")
    assert wind.direction == (0, -1, 0)
    solved(tab)
    tab.run("document.getElementById('weather-self_weight').click()")
    tab.run("document.getElementById('weather-wind').click()")
    assert kinds() == ["force", "snow"]
    assert tab.run("document.querySelectorAll('#load-list .acting').length") == 2  # the force and the support
    solved(tab)
    assert tab.run("document.getElementById('notice').hidden"), tab.run("document.getElementById('notice').textContent")


@seen_in_a_page
@pytest.mark.slow
def test_the_mesh_is_refined_and_left_again(tab):
    before = tab.run("dsfab.model.facts.triangles")
    type_into(tab, "surface-refine", "0.8")
    solved(tab)
    assert tab.run("dsfab.model.facts.triangles") > 2 * before
    tab.run("document.getElementById('surface-refine').closest('.row').querySelector('.word').click()")
    assert tab.run("dsfab.state.changes") == {}
    solved(tab)
    assert tab.run("dsfab.model.facts.triangles") == before


@seen_in_a_page
@pytest.mark.slow
def test_symmetry_and_the_bed_are_written(tab, server):
    type_into(tab, "diffusion-symmetry", "x, rot:6:z")
    assert shown(tab, server).diffusion.symmetry == ("x", "rot:6:z")
    type_into(tab, "fabrication-bed", "2 x 1,5 × 0.3")
    assert shown(tab, server).fabrication.bed == (2, 1.5, 0.3)
    type_into(tab, "fabrication-bed", "2 x 1")
    assert tab.run("document.getElementById('fabrication-bed').value") == "2 × 1.5 × 0.3"
    type_into(tab, "fabrication-bed", "")
    assert shown(tab, server).fabrication.bed is None
    type_into(tab, "fabrication-min_member", "0.5")
    assert shown(tab, server).fabrication.min_member == 0.5
    until(tab, "dsfab.told.min_member === 0.5")
    assert "under 500 mm" in tab.run("document.getElementById('f-widths').textContent")
