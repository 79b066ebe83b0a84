"""The picture of a whole design with its caption, for its folder of files or for a notebook."""

import os
import pickle
import subprocess
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.core.messages import length, mass
from dsfab.design.design import Design
from dsfab.export import PreparedProgram, ProgramError, temporary_folder
from dsfab.render import picture_program
from dsfab.render.client_picture import CLIENT_LOOK, ClientPicture
from dsfab.render.drawing import Annotations, GroundKind, check_ground
from dsfab.render.lettering import PAPER
from dsfab.render.light import QUICK
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import Look, StructurePicture, picture, png_bytes, write_png
from dsfab.render.previewer import DEFAULT_SIZE, Previewer, layer_names
from dsfab.render.scene import Bytes
from dsfab.render.view import named_side, up_axis


def caption(design: Design) -> str:
    """Return the caption of a design's picture: name, kept share, thickness, mass and number of pieces."""
    pieces = design.solid.pieces
    share = design.sheet.surface.area / design.surface.area
    return (
        f"{design.preset.name} - {share:.0%} of the surface kept, {length(design.preset.statics.thickness)} thick, "
        f"{mass(design.mass)}, {pieces} {'piece' if pieces == 1 else 'pieces'}"
    )


SECONDS = 600.0  # time limit for the process that draws, from the moment at which the caller waits for it


def client_picture(design: Design, look: Look = CLIENT_LOOK) -> ClientPicture:
    """Return the data of the picture for clients. Raises DsfabError for an impossible design."""
    solid, half = design.solid, design.preset.statics.thickness / 2
    return ClientPicture(solid.V, solid.F, half, design.surface, design.load, caption(design), look)


def write_picture(design: Design, path: Path, look: Look = CLIENT_LOOK) -> None:
    """Draw the picture for clients into a PNG file. Raises DsfabError if this machine cannot draw."""
    require_rendering()
    write_png(client_picture(design, look).render(), path)


def structure_picture(
    design: Design,
    *,
    view: str = "iso",
    marks: bool | Collection[str] = True,
    ground: GroundKind = "paper",
    size: tuple[int, int] = DEFAULT_SIZE,
) -> Bytes:
    """Return the finished structure in the style of `Previewer`, (height, width, 3) bytes, or 4 on transparent ground.

    The structure has round corners, filled openings and no loose ends; a preview is drawn before these steps.
    view, marks, ground, size : as for `Previewer`. Raises DsfabError if the design or its picture is impossible.
    """
    drawing = structure_drawing(design, view=view, marks=marks, ground=ground, size=size)
    require_rendering()
    return drawing.render()


def structure_drawing(
    design: Design,
    *,
    view: str = "iso",
    marks: bool | Collection[str] = True,
    ground: GroundKind = "paper",
    size: tuple[int, int] = DEFAULT_SIZE,
) -> StructurePicture:
    """Return the data of `structure_picture`, with its parameters. Raises DsfabError for an impossible design."""
    check_ground(ground)
    solid, surface, load = design.solid, design.surface, design.load
    up = up_axis(surface.V, surface, load)
    palette = replace(PAPER, paper=(255, 255, 255)) if ground == "white" else PAPER
    annotations = Annotations(surface, load, design.statics.equilibrium.reaction, None, layer_names(marks, view))
    return StructurePicture(
        *(solid.V, solid.F, design.preset.statics.thickness / 2, named_side(solid.V, up, view), up, annotations),
        *(caption(design), Look(size, palette=palette), ground == "transparent"),
    )


_STARTED_PROGRAM: ContextVar[PreparedProgram | None] = ContextVar("_AHEAD", default=None)


@contextmanager
def start_picture_program() -> Iterator[None]:
    """Start a process that loads drawing modules for a later picture. Raises DsfabError if this machine cannot draw."""
    if (os.cpu_count() or 1) == 1:
        yield
        return
    require_rendering()
    with PreparedProgram(picture_program.__file__) as program:
        token = _STARTED_PROGRAM.set(program)
        try:
            yield
        finally:
            _STARTED_PROGRAM.reset(token)


@contextmanager
def picture_in_background(design: Design, path: Path, look: Look = CLIENT_LOOK) -> Iterator[Callable[[], None]]:
    """Draw the picture of `write_picture` in a second process. The yielded function waits until the picture is written.
    With one core, or if the second process fails, that function draws the picture itself.
    Raises DsfabError if this machine cannot draw.
    """
    if (os.cpu_count() or 1) == 1:
        yield lambda: write_picture(design, path, look)
        return
    require_rendering()  # sets VTK's kind of window in the environment of both processes
    with (
        temporary_folder("dsfab-picture") as folder,
        _STARTED_PROGRAM.get() or PreparedProgram(picture_program.__file__) as program,
    ):
        _STARTED_PROGRAM.set(None)  # a later picture needs a new program
        arguments_file = Path(folder) / "picture.pickle"
        arguments_file.write_bytes(pickle.dumps(client_picture(design, look), protocol=5))
        program.send(str(arguments_file), str(path))

        def finish() -> None:
            try:
                program.answer(SECONDS)
            except (ProgramError, subprocess.TimeoutExpired):
                write_picture(design, path, look)

        yield finish


NOTEBOOK_SIZE = (800, 600)  # size of a picture in a notebook (pixels)


def inline_picture(design: Design) -> bytes | None:
    """Return PNG bytes of a design's solid or of its preview. If this machine cannot draw, warn and return None."""
    try:
        if design.has("thickening"):
            solid, words = design.solid, caption(design)
            look = Look(NOTEBOOK_SIZE)
            return png_bytes(
                picture(solid.V, solid.F, surface=design.surface, load=design.load, caption=words, look=look)
            )
        with Previewer(design) as previewer:
            return png_bytes(previewer.picture(NOTEBOOK_SIZE, quality=QUICK))
    except DsfabError as error:
        warnings.warn(str(error), stacklevel=2)
        return None
