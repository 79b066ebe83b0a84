"""Where the editor's files go: one folder for each name, never elsewhere, and nothing of others without a question."""

import shlex
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.app.editor.building import Builds
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import MeshRequest, OpenedPreset, Outputs, open_preset, opened_mesh, saved_preset
from dsfab.app.export import TO_HELP, format_suffix, offered_formats
from dsfab.core.errors import DsfabError, ExportError
from dsfab.export import write
from dsfab.preset.file import load_preset
from tests.app.editor_page import DROP, READY, page_of, type_into, until
from tests.app.editor_server import COARSE, COARSELY, serving, wait
from tests.browser import browser
from tests.presets import DOME_MODES

seen_in_a_page = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")
STL = {"export.formats": ["stl"], "statics.thickness": 0.1}
"""And a thickness, which is searched for otherwise."""


@pytest.fixture
def outputs(tmp_path, monkeypatch, no_pictures, coarse_proposals, rough_shares):
    monkeypatch.chdir(tmp_path)
    return Outputs(tmp_path / "outputs", "outputs")


@pytest.mark.parametrize("name", ["", ".", "..", "../x", "a/b", "/etc", ".hidden", "a b", "ä", "x\n", "-o"])
def test_a_name_leads_to_no_other_folder(outputs, name):
    with pytest.raises(DsfabError, match="is not a valid name of a folder in outputs"):
        outputs.folder(name)


def test_a_link_leads_to_no_other_folder(outputs, tmp_path):
    outputs.home.mkdir()
    (tmp_path / "elsewhere").mkdir()
    (outputs.home / "roof").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    with pytest.raises(DsfabError, match="is not a valid name of a folder"):
        outputs.folder("roof")


def test_files_of_others_are_counted_and_passed_by(outputs, tmp_path):
    assert outputs.foreign_files("roof") == 0
    for name in ("roof", "roof-2"):
        (outputs.home / name).mkdir(parents=True)
        (outputs.home / name / "notes.txt").write_text("mine")
    assert outputs.foreign_files("roof") == 1
    assert outputs.free_name("roof") == "roof-3"
    made = tmp_path / "made"
    made.mkdir()
    (made / "roof.stl").write_text("solid")
    assert outputs.publish(made, "roof") == outputs.home / "roof"
    assert outputs.foreign_files("roof") == 0  # it is ours now
    assert (outputs.home / "roof" / "notes.txt").read_text() == "mine"


def test_a_file_of_others_is_never_overwritten(outputs):
    outputs.home.mkdir()
    (outputs.home / "roof.toml").write_text("mine")
    assert outputs.write_file("roof", ".toml", b"ours").name == "roof-2.toml"
    assert outputs.write_file("roof", ".toml", b"ours again").name == "roof-2.toml"
    assert outputs.write_file("roof", ".toml", b"mine").name == "roof.toml"  # the same bytes
    assert (outputs.home / "roof.toml").read_text() == "mine"


def test_a_build_goes_into_a_folder_of_its_name_after_a_question(outputs):
    with Session(open_preset(DOME_MODES, COARSELY), outputs=outputs) as session:
        job = wait(session.jobs, session.ask_build({**STL, "name": "hut"}, replace=False)["job"])
        assert job.state == "done", job.text
        assert job.result["folder"] == "outputs/hut"
        assert {"hut.stl", "preset.toml", "design.json"} <= {path.name for path in (outputs.home / "hut").iterdir()}
        assert "job" in session.ask_build({**STL, "name": "hut"}, replace=False)  # its own folder
    with Session(open_preset(DOME_MODES, COARSELY), outputs=Outputs(outputs.home, "outputs")) as session:
        question = session.ask_build({**STL, "name": "hut"}, replace=False)
        assert question["taken"].startswith("outputs/hut holds ")
        assert question["free"] == "hut-2"
        assert "job" in session.ask_build({**STL, "name": "hut"}, replace=True)


def test_one_file_is_counted_in_the_singular(outputs):
    (outputs.home / "hut").mkdir(parents=True)
    (outputs.home / "hut" / "a").touch()
    builds = Builds(outputs, outputs.home)
    assert builds.replacement_question("hut")["taken"].startswith("outputs/hut holds 1 file of before;")
    assert builds.replacement_question("other") == {}


@pytest.fixture
def dropped(outputs, tmp_path):
    """A mesh that came from the page: the file that it is in goes with the session."""
    path = write(load_preset(DOME_MODES, COARSE).surface.build(), tmp_path / "mesh-1.obj")
    return opened_mesh(MeshRequest(path, "my roof.obj", "mm"))


