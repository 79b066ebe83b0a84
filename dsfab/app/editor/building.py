"""Builds that the page starts, and the folders of their files."""

import io
import json
import os
import pickle
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
from dsfab.app.editor.jobs import JobProgress, ReportProgress
from dsfab.app.editor.workspace import MeshRequest, OpenedPreset, Outputs, with_file
from dsfab.core.errors import DsfabError
from dsfab.design import draft, revise, run
from dsfab.design.design import Design
from dsfab.preset.file import preset_from_toml
from dsfab.preset.model import Preset
from dsfab.preset.proposal import Decision
from dsfab.render.design_picture import caption
from dsfab.report.design.save import save


@dataclass(frozen=True)
class EditorBuild:
    """Result of a build: paths of the files, and values that the editor's page shows."""

    files: list[Path]
    facts: dict[str, Any]


@dataclass(frozen=True)
class BuildRequest:
    """A request to build a preset.
    old    : earlier design; the build uses its unchanged results again.    mesh : mesh file from the page.
    only   : format of a single file, as in `dsfab export --to`; '' for all.    before : folder of an earlier build."""

    preset: Preset
    old: Design | None = None
    picture: bool = False
    mesh: Path | None = None
    only: str = ""
    before: Path | None = None


def build_files(request: BuildRequest, folder: Path, progress: ReportProgress) -> EditorBuild:
    """Build a preset and write all its files into `folder`. Raises DsfabError."""
    preset = request.preset
    design = _design_of_request(request, progress)
    if request.mesh:
        copy = Path(shutil.copy(request.mesh, _mesh_copy_path(request.mesh, folder)))
        design = replace(design, preset=with_file(design.preset, copy))
    saved = save(design, folder, progress, request.picture)
    wanted_files = [folder / f"{preset.name}.{suffix}" for suffix in preset.export.formats]
    requested_files = [path for path in wanted_files if path.exists()]
    rest = sorted(path for path in folder.iterdir() if path not in requested_files)
    facts = {
        "caption": caption(design),
        "mass": design.mass,
        "volume": design.solid.volume,
        "triangles": len(design.solid.F),
        "pieces": design.solid.pieces,
        "refused": saved.refused,
        "notes": [*(note.text for note in design.notes), *saved.messages],
    }
    return EditorBuild([*requested_files, *rest], facts)


def export_file(request: BuildRequest, folder: Path, progress: ReportProgress) -> EditorBuild:
    """Write one file in the format `request.only`. Raises DsfabError."""
    from dsfab.app.export import CALCULIX, CALCULIX_SUFFIX, ExportRequest, write_file
    from dsfab.design.output.archive import read_archive

    suffix = CALCULIX_SUFFIX if request.only == CALCULIX else f".{request.only}"
    preset, before = request.preset, request.before
    preset_of_build = with_file(preset, _mesh_copy_path(request.mesh, before)) if request.mesh and before else preset
    design = read_archive(before, preset_of_build) if before else None
    export_request = ExportRequest(suffix, folder / f"{preset.name}{suffix}", None)
    current = design or (None if suffix == CALCULIX_SUFFIX else _design_of_request(request, progress))
    lines = write_file(preset, current, export_request, progress)
    return EditorBuild([export_request.path], {"told": lines})


def _design_of_request(request: BuildRequest, progress: ReportProgress) -> Design:
    return revise(request.old, request.preset, progress) if request.old else run(request.preset, progress)


def _mesh_copy_path(mesh: Path, folder: Path) -> Path:
    return folder / f"surface{mesh.suffix}"


def draw_png(
    preset: Preset, earlier: Design | None, view: str, show: str, size: tuple[int, int], progress: ReportProgress
) -> bytes:
    """Return a picture of a preset as the bytes of a PNG file. Raises DsfabError if drawing fails.
    earlier : design whose results are used again if they are unchanged.    size : width and height, pixels."""
    from PIL import Image

    from dsfab.render import light
    from dsfab.render.colouring import preset_with_mode
    from dsfab.render.previewer import Previewer

    drawn_draft = draft(preset_with_mode(preset, show), progress, earlier)
    progress("preview", "drawing")
    with Previewer(drawn_draft, view=view, show=show) as previewer:
        pixels = previewer.picture(size, quality=light.QUICK)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


PROGRAM = "import sys; sys.path.append(sys.argv[1]); from dsfab.app.editor.builder import main; main()"


class BuilderError(RuntimeError):
    """Unexpected error in the separate process that builds a preset."""


def build_in_process(request: BuildRequest, folder: Path, progress: JobProgress) -> EditorBuild:
    """Build a preset, or export a single format, in another process. Raises DsfabError and Cancelled.
    After an error, `folder` is removed."""
    message = pickle.dumps((request, str(folder)), protocol=5)
    try:
        with (
            tempfile.TemporaryDirectory(dir=folder.parent, ignore_cleanup_errors=True) as temporary,
            _process(Path(temporary)) as process,
        ):
            answer = _final_message(
                process, message, progress, "the build", "choose fewer kinds of files, and build again"
            )
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return EditorBuild([folder / name for name in answer["files"]], answer["done"])


