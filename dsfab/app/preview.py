"""The command `dsfab preview`: a picture of a design."""

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
from dsfab.app.options import UNCHANGED, OutputName, Quiet, Show, Source, Switch, View, built_folder, picture_size
from dsfab.app.terminal import Reporter, print_result
from dsfab.core.errors import DsfabError
from dsfab.core.messages import byte_size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dsfab.design import Design
    from dsfab.preset.model import Preset
    from dsfab.render.previewer import Previewers

FINISHED_PICTURES = ("fabrication", "members")  # Pictures that need the finished solid or sheet.

SHOW_WORDS = {
    "deflection": ("displacement",),
    "modes": ("major_mode", "minor_mode"),
    "all": (
        *("structure", "families", "loads", "stress", "directions", "vonmises"),
        *("major_mode", "minor_mode", "displacement"),
    ),
}
"""Words for `--show` that stand for other pictures, with the names of these pictures."""

SHOWN_ON_REQUEST = {"utilisation": "strength", "buckling": "buckling", "frequency": "frequencies"}
"""Key of [statics] by name of a picture. `--show all` includes the picture only if the preset sets this key."""


def picture_names(text: str, preset: "Preset") -> tuple[str, ...]:
    """Return the pictures that a text such as 'structure,stress' names. Raises DsfabError for other names."""
    from dsfab.render.colouring import MODE_FIELDS, check_show

    names: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if word == "all":
            modes = preset.pattern.method != "stripes"  # evenly spaced stripes have no modes
            names += [name for name in SHOW_WORDS[word] if modes or name not in MODE_FIELDS]
            names += [name for name, key in SHOWN_ON_REQUEST.items() if getattr(preset.statics, key)]
        else:
            names += SHOW_WORDS.get(word, (word,))
    for name in names:
        check_show(name)
    return tuple(dict.fromkeys(names))


@dataclass(frozen=True)
class PreviewPage:
    """A file of pictures side by side. names : what each picture shows.    pixels : width and height of each picture.
    options : options of `Previewer`, except `show`."""

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
            help="What to add to the picture, a comma list: loads, supports, reactions, person, tree, gradients (of "
            "modes); or all, none [loads,supports,person]."
        ),
    ] = None
    ground: Annotated[str, Parameter(help="paper, white or transparent.")] = "paper"
    output: Annotated[Path | None, OutputName(help="PNG file [NAME.png; in the folder of a built design].")] = None
    size_: Annotated[
        str | None,
        Parameter(
            name="--size", help="Size of the picture: WIDTHxHEIGHT in pixels [1600x1200; 800x600 for several pictures]."
        ),
    ] = None

    def page(self, preset: "Preset", folder: Path = Path()) -> PreviewPage:
        """Return the requested picture's description. folder : default folder. Raises DsfabError for a bad option."""
        from dsfab.render.drawing import check_ground

        names = (self.show.strip(),) if self.show.strip() in FINISHED_PICTURES else picture_names(self.show, preset)
        marks = {} if self.layers is None else {"marks": _layer_names(self.layers)}
        pixels = picture_size(self.size_ or ("1600x1200" if len(names) == 1 else "800x600"))
        path = self.output or folder / f"{preset.name}.png"
        if path.suffix.lower() != ".png":
            raise DsfabError(f"-o {path} does not end in .png; write for instance -o {path.stem}.png")
        check_ground(self.ground)
        return PreviewPage(names, pixels, path, {"view": self.view, "ground": self.ground, **marks})


