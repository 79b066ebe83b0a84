"""The editor without its page: what is opened, jobs, arrays, and a server that answers its own page alone."""

import base64
import contextlib
import hashlib
import http.client
import json
import os
import pickle
import queue
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import tomllib
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from dsfab.app.editor import server as doors
from dsfab.app.editor.controls import controls
from dsfab.app.editor.drafts import (
    colour_scales,
    draft_model,
    has_creases,
    pack_message,
    pattern_widths,
    sheet_figures,
    tidied_cut,
)
from dsfab.app.editor.jobs import Jobs
from dsfab.app.editor.page import static_files
from dsfab.app.editor.server import EditorServer
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import MeshRequest, OpenedPreset, open_preset, opened_mesh, opened_shipped
from dsfab.app.hops.server import HopsHandler
from dsfab.core.errors import DsfabError, PresetError
from dsfab.core.limits import CROWDING, SLIT
from dsfab.design import Design, draft, run
from dsfab.export import write
from dsfab.pattern.layers import CLOSING_WIDTHS, FOLLOWING_WIDTHS
from dsfab.pattern.widths import SOLID
from dsfab.preset.file import load_preset, preset_from
from dsfab.surface import Surface
from tests.app.editor_server import COARSE, COARSELY, served_changes, serving, unpacked, wait
from tests.presets import DOME_MODES


@pytest.fixture(scope="module")
def server():
    with serving() as made:
        yield made


# --- opened


def test_the_command_builds_exactly_what_the_page_shows():
    now = open_preset(DOME_MODES, COARSELY)
    changes = {
        "pattern.major.frequency": 9.5,
        "pattern.width.rule": "graded",
        "pattern.minor.mode": "auto",
        "surface.load.1.force": [0.0, 0.0, -7e4],
        "surface.support": [{"at": {"pick": "ball", "center": [0.0, 6.0, 0.0], "radius": 2.0}, "hold": "xyz"}],
    }
    command, save = now.command(changes)
    name, sets = served_changes(command)
    assert not save
    assert load_preset(name, sets) == now.preset_with(changes)


def test_a_command_too_long_to_paste_becomes_a_file():
    indices = list(range(1000))
    changes = {"surface.support": [{"at": {"pick": "vertices", "indices": indices}, "hold": "xyz"}]}
    assert opened_shipped("dome").command(changes) == ("dsfab build dome.toml", True)


def test_the_saved_preset_equals_the_shown_preset():
    now = opened_shipped("dome")
    changes = {"pattern.keep": 0.5}
    assert preset_from(tomllib.loads(now.toml(changes))) == now.preset_with(changes)
    assert now.open_toml(now.toml(changes)).preset == now.preset_with(changes)


def test_the_page_names_no_file_here(tmp_path):
    now = opened_shipped("dome")
    with pytest.raises(PresetError, match=r"surface\.file"):
        now.preset_with({"surface": {"file": "/etc/passwd", "support": [], "load": []}})
    text = now.toml({}).replace('shape = "dome"', 'file = "/etc/hostname"')
    with pytest.raises(PresetError, match="needs the mesh file"):
        now.open_toml(text)
    with pytest.raises(PresetError, match="no preset"):
        opened_shipped("../presets/dome")


@pytest.mark.slow
def test_a_mesh_stands_and_carries_itself(tmp_path):
    path = write(load_preset(DOME_MODES, COARSE).surface.build(), tmp_path / "my mesh.obj")
    now = opened_mesh(MeshRequest(path, "my mesh.obj", "mm"))
    assert now.preset.name == "my_mesh"
    made = draft(now.preset)
    assert made.load.supported.any()
    again = now.open_toml(now.toml({"pattern.keep": 0.001}))  # the file says 'my mesh.obj', as the person knows it
    assert tomllib.loads(now.toml({}))["surface"]["file"] == "my mesh.obj"
    assert again.preset.surface == now.preset.surface


# --- controls and arrays


def leaves(values, prefix=""):
    for key, value in values.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key


def test_every_number_of_the_pattern_has_a_control():
    preset = load_preset(DOME_MODES, COARSE)
    listed = {control["key"] for control in controls(preset, preset.surface.build())}
    assert {f"pattern.{key}" for key in leaves(preset.pattern.model_dump())} - {
        "pattern.guide",
        "pattern.region",
    } <= listed
    assert {"diffusion.r", "diffusion.gamma", "statics.thickness"} <= listed
    whole = preset.model_dump(mode="json")
    for key in listed:  # each is a key of a preset
        where = whole
        for part in key.split("."):
            where = where[part]


