"""Draws a first picture of a design: a program of its own, started before anybody knows what to ask it.

standard input : 8 bytes n | n bytes of pickle: a sketch (see `Design.sketch`), the PNG file to write, its width and
                 height in pixels, and options of `Previewer`; it stays open for as long as anybody waits
standard output: one line, the kind of window that it has drawn with
"""

import os
import pickle
import sys
import threading

from dsfab.render.colouring import WHOLE_SHEET
from dsfab.render.light import ROUGH
from dsfab.render.opengl import take_for_granted
from dsfab.render.png import write_png
from dsfab.render.previewer import Previewer
from dsfab.render.window import warm_up


def main() -> None:
    """Draw what standard input asks for."""
    window = take_for_granted()  # where nothing can be drawn this process crashes, and says nothing
    warm_up()
    source = sys.stdin.buffer
    sketch, path, size, options = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with Previewer(sketch, **options) as previewer:
        write_png(previewer.picture(size, _caption(previewer, options["show"]), ROUGH), path, effort=1)
    sys.stdout.write(f"{window}\n")


def _caption(previewer: Previewer, show: str) -> str:
    """That it is the first, and how far it can be trusted."""
    words = previewer.words or (show.replace("_", " ") if show in WHOLE_SHEET else "")
    if not words and previewer.preset.pattern.width.solid_fraction:
        words = "members about as wide as they will be"
    return ", ".join(filter(None, (f"{previewer.preset.name} - first picture", words)))


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