def open_mesh_in_process(request: MeshRequest, progress: JobProgress) -> OpenedPreset:
    """Read a mesh in another process, and return the preset that dsfab proposes. Raises DsfabError and Cancelled."""
    progress("surface", f"reading {request.name}")
    message = pickle.dumps((request, ""), protocol=5)
    with (
        tempfile.TemporaryDirectory(dir=request.path.parent, ignore_cleanup_errors=True) as temporary,
        _process(Path(temporary)) as process,
    ):
        answer = _final_message(process, message, progress, "reading the mesh", "make it coarser")
    decided = tuple(Decision(**decision) for decision in answer["decided"])
    return OpenedPreset(preset_from_toml(answer["preset"]), (), request.name, decided)


def _final_message(
    process: "subprocess.Popen[bytes]", request_bytes: bytes, progress: JobProgress, subject: str, advice: str
) -> dict[str, Any]:
    lines: queue.Queue[bytes] = queue.Queue()
    for act in (lambda: _send(process, request_bytes), lambda: _read(process, lines)):
        threading.Thread(target=act, daemon=True).start()
    while True:
        progress.check()
        try:
            line = lines.get(timeout=0.1)  # after 0.1 s without a line, the loop looks for a cancellation
        except queue.Empty:
            continue
        if not line:
            code = process.wait()
            raise DsfabError(f"{subject} stopped too early (exit code {code}); {advice}")
        message: dict[str, Any] = json.loads(line)
        if "stage" in message:
            progress(message["stage"], message["text"])
        elif "refused" in message:
            raise DsfabError(message["refused"])
        elif "mistaken" in message:
            raise BuilderError(message["mistaken"])
        else:
            return message


def _send(process: "subprocess.Popen[bytes]", message: bytes) -> None:
    assert process.stdin is not None
    with suppress(OSError):  # the process has ended already
        process.stdin.write(len(message).to_bytes(8, "little") + message)
        process.stdin.flush()


def _read(process: "subprocess.Popen[bytes]", lines: "queue.Queue[bytes]") -> None:
    assert process.stdout is not None
    with suppress(OSError, ValueError):
        for line in process.stdout:
            lines.put(line)
    lines.put(b"")


@contextmanager
def _process(temporary: Path) -> Iterator["subprocess.Popen[bytes]"]:
    home = str(Path(dsfab.__file__).parent.parent)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, home],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary))},
        start_new_session=True,  # lets `_end` kill all child processes, too
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
    """The builds of an editor session; each build has a number and files."""

    def __init__(self, outputs: Outputs, aside: Path) -> None:
        self.outputs, self._aside = outputs, aside
        self._files: dict[int, list[Path]] = {}

    def file(self, build: int, index: int) -> Path | None:
        """Return the path of file `index` (from 0) of build number `build`; None if the file does not exist."""
        files = self._files.get(build, [])
        return files[index] if 0 <= index < len(files) else None

    @property
    def latest(self) -> list[Path]:
        """Files of the latest build."""
        return list(self._files[max(self._files)]) if self._files else []

    def replacement_question(self, name: str) -> dict[str, Any]:
        """Return {} if folder `name` has no old files; else a warning as `taken`, and an unused name as `free`."""
        count = self.outputs.foreign_files(name)
        if not count:
            return {}
        words = f"{self.outputs.label}/{name} holds {'1 file' if count == 1 else f'{count} files'} of before; "
        text = words + "a new build would replace files with the same names, and all files of an earlier build."
        return {"taken": text, "free": self.outputs.free_name(name)}

    def make(self, request: BuildRequest, progress: JobProgress) -> dict[str, Any]:
        """Build a preset; return its number, folder, files and results for JSON. Raises DsfabError and Cancelled."""
        name = request.preset.name
        request = replace(request, before=self.outputs.folder(name))
        folder = Path(tempfile.mkdtemp(prefix="build-", dir=self._aside))
        result = build_in_process(request, folder, progress)
        published = self.outputs.publish(folder, name)
        folder.rmdir()
        number = len(self._files) + 1
        self._files[number] = files = [published / path.name for path in result.files]
        listed = [{"name": path.name, "bytes": path.stat().st_size} for path in files]
        place = f"{self.outputs.label}/{name}" if self.outputs.label else ""
        facts = result.facts
        if "told" in facts:  # replace the temporary folder in messages by the final folder
            facts = facts | {"told": [line.replace(str(folder), place or str(published)) for line in facts["told"]]}
        return {"build": number, "files": listed, "folder": place, **facts}
