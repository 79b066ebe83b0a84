"""Draws pictures of a design: a program of its own, started before anybody knows what to ask it.

standard output: one line as soon as it can draw, the kind of window that it draws with; then a line for each picture
standard input : for each picture 8 bytes n | n bytes of pickle; the input stays open for as long as anybody waits
                 of a sketch (see `Design.sketch`), the PNG file to write, its width and height, options of `Previewer`
                 of a `StructurePicture`, and the PNG file to write
"""

import gc
import os
import pickle
import sys
import threading
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from dsfab.render.opengl import take_for_granted
from dsfab.render.picture import StructurePicture, write_png
from dsfab.render.scene import warm_up

if TYPE_CHECKING:
    from dsfab.render.previewer import Previewer


def main(sketches: bool) -> None:
    """Draw what standard input asks for; `sketches`: whether one will be asked for, which takes more to be loaded."""
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    window = take_for_granted()  # where nothing can be drawn this process crashes, and says nothing
    if not warm_up():
        sys.exit(1)
    _say(window)
    if sketches:
        import dsfab.render.previewer  # noqa: F401  (before it is needed)
    while True:
        _draw(*pickle.loads(requests.get()))
        _say("drawn")
        gc.enable()  # whoever watches a file asks for many


def _draw(what: Any, path: Any, size: tuple[int, int] = (0, 0), options: Any = None) -> None:
    """One picture into its file."""
    if isinstance(what, StructurePicture):
        write_png(what.drawn(), path)
        return
    from dsfab.render.light import ROUGH
    from dsfab.render.previewer import Previewer

    with Previewer(what, **options) as previewer:
        write_png(previewer.picture(size, _caption(previewer, options["show"]), ROUGH), path, effort=1)


def _caption(previewer: "Previewer", show: str) -> str:
    """That it is the first, and how far it can be trusted."""
    from dsfab.render.colouring import WHOLE_SHEET

    words = previewer.words or (show.replace("_", " ") if show in WHOLE_SHEET else "")
    if not words and previewer.preset.pattern.width.solid_fraction:
        words = "members about as wide as they will be"
    return ", ".join(filter(None, (f"{previewer.preset.name} - first picture", words)))


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _listen(requests: "SimpleQueue[bytes]") -> None:
    """Take requests while a picture is drawn, and end with who asks."""
    source = sys.stdin.buffer
    while len(head := source.read(8)) == 8:
        requests.put(source.read(int.from_bytes(head, "little")))
    os._exit(1)
