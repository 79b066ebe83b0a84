"""`dsfab preview`: one design, seen before anything is cut; again whenever its file is saved."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import Mesh, Quiet, Set, Show, Unit, View, picture_size, read_preset
from dsfab.app.terminal import Reporter, out
from dsfab.errors import DsfabError
from dsfab.render.answers import asking
from dsfab.wording import size

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.render.previewers import Studio

POLL = 0.25
"""Seconds between looks at the file that is watched."""


def preview(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    view: View = "iso",
    show: Show = "structure",
    layers: Annotated[
        str | None,
        Parameter(help="Comma list of loads, supports, reactions, person; or all, none [loads,supports,person]."),
    ] = None,
    ground: Annotated[str, Parameter(help="paper, white or transparent.")] = "paper",
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="PNG file [NAME.png].")] = None,
    size_: Annotated[
        str | None, Parameter(name="--size", help="WIDTHxHEIGHT in pixels [1600x1200; each of several: 800x600].")
    ] = None,
    watch: Annotated[
        bool, Parameter(negative=(), help="Draw again when the preset file is saved, until Ctrl-C.")
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Draw a preset before it is cut: a picture in a few seconds.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.render.drawing import check_ground
    from dsfab.render.opengl import require_rendering
    from dsfab.render.previewers import Studio

    def read() -> "Preset":
        return read_preset(preset, set_, mesh, unit)

    given = read()
    finished = show.strip() == "fabrication"
    names = ("structure",) if finished else _names(show, given)
    marked = {} if layers is None else {"marks": _layers(layers)}
    pixels = picture_size(size_ or ("1600x1200" if len(names) == 1 else "800x600"))
    path = output if output is not None else Path(f"{given.name}.png")
    if path.suffix.lower() != ".png":
        raise DsfabError(f"-o {path} does not end in .png; previews are PNG files")
    check_ground(ground)
    if watch and not Path(preset).is_file():
        raise DsfabError(f"--watch needs a file to watch, {preset!r} is the name of a preset; save it as a file first")
    require_rendering()
    reporter = Reporter(quiet)
    with Studio(view=view, show=names[0], ground=ground, **marked) as studio:

        def draw(asked: "Preset") -> None:
            if finished:
                _draw_finished(asked, pixels, path, reporter, view=view, ground=ground)
            else:
                _draw(studio, asked, names, pixels, path, reporter, view=view, ground=ground, **marked)
            if not quiet:
                out(f"  {path}  {size(path.stat().st_size)}")

        try:
            if watch:
                return _watch(Path(preset), lambda: draw(read()), reporter)
            draw(given)
        finally:
            reporter.stop()
    return 0


def _names(show: str, preset: "Preset") -> tuple[str, ...]:
    from dsfab.render.panels import shows

    return shows(show, preset)


def _layers(text: str) -> tuple[str, ...]:
    """Names of layers; raises DsfabError for others."""
    from dsfab.render.stage import EVERY_LAYER

    if text in ("all", "none"):
        return EVERY_LAYER if text == "all" else ()
    names = tuple(word.strip() for word in text.split(",") if word.strip())
    if unknown := [name for name in names if name not in EVERY_LAYER]:
        raise DsfabError(f"--layers {unknown[0]!r} is not known; use some of {', '.join(EVERY_LAYER)}, or all, none")
    return names


def _draw(
    studio: "Studio",
    preset: "Preset",
    names: tuple[str, ...],
    pixels: tuple[int, int],
    path: Path,
    reporter: Reporter,
    **options: Any,
) -> None:
    """One picture, or several on one page, into one file."""
    from dsfab.render.panels import panels
    from dsfab.render.png import write_png

    for name in names:
        preset = asking(preset, name)
    if len(names) == 1:
        previewer = studio.showing(preset, reporter)
        reporter("preview", f"drawing {path.name}")
        previewer.write(path, pixels)
        reporter.done()
    else:
        made = studio.drafted(preset, reporter)
        found = panels(made, names, pixels, reporter, **options)
        reporter.done()
        for line in found.left_out:
            reporter.say(f"preview     left out: {line}")
        write_png(found.pixels, path)
    if studio.made:
        for note in studio.made.notes:
            reporter.say(f"note ({note.stage}): {note.text}")


def _draw_finished(preset: "Preset", pixels: tuple[int, int], path: Path, reporter: Reporter, **options: Any) -> None:
    """The design cut, thickened and measured, with the places of what is smallest."""
    from dsfab.pipeline import run
    from dsfab.render.fabrication import workshop_picture
    from dsfab.render.png import write_png
    from dsfab.study.fabrication import fabrication

    design = run(preset, reporter)
    reporter("fabrication", "measuring members, gaps and walls")
    made = fabrication(design)
    reporter("preview", f"drawing {path.name}")
    write_png(workshop_picture(design, made, size=pixels, **options), path)
    reporter.done()
    for note in design.notes:
        reporter.say(f"note ({note.stage}): {note.text}")


def _watch(file: Path, draw: Callable[[], None], reporter: Reporter) -> int:
    """Draw now and whenever the file has changed; a mistake in it is one sentence, and the watching goes on."""
    seen: tuple[int, int] | None = None
    reporter.say(f"watch       {file}; Ctrl-C ends it")
    try:
        while True:
            now = _stamp(file)
            if now is not None and now != seen:  # an editor may take the file away for a moment
                seen = now
                try:
                    draw()
                except DsfabError as error:
                    reporter.stop()
                    reporter.say(f"watch       {error}")
            time.sleep(POLL)
    except KeyboardInterrupt:
        return 0


def _stamp(file: Path) -> tuple[int, int] | None:
    """What changes when a file is saved; None while it is not there."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
