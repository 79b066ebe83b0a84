"""The program that builds for the editor: a process of its own, which can be ended in the middle of anything.

standard input : 8 bytes n | n bytes of what `building.built` takes; it stays open for as long as anybody waits
standard output: one line of JSON for each progress, and a last one: done, refused or mistaken
"""

import json
import os
import pickle
import sys
import threading
from pathlib import Path
from typing import Any, TextIO

from dsfab.errors import DsfabError


def main() -> None:
    """Build, or export, what standard input asks for."""
    tell = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)  # what libraries print is none of it
    source = sys.stdin.buffer
    request, folder = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from dsfab.app.editor.building import built, exported

    def progress(stage: str, text: str) -> None:
        _say(tell, {"stage": stage, "text": text})

    try:
        made = (exported if request.only else built)(request, Path(folder), progress)
    except DsfabError as error:
        _say(tell, {"refused": str(error)})
    except Exception as error:  # the person is asked to report it
        _say(tell, {"mistaken": f"{type(error).__name__}: {error}"})
    else:
        _say(tell, {"done": made.facts, "files": [path.name for path in made.files]})


def _say(tell: TextIO, told: dict[str, Any]) -> None:
    tell.write(json.dumps(told) + "\n")
    tell.flush()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
