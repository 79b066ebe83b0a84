"""What a run tells besides its results: progress, seconds and notes."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from dsfab.results import Note
from dsfab.surface import FileRecord

Progress = Callable[[str, str], None]
"""Called with a stage and what it is about to do."""


def silent(_stage: str, _doing: str) -> None:
    """The progress that nobody wants to see."""


@dataclass
class Log:
    """What a run tells besides its results. clock : what its seconds are measured with."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    file: FileRecord | None = None
    """What was read, repaired and dropped, where the surface is in a file."""
    clock: Callable[[], float] = time.perf_counter

    @contextmanager
    def stage(self, name: str, doing: str) -> Iterator[None]:
        """Tell that a stage begins, and write down its seconds."""
        if self.progress:
            self.progress(name, doing)
        start = self.clock()
        yield
        self.seconds[name] = self.clock() - start

    @contextmanager
    def row(self, name: str) -> Iterator[None]:
        """Add the seconds of what is done inside to a row."""
        start = self.clock()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + self.clock() - start

    def note(self, stage: str, text: str) -> None:
        """Write down what a person should know."""
        self.notes.append(Note(stage, text))
