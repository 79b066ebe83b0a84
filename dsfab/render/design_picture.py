"""The picture of a whole design with its caption: beside its files, or in a notebook."""

import os
import pickle
import subprocess
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path
from typing import Any

from dsfab.core.errors import DsfabError
from dsfab.core.messages import length, mass
from dsfab.design.design import Design
from dsfab.export import Ahead, ProgramError, temporary_folder
from dsfab.render import picture_program
from dsfab.render.drawing import Annotations, Ground, check_ground
from dsfab.render.lettering import PAPER
from dsfab.render.light import QUICK
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import PLAIN, Look, StructurePicture, picture, png, write_png
from dsfab.render.previewer import NOMINAL, Previewer, layers_of
from dsfab.render.scene import Bytes
from dsfab.render.view import named_side, up_axis


def caption(design: Design) -> str:
    """Return the line below a design's picture."""
    pieces = design.solid.pieces
    share = design.sheet.surface.area / design.surface.area
    return (
        f"{design.preset.name} - {share:.0%} of the surface kept, {length(design.preset.statics.thickness)} thick, "
        f"{mass(design.mass)}, {pieces} {'piece' if pieces == 1 else 'pieces'}"
    )


SECONDS = 600.0
"""Time limit for the other process, from the beginning of the wait."""


def write_picture(design: Design, path: Path, look: Look = PLAIN) -> None:
    """Draw the finished structure into a PNG file; raises DsfabError if this machine cannot draw."""
    write_png(picture(**_asked(design, look)), path)


def structure_picture(
    design: Design,
    *,
    view: str = "iso",
    marks: bool | Collection[str] = True,
    ground: Ground = "paper",
    size: tuple[int, int] = NOMINAL,
) -> Bytes:
    """Return the finished structure in the style of `Previewer`, (height, width, 3) bytes; 4 channels on transparent
    ground.

    Unlike a preview it has loose ends removed, corners rounded and openings filled.
    view, marks, ground, size : as for `Previewer`. Raises DsfabError if the design or its picture is impossible.
    """
    asked = structure_drawing(design, view=view, marks=marks, ground=ground, size=size)
    require_rendering()
    return asked.drawn()


def structure_drawing(
    design: Design,
    *,
    view: str = "iso",
    marks: bool | Collection[str] = True,
    ground: Ground = "paper",
    size: tuple[int, int] = NOMINAL,
) -> StructurePicture:
    """Return the data of `structure_picture`, with its parameters; raises DsfabError if the design is impossible."""
    check_ground(ground)
    solid, surface, load = design.solid, design.surface, design.load
    up = up_axis(surface.V, surface, load)
    palette = replace(PAPER, paper=(255, 255, 255)) if ground == "white" else PAPER
    beside = Annotations(surface, load, design.statics.equilibrium.reaction, None, layers_of(marks, view))
    return StructurePicture(
        *(solid.V, solid.F, design.preset.statics.thickness / 2, named_side(solid.V, up, view), up, beside),
        *(caption(design), Look(size, palette=palette), ground == "transparent"),
    )


def _asked(design: Design, look: Look) -> dict[str, Any]:
    solid, words = design.solid, caption(design)
    return {"V": solid.V, "F": solid.F, "surface": design.surface, "load": design.load, "caption": words, "look": look}


_AHEAD: ContextVar[Ahead | None] = ContextVar("_AHEAD", default=None)


@contextmanager
def picture_ahead() -> Iterator[None]:
    """Start a process that loads drawing modules for a later picture. Raises DsfabError if this machine cannot draw."""
    if (os.cpu_count() or 1) == 1:
        yield
        return
    require_rendering()
    with Ahead(picture_program.__file__) as program:
        token = _AHEAD.set(program)
        try:
            yield
        finally:
            _AHEAD.reset(token)


@contextmanager
def picture_meanwhile(design: Design, path: Path, look: Look = PLAIN) -> Iterator[Callable[[], None]]:
    """Draw the picture of `write_picture` in another process inside the context; the yielded function waits for it.

    With one core, or if the other process fails, that function draws the picture itself.
    Raises DsfabError if this machine cannot draw.
    """
    if (os.cpu_count() or 1) == 1:
        yield lambda: write_picture(design, path, look)
        return
    require_rendering()  # sets the kind of window in the environment of both processes
    with temporary_folder("dsfab-picture") as folder, _AHEAD.get() or Ahead(picture_program.__file__) as program:
        _AHEAD.set(None)  # the program draws a single picture
        given = Path(folder) / "picture.pickle"
        given.write_bytes(pickle.dumps(_asked(design, look), protocol=5))
        program.ask(str(given), str(path))

        def finish() -> None:
            try:
                program.answer(SECONDS)
            except (ProgramError, subprocess.TimeoutExpired):
                write_picture(design, path, look)

        yield finish


SIZE = (800, 600)
"""Size of a picture in a notebook (pixels)."""


def inline_picture(made: Design) -> bytes | None:
    """Return PNG bytes of a design's solid, or of its draft; None, with a warning, if this machine cannot draw."""
    try:
        if made.has("thickening"):
            solid = made.solid
            words = caption(made)
            return png(picture(solid.V, solid.F, surface=made.surface, load=made.load, caption=words, look=Look(SIZE)))
        with Previewer(made) as previewer:
            return png(previewer.picture(SIZE, quality=QUICK))
    except DsfabError as error:
        warnings.warn(str(error), stacklevel=2)
        return None
