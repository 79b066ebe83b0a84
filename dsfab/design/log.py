"""The log of a run: progress, seconds and notes."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from dsfab.results import Note
from dsfab.surface import FileRecord

ROWS = {
    "surface": ("surface",),
    "statics": ("membrane", "bending", "statics", "stress", "answers"),
    "diffusion": ("diffusion", "modes"),
    "pattern": ("method", "stripes", "choice", "widths", "pattern"),
    "slicing": ("slicing",),
    "thickening": ("thickening",),
}
"""Rows of the timing table of each stage."""
PARTS = {"statics": ("factor",)}  # Rows whose seconds are part of another row, by stage.
Progress = Callable[[str, str], None]  # Receives the name of a stage and a message about the step that begins.


def silent(_stage: str, _doing: str) -> None: ...


@dataclass
class Log:
    """Progress, seconds and notes of a run. file : record of the surface file. clock : returns the time in seconds."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    file: FileRecord | None = None
    clock: Callable[[], float] = time.perf_counter

    def report(self, stage: str, doing: str) -> None:
        if self.progress:
            self.progress(stage, doing)

    @contextmanager
    def stage(self, name: str, doing: str) -> Iterator[None]:
        """Report that a stage begins, and record its seconds."""
        self.report(name, doing)
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
        self.notes.append(Note(stage, text))

    def add_stage(self, earlier: "Log", stage: str) -> None:
        """Add the seconds and notes of a stage from the log of another design."""
        rows = (*ROWS[stage], *PARTS.get(stage, ()))
        self.seconds.update({row: earlier.seconds[row] for row in rows if row in earlier.seconds})
        self.notes.extend(note for note in earlier.notes if note.stage == stage)

    def of_stages(self, stages: Sequence[str], progress: Progress | None) -> "Log":
        """Return a log with the seconds and notes of these stages, for a revision."""
        log = Log(progress, file=self.file if "surface" in stages else None)
        for stage in stages:
            log.add_stage(self, stage)
        return log

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the progress callback, which cannot be pickled."""
        return {**vars(self), "progress": None}
