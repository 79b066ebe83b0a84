"""The command `dsfab preview`: a picture of a design before its files are written, again after each save of its
preset.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.first_picture import FirstPicture
from dsfab.app.options import UNCHANGED, Quiet, Show, Source, View, built_folder, picture_size
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import DsfabError
from dsfab.core.messages import size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dsfab.design import Design
    from dsfab.preset.model import Preset
    from dsfab.render.previewer import Previewers

FINISHED = ("fabrication", "members")
"""Pictures of the finished solid, and of the finished sheet."""


WORDS = {
    "deflection": ("displacement",),
    "modes": ("major_mode", "minor_mode"),
    "all": (
        *("structure", "families", "loads", "stress", "directions", "vonmises"),
        *("major_mode", "minor_mode", "displacement"),
    ),
}
"""Words of --show that stand for several names."""

ASKED = {"utilisation": "strength", "buckling": "buckling", "frequency": "frequencies"}
"""Pictures that `all` adds if this key of [statics] is set."""


def shows(text: str, preset: "Preset") -> tuple[str, ...]:
    """Return the names in 'structure', 'modes', 'all', 'structure,stress'; raise DsfabError for unknown ones."""
    from dsfab.render.colouring import MODES, check_show

    names: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if word == "all":
            modes = preset.pattern.method != "stripes"  # stripes do not run along modes
            names += [name for name in WORDS[word] if modes or name not in MODES]
            names += [name for name, key in ASKED.items() if getattr(preset.statics, key)]
        else:
            names += WORDS.get(word, (word,))
    for name in names:
        check_show(name)
    return tuple(dict.fromkeys(names))


@dataclass(frozen=True)
class Page:
    """Pictures of a page and its file. options : of `dsfab.render.previewer.Previewer`, but `show`."""

    names: tuple[str, ...]
    pixels: tuple[int, int]
    path: Path
    options: dict[str, Any]


@Parameter(name="*")
@dataclass(frozen=True)
class PictureOptions:
    """Options of the picture, and its file."""

    view: View = "iso"
    show: Show = "structure"
    layers: Annotated[
        str | None,
        Parameter(
            help="Comma list of loads, supports, reactions, person, tree, gradients (of modes); or all, none "
            "[loads,supports,person]."
        ),
    ] = None
    ground: Annotated[str, Parameter(help="paper, white or transparent.")] = "paper"
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="PNG file [NAME.png, in the folder if one is built].")
    ] = None
    size_: Annotated[
        str | None, Parameter(name="--size", help="WIDTHxHEIGHT in pixels [1600x1200; each of several: 800x600].")
    ] = None

    def page(self, preset: "Preset", folder: Path = Path()) -> Page:
        """Return the page of a preset, in `folder` unless --output names a file; raise DsfabError for invalid
        options.
        """
        from dsfab.render.drawing import check_ground

        names = (self.show.strip(),) if self.show.strip() in FINISHED else shows(self.show, preset)
        marks = {} if self.layers is None else {"marks": _layers(self.layers)}
        pixels = picture_size(self.size_ or ("1600x1200" if len(names) == 1 else "800x600"))
        path = self.output or folder / f"{preset.name}.png"
        if path.suffix.lower() != ".png":
            raise DsfabError(f"-o {path} does not end in .png; previews are PNG files")
        check_ground(self.ground)
        return Page(names, pixels, path, {"view": self.view, "ground": self.ground, **marks})


def preview(
    preset: str,
    /,
    *,
    source: Source = UNCHANGED,
    picture: PictureOptions = PictureOptions(),
    watch: Annotated[
        bool, Parameter(negative=(), help="Draw again when the preset file is saved, until Ctrl-C.")
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Draw a preset in a few seconds: evenly spaced stripes as they are built, all else before it is cut.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    """
    reporter = Reporter(quiet)
    with _first_picture(picture, reporter) as first:
        folder = built_folder(preset)
        file = preset if folder is None else str(folder / "preset.toml")
        given = source.read(file)
        page = picture.page(given, folder or Path())
        if watch and not Path(file).is_file():
            raise DsfabError(
                f"--watch needs a file to watch, {preset!r} is the name of a preset; save it as a file first"
            )
        with _drawing(page, reporter, folder, first) as draw:
            if watch:
                return _watch(Path(file), lambda: draw(source.read(file)), reporter)
            draw(given)
    return 0


@contextmanager
def _first_picture(picture: PictureOptions, reporter: Reporter) -> "Iterator[FirstPicture | None]":
    """Start a process that draws, if a core is free: for a sketch on a terminal, or for the finished structure."""
    single = "," not in picture.show and picture.show.strip() not in (*WORDS, *FINISHED)
    sketched = single and reporter.watched
    finished = (
        picture.show.strip() == "structure" and "vtkmodules" not in sys.modules
    )  # otherwise this process is as quick
    if not (sketched or finished) or (os.cpu_count() or 1) == 1:
        from dsfab.render.opengl import ask_ahead

        ask_ahead()
        yield None
        return
    told = (lambda: reporter.say("preview     a first picture is there, its widths follow")) if sketched else None
    with FirstPicture(told) as first:
        yield first


