"""State of the editor, independent of HTTP."""

import base64
import binascii
import itertools
import shlex
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from dsfab.app.editor.building import BuildRequest, Builds, draw_png, open_mesh_in_process
from dsfab.app.editor.controls import controls
from dsfab.app.editor.drafts import (
    colour_scales,
    cut_sheet_arrays,
    draft_model,
    pack_message,
    pattern_widths,
    sheet_figures,
    tidied_cut,
)
from dsfab.app.editor.jobs import JobProgress, Jobs
from dsfab.app.editor.workspace import MeshRequest, OpenedPreset, Outputs, VariantTray, opened_shipped, saved_preset
from dsfab.app.export import format_suffix
from dsfab.core.errors import DsfabError
from dsfab.core.materials import MATERIALS
from dsfab.core.toml_files import shipped_presets
from dsfab.core.units import METRES_PER
from dsfab.design import Design
from dsfab.export import temporary_folder
from dsfab.pattern.stripes import GLSL
from dsfab.preset.model import Preset
from dsfab.render.striped_mesh import StripedMesh
from dsfab.slicing import Sheet
from dsfab.surface import MESH_SUFFIXES

Changes = Mapping[str, Any]
Packed = tuple[dict[str, Any], dict[str, NDArray[Any]]]


@dataclass(frozen=True, eq=False)
class SessionView:
    """A draft (a design before the cut) that the page shows. number : number of the draft, from 1.
    version : number that increases, unless the new draft differs only in widths or in chosen modes.
    opening : number of the opened preset, from 1; each opening of a preset counts."""

    draft: Design
    number: int
    version: int
    opening: int


