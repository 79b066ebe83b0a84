"""A first picture while a person waits: another process draws a sketch, while this one goes on to the true widths.

It is started before there is anything to draw, and loads what draws meanwhile; so this module loads nothing itself.
"""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from dsfab.pipeline import Design

PROGRAM = (
    "import gc, sys; gc.disable(); sys.path.append(sys.argv[1]); from dsfab.render.sketch_program import main; main()"
)
"""Looking for rings of objects takes a tenth of the time of importing, and it ends after one picture."""

SECONDS = 60.0
"""After which it is given up, counted from when the true picture could be drawn."""


class FirstPicture:
    """Use as `with FirstPicture(told) as first`, and in it once `with first.replaced()`: in there `draw` and `finish`.

    told : called from another thread as soon as the picture is there.
    """

    def __init__(self, told: Callable[[], None]) -> None:
        self._told = told
        home = str(Path(__file__).parents[2])
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", PROGRAM, home],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._drawing: threading.Thread | None = None
        self._path, self._before = Path(), list[bytes]()
        self._window: str | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        with self._process:  # its pipes are closed
            pass

    @contextmanager
    def replaced(self) -> Iterator[None]:
        """Inside, the file is written a second time; after an error in here it holds what it held before the first."""
        try:
            yield
        except BaseException:
            self._end()
            if self._drawing:
                self._undo()
            raise

    def draw(self, sketch: "Design", path: Path, pixels: tuple[int, int], options: dict[str, Any]) -> None:
        """Draw it, while this process goes on; not a second one, and not over a file that cannot be read.

        sketch : see `Design.sketch`.    options : of `dsfab.render.previewer.Previewer`.
        """
        from dsfab.app.carrier import carried

        if self._drawing:
            return
        self._path = path
        if self._path.exists():
            try:
                self._before.append(self._path.read_bytes())
            except OSError:
                return
        self._drawing = threading.Thread(
            target=self._draw, args=(carried((sketch, path, pixels, options)),), daemon=True
        )
        self._drawing.start()

    def finish(self) -> str | None:
        """Wait until it is drawn; the kind of window that it was drawn with, or None where it was not."""
        if self._drawing:
            self._drawing.join(SECONDS)
        self._end()
        return self._window

    def _end(self) -> None:
        """End the other process, wherever it is."""
        self._process.kill()
        if self._drawing:
            self._drawing.join()

    def _draw(self, asked: bytes) -> None:
        """Ask for it, and tell when it is there; a process that fails has said nothing."""
        given, answer = self._process.stdin, self._process.stdout
        assert given
        assert answer
        with suppress(OSError, ValueError):
            given.write(len(asked).to_bytes(8, "little") + asked)
            given.flush()
            if line := answer.readline():
                self._window = line.decode().strip()
                self._told()

    def _undo(self) -> None:
        """What was in the file before the first picture."""
        from dsfab.export import replacing

        if not self._before:
            self._path.unlink(missing_ok=True)
        elif self._path.read_bytes() != self._before[0]:
            with replacing(self._path) as temporary:
                temporary.write_bytes(self._before[0])
