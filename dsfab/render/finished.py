"""The picture of a finished design, drawn in a process of its own while this one writes files."""

import os
import pickle
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dsfab.export import Ahead, ProgramError, temporary_folder
from dsfab.pipeline.design import Design
from dsfab.render import picture_program
from dsfab.render.caption import caption
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import PLAIN, Look, picture
from dsfab.render.png import write_png

SECONDS = 600.0
"""After which the other process is given up, counted from when somebody waits for it."""


def write_picture(design: Design, path: Path, look: Look = PLAIN) -> None:
    """Draw the finished structure into a PNG file; raises DsfabError where nothing can be drawn."""
    write_png(picture(**_asked(design, look)), path)


def _asked(design: Design, look: Look) -> dict[str, Any]:
    """The arguments of `picture`."""
    solid, words = design.solid, caption(design)
    return {"V": solid.V, "F": solid.F, "surface": design.surface, "load": design.load, "caption": words, "look": look}


@contextmanager
def picture_meanwhile(design: Design, path: Path, look: Look = PLAIN) -> Iterator[Callable[[], None]]:
    """Inside, the picture of `write_picture` is drawn by another process; what is given waits until it is.

    Where there is one core, and when the other process fails, it is drawn in this one, by who waits for it.
    Raises DsfabError where nothing can be drawn.
    """
    if (os.cpu_count() or 1) == 1:
        yield lambda: write_picture(design, path, look)
        return
    require_rendering()  # the kind of window is in the environment then, for the other process too
    with temporary_folder("dsfab-picture") as folder, Ahead(picture_program.__file__) as program:
        given = Path(folder) / "picture.pickle"
        given.write_bytes(pickle.dumps(_asked(design, look), protocol=5))
        program.ask(str(given), str(path))

        def finish() -> None:
            try:
                program.answer(SECONDS)
            except (ProgramError, subprocess.TimeoutExpired):
                write_picture(design, path, look)

        yield finish