def test_a_packed_message_unpacks_to_the_same_arrays():
    given = {"a": np.arange(5.0).reshape(5, 1), "b": np.array([True, False, True]), "c": np.arange(6).reshape(2, 3)}
    facts, arrays = unpacked(pack_message({"name": "ü"}, given))
    assert facts["name"] == "ü"
    assert [told["at"] % 4 for told in facts["arrays"].values()] == [0, 0, 0]  # browsers read whole words only
    for name, array in given.items():
        np.testing.assert_array_equal(arrays[name], array)


@pytest.fixture(scope="module")
def dome():
    return draft(load_preset(DOME_MODES, COARSE))


def test_the_page_gets_the_draft(dome):
    facts, arrays = unpacked(pack_message(*draft_model(dome)))
    n = dome.surface.n
    np.testing.assert_allclose(arrays["V"] + facts["centre"], dome.surface.V, atol=1e-5)
    np.testing.assert_array_equal(arrays["F"], dome.surface.F)
    np.testing.assert_allclose(arrays["minor"][4], dome.diffusion.minor.mode(5), rtol=1e-6)
    assert arrays["kept"].shape == (n, 2)
    assert np.isfinite(arrays["kept"]).all()
    balance = arrays["reactions"][:, 3:].sum(axis=0) + dome.load.force.sum(axis=0)
    assert np.abs(balance).max() < 1e-3 * np.abs(dome.load.force.sum(axis=0)).max()
    points = arrays["points"]
    assert points.shape == (1, 6)
    assert points[0, 5] < -50e3  # the crown carries its own weight too
    for name in ("major", "minor"):  # frequency times spacing
        assert facts["lines"][name][0] > 0


def test_the_page_receives_the_creases_of_a_surface():
    """Two plates at a right angle; a dome has none."""
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1]], dtype=float)
    folded = Surface(V, np.array([[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]]))
    assert has_creases(folded)
    assert not has_creases(load_preset(DOME_MODES, COARSE).surface.build())


def test_the_page_receives_the_widths_of_the_cut(dome):
    facts, arrays = unpacked(pack_message(*pattern_widths(dome)))
    half = dict(zip(dome.pattern.names, dome.pattern.half_widths, strict=True))
    np.testing.assert_allclose(arrays["half"][:, 0], half["major"], rtol=1e-6)
    # constant widths: d is slope x frequency x width / 2, unless stripes touch
    reached = arrays["slope"][:, 0] * facts["frequency"][0] * facts["factor"] * facts["member"] / 2
    free = half["major"] < 0.5
    np.testing.assert_allclose(reached[free], half["major"][free], rtol=1e-5)


def test_figures_are_those_of_the_built_sheet(dome):
    told, design = sheet_figures(dome, *tidied_cut(dome)), run(dome.preset)
    assert told["area"] == pytest.approx(design.sheet.surface.area)
    assert told["pieces"] == len(design.slicing.pieces)
    assert told["mass"] == pytest.approx(design.mass, rel=0.05)
    assert sum(told["widths"]) == pytest.approx(1)
    assert told["limits"][0] == 0
    assert 0 < told["narrowest"] < told["limits"][-1]
    assert told["under"] == (told["narrowest"] < told["min_member"])
    assert len(told["bars_under"]) == len(told["widths"])
    assert told["bars_under"] == [end <= told["min_member"] for end in told["limits"][1:]]
    assert told["notes"] == [f"{note.stage}: {note.text}" for note in design.notes if note.stage == "slicing"]


def test_colour_scales_have_64_steps():
    assert {len(scale) for scale in colour_scales().values()} == {64}


# --- jobs


def test_a_job_reports_its_progress_and_its_end():
    with Jobs() as jobs:
        news = jobs.add_listener()
        number = jobs.submit("solve", lambda progress: progress("statics", "solving") or {"answer": 42})
        assert wait(jobs, number).result == {"answer": 42}
        states = [news.get(timeout=60)["state"] for _ in range(4)]
        assert states == ["waiting", "running", "running", "done"]
        jobs.remove_listener(news)


