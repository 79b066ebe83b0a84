"""Program that builds and reads meshes for the editor, in a separate process.

standard input : the length n of the request (8 bytes), then the pickled request (n bytes)
standard output: lines of JSON. The first lines report the progress. The last line has the result (key `done` or
    `preset`), a DsfabError (`refused`), or an unexpected error (`mistaken`)."""

import json
import os
import pickle
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from dsfab.app.editor.workspace import MeshRequest, opened_mesh
from dsfab.core.errors import DsfabError
from dsfab.preset.file import preset_toml


def main() -> None:
    """Read a request from standard input, and write the result to standard output."""
    output = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)  # output of libraries goes to standard error
    source = sys.stdin.buffer
    request, folder = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def progress(stage: str, text: str) -> None:
        _send_line(output, {"stage": stage, "text": text})

    final_message: dict[str, Any]
    try:
        if isinstance(request, MeshRequest):
            opened = opened_mesh(request)
            decided = [asdict(decision) for decision in opened.decided]
            final_message = {"preset": preset_toml(opened.preset), "decided": decided}
        else:
            from dsfab.app.editor.building import build_files, export_file

            result = (export_file if request.only else build_files)(request, Path(folder), progress)
            final_message = {"done": result.facts, "files": [path.name for path in result.files]}
    except DsfabError as error:
        _send_line(output, {"refused": str(error)})
    except Exception as error:  # the editor's message asks the user to report this bug
        _send_line(output, {"mistaken": f"{type(error).__name__}: {error}"})
    else:
        _send_line(output, final_message)


def _send_line(output: TextIO, message: dict[str, Any]) -> None:
    output.write(json.dumps(message) + "\n")
    output.flush()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