@contextmanager
def _drawing(
    page: Page, reporter: Reporter, folder: Path | None, first: FirstPicture | None
) -> "Iterator[Callable[[Preset], None]]":
    """Provide a function that draws the page of a preset into its file; `folder` is the built folder, if any."""
    from dsfab.render.opengl import require_rendering, take_for_granted
    from dsfab.render.previewer import Previewers

    if first is None:
        require_rendering()
    options = {"show": page.names[0], **page.options}

    def sketched(design: "Design") -> None:
        if first:
            first.draw(design, page.path, page.pixels, options)

    with Previewers(sketched if first and first.sketches else None, **options) as previewers:

        def draw(preset: "Preset") -> None:
            if page.names[0] in FINISHED:
                _draw_finished(preset, page, reporter, folder)
            elif first and not previewers.made:
                with first.replaced():
                    previewers.drafted(preset, reporter)
                    if (window := first.finish()) is not None:
                        take_for_granted(window)
                    _draw(previewers, preset, page, reporter, first)
            else:
                _draw(previewers, preset, page, reporter, first)
            if not reporter.quiet:
                out(f"  {page.path}  {size(page.path.stat().st_size)}")

        try:
            yield draw
        finally:
            reporter.stop()


def _layers(text: str) -> tuple[str, ...]:
    from dsfab.render.drawing import EVERY_LAYER

    if text in ("all", "none"):
        return EVERY_LAYER if text == "all" else ()
    names = tuple(word.strip() for word in text.split(",") if word.strip())
    if unknown := [name for name in names if name not in EVERY_LAYER]:
        raise DsfabError(f"--layers {unknown[0]!r} is not known; use some of {', '.join(EVERY_LAYER)}, or all, none")
    return names


def _draw(
    previewers: "Previewers", preset: "Preset", page: Page, reporter: Reporter, first: FirstPicture | None
) -> None:
    if page.names != ("structure",) or not _draw_structure(previewers, preset, page, reporter, first):
        _draw_pattern(previewers, preset, page, reporter)


def _draw_pattern(previewers: "Previewers", preset: "Preset", page: Page, reporter: Reporter) -> None:
    from dsfab.render.colouring import asking
    from dsfab.render.picture import write_png
    from dsfab.render.previewer import panels

    for name in page.names:
        preset = asking(preset, name)
    if len(page.names) == 1:
        previewer = previewers.showing(preset, reporter)
        reporter("preview", f"drawing {page.path.name}")
        previewer.write(page.path, page.pixels)
        reporter.done()
    else:
        found = panels(previewers.drafted(preset, reporter), page.names, page.pixels, reporter, **page.options)
        reporter.done()
        for line in found.left_out:
            reporter.say(f"preview     left out: {line}")
        write_png(found.pixels, page.path)
    if previewers.made:
        for note in previewers.made.notes:
            reporter.say(f"note ({note.stage}): {note.text}")


def _draw_structure(
    previewers: "Previewers", preset: "Preset", page: Page, reporter: Reporter, first: FirstPicture | None
) -> bool:
    """Draw evenly spaced stripes as they are built; return False if that is impossible.

    The drawing before cutting would show loose ends, holes at singular points of the stress, and sharp corners.
    """
    from dsfab.render.design_picture import structure_drawing
    from dsfab.render.opengl import require_rendering
    from dsfab.render.picture import write_png

    design = previewers.drafted(preset, reporter)
    if not design.pattern.even:
        return False
    try:
        design = design.until("thickening")
    except DsfabError as error:
        reporter.say(f"note (preview): drawn before it is cut, because cutting failed: {error}")
        return False
    reporter("preview", f"drawing {page.path.name}")
    asked = structure_drawing(design, size=page.pixels, **page.options)
    if not (first and first.structure(asked, page.path)):
        require_rendering()
        write_png(asked.drawn(), page.path)
    reporter.done()
    for note in design.notes:
        reporter.say(f"note ({note.stage}): {note.text}")
    return True


def _draw_finished(preset: "Preset", page: Page, reporter: Reporter, built: Path | None) -> None:
    from dsfab.design import Design
    from dsfab.design.output.archive import read_archive
    from dsfab.render.picture import write_png

    members = page.names == ("members",)
    design = read_archive(built, preset) if built else None
    design = design or Design.of(preset, None, reporter).until("slicing" if members else "thickening")
    picture = _members if members else _measured
    write_png(picture(design, page, reporter), page.path)
    reporter.done()
    for text in design.members.notes if members else ():
        reporter.say(f"note (members): {text}")
    for note in design.notes:
        reporter.say(f"note ({note.stage}): {note.text}")


def _measured(design: "Design", page: Page, reporter: Reporter) -> "NDArray[Any]":
    from dsfab.render.fabrication import workshop_picture
    from dsfab.study.fabrication import fabrication

    reporter("fabrication", "measuring members, gaps and walls")
    made = fabrication(design)
    reporter("preview", f"drawing {page.path.name}")
    return workshop_picture(design, made, size=page.pixels, view=page.options["view"], ground=page.options["ground"])


def _members(design: "Design", page: Page, reporter: Reporter) -> "NDArray[Any]":
    from dsfab.render import members_picture

    reporter("members", f"naming members, and drawing {page.path.name}")
    return members_picture(design, size=page.pixels, view=page.options["view"], ground=page.options["ground"])


def _watch(file: Path, draw: Callable[[], None], reporter: Reporter) -> int:
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
            time.sleep(0.25)
    except KeyboardInterrupt:
        return 0


def _stamp(file: Path) -> tuple[int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
