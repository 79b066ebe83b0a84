"""Pictures drawn by another process: a sketch while this one goes on to the true widths, and the finished structure.

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
    from dsfab.design import Design

PROGRAM = (
    "import gc, sys; gc.disable(); sys.path.append(sys.argv[1]); from dsfab.render.sketch_program import main; "
    "main('sketches' in sys.argv)"
)
"""Looking for rings of objects takes a tenth of the time of importing."""

SECONDS = 60.0
"""After which a sketch is given up, counted from when the true picture could be drawn."""

PATIENCE = 600.0
"""After which a picture is given up."""


class FirstPicture:
    """Use as `with FirstPicture(told) as first`, and in it once `with first.replaced()`: in there the other methods.

    told : called from another thread as soon as a sketch is there; None where nobody waits for one.
    """

    def __init__(self, told: Callable[[], None] | None) -> None:
        self._told = told
        home = str(Path(__file__).parents[2])
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", PROGRAM, home, *["sketches"] * bool(told)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._talking: threading.Thread | None = None
        self._sketched = False
        self._path, self._before = Path(), list[bytes]()
        self._window: str | None = None

    @property
    def sketches(self) -> bool:
        """Whether somebody waits for a sketch."""
        return self._told is not None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        with suppress(BrokenPipeError), self._process:  # its pipes are closed, of which one may hold what nobody read
            pass

    @contextmanager
    def replaced(self) -> Iterator[None]:
        """Inside, the file is written a second time; after an error in here it holds what it held before the first."""
        try:
            yield
        except BaseException:
            self._end()
            if self._sketched:
                self._undo()
            raise

    def draw(self, sketch: "Design", path: Path, pixels: tuple[int, int], options: dict[str, Any]) -> None:
        """Draw it, while this process goes on; not a second one, and not over a file that cannot be read.

        sketch : see `Design.sketch`.    options : of `dsfab.render.previewer.Previewer`.
        """
        from dsfab.app.carrier import carried

        if self._sketched:
            return
        self._path = path
        if self._path.exists():
            try:
                self._before.append(self._path.read_bytes())
            except OSError:
                return
        self._sketched = True
        self._talk(carried((sketch, path, pixels, options)), self._told)

    def finish(self) -> str | None:
        """Wait until a sketch is drawn, if one is; the kind of window that it can draw with, or None if it cannot."""
        if not self._talking:
            self._talk(None, None)
        self._wait(SECONDS)
        return self._window

    def structure(self, asked: object, path: Path) -> bool:
        """Write the picture of a `StructurePicture`; False where it could not, for whoever asks to draw it."""
        import pickle

        drawn: list[bool] = []
        if self.finish() is not None:
            self._talk(pickle.dumps((asked, path), protocol=5), lambda: drawn.append(True))
            self._wait(PATIENCE)
        return bool(drawn)

    def _wait(self, seconds: float) -> None:
        """Until what was asked is there; a process that takes longer, or failed, is ended."""
        assert self._talking
        self._talking.join(seconds)
        if self._talking.is_alive() or self._process.poll() is not None:
            self._end()

    def _end(self) -> None:
        """End the other process, wherever it is."""
        self._process.kill()
        if self._talking:
            self._talking.join()

    def _talk(self, asked: bytes | None, then: Callable[[], None] | None) -> None:
        """Ask for a picture, and do something when it is there."""
        self._talking = threading.Thread(target=self._ask, args=(asked, then), daemon=True)
        self._talking.start()

    def _ask(self, asked: bytes | None, then: Callable[[], None] | None) -> None:
        """A process that fails says nothing more."""
        given, answer = self._process.stdin, self._process.stdout
        assert given
        assert answer
        try:
            if asked is not None:
                given.write(len(asked).to_bytes(8, "little") + asked)
                given.flush()
            if self._window is None and (line := answer.readline()):
                self._window = line.decode().strip()
            if self._window is not None and asked is not None:
                if not answer.readline():
                    self._window = None
                elif then:
                    then()
        except (OSError, ValueError):
            self._window = None

    def _undo(self) -> None:
        """What was in the file before the first picture."""
        from dsfab.export import replacing

        if not self._before:
            self._path.unlink(missing_ok=True)
        elif self._path.read_bytes() != self._before[0]:
            with replacing(self._path) as temporary:
                temporary.write_bytes(self._before[0])