def test_errors_are_reported_and_the_worker_continues(caplog):
    def refuse(progress):
        raise DsfabError("no support")

    with Jobs() as jobs:
        assert wait(jobs, jobs.submit("solve", refuse)).text == "no support"
        assert "ZeroDivisionError" in wait(jobs, jobs.submit("solve", lambda progress: 1 / 0)).text
        assert wait(jobs, jobs.submit("solve", lambda progress: {})).state == "done"


def endless():
    """A job that never ends by itself, and the event of its beginning."""
    begun = threading.Event()

    def long(progress):
        begun.set()
        while True:
            progress("statics", "again")
            time.sleep(0.001)

    return begun, long


def test_cancel_stops_at_the_next_progress():
    begun, long = endless()
    with Jobs() as jobs:
        number = jobs.submit("build", long)
        begun.wait(60)
        assert wait(jobs, jobs.submit("solve", lambda progress: {})).state == "done"  # a slider waits for no solid
        assert jobs.cancel(number)
        assert wait(jobs, number).state == "cancelled"
        assert not jobs.cancel(number)
        assert not jobs.cancel(999)


def test_a_job_that_does_not_notice_is_left_behind():
    begun, go_on, late = threading.Event(), threading.Event(), []

    def deaf(progress):
        begun.set()
        go_on.wait(120)
        late.append("awake")
        progress("statics", "too late")
        late.append("not to be reached")

    with Jobs() as jobs:
        number = jobs.submit("solve", deaf)
        begun.wait(60)
        assert jobs.cancel(number)
        assert wait(jobs, number).state == "cancelled"
        assert not go_on.is_set()
        next_one = jobs.submit("solve", lambda progress: {"answer": 1})  # by another worker
        assert wait(jobs, next_one).result == {"answer": 1}
        go_on.set()
        while late[:1] != ["awake"]:
            time.sleep(0.005)
        assert wait(jobs, jobs.submit("solve", lambda progress: {})).state == "done"
        assert late == ["awake"]
        assert jobs.job(number).state == "cancelled"


def test_a_newer_request_cancels_the_older_request():
    begun, long = endless()
    with Jobs() as jobs:
        old = jobs.submit("solve", long)
        begun.wait(60)
        skipped = jobs.submit("solve", lambda progress: {})
        new = jobs.submit("solve", lambda progress: {})
        assert wait(jobs, new).state == "done"
        assert wait(jobs, old).state == "cancelled"
        assert jobs.job(skipped).state == "cancelled"


# --- session


def test_a_change_of_stripes_solves_nothing_again():
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        first = wait(session.jobs, session.ask_solve({}))
        second = wait(session.jobs, session.ask_solve({"pattern.major.phase": 0.1}))
        third = wait(session.jobs, session.ask_solve({"diffusion.r": 10.0}))
        assert [job.result["version"] for job in (first, second, third)] == [1, 1, 2]
        whole, part = session.model(0), session.model(2)
        assert unpacked(whole)[0]["whole"]
        assert not unpacked(part)[0]["whole"]
        assert len(part) < 0.2 * len(whole)


def test_a_new_page_receives_the_running_solution():
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        assert session.first_model() == b""  # nobody has asked for anything
        job = session.ask_solve({})
        assert session.ask_solve({}) == job  # by dsfab edit, and then by the page
        facts, _ = unpacked(session.first_model())  # waited for
        assert (facts["whole"], facts["opening"]) == (True, 1)
        wait(session.jobs, job)
        assert session.ask_solve({}) != job
        assert session.ask_solve({"pattern.keep": 0.4}) != session.ask_solve({"pattern.keep": 0.5})


@pytest.mark.slow
@pytest.mark.parametrize("answers", [False, True])
def test_a_page_that_begins_gets_a_sketch_until_the_widths_are_solved(answers, monkeypatch):
    """The sketch's surface stays good but for rough stress; one of something else that is wished meanwhile does not."""
    goes_on, until = threading.Event(), Design.until
    monkeypatch.setattr(Design, "until", lambda design, stage: goes_on.wait(120) and until(design, stage))
    changes = COARSELY.with_overrides("statics.strength=235e6") if answers else COARSELY
    with Session(open_preset("barrel_vault", changes)) as session:
        first = session.ask_solve({})
        sketch, _ = unpacked(session.first_model())
        assert (sketch["whole"], session.jobs.pending(first)) == (True, True)
        with pytest.raises(DsfabError, match="has not solved the design yet"):
            session.ask_members(judged=False)
        goes_on.set()
        wait(session.jobs, first)
        assert session._sketched is None
        solved, _ = unpacked(session.model(sketch["version"]))
        assert (solved["whole"], solved["draft"]) == (answers, sketch["draft"] + 1)
    goes_on.clear()
    with Session(open_preset("barrel_vault", COARSELY)) as session:
        first = session.ask_solve({})
        sketch, _ = unpacked(session.first_model())
        other = session.ask_solve({"diffusion.r": 10.0})
        goes_on.set()
        wait(session.jobs, first)
        wait(session.jobs, other)
        assert unpacked(session.model(sketch["version"]))[0]["whole"]


