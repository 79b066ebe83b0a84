"""Builds and readings of meshes in a process of their own: cancelled at once, wherever they are."""

import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import dsfab
from dsfab.app.carrier import carried, carried_preset
from dsfab.app.editor.building import BuildRequest, EditorBuild
from dsfab.app.editor.job import JobProgress
from dsfab.app.editor.source import MeshRequest, Opened
from dsfab.errors import DsfabError
from dsfab.proposal import Decision

PAUSE = 0.1
"""Seconds after which somebody looks whether the job was cancelled."""

PROGRAM = "import sys; sys.path.append(sys.argv[1]); from dsfab.app.editor.builder import main; main()"


class BuilderError(RuntimeError):
    """A mistake of ours in the other process."""


def built_apart(request: BuildRequest, folder: Path, progress: JobProgress) -> EditorBuild:
    """What `building.built` makes, or `exported` where one file is wanted.

    Raises what it raises, and Cancelled within a fraction of a second.

    Whatever ends it before its end: the process and those that it began are ended, and the folder is gone.
    """
    asked = carried((request, str(folder)))
    try:
        with (
            tempfile.TemporaryDirectory(dir=folder.parent, ignore_cleanup_errors=True) as aside,
            _process(Path(aside)) as process,
        ):
            told = _followed(process, asked, progress, "the build", "build with fewer kinds of files")
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return EditorBuild([folder / name for name in told["files"]], told["done"])


def opened_apart(request: MeshRequest, progress: JobProgress) -> Opened:
    """What `source.opened_mesh` makes; raises what it raises, and Cancelled within a fraction of a second."""
    progress("surface", f"reading {request.name}")
    asked = carried((request, ""))
    with (
        tempfile.TemporaryDirectory(dir=request.path.parent, ignore_cleanup_errors=True) as aside,
        _process(Path(aside)) as process,
    ):
        told = _followed(process, asked, progress, "reading the mesh", "make it coarser")
    return Opened(carried_preset(told["preset"]), (), request.name, tuple(Decision(**one) for one in told["decided"]))


def _followed(
    process: "subprocess.Popen[bytes]", asked: bytes, progress: JobProgress, what: str, advice: str
) -> dict[str, Any]:
    """The last thing it says; its progress is told on the way.

    what, advice : of the sentence that says that it ended before.
    """
    lines: queue.Queue[bytes] = queue.Queue()
    for act in (lambda: _send(process, asked), lambda: _read(process, lines)):
        threading.Thread(target=act, daemon=True).start()
    while True:
        progress.check()
        try:
            line = lines.get(timeout=PAUSE)
        except queue.Empty:
            continue
        if not line:
            code = process.wait()
            raise DsfabError(f"{what} ended before its end (exit code {code}); {advice}")
        told: dict[str, Any] = json.loads(line)
        if "stage" in told:
            progress(told["stage"], told["text"])
        elif "refused" in told:
            raise DsfabError(told["refused"])
        elif "mistaken" in told:
            raise BuilderError(told["mistaken"])
        else:
            return told


def _send(process: "subprocess.Popen[bytes]", asked: bytes) -> None:
    assert process.stdin is not None
    with suppress(OSError):  # it was ended
        process.stdin.write(len(asked).to_bytes(8, "little") + asked)
        process.stdin.flush()


def _read(process: "subprocess.Popen[bytes]", lines: "queue.Queue[bytes]") -> None:
    assert process.stdout is not None
    with suppress(OSError, ValueError):
        for line in process.stdout:
            lines.put(line)
    lines.put(b"")


@contextmanager
def _process(aside: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """The program; at the end it is ended with all that it began. Its temporary files go into `aside`."""
    home = str(Path(dsfab.__file__).parent.parent)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, home],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(aside))},
        start_new_session=True,  # a group of its own
    )
    try:
        yield process
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    if os.name == "nt":
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True, check=False)
    else:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe:
            with suppress(OSError):
                pipe.close()
