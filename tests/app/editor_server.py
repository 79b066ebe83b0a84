"""An editor that serves a coarse preset, and requests to it."""

import json
import threading
import time
from contextlib import contextmanager

import numpy as np

from dsfab.app.editor.server import EditorServer
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import OpenedPreset
from dsfab.app.options import Source
from dsfab.preset.file import load_preset, parse_override
from tests.presets import DOME_MODES

COARSE = {"surface.edge": 1.2}

COARSELY = Source(("surface.edge=1.2",))


def served_changes(page):
    """The names and numbers that the command line makes of a command."""
    import shlex

    words = shlex.split(page)
    sets = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    return words[2], dict(parse_override(text) for text in sets)


def unpacked(content):
    long = int.from_bytes(content[:4], "little")
    facts = json.loads(content[4 : 4 + long])
    arrays = {
        name: np.frombuffer(content, told["type"], int(np.prod(told["shape"])), 4 + long + told["at"]).reshape(
            told["shape"]
        )
        for name, told in facts["arrays"].items()
    }
    return facts, arrays


def wait(jobs, number, states=("done", "failed", "cancelled")):
    end = time.monotonic() + 60
    while jobs.job(number).state not in states:
        assert time.monotonic() < end
        time.sleep(0.005)
    return jobs.job(number)


@contextmanager
def serving(first=None, outputs=None):
    with Session(first or OpenedPreset(load_preset(DOME_MODES, COARSE), ("dome",)), outputs=outputs) as session:
        server = EditorServer(session)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
            server.server_close()