def test_a_value_out_of_range_is_refused_in_one_sentence():
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        with pytest.raises(PresetError, match=r"pattern\.major\.threshold"):
            session.ask_solve({"pattern.major.threshold": 7})
        with pytest.raises(DsfabError, match="not arrive completely"):
            session.ask_mesh("a.obj", "m", "%%%")
        with pytest.raises(DsfabError, match="not a mesh file"):
            session.ask_mesh("a.exe", "m", "")
        broken = base64.b64encode(b"v 0 0 0\n").decode()
        refused = wait(session.jobs, session.ask_mesh("../../part.obj", "m", broken)["job"])
        assert refused.state == "failed"
        assert refused.text.startswith("part.obj has 1 vertex and no faces")


def test_a_mesh_of_the_page_is_read_elsewhere_and_may_be_cancelled(tmp_path):
    from dsfab.surface.shapes import dome

    cap = dome(edge=1.0)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in cap.V) + "".join(f"f {a} {b} {c}\n" for a, b, c in cap.F + 1)
    data = base64.b64encode(text.encode()).decode()
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        job = session.ask_mesh("cap.obj", "m", data)["job"]
        session.jobs.cancel(job)
        assert wait(session.jobs, job).state == "cancelled"
        assert session.start()["opening"] == 1
        done = wait(session.jobs, session.ask_mesh("cap.obj", "m", data)["job"])
        assert done.state == "done", done.text
        assert (done.result["title"], done.result["opening"]) == ("cap", 2)
        assert session.current_preset.preset.surface.base_surface().n == cap.n
        assert {one.topic for one in session.current_preset.decided} >= {"unit", "stands on", "made of"}


@pytest.mark.slow
def test_a_build_of_the_editor_writes_the_files_of_the_command_line(no_pictures):
    import trimesh

    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        wait(session.jobs, session.ask_solve({}))
        job = wait(session.jobs, session.ask_build({"export.formats": ["stl", "3mf"]})["job"])
        assert job.state == "done", job.text
        names = [file["name"] for file in job.result["files"]]
        assert names[:2] == ["dome_modes.stl", "dome_modes.3mf"]
        assert {"design.json", "preset.toml", "sheet.ply"} < set(names)
        path = session.builds.file(job.result["build"], 0)
        assert trimesh.load(path).is_volume
        saved = session.builds.file(job.result["build"], names.index("preset.toml"))
        assert preset_from(tomllib.loads(saved.read_text())).pattern == session.current_preset.preset.pattern
        assert session.builds.file(job.result["build"], 99) is None
        folder = path.parent.parent.parent
    assert not folder.exists()  # nothing stays behind


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked at in /proc")
def test_a_build_is_cancelled_in_the_middle_of_a_stage(monkeypatch, tmp_path, no_pictures):
    """Also the programs that it began, and its temporary files: STEP files are read back by one."""
    pids = tmp_path / "pids"
    deep = (
        'import os, subprocess, sys, tempfile, time; print(\'{"stage": "export", "text": "long"}\', flush=True);'
        "tempfile.mkdtemp(); p = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)']);"
        f"open({str(pids)!r}, 'w').write(f'{{os.getpid()}} {{p.pid}} '); time.sleep(600)"
    )
    monkeypatch.setattr("dsfab.app.editor.building.PROGRAM", deep)
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        folder = Path(session._folder.name)
        number = session.ask_build({"export.formats": ["step"]})["job"]
        while not (pids.exists() and pids.read_text().endswith(" ") and session.jobs.job(number).text == "long"):
            assert session.jobs.job(number).state in ("waiting", "running")
            time.sleep(0.01)
        assert list(folder.rglob("*"))
        assert session.jobs.cancel(number)
        assert wait(session.jobs, number).state == "cancelled"
        end = time.monotonic() + 60
        while list(folder.rglob("*")):
            assert time.monotonic() < end
            time.sleep(0.01)
        for pid in map(int, pids.read_text().split()):
            while alive(pid):
                assert time.monotonic() < end
                time.sleep(0.01)


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.parametrize(
    ("program", "state", "said"),
    [
        ('print(\'{"refused": "no material"}\')', "failed", "no material"),
        ('print(\'{"mistaken": "KeyError: 1"}\')', "failed", "please report"),
        ("import os; os.abort()", "failed", "stopped too early"),
    ],
)
def test_a_failed_build_reports_its_cause(monkeypatch, caplog, program, state, said, no_pictures):
    monkeypatch.setattr("dsfab.app.editor.building.PROGRAM", program)
    with Session(open_preset(DOME_MODES, COARSELY)) as session:
        job = wait(session.jobs, session.ask_build({"export.formats": ["stl"]})["job"])
        assert job.state == state
        assert said in job.text
        assert not list(Path(session._folder.name).rglob("*"))


