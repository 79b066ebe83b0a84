"""What the page's Build does: what `dsfab build` does, with its own words for the progress."""

import io
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsfab.app.editor.job import Telling
from dsfab.app.editor.source import with_file
from dsfab.pipeline import draft, revise, run
from dsfab.pipeline.design import Design
from dsfab.preset import Preset
from dsfab.render.caption import caption
from dsfab.report.design.save import save


@dataclass(frozen=True)
class EditorBuild:
    """The files, those asked for first, and what the page is told about the solid."""

    files: list[Path]
    facts: dict[str, Any]


@dataclass(frozen=True)
class BuildRequest:
    """What is to be built: a preset, from the first stage that `old` has not.

    picture : whether it is drawn too.
    mesh    : of the page: it is copied beside the files, and the preset there names the copy.
    only    : the one format that is wanted, in a word of `dsfab export --to`; '' for everything that a build writes.
    before  : the folder of an earlier build, which may hold this very design.
    """

    preset: Preset
    old: Design | None = None
    picture: bool = False
    mesh: Path | None = None
    only: str = ""
    before: Path | None = None


def built(request: BuildRequest, folder: Path, progress: Telling) -> EditorBuild:
    """Make the solid, and write what the command line writes.

    Raises DsfabError, of the stage that refuses; a STEP file that is too large is told in `facts` instead.
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
    """Write one file as `dsfab export` does, of what the folder `before` holds of this design, or of what is made now.

    Raises DsfabError, of the stage that refuses or of the format.
    """
    from dsfab.app.export import CALCULIX, SUFFIX, ExportRequest, write_file
    from dsfab.delivery.archive import read_archive

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
    """Where a mesh of the page lies among the files of its build."""
    return folder / f"surface{mesh.suffix}"


def _beside(design: Design, mesh: Path, folder: Path) -> Design:
    """The design with its mesh in the folder of its files, where it outlives the session."""
    copy = Path(shutil.copy(mesh, _copied(mesh, folder)))
    made = {name: value for name, value in vars(design).items() if name != "preset"}
    return Design.known(with_file(design.preset, copy), **made)


def draw_png(
    preset: Preset, old: Design | None, view: str, show: str, size: tuple[int, int], progress: Telling
) -> bytes:
    """A PNG picture, drawn here. Raises DsfabError where nothing can be drawn."""
    from PIL import Image

    from dsfab.render import light
    from dsfab.render.answers import asking
    from dsfab.render.previewer import Previewer

    made = draft(asking(preset, show), progress, old)
    progress("preview", "drawing")
    with Previewer(made, view=view, show=show) as previewer:
        pixels = previewer.picture(size, quality=light.QUICK)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
