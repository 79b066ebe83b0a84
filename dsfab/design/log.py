"""The log of a run: progress, seconds and notes."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from dsfab.results import Note
from dsfab.surface import FileRecord

Progress = Callable[[str, str], None]
"""Called with a stage and a message about the step that begins."""


def silent(_stage: str, _doing: str) -> None:
    """Ignore progress."""


@dataclass
class Log:
    """Progress, seconds and notes of a run. clock : measures its seconds."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    file: FileRecord | None = None
    """The record of the surface file, if the surface is in a file."""
    clock: Callable[[], float] = time.perf_counter

    @contextmanager
    def stage(self, name: str, doing: str) -> Iterator[None]:
        """Report that a stage begins, and record its seconds."""
        if self.progress:
            self.progress(name, doing)
        start = self.clock()
        yield
        self.seconds[name] = self.clock() - start

    @contextmanager
    def row(self, name: str) -> Iterator[None]:
        """Add the seconds of the enclosed block to a row."""
        start = self.clock()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + self.clock() - start

    def note(self, stage: str, text: str) -> None:
        """Add a note for the user."""
        self.notes.append(Note(stage, text))