def test_a_pickled_draft_equals_the_original(dome):
    there = pickle.loads(pickle.dumps(dome))
    assert there.preset == dome.preset
    np.testing.assert_array_equal(there.statics.answers.equilibrium.u, dome.statics.answers.equilibrium.u)
    assert there.notes == dome.notes


# --- doors


@pytest.fixture
def idle():
    """A server that listens and answers nobody yet."""
    with Session(OpenedPreset(load_preset(DOME_MODES, COARSE), ("dome",))) as session, EditorServer(session) as made:
        yield made


def test_fifty_clients_may_wait_at_the_door(idle):
    """With the library's five places, the sixth waited for its second call, seconds later."""
    with contextlib.ExitStack() as stack:
        for _ in range(50):
            stack.enter_context(socket.create_connection(idle.server_address, timeout=0.9))


@pytest.mark.parametrize("handler", [doors.EditorHandler, HopsHandler])
def test_answers_do_not_wait_for_word_of_their_heads(handler):
    """A body is sent after its head: by Nagle's rule it waits for the head's receipt, which may take 40 ms."""
    with socket.create_server(("127.0.0.1", 0)) as door, socket.create_connection(door.getsockname()) as client:
        here, address = door.accept()
        with here:
            made = handler.__new__(handler)  # its constructor would answer, too
            made.request, made.client_address = here, address
            made.setup()
            assert here.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            made.finish()
        assert client.recv(1) == b""


def test_fifty_clients_at_once_are_answered(server):
    """Each of them opens the page and listens for news, all of them at the same moment."""
    server.session.start()
    door, got, lock = threading.Barrier(50), [], threading.Lock()

    def client():
        door.wait()
        status = [ask(server, "GET", path)[0] for path in ("/", "/static/main.js", "/api/start")]
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=60)) as news:
            news.request("GET", "/api/events", headers={"X-Dsfab-Token": server.token})
            answer = news.getresponse()
            status.append(answer.status)
            assert answer.fp.readline() == b": here\n"
            with lock:
                got.append(status)
            door.wait()  # all of them listen at once

    clients = [threading.Thread(target=client) for _ in range(50)]
    for one in clients:
        one.start()
    for one in clients:
        one.join()
    assert got == [[200] * 4] * 50


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="what a process is told, and who is alive, by Linux")
def test_temporary_folders_are_gone_at_the_end_and_after_a_kill_at_the_next_start(tmp_path):
    def editor():
        words = [sys.executable, "-m", "dsfab.app.cli", "edit", DOME_MODES, "--set", "surface.edge=1.5", "--no-open"]
        process = subprocess.Popen(
            words, cwd=tmp_path, env={**os.environ, "TMPDIR": str(tmp_path)}, stdout=subprocess.PIPE, text=True
        )
        assert "dsfab edit" in process.stdout.readline()
        assert "Ctrl-C" in process.stdout.readline()
        return process

    def folders():
        return [path.name for path in tmp_path.glob("dsfab-edit-*")]

    with editor() as killed:
        (left,) = folders()
        killed.kill()
    assert folders() == [left], "nobody could remove it"
    with editor() as other:
        (now,) = folders()
        assert now != left
        other.send_signal(signal.SIGTERM)
        assert other.wait(timeout=60) == 0
    assert folders() == []