def test_a_mesh_of_the_page_is_saved_beside_its_preset(outputs, dropped):
    saved = saved_preset(dropped, {"pattern.width.solid_fraction": 0.4}, outputs)
    assert saved == outputs.home / "my_roof.toml"
    assert tomllib.loads(saved.read_text())["surface"]["file"] == "my_roof.obj"
    dropped.page_mesh.unlink()  # the session has ended
    again = load_preset(saved)
    assert again.pattern.width.solid_fraction == 0.4
    assert again.surface.base_surface().n == load_preset(DOME_MODES, COARSE).surface.build().n


@pytest.mark.slow
def test_a_mesh_of_the_page_is_built_beside_its_files(outputs, dropped, capsys, unjudged):
    with Session(dropped, outputs=outputs) as session:
        wait(session.jobs, session.ask_solve(STL))
        job = wait(session.jobs, session.ask_build(STL)["job"])
        assert job.state == "done", job.text
    dropped.page_mesh.unlink()
    folder = outputs.home / "my_roof"
    assert tomllib.loads((folder / "preset.toml").read_text())["surface"]["file"] == "surface.obj"
    assert main(["export", str(folder), "--to", "ply", "--quiet"]) == 0  # of what was kept, nothing is made again
    assert (folder / "my_roof.ply").stat().st_size > 1000
    before = (folder / "my_roof.stl").read_bytes()
    assert main(["build", str(folder / "preset.toml"), "--quiet", "--no-preview"]) == 0
    assert (folder / "my_roof.stl").read_bytes() == before


@pytest.fixture
def tab(outputs, tmp_path):
    first = OpenedPreset(load_preset(DOME_MODES, COARSE), (DOME_MODES,))
    with serving(first, outputs) as server, page_of(server, tmp_path / "browser") as tab:
        tab.open(server.address, READY)
        yield tab


@pytest.mark.slow
def test_the_editor_exports_one_file_and_names_it(outputs, dropped):
    with Session(dropped, outputs=outputs) as session:
        wait(session.jobs, session.ask_solve(STL))
        job = wait(session.jobs, session.ask_build(STL, only="csv")["job"])
        assert job.state == "done", job.text
        assert [file["name"] for file in job.result["files"]] == ["my_roof.csv"]
        assert job.result["told"][-1].startswith("csv: ")
        job = wait(session.jobs, session.ask_build(STL, only="calculix")["job"])
        assert job.state == "done", job.text
        assert job.result["told"][-1] == "to compare, run cd outputs/my_roof && ccx my_roof, then read my_roof.dat"
        with pytest.raises(ExportError, match="is not a format"):
            session.ask_build(STL, only="docx")


def test_every_format_of_the_command_line_is_offered(monkeypatch):
    from dsfab.export import FORMATS

    def missing():
        raise ExportError('.3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"')

    monkeypatch.setitem(FORMATS, ".3dm", replace(FORMATS[".3dm"], ready=missing))
    offered = {one["format"]: one for one in offered_formats()}
    assert set(offered) == {suffix[1:] for suffix in FORMATS} - {"stp"} | {"calculix"}
    for word in offered:
        assert word in TO_HELP
    assert offered["3dm"]["missing"].endswith('pip install "dsfab[rhino]"')
    assert not any(one["missing"] for word, one in offered.items() if word not in ("3dm", "ifc"))
    with pytest.raises(ExportError, match="dsfab\\[rhino\\]"):
        format_suffix("3dm")


def drop_roof(tab):
    tab.run(DROP)
    until(tab, "document.getElementById('ask').open")
    tab.run("document.getElementById('ask-unit').value = 'cm'; document.querySelector('#ask button.main').click()")
    until(tab, "dsfab.start.title === 'my_roof' && dsfab.model.facts.opening === dsfab.start.opening && " + READY)


@seen_in_a_page
@pytest.mark.slow
def test_the_copied_command_works_when_pasted(tab, outputs, unjudged):
    drop_roof(tab)
    tab.run("document.querySelector('#formats [value=step]').click()")
    few = "'pattern.major.spacing': 0.2, 'pattern.minor.spacing': 0.2"
    tab.run(f"dsfab.state.set({{'statics.thickness': 0.01, {few}}})")  # it is searched for otherwise
    tab.run("document.getElementById('copy').click()")
    command = until(tab, "document.querySelector('#command code')?.textContent")
    assert command == "dsfab build outputs/my_roof.toml"
    assert "outputs/my_roof.toml is saved" in tab.run("document.getElementById('command').textContent")
    assert main([*shlex.split(command)[1:], "--no-preview", "--quiet"]) == 0
    built = {path.name for path in (outputs.home / "my_roof").iterdir()}
    assert {"my_roof.stl", "my_roof.3mf"} <= built
    assert "my_roof.step" not in built


