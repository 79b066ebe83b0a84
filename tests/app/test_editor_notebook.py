"""The editor in a notebook: anywidget's contract on both sides, played by a page and a comm of our own."""

import base64
import gzip
import json
import queue
import re
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

import dsfab
from dsfab.app.editor.page import static_files, widget_module
from dsfab.core.errors import DsfabError, PresetError
from dsfab.design import draft
from dsfab.preset.file import load_preset
from tests.browser import browser, opened
from tests.presets import DOME_MODES

COARSE = {"surface.edge": 1.2}

HOST = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><div id="cell"></div>
<script type="module">
const heard = {};
const call = (event, ...told) => [...(heard[event] ?? [])].forEach((hear) => hear(...told));
const send = (data) => fetch('/send', { method: 'POST', body: JSON.stringify(data) });
const state = await (await fetch('/state')).json();
let dirty = {};
const model = {
  get: (name) => state[name],
  set(name, value) {
    if (JSON.stringify(state[name]) === JSON.stringify(value)) return;
    state[name] = dirty[name] = value;
    call(`change:${name}`);
  },
  save_changes() {
    send({ method: 'update', state: dirty, buffer_paths: [] });
    dirty = {};
  },
  send: (content) => send({ method: 'custom', content }),
  on: (event, hear) => (heard[event] ??= new Set()).add(hear),
  off: (event, hear) => heard[event]?.delete(hear),
};
const bytes = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
new EventSource('/messages').onmessage = ({ data: text }) => {
  const { data, buffers } = JSON.parse(text);
  if (data.method === 'update') for (const [name, value] of Object.entries(data.state)) {
    state[name] = value;
    call(`change:${name}`);
  }
  if (data.method === 'custom') call('msg:custom', data.content, buffers.map(bytes));
};
const url = URL.createObjectURL(new Blob([state._esm], { type: 'text/javascript' }));
const { default: widget } = await import(url);
window.model = model;
window.heard = heard;
window.leave = widget.render({ model, el: document.getElementById('cell') });
</script>"""
"""A notebook's half of the contract (anywidget.dev, Anywidget Front-End Module): a model, and `render({model, el})`."""


class Wire:
    """A comm as ipywidgets makes one: what Python sends is queued for the page, what the page sends comes in here."""

    def __init__(self, **_):
        self.comm_id, self.kernel, self.sent = "wire", "here", queue.Queue()

    def send(self, data=None, metadata=None, buffers=None):
        self.sent.put(
            json.dumps({"data": data, "buffers": [base64.b64encode(part).decode() for part in buffers or ()]})
        )

    def on_msg(self, hear):
        self.hear = hear

    def close(self, *_, **__):
        self.sent.put(None)

    def receive(self, data):
        self.hear({"content": {"data": data}, "buffers": []})


class Handler(BaseHTTPRequestHandler):
    """A notebook server with one cell."""

    def do_GET(self):
        if self.path == "/messages":
            self.begin("text/event-stream")
            while (text := self.server.wire.sent.get()) is not None:
                self.wfile.write(f"data: {text}\n\n".encode())
            return
        told = json.dumps(self.server.editor.get_state()) if self.path == "/state" else HOST
        self.begin("text/html" if self.path == "/" else "application/json")
        self.wfile.write(told.encode())

    def do_POST(self):
        data = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        with self.server.one_at_a_time:  # as a kernel does
            self.server.wire.receive(data)
        self.begin("text/plain")

    def begin(self, kind):
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.end_headers()

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def editor():
    pytest.importorskip("anywidget")
    import comm

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(comm, "create_comm", Wire)
        patched.setattr("dsfab.render.opengl.why_no_pictures", lambda: "not now")
        made = dsfab.edit(draft(load_preset(DOME_MODES, {**COARSE, "export.formats": ["stl"]})))
        yield made
        made.close()


@pytest.fixture(scope="module")
def tab(editor, tmp_path_factory):
    if browser() is None:
        pytest.skip("no Chromium or Chrome is installed")
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.editor, server.wire, server.one_at_a_time = editor, editor.comm, threading.Lock()
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        with opened(tmp_path_factory.mktemp("notebook"), (980, 700)) as tab:
            tab.open(f"http://127.0.0.1:{server.server_address[1]}/", READY)
            yield tab
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


PAGE = "document.querySelector('iframe').contentWindow"
READY = f"!!(window.leave && {PAGE}.dsfab?.done)"
SEEN = f"{PAGE}.dsfab.viewer.mask().seen.reduce((a, b) => a + b, 0)"


def until(true, seconds=60):
    end = time.monotonic() + seconds
    while not (value := true()):
        assert time.monotonic() < end
        time.sleep(0.03)
    return value


def of(tab, identifier):
    return f"{PAGE}.document.getElementById('{identifier}')"


