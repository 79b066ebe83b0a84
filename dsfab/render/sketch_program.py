"""Program that draws pictures of a design.

Each request on standard input is a number n in 8 bytes, then n bytes of pickle. A closed input ends the program.
The pickle contains
    a sketch (see `Design.sketch`), the PNG file, its width and height, and options of `Previewer`; or
    a `StructurePicture`, and the PNG file.
The program prints the name of its VTK window when it is ready to draw, and the line "drawn" after each picture."""

import gc
import os
import pickle
import sys
import threading
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from dsfab.render.opengl import assume_window
from dsfab.render.picture import StructurePicture, write_png
from dsfab.render.scene import load_renderer

if TYPE_CHECKING:
    from dsfab.render.previewer import Previewer


def main(sketches: bool) -> None:
    """Draw each picture requested on standard input. sketches : True to load modules for sketches."""
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_read_requests, args=(requests,), daemon=True).start()
    window = assume_window()  # if this machine cannot draw, the process crashes silently
    if not load_renderer():
        sys.exit(1)
    _print_line(window)
    if sketches:
        import dsfab.render.previewer  # noqa: F401  (saves time at the first sketch)
    while True:
        _draw(*pickle.loads(requests.get()))
        _print_line("drawn")
        gc.enable()  # frees memory between pictures


def _draw(what: Any, path: Any, size: tuple[int, int] = (0, 0), options: Any = None) -> None:
    if isinstance(what, StructurePicture):
        write_png(what.render(), path)
        return
    from dsfab.render.light import ROUGH
    from dsfab.render.previewer import Previewer

    with Previewer(what, **options) as previewer:
        write_png(previewer.picture(size, sketch_caption(previewer, options["show"]), ROUGH), path, effort=1)


def sketch_caption(previewer: "Previewer", show: str) -> str:
    """Return the caption of a design's first picture."""
    from dsfab.render.colouring import WHOLE_SHEET

    words = previewer.words or (show.replace("_", " ") if show in WHOLE_SHEET else "")
    if not words and previewer.preset.pattern.width.solid_fraction:
        words = "the widths of members in this sketch are approximate"
    return ", ".join(filter(None, (f"{previewer.preset.name} - first picture", words)))


def _print_line(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _read_requests(requests: "SimpleQueue[bytes]") -> None:
    source = sys.stdin.buffer
    while len(head := source.read(8)) == 8:
        requests.put(source.read(int.from_bytes(head, "little")))
    os._exit(1)