class Session:
    """The open preset, its last draft (a design before the cut), and builds; use as `with Session(opened)`.
    drafted : existing draft, or None.    outputs : folder for builds, with a name; None for a temporary folder."""

    def __init__(self, opened: OpenedPreset, drafted: Design | None = None, outputs: Outputs | None = None) -> None:
        self.jobs = Jobs()
        self._opened, self._opening = opened, 1
        self._shown = SessionView(drafted, 1, 1, 1) if drafted else None
        self._sketched: SessionView | None = None
        self._asked: tuple[int, int, Preset] | None = None
        self._lock = threading.RLock()
        self._kept: tuple[int, Packed] | None = None
        self._cut: tuple[SessionView, Sheet] | None = None
        self._meshes = itertools.count(1)
        self._folder = temporary_folder("dsfab-edit")
        temporary = Path(self._folder.name)
        self.variants = VariantTray()
        self.builds = Builds(outputs or Outputs(temporary / "outputs"), temporary)

    def __enter__(self) -> "Session":
        self.jobs.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.jobs.__exit__()
        finally:
            self._folder.cleanup()

    @property
    def current_preset(self) -> OpenedPreset:
        with self._lock:
            return self._opened

    def start(self) -> dict[str, Any]:
        """Return the values that the editor's page needs at its start."""
        with self._lock:
            opened, number = self._opened, self._opening
        return {
            "preset": opened.preset.model_dump(mode="json", exclude={"surface": {"file", "mesh"}}),
            "title": opened.preset.name,
            "opening": number,
            "presets": list(shipped_presets()),
            "units": list(METRES_PER),
            "meshes": list(MESH_SUFFIXES),
            "decided": [asdict(decision) for decision in opened.decided],
            "outputs": self.builds.outputs.label,
            "materials": {name: {**material.values, "says": material.says} for name, material in MATERIALS.items()},
            "variants": self.variants.records(),
            "wave": GLSL,
            "colours": colour_scales(),
        }

    def open_preset(self, name: str) -> dict[str, Any]:
        """Open a shipped preset; return the values of `start`."""
        return self._set_opened(opened_shipped(name))

    def open_toml(self, text: str) -> dict[str, Any]:
        """Open a preset from the text of a TOML file; return the values of `start`."""
        return self._set_opened(self.current_preset.open_toml(text))

    def open_variant(self, number: int) -> dict[str, Any]:
        """Open the preset of a variant; return the values of `start`, and the variant's changes as `changes`."""
        variant = self.variants[number]
        with self._lock:
            is_open = variant.opened is self._opened
            return {**(self.start() if is_open else self._set_opened(variant.opened)), "changes": dict(variant.changes)}

    def ask_mesh(self, name: str, unit: str | None, data: str) -> dict[str, Any]:
        """Start a job that opens a mesh file from the page; return the job's number as `job`. Raises DsfabError.
        data : content of the file in base64.    unit : unit of the file's numbers, or None if unknown."""
        suffix = Path(name).suffix.lower()
        if suffix not in MESH_SUFFIXES:
            raise DsfabError(
                f"{Path(name).name} is not a mesh file that dsfab reads; use one of {', '.join(MESH_SUFFIXES)}"
            )
        try:
            content = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError):
            raise DsfabError("the mesh file did not arrive completely; drop the file on the page again") from None
        path = Path(self._folder.name) / f"mesh-{next(self._meshes)}{suffix}"
        path.write_bytes(content)
        request = MeshRequest(path, Path(name).name, unit)
        return {"job": self.jobs.submit("open", lambda progress: self._mesh(request, progress))}

    def _mesh(self, request: MeshRequest, progress: JobProgress) -> dict[str, Any]:
        try:
            opened = open_mesh_in_process(request, progress)
        except BaseException:
            request.path.unlink(missing_ok=True)
            raise
        progress.check()
        return self._set_opened(opened)

    def _set_opened(self, opened: OpenedPreset) -> dict[str, Any]:
        with self._lock:
            self._opened, self._opening = opened, self._opening + 1
        return self.start()

    def preset_file(self, changes: Changes) -> dict[str, Any]:
        """Return the changed preset as a TOML file: keys `name` (file name) and `toml` (text)."""
        opened = self.current_preset
        return {"name": f"{opened.preset_with(changes).name}.toml", "toml": opened.toml(changes)}

    def command(self, changes: Changes) -> dict[str, Any]:
        """Return a dict: `command` is a command line that builds the changed preset.
        saved : path of the preset file that this function wrote for the command, or ''.
        save  : True if the user must save the preset file before the command."""
        opened, outputs = self.current_preset, self.builds.outputs
        command, save = opened.command(changes)
        if not (save and outputs.label):
            return {"command": command, "save": save, "saved": ""}
        path = saved_preset(opened, changes, outputs)
        place = f"{outputs.label}/{path.name}"
        return {"command": shlex.join(["dsfab", "build", place]), "save": False, "saved": place}

    def ask_solve(self, changes: Changes) -> int:
        """Start a job that solves the changed preset; return the job's number."""
        with self._lock:
            preset, number = self._opened.preset_with(changes), self._opening
            pending_request = self._asked
            if pending_request and pending_request[1:] == (number, preset) and self.jobs.pending(pending_request[0]):
                return pending_request[0]
            job = self.jobs.submit("solve", lambda progress: self._solve(preset, progress))
            self._asked = job, number, preset
        return job

    def ask_build(self, changes: Changes, replace: bool = True, only: str = "") -> dict[str, Any]:
        """Start a job that builds; return its number, or a question if files exist and `replace` is false.
        only : format of a single file, or ''. Raises ExportError if this format is not available."""
        opened = self.current_preset
        preset = opened.preset_with(changes)
        if only:
            format_suffix(only)
        if not replace and (question := self.builds.replacement_question(preset.name)):
            return question
        request = BuildRequest(preset, mesh=opened.page_mesh, only=only)
        return {"job": self.jobs.submit("export" if only else "build", lambda progress: self._build(request, progress))}

    def ask_members(self, judged: bool) -> int:
        """Start a job that measures the members of the design; return the job's number.
        judged : True to compute utilisation, too. Raises DsfabError before the first draft."""
        with self._lock:
            shown = self._shown
        if shown is None:
            raise DsfabError("dsfab has not solved the design yet; wait for its first picture")
        return self.jobs.submit("members", lambda progress: self._members(shown, judged))

    def ask_picture(self, changes: Changes, view: str, show: str, size: tuple[int, int]) -> int:
        """Start a job that draws a picture on this machine; return the job's number.
        view : direction of view.    show : picture of `Previewer`.    size : width and height, pixels."""
        preset = self.current_preset.preset_with(changes)
        return self.jobs.submit("picture", lambda progress: self._picture(preset, view, show, size, progress))

    def first_model(self) -> bytes:
        """Return the last draft as a message for a new page, or b''. Waits for the first draft or sketch."""
        shown = self._shown
        while shown is None and self._asked and self.jobs.pending(self._asked[0]):
            time.sleep(0.01)
            with self._lock:
                shown = self._shown or self._sketched
        return self._model(shown, 0) if shown else b""

    def model(self, have: int) -> bytes:
        """Return the last draft as a message for the page. Raises DsfabError before the first draft.
        have : version of the draft on the page. For an equal version the message has only widths and notes."""
        with self._lock:
            shown = self._shown
        if shown is None:
            raise DsfabError("dsfab has not solved the design yet; wait for its first picture")
        return self._model(shown, have)

    def cut_sheet(self, draft: int) -> bytes:
        """Return the cut sheet of draft number `draft` as a message; b'' if the latest cut was of another draft."""
        with self._lock:
            latest_cut = self._cut
        if not latest_cut or latest_cut[0].number != draft:
            return b""
        return pack_message({}, cut_sheet_arrays(latest_cut[0].draft, latest_cut[1]))

    def _model(self, shown: SessionView, have: int) -> bytes:
        facts, arrays = pattern_widths(shown.draft)
        facts |= {"draft": shown.number, "version": shown.version, "whole": have != shown.version}
        facts["opening"] = shown.opening
        if have != shown.version:
            version_facts, version_arrays = self._model_of_version(shown)
            facts |= version_facts | {"controls": controls(shown.draft.preset, shown.draft.surface)}
            arrays |= version_arrays
        return pack_message(facts, arrays)

    def _model_of_version(self, shown: SessionView) -> Packed:
        with self._lock:
            if self._kept is None or self._kept[0] != shown.version:
                self._kept = shown.version, draft_model(shown.draft)
            return self._kept[1]

    def _solve(self, preset: Preset, progress: JobProgress) -> dict[str, Any]:
        with self._lock:
            earlier, opening = self._shown, self._opening
        design = Design.from_preset(preset, earlier.draft if earlier else None, progress)
        if earlier is None and (sketch := design.sketch()):  # a new page shows the sketch first
            with self._lock:
                self._sketched = self._next_view(sketch, opening)
        solved = design.until("pattern")
        progress("pattern", "handing over")  # the user can cancel here for the last time
        with self._lock:
            self._shown = shown = self._next_view(solved, opening)
            self._sketched = None
        self.jobs.submit("figures", lambda progress: self._figures(shown, progress))
        return {"version": shown.version}

    def _next_view(self, draft: Design, opening: int) -> SessionView:
        earlier = self._shown or self._sketched
        if earlier is None:
            return SessionView(draft, 1, 1, opening)
        is_same = earlier.opening == opening and _same_model(draft, earlier.draft)
        return SessionView(draft, earlier.number + 1, earlier.version if is_same else earlier.version + 1, opening)

    def _figures(self, shown: SessionView, progress: JobProgress) -> dict[str, Any]:
        cut, notes = tidied_cut(shown.draft, progress)
        progress("slicing", "measuring members")
        measures = sheet_figures(shown.draft, cut, notes)
        with self._lock:
            self._cut = shown, cut.sheet
        return {"draft": shown.number, **measures}

    def _members(self, shown: SessionView, judged: bool) -> dict[str, Any]:
        from dsfab.render import member_places

        return {"draft": shown.number, **member_places(shown.draft, judged)}

    def _build(self, request: BuildRequest, progress: JobProgress) -> dict[str, Any]:
        from dsfab.render.opengl import why_no_pictures

        with self._lock:
            earlier = self._shown.draft if self._shown else None
        return self.builds.make(replace(request, old=earlier, picture=not why_no_pictures()), progress)

    def _picture(
        self, preset: Preset, view: str, show: str, size: tuple[int, int], progress: JobProgress
    ) -> dict[str, Any]:
        with self._lock:
            earlier = self._shown.draft if self._shown else None
        return {"png": base64.b64encode(draw_png(preset, earlier, view, show, size, progress)).decode()}


def _same_model(draft: Design, earlier: Design) -> bool:
    pattern, earlier_pattern = draft.preset.pattern, earlier.preset.pattern
    if pattern.region != earlier_pattern.region or (pattern.region and pattern.keep != earlier_pattern.keep):
        return False
    # a sketch has only rough statics, so the page needs the statics of the design
    if draft.statics is not earlier.statics or draft.diffusion is not earlier.diffusion:
        return False
    return StripedMesh.from_design(draft).is_same_mesh(StripedMesh.from_design(earlier))
