"""The state behind a page of the editor, independent of HTTP."""

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

from dsfab.app.editor.building import BuildRequest, Builds, opened_apart
from dsfab.app.editor.controls import controls
from dsfab.app.editor.drafts import colours, model, packed, widths
from dsfab.app.editor.jobs import JobProgress, Jobs
from dsfab.app.editor.workspace import MeshRequest, Opened, Outputs, VariantTray, opened_shipped, saved_preset
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
    """A draft with its number; `version` changes with the data that stripes alone do not change, which the page
    keeps.
    """

    draft: Design
    number: int
    version: int
    opening: int


class Session:
    """The open preset, its last draft, and the files of builds; use as `with Session(opened)`.

    made    : a draft of the first preset, which the page then shows at once.
    outputs : folder of builds and its name; None puts them into a temporary folder of the session.
    """

    def __init__(self, first: Opened, made: Design | None = None, outputs: Outputs | None = None) -> None:
        self.jobs = Jobs()
        self._opened, self._opening = first, 1
        self._shown = SessionView(made, 1, 1, 1) if made else None
        self._sketched: SessionView | None = None
        self._asked: tuple[int, int, Preset] | None = None
        self._lock = threading.RLock()
        self._kept: tuple[int, Packed] | None = None
        self._cut: tuple[SessionView, Sheet] | None = None
        self._meshes = itertools.count(1)
        self._folder = temporary_folder("dsfab-edit")
        aside = Path(self._folder.name)
        self.variants = VariantTray()
        self.builds = Builds(outputs or Outputs(aside / "outputs"), aside)

    def __enter__(self) -> "Session":
        self.jobs.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.jobs.__exit__()
        finally:
            self._folder.cleanup()

    @property
    def opened(self) -> Opened:
        """The open preset."""
        with self._lock:
            return self._opened

    def start(self) -> dict[str, Any]:
        """Return the facts that the page needs before the first solution."""
        with self._lock:
            now, number = self._opened, self._opening
        return {
            "preset": now.preset.model_dump(mode="json", exclude={"surface": {"file", "mesh"}}),
            "title": now.preset.name,
            "opening": number,
            "presets": list(shipped_presets()),
            "units": list(METRES_PER),
            "meshes": list(MESH_SUFFIXES),
            "decided": [asdict(decision) for decision in now.decided],
            "outputs": self.builds.outputs.shown,
            "materials": {name: {**one.values, "says": one.says} for name, one in MATERIALS.items()},
            "variants": self.variants.listed(),
            "wave": GLSL,
            "colours": colours(),
        }

    def open_preset(self, name: str) -> dict[str, Any]:
        """Open a shipped preset."""
        return self._open(opened_shipped(name))

    def open_toml(self, text: str) -> dict[str, Any]:
        """Open a preset file that the page sends."""
        return self._open(self.opened.reopened(text))

    def open_variant(self, number: int) -> dict[str, Any]:
        """Return to a variant; `changes` are those over the preset that is then open."""
        variant = self.variants[number]
        with self._lock:
            same = variant.opened is self._opened
            return {**(self.start() if same else self._open(variant.opened)), "changes": dict(variant.changes)}

    def ask_mesh(self, name: str, unit: str | None, data: str) -> dict[str, Any]:
        """Start a job that opens a mesh from the page, base64; the file here has a name of ours.

        Another process reads it, so that the page goes on and the user may cancel.
        """
        suffix = Path(name).suffix.lower()
        if suffix not in MESH_SUFFIXES:
            raise DsfabError(f"{Path(name).name} is no mesh that dsfab reads; use one of {', '.join(MESH_SUFFIXES)}")
        try:
            content = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError):
            raise DsfabError("the mesh did not arrive whole; drop it again") from None
        path = Path(self._folder.name) / f"mesh-{next(self._meshes)}{suffix}"
        path.write_bytes(content)
        request = MeshRequest(path, Path(name).name, unit)
        return {"job": self.jobs.ask("open", lambda progress: self._mesh(request, progress))}

    def _mesh(self, request: MeshRequest, progress: JobProgress) -> dict[str, Any]:
        try:
            found = opened_apart(request, progress)
        except BaseException:
            request.path.unlink(missing_ok=True)
            raise
        progress.check()
        return self._open(found)

    def _open(self, new: Opened) -> dict[str, Any]:
        with self._lock:
            self._opened, self._opening = new, self._opening + 1
        return self.start()

    def preset_file(self, changes: Changes) -> dict[str, Any]:
        """Return the changed preset as a file."""
        now = self.opened
        return {"name": f"{now.changed(changes).name}.toml", "toml": now.toml(changes)}

    def command(self, changes: Changes) -> dict[str, Any]:
        """Return the command of the build, and the preset file that was saved for it, or that the page has to save
        first.
        """
        now, outputs = self.opened, self.builds.outputs
        command, save = now.command(changes)
        if not (save and outputs.shown):
            return {"command": command, "save": save, "saved": ""}
        path = saved_preset(now, changes, outputs)
        place = f"{outputs.shown}/{path.name}"
        return {"command": shlex.join(["dsfab", "build", place]), "save": False, "saved": place}

    def ask_solve(self, changes: Changes) -> int:
        """Start a job that solves these changes and then measures the design; return the running one if it does so
        already.
        """
        with self._lock:
            preset, number = self._opened.changed(changes), self._opening
            asked = self._asked
            if asked and asked[1:] == (number, preset) and self.jobs.pending(asked[0]):
                return asked[0]
            job = self.jobs.ask("solve", lambda progress: self._solve(preset, progress))
            self._asked = job, number, preset
        return job

    def ask_build(self, changes: Changes, replace: bool = True, only: str = "") -> dict[str, Any]:
        """Start a job that makes the solid and its files; or return a question first, unless it may `replace` files.

        only : one format, in a word of `dsfab export --to`. Raises ExportError for a format that is not available.
        """
        now = self.opened
        preset = now.changed(changes)
        if only:
            format_suffix(only)
        if not replace and (question := self.builds.taken(preset.name)):
            return question
        request = BuildRequest(preset, mesh=now.page_mesh, only=only)
        return {"job": self.jobs.ask("export" if only else "build", lambda progress: self._build(request, progress))}

    def ask_members(self, judged: bool) -> int:
        """Start a job that names and measures the members of the last draft; judged: with their utilisation.

        Raises DsfabError before the first draft.
        """
        with self._lock:
            shown = self._shown
        if shown is None:
            raise DsfabError("nothing is solved yet")
        return self.jobs.ask("members", lambda progress: self._members(shown, judged))

    def ask_picture(self, changes: Changes, view: str, show: str, size: tuple[int, int]) -> int:
        """Start a job that draws the structure here, for browsers without WebGL."""
        preset = self.opened.changed(changes)
        return self.jobs.ask("picture", lambda progress: self._picture(preset, view, show, size, progress))

    def early(self) -> bytes:
        """Return the last draft, or a sketch of the first one, for a page that opens; empty if neither is in
        progress.
        """
        shown = self._shown
        while shown is None and self._asked and self.jobs.pending(self._asked[0]):
            time.sleep(0.01)
            with self._lock:
                shown = self._shown or self._sketched
        return self._model(shown, 0) if shown else b""

    def model(self, have: int) -> bytes:
        """Return the last draft, for a page that has version `have`. Raises DsfabError before the first."""
        with self._lock:
            shown = self._shown
        if shown is None:
            raise DsfabError("nothing is solved yet")
        return self._model(shown, have)

    def cut(self, draft: int) -> bytes:
        """Return the measured cut sheet of a draft (`drafts.cut_sheet_arrays`); empty for another draft."""
        from dsfab.app.editor.drafts import settled

        with self._lock:
            last = self._cut
        return packed({}, settled(last[0].draft, last[1])) if last and last[0].number == draft else b""

    def _model(self, shown: SessionView, have: int) -> bytes:
        facts, arrays = widths(shown.draft)
        facts |= {"draft": shown.number, "version": shown.version, "whole": have != shown.version}
        facts["opening"] = shown.opening
        if have != shown.version:
            more, large = self._whole(shown)
            facts |= more | {"controls": controls(shown.draft.preset, shown.draft.surface)}
            arrays |= large
        return packed(facts, arrays)

    def _whole(self, shown: SessionView) -> Packed:
        """Result of `model` for a version; the last one is kept, because pages may load again."""
        with self._lock:
            if self._kept is None or self._kept[0] != shown.version:
                self._kept = shown.version, model(shown.draft)
            return self._kept[1]

    def _solve(self, preset: Preset, progress: JobProgress) -> dict[str, Any]:
        with self._lock:
            old, opening = self._shown, self._opening
        design = Design.of(preset, old.draft if old else None, progress)
        if old is None and (sketch := design.sketch()):  # for a new page, until the widths are solved
            with self._lock:
                self._sketched = self._following(sketch, opening)
        made = design.until("pattern")
        progress("pattern", "handing over")  # the last chance to cancel
        with self._lock:
            self._shown = shown = self._following(made, opening)
            self._sketched = None
        self.jobs.ask("figures", lambda progress: self._figures(shown, progress))
        return {"version": shown.version}

    def _following(self, made: Design, opening: int) -> SessionView:
        """Number a draft after the last one, or after its sketch."""
        last = self._shown or self._sketched
        if last is None:
            return SessionView(made, 1, 1, opening)
        same = last.opening == opening and _same(made, last.draft)
        return SessionView(made, last.number + 1, last.version if same else last.version + 1, opening)

    def _figures(self, shown: SessionView, progress: JobProgress) -> dict[str, Any]:
        from dsfab.app.editor.drafts import cut_as_built, figures

        cut, notes = cut_as_built(shown.draft, progress)
        progress("slicing", "measuring members")
        found = figures(shown.draft, cut, notes)
        with self._lock:
            self._cut = shown, cut.sheet
        return {"draft": shown.number, **found}

    def _members(self, shown: SessionView, judged: bool) -> dict[str, Any]:
        from dsfab.render import member_places

        return {"draft": shown.number, **member_places(shown.draft, judged)}

    def _build(self, request: BuildRequest, progress: JobProgress) -> dict[str, Any]:
        from dsfab.render.opengl import why_no_pictures

        with self._lock:
            old = self._shown.draft if self._shown else None
        return self.builds.make(replace(request, old=old, picture=not why_no_pictures()), progress)

    def _picture(
        self, preset: Preset, view: str, show: str, size: tuple[int, int], progress: JobProgress
    ) -> dict[str, Any]:
        from dsfab.app.editor.building import draw_png

        with self._lock:
            old = self._shown
        return {
            "png": base64.b64encode(draw_png(preset, old.draft if old else None, view, show, size, progress)).decode()
        }


def _same(made: Design, old: Design) -> bool:
    """True if drafts differ only in widths or in the choice of modes, so that `model` returns the same."""
    now, before = made.preset.pattern, old.preset.pattern
    if now.region != before.region or (now.region and now.keep != before.keep):
        return False
    if made.statics is not old.statics:  # the statics of a sketch may be rough
        return False
    return made.diffusion is old.diffusion and StripedMesh.of(made).same(StripedMesh.of(old))
