"""Builds of the page in a process that can be cancelled, and their folders of files."""

import io
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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import dsfab
from dsfab.app.carrier import carried, carried_preset
from dsfab.app.editor.jobs import JobProgress, Telling
from dsfab.app.editor.workspace import MeshRequest, Opened, Outputs, with_file
from dsfab.core.errors import DsfabError
from dsfab.design import draft, revise, run
from dsfab.design.design import Design
from dsfab.preset.model import Preset
from dsfab.preset.proposal import Decision
from dsfab.render.design_picture import caption
from dsfab.report.design.save import save


@dataclass(frozen=True)
class EditorBuild:
    """Files of a build, those of the preset's formats first, and facts about the solid for the page."""

    files: list[Path]
    facts: dict[str, Any]


@dataclass(frozen=True)
class BuildRequest:
    """A request to build a preset, reusing the stages of `old`.

    picture : also draw it.
    mesh    : mesh of the page; it is copied beside the files, and the preset there names the copy.
    only    : a single format, in a word of `dsfab export --to`; '' for all files of a build.
    before  : folder of an earlier build, which may hold this design.
    """

    preset: Preset
    old: Design | None = None
    picture: bool = False
    mesh: Path | None = None
    only: str = ""
    before: Path | None = None


def built(request: BuildRequest, folder: Path, progress: Telling) -> EditorBuild:
    """Make the solid and write the files of `dsfab build`.

    Raises DsfabError of the stage that refuses; `facts` reports a STEP file that is too large.
    """
    preset = request.preset
    design = _made(request, progress)
    if request.mesh:
        design = _beside(design, request.mesh, folder)
    saved = save(design, folder, progress, request.picture)
    asked = [folder / f"{preset.name}.{suffix}" for suffix in preset.export.formats]
    first = [path for path in asked if path.exists()]
    rest = sorted(path for path in folder.iterdir() if path not in first)
    facts = {
        "caption": caption(design),
        "mass": design.mass,
        "volume": design.solid.volume,
        "triangles": len(design.solid.F),
        "pieces": design.solid.pieces,
        "refused": saved.refused,
        "notes": [*(note.text for note in design.notes), *saved.told],
    }
    return EditorBuild([*first, *rest], facts)


def exported(request: BuildRequest, folder: Path, progress: Telling) -> EditorBuild:
    """Write one file as `dsfab export` does, of the design in the folder `before` or of a new one.

    Raises DsfabError of the stage that refuses or of the format.
    """
    from dsfab.app.export import CALCULIX, SUFFIX, ExportRequest, write_file
    from dsfab.design.output.archive import read_archive

    suffix = SUFFIX if request.only == CALCULIX else f".{request.only}"
    preset, before = request.preset, request.before
    there = with_file(preset, _copied(request.mesh, before)) if request.mesh and before else preset
    design = read_archive(before, there) if before else None
    ask = ExportRequest(suffix, folder / f"{preset.name}{suffix}", None)
    made = design or (None if suffix == SUFFIX else _made(request, progress))
    told = write_file(preset, made, ask, progress)
    return EditorBuild([ask.path], {"told": told})


def _made(request: BuildRequest, progress: Telling) -> Design:
    return revise(request.old, request.preset, progress) if request.old else run(request.preset, progress)


def _copied(mesh: Path, folder: Path) -> Path:
    return folder / f"surface{mesh.suffix}"


def _beside(design: Design, mesh: Path, folder: Path) -> Design:
    """Copy the mesh beside the files, where it outlives the session; return the design with the copy."""
    copy = Path(shutil.copy(mesh, _copied(mesh, folder)))
    made = {name: value for name, value in vars(design).items() if name != "preset"}
    return Design.known(with_file(design.preset, copy), **made)


def draw_png(
    preset: Preset, old: Design | None, view: str, show: str, size: tuple[int, int], progress: Telling
) -> bytes:
    """Return a PNG picture, drawn in this process. Raises DsfabError if this machine cannot draw."""
    from PIL import Image

    from dsfab.render import light
    from dsfab.render.colouring import asking
    from dsfab.render.previewer import Previewer

    made = draft(asking(preset, show), progress, old)
    progress("preview", "drawing")
    with Previewer(made, view=view, show=show) as previewer:
        pixels = previewer.picture(size, quality=light.QUICK)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


PROGRAM = "import sys; sys.path.append(sys.argv[1]); from dsfab.app.editor.builder import main; main()"


class BuilderError(RuntimeError):
    """A bug in the other process."""


def built_apart(request: BuildRequest, folder: Path, progress: JobProgress) -> EditorBuild:
    """Run `build_files`, or `export_file` for a single format, in another process.

    Raises what they raise, and Cancelled within a fraction of a second. On any error the process and its children end,
    and the folder is removed.
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
    """Run `opened_mesh` in another process; raises what it raises, and Cancelled within a fraction of a second."""
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
    """Final message of the process; report its progress.

    what, advice : words for the error if the process ends early.
    """
    lines: queue.Queue[bytes] = queue.Queue()
    for act in (lambda: _send(process, asked), lambda: _read(process, lines)):
        threading.Thread(target=act, daemon=True).start()
    while True:
        progress.check()
        try:
            line = lines.get(timeout=0.1)  # then `progress.check` looks for a cancellation
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
    with suppress(OSError):  # the process has ended
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
    """Run the program; at the end kill it and its children. Its temporary files go into `aside`."""
    home = str(Path(dsfab.__file__).parent.parent)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, home],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(aside))},
        start_new_session=True,  # a group of its own, which `_end` kills
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


class Builds:
    """Files of builds, by number; unfinished builds lie in `aside`."""

    def __init__(self, outputs: Outputs, aside: Path) -> None:
        self.outputs, self._aside = outputs, aside
        self._files: dict[int, list[Path]] = {}

    def file(self, build: int, index: int) -> Path | None:
        """Return a file by the number of its build and its index, because the page may name no path."""
        files = self._files.get(build, [])
        return files[index] if 0 <= index < len(files) else None

    @property
    def latest(self) -> list[Path]:
        """Files of the last build."""
        return list(self._files[max(self._files)]) if self._files else []

    def taken(self, name: str) -> dict[str, Any]:
        """Return the question before a build replaces files in the folder of this name; empty without such files."""
        count = self.outputs.standing(name)
        if not count:
            return {}
        place = f"{self.outputs.shown}/{name}"
        files = "1 file" if count == 1 else f"{count} files"
        would = "files of the same names, and what a build wrote there, would be replaced."
        text = f"{place} holds {files} of before; {would}"
        return {"taken": text, "free": self.outputs.free(name)}

    def make(self, request: BuildRequest, progress: JobProgress) -> dict[str, Any]:
        """Build, move the files to their folder, and return facts for the page. Raises DsfabError, and Cancelled."""

        name = request.preset.name
        request = replace(request, before=self.outputs.folder(name))
        folder = Path(tempfile.mkdtemp(prefix="build-", dir=self._aside))
        made = built_apart(request, folder, progress)
        there = self.outputs.publish(folder, name)
        folder.rmdir()
        number = len(self._files) + 1
        self._files[number] = files = [there / path.name for path in made.files]
        listed = [{"name": path.name, "bytes": path.stat().st_size} for path in files]
        place = f"{self.outputs.shown}/{name}" if self.outputs.shown else ""
        facts = made.facts
        if "told" in facts:  # name the final folder of the file
            facts = facts | {"told": [line.replace(str(folder), place or str(there)) for line in facts["told"]]}
        return {"build": number, "files": listed, "folder": place, **facts}