def preview(
    preset: str,
    /,
    *,
    source: Source = UNCHANGED,
    picture: PictureOptions = PictureOptions(),
    watch: Annotated[bool, Switch(help="Draw again each time the preset file is saved; Ctrl-C stops.")] = False,
    quiet: Quiet = False,
) -> int:
    """Draw a preset in seconds: evenly spaced stripes as a cut sheet, all other patterns and fields on the uncut sheet.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote."""
    reporter = Reporter(quiet)
    with _first_picture(picture, reporter) as first_picture:
        folder = built_folder(preset)
        file = preset if folder is None else str(folder / "preset.toml")
        loaded_preset = source.read_preset(file, thickness="guessed")
        page = picture.page(loaded_preset, folder or Path())
        if watch and not Path(file).is_file():
            raise DsfabError(
                f"--watch needs a file, but {preset!r} is the name of a shipped preset; save the preset as a file first"
            )
        with _drawing(page, reporter, folder, first_picture) as draw:
            if watch:
                return _watch(Path(file), lambda: draw(source.read_preset(file, thickness="guessed")), reporter)
            draw(loaded_preset)
    return 0


@contextmanager
def _first_picture(picture: PictureOptions, reporter: Reporter) -> "Iterator[FirstPicture | None]":
    single = "," not in picture.show and picture.show.strip() not in (*SHOW_WORDS, *FINISHED_PICTURES)
    sketched = single and reporter.is_watched
    # a second process saves time only if this process has not loaded VTK yet
    needs_structure = picture.show.strip() == "structure" and "vtkmodules" not in sys.modules
    if not (sketched or needs_structure) or (os.cpu_count() or 1) == 1:
        from dsfab.render.opengl import probe_ahead

        probe_ahead()
        yield None
        return
    on_sketch = lambda: reporter.print_line("preview     a first picture is ready; the exact widths of members follow")  # noqa: E731
    with FirstPicture(on_sketch if sketched else None) as first_picture:
        yield first_picture


@contextmanager
def _drawing(
    page: PreviewPage, reporter: Reporter, folder: Path | None, first_picture: FirstPicture | None
) -> "Iterator[Callable[[Preset], None]]":
    from dsfab.render.opengl import assume_window, require_rendering
    from dsfab.render.previewer import Previewers

    if first_picture is None:
        require_rendering()
    options = {"show": page.names[0], **page.options}

    def draw_sketch(design: "Design") -> None:
        if first_picture:
            first_picture.draw(design, page.path, page.pixels, options)

    with Previewers(draw_sketch if first_picture and first_picture.draws_sketches else None, **options) as previewers:

        def draw(preset: "Preset") -> None:
            if page.names[0] in FINISHED_PICTURES:
                _draw_finished(preset, page, reporter, folder)
            elif first_picture and not previewers.design:
                with first_picture.restore_on_error():
                    previewers.draft_for(preset, reporter)
                    if (window := first_picture.finish()) is not None:
                        assume_window(window)
                    _draw(previewers, preset, page, reporter, first_picture)
            else:
                _draw(previewers, preset, page, reporter, first_picture)
            if not reporter.quiet:
                print_result(f"  {page.path}  {byte_size(page.path.stat().st_size)}")

        try:
            yield draw
        finally:
            reporter.stop()


def _layer_names(text: str) -> tuple[str, ...]:
    from dsfab.render.drawing import EVERY_LAYER

    if text in ("all", "none"):
        return EVERY_LAYER if text == "all" else ()
    names = tuple(word.strip() for word in text.split(",") if word.strip())
    if unknown := [name for name in names if name not in EVERY_LAYER]:
        raise DsfabError(f"--layers {unknown[0]!r} is unknown; use {', '.join(EVERY_LAYER)}, all or none")
    return names


def _draw(
    previewers: "Previewers",
    preset: "Preset",
    page: PreviewPage,
    reporter: Reporter,
    first_picture: FirstPicture | None,
) -> None:
    if page.names != ("structure",) or not _draw_structure(previewers, preset, page, reporter, first_picture):
        _draw_pattern(previewers, preset, page, reporter)