@seen_in_a_page
@pytest.mark.slow
def test_the_editor_asks_before_it_replaces_a_build_of_another_run(tab, outputs):
    (outputs.home / "hut").mkdir(parents=True)
    (outputs.home / "hut" / "hut.stl").write_text("of before")
    assert tab.run("document.getElementById('place').textContent") == "outputs/"
    type_into(tab, "name", "../hut")
    assert tab.run("document.getElementById('name').value") == "dome_modes"
    assert "no name for files" in tab.run("document.getElementById('notice').textContent")
    type_into(tab, "name", "hut")
    for word in ("3mf", "step"):
        tab.run(f"document.querySelector('#formats [value=\"{word}\"]').click()")
    tab.run("document.getElementById('build').click()")
    until(tab, "document.getElementById('replace').open")
    assert "outputs/hut holds 1 file" in tab.run("document.getElementById('replace-text').textContent")
    tab.run("document.querySelector('#replace [value=no]').click()")
    assert not tab.run("document.getElementById('build').disabled")
    tab.run("document.getElementById('build').click()")
    until(tab, "document.getElementById('replace').open")
    tab.run("document.getElementById('replace-other').click()")
    until(tab, "document.querySelectorAll('#built a').length > 0")
    assert (outputs.home / "hut" / "hut.stl").read_text() == "of before"
    assert (outputs.home / "hut-2" / "hut-2.stl").stat().st_size > 1000
    assert tab.run("document.getElementById('name').value") == "hut-2"


@seen_in_a_page
@pytest.mark.slow
def test_an_opened_preset_fills_the_picture_at_any_size(tab, rough_shipped):
    """From a dome of 14 m to a roof of 0.9 m, and back; the eye of the one is no eye for the other."""
    share = "(() => { const { seen } = dsfab.viewer.mask(); return seen.reduce((a, b) => a + b, 0) / seen.length; })()"
    dsfab = "dsfab.views.view({layers: ['sheet']}); new Promise(done => setTimeout(done, 400))"  # eyes are remembered
    tab.run(dsfab)
    whole = tab.run(share)
    drop_roof(tab)
    assert tab.run("dsfab.model.facts.size") == pytest.approx(np.hypot(0.9, 0.9), rel=1e-2)
    assert tab.run(share) == pytest.approx(0.25, abs=0.15)
    assert np.abs(np.array(tab.run("dsfab.viewer.eye.numbers"))[3:6]).max() < 0.3
    tab.run("dsfab.files.open({preset: 'dome'})")
    until(tab, "dsfab.start.title === 'dome' && dsfab.model.facts.opening === dsfab.start.opening && " + READY)
    assert tab.run(share) == pytest.approx(whole, rel=0.3)


@seen_in_a_page
@pytest.mark.slow
def test_a_file_of_any_kind_is_exported_from_the_page(tab, outputs, monkeypatch):
    missing = {"format": "3dm", "group": "the solid", "missing": 'install it with: pip install "dsfab[rhino]"'}
    offered = [one for one in offered_formats() if one["format"] != "3dm"]
    monkeypatch.setattr("dsfab.app.editor.page.offered_formats", lambda: [*offered, missing])
    tab.run("document.getElementById('export').click()")
    until(tab, "document.getElementById('exporting').open")
    buttons = "[...document.querySelectorAll('#format-list button')]"
    assert set(tab.run(f"{buttons}.map(e => e.textContent)")) == {one["format"] for one in offered_formats()}
    assert tab.run(f"{buttons}.filter(e => e.disabled).map(e => e.textContent)") == ["3dm"]
    assert 'pip install "dsfab[rhino]"' in tab.run("document.getElementById('format-list').innerText")
    tab.run(f"{buttons}.find(e => e.textContent === 'svg').click()")
    until(tab, "document.querySelectorAll('#built a').length > 0")
    assert not tab.run("document.getElementById('exporting').open")
    assert "outputs/dome_modes:" in tab.run("document.getElementById('built').innerText")
    assert (outputs.home / "dome_modes" / "dome_modes.svg").read_text().startswith("<?xml")
    assert [path.name for path in (outputs.home / "dome_modes").iterdir()] == ["dome_modes.svg"]
