"""A process that draws a sketch, then the finished structure."""

import pickle
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
"""Python code of the drawing process. It stops garbage collection, which shortens the imports by a tenth."""

SKETCH_SECONDS = 60.0  # Longest time to wait for the drawing process to finish its sketch.


class FirstPicture:
    """The drawing process; use as `with FirstPicture(on_sketch) as first`.
    on_sketch : function to call, in another thread, after a sketch was drawn. With None, no sketch is drawn."""

    def __init__(self, on_sketch: Callable[[], None] | None) -> None:
        self._told = on_sketch
        home = str(Path(__file__).parents[2])
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", PROGRAM, home, *["sketches"] * bool(on_sketch)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._talking: threading.Thread | None = None
        self._sketched = False
        self._path, self._before = Path(), list[bytes]()
        self._window: str | None = None

    @property
    def draws_sketches(self) -> bool:
        """True if the drawing process draws a sketch."""
        return self._told is not None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        with suppress(BrokenPipeError), self.process:  # close pipes that may hold unread bytes
            pass

    @contextmanager
    def restore_on_error(self) -> Iterator[None]:
        """Run the `with` block; after an error, replace the sketch by the earlier file, or delete the sketch."""
        try:
            yield
        except BaseException:
            self._end()
            if self._sketched:
                self._restore_file()
            raise

    def draw(self, sketch: "Design", path: Path, pixels: tuple[int, int], options: dict[str, Any]) -> None:
        """Start to draw a sketch (a design with an approximate pattern) into the file `path`. Further calls do nothing.
        pixels : width and height.    options : as for `Previewer`."""
        if self._sketched:
            return
        self._path = path
        if self._path.exists():
            try:
                self._before.append(self._path.read_bytes())
            except OSError:
                return
        self._sketched = True
        self._start_request(pickle.dumps((sketch, path, pixels, options), protocol=5), self._told)

    def finish(self) -> str | None:
        """Wait for the sketch; return the kind of graphics window, or None if the process cannot draw."""
        if not self._talking:
            self._start_request(None, None)
        self._wait(SKETCH_SECONDS)
        return self._window

    def draw_structure(self, structure_picture: object, path: Path) -> bool:
        """Draw a `StructurePicture` into a file. Return False if the process failed."""
        successes: list[bool] = []
        if self.finish() is not None:
            self._start_request(pickle.dumps((structure_picture, path), protocol=5), lambda: successes.append(True))
            self._wait(600.0)
        return bool(successes)

    def _wait(self, seconds: float) -> None:
        assert self._talking
        self._talking.join(seconds)
        if self._talking.is_alive() or self.process.poll() is not None:
            self._end()

    def _end(self) -> None:
        self.process.kill()
        if self._talking:
            self._talking.join()

    def _start_request(self, message: bytes | None, on_success: Callable[[], None] | None) -> None:
        self._talking = threading.Thread(target=self._send_request, args=(message, on_success), daemon=True)
        self._talking.start()

    def _send_request(self, message: bytes | None, on_success: Callable[[], None] | None) -> None:
        requests, answers = self.process.stdin, self.process.stdout
        assert requests
        assert answers
        try:
            if message is not None:
                requests.write(len(message).to_bytes(8, "little") + message)
                requests.flush()
            if self._window is None and (line := answers.readline()):
                self._window = line.decode().strip()
            if self._window is not None and message is not None:
                if not answers.readline():
                    self._window = None
                elif on_success:
                    on_success()
        except (OSError, ValueError):
            self._window = None

    def _restore_file(self) -> None:
        from dsfab.export import atomic_file

        if not self._before:
            self._path.unlink(missing_ok=True)
        elif self._path.read_bytes() != self._before[0]:
            with atomic_file(self._path) as temporary:
                temporary.write_bytes(self._before[0])
