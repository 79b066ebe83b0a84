"""The process that builds and reads for the editor; the editor may kill it at any time.

standard input : 8 bytes n | n bytes of a pickled request; it stays open while the editor waits
standard output: a line of JSON for each progress, and a last one: done, refused or mistaken
"""

import json
import os
import pickle
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from dsfab.app.editor.jobs import Telling
from dsfab.app.editor.workspace import MeshRequest, opened_mesh
from dsfab.core.errors import DsfabError
from dsfab.preset.file import preset_toml


def main() -> None:
    """Build, export or read as the request on standard input says."""
    tell = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)  # so that libraries print to standard error
    source = sys.stdin.buffer
    request, folder = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def progress(stage: str, text: str) -> None:
        _say(tell, {"stage": stage, "text": text})

    try:
        last = _opened(request) if isinstance(request, MeshRequest) else _built(request, Path(folder), progress)
    except DsfabError as error:
        _say(tell, {"refused": str(error)})
    except Exception as error:  # a bug, which the user is asked to report
        _say(tell, {"mistaken": f"{type(error).__name__}: {error}"})
    else:
        _say(tell, last)


def _built(request: Any, folder: Path, progress: Telling) -> dict[str, Any]:
    from dsfab.app.editor.building import built, exported

    made = (exported if request.only else built)(request, folder, progress)
    return {"done": made.facts, "files": [path.name for path in made.files]}


def _opened(request: MeshRequest) -> dict[str, Any]:
    found = opened_mesh(request)
    return {"preset": preset_toml(found.preset), "decided": [asdict(one) for one in found.decided]}


def _say(tell: TextIO, told: dict[str, Any]) -> None:
    tell.write(json.dumps(told) + "\n")
    tell.flush()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