def _draw_pattern(previewers: "Previewers", preset: "Preset", page: PreviewPage, reporter: Reporter) -> None:
    from dsfab.render.colouring import preset_with_mode
    from dsfab.render.picture import write_png
    from dsfab.render.previewer import panels

    for name in page.names:
        preset = preset_with_mode(preset, name)
    if len(page.names) == 1:
        previewer = previewers.previewer_for(preset, reporter)
        reporter("preview", f"drawing {page.path.name}")
        previewer.write(page.path, page.pixels)
        reporter.done()
    else:
        panel_page = panels(previewers.draft_for(preset, reporter), page.names, page.pixels, reporter, **page.options)
        reporter.done()
        for line in panel_page.left_out:
            reporter.print_line(f"preview     left out: {line}")
        write_png(panel_page.pixels, page.path)
    if previewers.design:
        for note in previewers.design.notes:
            reporter.print_line(f"note ({note.stage}): {note.text}")


def _draw_structure(
    previewers: "Previewers",
    preset: "Preset",
    page: PreviewPage,
    reporter: Reporter,
    first_picture: FirstPicture | None,
) -> bool:
    from dsfab.render.design_picture import structure_drawing
    from dsfab.render.opengl import require_rendering
    from dsfab.render.picture import write_png

    design = previewers.draft_for(preset, reporter)
    if not design.pattern.even:
        return False
    try:
        design = design.until("thickening")
    except DsfabError as error:
        reporter.print_line(
            f"note (preview): the picture shows the uncut sheet with its pattern, because dsfab "
            f"could not cut the sheet: {error}"
        )
        return False
    reporter("preview", f"drawing {page.path.name}")
    structure_picture = structure_drawing(design, size=page.pixels, **page.options)
    if not (first_picture and first_picture.draw_structure(structure_picture, page.path)):
        require_rendering()
        write_png(structure_picture.render(), page.path)
    reporter.done()
    for note in design.notes:
        reporter.print_line(f"note ({note.stage}): {note.text}")
    return True


def _draw_finished(preset: "Preset", page: PreviewPage, reporter: Reporter, built: Path | None) -> None:
    from dsfab.design import Design
    from dsfab.design.output.archive import read_archive
    from dsfab.render.picture import write_png

    members = page.names == ("members",)
    design = read_archive(built, preset) if built else None
    design = design or Design.from_preset(preset, None, reporter).until("slicing" if members else "thickening")
    picture = _members_picture if members else _fabrication_picture
    write_png(picture(design, page, reporter), page.path)
    reporter.done()
    for text in design.members.notes if members else ():
        reporter.print_line(f"note (members): {text}")
    for note in design.notes:
        reporter.print_line(f"note ({note.stage}): {note.text}")


def _fabrication_picture(design: "Design", page: PreviewPage, reporter: Reporter) -> "NDArray[Any]":
    from dsfab.render.fabrication import workshop_picture
    from dsfab.study.fabrication import fabrication

    reporter("fabrication", "measuring members, gaps and walls")
    sizes = fabrication(design)
    reporter("preview", f"drawing {page.path.name}")
    return workshop_picture(design, sizes, size=page.pixels, view=page.options["view"], ground=page.options["ground"])


def _members_picture(design: "Design", page: PreviewPage, reporter: Reporter) -> "NDArray[Any]":
    from dsfab.render import members_picture

    reporter("members", f"naming members, and drawing {page.path.name}")
    return members_picture(design, size=page.pixels, view=page.options["view"], ground=page.options["ground"])


def _watch(file: Path, draw: Callable[[], None], reporter: Reporter) -> int:
    seen_stamp: tuple[int, int] | None = None
    reporter.print_line(f"watch       {file}; Ctrl-C ends it")
    try:
        while True:
            current_stamp = _file_stamp(file)
            # the time stamp is None while a text editor replaces the file
            if current_stamp is not None and current_stamp != seen_stamp:
                seen_stamp = current_stamp
                try:
                    draw()
                except DsfabError as error:
                    reporter.stop()
                    reporter.print_line(f"watch       {error}")
            time.sleep(0.25)
    except KeyboardInterrupt:
        return 0


def _file_stamp(file: Path) -> tuple[int, int] | None:
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