def ask(server, method, path, body=None, **headers):
    """Status, headers and body of a request; headers of None are left out."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=60)
    given = {"X-Dsfab-Token": server.token, "Content-Type": "application/json" if body is not None else None}
    given |= {name.replace("_", "-"): value for name, value in headers.items()}
    data = json.dumps(body).encode() if isinstance(body, dict) else body
    connection.request(method, path, data, {k: v for k, v in given.items() if v is not None})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), content


def test_the_server_serves_the_page_with_a_strict_content_policy(server):
    status, headers, content = ask(server, "GET", f"/?token={server.token}", X_Dsfab_Token=None)
    assert status == 200
    assert "script-src 'self' 'nonce-" in headers["Content-Security-Policy"]
    assert "unsafe" not in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert server.token.encode() in content
    status, _, content = ask(server, "POST", "/api/command", {"changes": {}})
    assert status == 200
    assert json.loads(content)["command"] == "dsfab build dome"
    assert ask(server, "GET", "/api/start")[0] == 200


def test_the_server_listens_on_localhost_only(server):
    assert server.server_address[0] == "127.0.0.1"


def test_all_files_that_the_page_names_exist(server):

    page = doors.static_files()
    named = re.findall(r'(?:src|href)="/static/([^"]+)"', page["index.html"].decode())
    named += re.findall(r'"/static/([^"]+)"', page["index.html"].decode())
    for name, content in page.items():
        if name.endswith(".js") and "/" not in name:
            named += [
                at.removeprefix("./").removeprefix("/static/")
                for at in re.findall(r" from '([./][^']+)'", content.decode())
            ]
    assert len(set(named)) > 15
    for name in set(named):
        assert ask(server, "GET", f"/static/{name}", X_Dsfab_Token=None)[0] == 200, name


def test_the_bundled_three_js_has_the_published_checksums():
    """Of the npm package three 0.187.0; whoever takes another version writes its sums here."""
    known = {
        "vendor/three.core.js": "613e370f76638fdef83926642bf256dc9615684922de1ce1f63a8583e5d78578",
        "vendor/three.module.js": "104f56145899722094556490d787aae0617cc2fc3382f31df02d724ea1aee341",
        "vendor/OrbitControls.js": "e7fca2fe9e7670a828af9b28084669a5909445b7f36f1f26cee9bf8f2961c32c",
        "vendor/LICENSE.three": "8b378ebe60e2fe500158cb0ac71cb5e8b7d92953c2abcc63a0eb90499653b5bc",
    }
    found = {name: hashlib.sha256(content).hexdigest() for name, content in doors.static_files().items()}
    assert {name: found[name] for name in found if name.startswith("vendor/")} == known


def test_the_page_requests_all_modules_at_once(server):
    """None is found only after another one has come (the way to a notebook is none of them)."""
    html = ask(server, "GET", f"/?token={server.token}")[2].decode()
    told = set(re.findall(r'modulepreload" href="/static/([^"]+)"', html))
    assert told == {name for name in doors.static_files() if name.endswith(".js")} - {
        "widget.js",
        "transport_notebook.js",
    }
    assert "{" + "token}" not in html
    assert ask(server, "GET", "/api/early")[0] in (200, 204)


@pytest.mark.parametrize(
    ("method", "path", "body", "headers", "status"),
    [
        ("GET", "/api/start", None, {"Host": "evil.example"}, 403),
        ("GET", "/static/main.js", None, {"Host": "evil.example:80"}, 403),
        ("POST", "/api/preset", {"changes": {}}, {"Origin": "http://evil.example"}, 403),
        ("POST", "/api/preset", {"changes": {}}, {"Origin": "null"}, 403),
        ("GET", "/api/start", None, {"X_Dsfab_Token": None}, 403),
        ("GET", "/api/start", None, {"X_Dsfab_Token": "guess"}, 403),
        ("GET", "/", None, {"X_Dsfab_Token": None}, 403),
        ("GET", "/?token=guess", None, {"X_Dsfab_Token": None}, 403),
        ("GET", "/api/events", None, {"X_Dsfab_Token": None}, 403),
        ("GET", "/api/early", None, {"X_Dsfab_Token": None}, 403),
        ("GET", "/api/file?build=1&index=0", None, {"X_Dsfab_Token": None}, 403),
        ("POST", "/api/build", {"changes": {}}, {"X_Dsfab_Token": None}, 403),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Type": "text/plain"}, 415),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Type": None}, 415),
        ("POST", "/api/preset", b"{", {}, 400),
        ("POST", "/api/preset", b"[]", {}, 400),
        ("POST", "/api/preset", {"changes": [1]}, {}, 400),
        ("POST", "/api/preset", {"changes": {"pattern.keep": "x"}}, {}, 422),
        ("POST", "/api/nothing", {}, {}, 404),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Length": str(doors.LARGEST + 1)}, 413),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Length": "-1"}, 411),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Length": "\u00b2"}, 411),
        ("POST", "/api/preset", {"changes": {}}, {"Content_Length": "9" * 30}, 411),
        ("GET", "/static/../server.py", None, {}, 404),
        ("GET", "/static/..%2fserver.py", None, {}, 404),
        ("GET", "/static//etc/passwd", None, {}, 404),
        ("GET", "/static/index.html", None, {}, 404),
        ("GET", "/api/file?build=../1&index=0", None, {}, 400),
        ("GET", "/api/file?build=1&index=7", None, {}, 404),
        ("POST", "/api/open", {"preset": "/etc/passwd"}, {}, 422),
        ("POST", "/api/picture", {"changes": {}, "size": [10**6, 64], "show": "structure", "view": "iso"}, {}, 400),
        ("PUT", "/api/preset", {"changes": {}}, {}, 501),
    ],
)  # fmt: skip
def test_unsafe_requests_are_rejected_with_their_status(server, method, path, body, headers, status):
    got, told, content = ask(server, method, path, body, **headers)
    assert got == status, content
    assert "Access-Control-Allow-Origin" not in told
    assert b"Traceback" not in content


def test_a_reset_connection_prints_nothing_on_the_terminal(server, capfd, monkeypatch):
    ended, shut_down = queue.Queue(), server.shutdown_request
    monkeypatch.setattr(server, "shutdown_request", lambda request: ended.put(shut_down(request)))
    for sent in (b"", b"GET / HTTP/1.1\r\nHost: ", b"POST /api/open HTTP/1.1\r\nContent-Length: 99\r\n\r\n{"):
        with socket.create_connection(("127.0.0.1", server.server_address[1])) as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.sendall(sent)
        ended.get(timeout=60)
    assert ask(server, "GET", "/api/start")[0] == 200
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(os.name == "nt", reason="signals are others there")
def test_ctrl_c_ends_the_editor_cleanly():
    command = [sys.executable, "-m", "dsfab.app.cli", "edit", DOME_MODES, "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = process.stdout.readline().split(": ", 1)[1].strip()
            assert urllib.request.urlopen(address, timeout=60).status == 200
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0
    assert said == ""


def test_a_port_in_use_is_reported(server, capsys):
    from dsfab.app.cli import main

    assert main(["edit", DOME_MODES, "--no-open", "--port", str(server.server_address[1])]) == 1
    assert "leave --port out" in capsys.readouterr().err


def test_news_of_jobs_arrive(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=60)
    connection.request("GET", f"/api/events?token={server.token}")
    stream = connection.getresponse()
    assert stream.getheader("Content-Type").startswith("text/event-stream")
    assert stream.readline() == b": here\n"
    job = json.loads(ask(server, "POST", "/api/solve", {"changes": {}})[2])["job"]
    while True:
        line = stream.readline()
        if line.startswith(b"data: ") and (news := json.loads(line[6:]))["job"] == job and news["state"] == "done":
            break
    facts, arrays = unpacked(ask(server, "GET", "/api/model?have=0")[2])
    assert facts["triangles"] == len(arrays["F"])
    connection.close()


def test_the_page_has_no_width_rules_of_its_own(dome):
    facts, _ = unpacked(pack_message(*draft_model(dome)))
    assert facts["widthRules"] == {
        "solid": SOLID,
        "open": SLIT,
        "closer": CROWDING,
        "closing": list(CLOSING_WIDTHS),
        "following": list(FOLLOWING_WIDTHS),
    }
    script = "".join(static_files()[name].decode() for name in ("pattern.js", "widths.js"))
    numbers = {"0.25", "1.25", *(str(x) for x in (*CLOSING_WIDTHS, *FOLLOWING_WIDTHS))}
    assert not numbers & set(re.findall(r"[\d.]+", script))
    assert all(f"rule.{name}" in script for name in facts["widthRules"])