@pytest.mark.slow
def test_a_slider_of_the_widget_changes_the_picture_and_the_python_value(tab, editor):
    before = tab.run(SEEN)
    assert before > 1000
    at = of(tab, "pattern-width-solid_fraction")
    tab.run(f"{at}.value = '0.75'; {at}.dispatchEvent(new Event('change'))")
    assert tab.run(SEEN) > 1.2 * before
    until(lambda: editor.changes == {"pattern.width.solid_fraction": 0.75})
    assert editor.preset.pattern.width.solid_fraction == 0.75
    until(lambda: tab.run(f"{of(tab, 'f-share')}.textContent") == "75.0 %")  # measured in Python


@pytest.mark.slow
def test_a_change_from_python_updates_the_picture(tab, editor):
    editor.changes = {"pattern.width.solid_fraction": 0.3}
    until(lambda: tab.run(f"{of(tab, 'pattern-width-solid_fraction')}.value") == "0.3")
    until(lambda: tab.run(f"{of(tab, 'f-share')}.textContent") == "30.0 %")
    few = tab.run(SEEN)
    editor.changes = {}
    until(lambda: tab.run(f"JSON.stringify({PAGE}.dsfab.state.changes)") == "{}")
    assert tab.run(SEEN) > 1.2 * few


@pytest.mark.slow
def test_an_invalid_input_is_reported_on_the_page(tab, editor):
    at = of(tab, "diffusion-r")
    tab.run(f"{at}.value = '0.5'; {at}.dispatchEvent(new Event('change'))")
    assert "diffusion.r" in until(lambda: tab.run(f"{of(tab, 'notice')}.textContent"))
    until(lambda: editor.changes)
    with pytest.raises(PresetError, match=r"diffusion\.r"):
        _ = editor.preset
    editor.changes = {}
    until(lambda: tab.run(f"{of(tab, 'notice')}.hidden"))


@pytest.mark.slow
def test_a_solid_is_built_and_its_file_arrives(tab, editor):
    import trimesh

    tab.run(f"{of(tab, 'build')}.click()")
    link = f"{PAGE}.document.querySelector('#built a')"
    until(lambda: tab.run(f"!!{link}"), 120)
    assert editor.files[0].suffix == ".stl"
    assert trimesh.load(editor.files[0]).is_volume
    tab.run(f"window.taken = []; {PAGE}.URL.createObjectURL = (blob) => {{ taken.push(blob.size); return 'data:,'; }}")
    tab.run(f"{link}.click()")
    assert until(lambda: tab.run("taken[0]")) == editor.files[0].stat().st_size


@pytest.mark.slow
def test_the_cell_may_be_shown_again_and_taken_away(tab, editor):
    editor.changes = {"pattern.keep": 0.5}
    until(lambda: tab.run(f"JSON.stringify({PAGE}.dsfab.state.changes)") == '{"pattern.keep":0.5}')
    tab.run("document.body.append(document.getElementById('cell'))")  # as notebooks do: the frame loads again
    until(lambda: tab.run(READY))
    assert tab.run(f"{PAGE}.dsfab.state.changes") == {"pattern.keep": 0.5}
    assert tab.run("heard['msg:custom'].size") == 1
    tab.run("leave()")
    until(lambda: tab.run("heard['msg:custom'].size") == 0)


def test_the_widget_makes_no_error_and_no_foreign_request(tab):
    assert tab.errors == []
    assert [url for url in tab.requests if not url.startswith(("http://127.0.0.1:", "data:", "blob:", "about:"))] == []


def test_the_bundle_contains_all_modules_that_it_imports():
    packed = re.search(r"PACKED = '([^']+)'", widget_module())[1]
    parts = json.loads(gzip.decompress(base64.b64decode(packed)))
    line = re.compile(r"""^(?:import|export)[^'"=(]*from ['"]([^'"]+)""", re.M)
    named = {at for text in parts["modules"].values() for at in line.findall(text)}
    assert "dsfab/vendor/three.core.js" in named
    assert named - {"three"} <= set(parts["modules"])
    assert "X-Dsfab-Token" not in "".join(parts["modules"].values())  # no way to a server
    # both ways to speak with Python offer the same
    offers = [
        set(re.findall(r"^export (?:async )?(?:function|const) (\w+)", text, re.M))
        for text in (static_files()["transport.js"].decode(), parts["modules"]["dsfab/transport.js"])
    ]
    assert offers[0] == offers[1] >= {"post", "model", "listen"}


def test_the_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "dsfab.app.editor.widget", raising=False)
    with pytest.raises(
        DsfabError, match=r'^the widget needs anywidget; install it with: pip install "dsfab\[notebook\]"$'
    ):
        dsfab.edit("dome")


def test_python_refuses_keys_that_no_preset_has(editor):
    before = editor.changes
    with pytest.raises(PresetError, match=r"pattern\.major\.threshold"):
        editor.changes = {"pattern.major.threshold": 7}
    assert editor.changes == before


def test_a_draft_is_shown_without_solving(editor):
    assert len(editor._session.model(0)) > 10_000  # a session that has solved nothing refuses


def test_an_unknown_preset_name_is_refused():
    pytest.importorskip("anywidget")
    with pytest.raises(PresetError, match="dome"):
        dsfab.edit("domme")
