"""Process that builds and reads for the editor; the editor may kill this process at any time.

standard input : 8 bytes n | n bytes of a pickled request; it stays open while the editor waits
standard output: a line of JSON for each progress, and a last line: done, refused or mistaken
"""

import json
import os
import pickle
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from dsfab.app.editor.jobs import ReportProgress
from dsfab.app.editor.workspace import MeshRequest, opened_mesh
from dsfab.core.errors import DsfabError
from dsfab.preset.file import preset_toml


def main() -> None:
    """Build, export or read as the request on standard input says."""
    output = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)  # output of libraries goes to standard error
    source = sys.stdin.buffer
    request, folder = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def progress(stage: str, text: str) -> None:
        _send_line(output, {"stage": stage, "text": text})

    try:
        final_message = (
            _open_mesh(request) if isinstance(request, MeshRequest) else _build_files(request, Path(folder), progress)
        )
    except DsfabError as error:
        _send_line(output, {"refused": str(error)})
    except Exception as error:  # a bug: the message invites the user to report this
        _send_line(output, {"mistaken": f"{type(error).__name__}: {error}"})
    else:
        _send_line(output, final_message)


def _build_files(request: Any, folder: Path, progress: ReportProgress) -> dict[str, Any]:
    from dsfab.app.editor.building import build_files, export_file

    result = (export_file if request.only else build_files)(request, folder, progress)
    return {"done": result.facts, "files": [path.name for path in result.files]}


def _open_mesh(request: MeshRequest) -> dict[str, Any]:
    opened = opened_mesh(request)
    return {"preset": preset_toml(opened.preset), "decided": [asdict(decision) for decision in opened.decided]}


def _send_line(output: TextIO, message: dict[str, Any]) -> None:
    output.write(json.dumps(message) + "\n")
    output.flush()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
