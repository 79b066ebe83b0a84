"""`EditorJob`: one thing that takes time, how far it is, and how it learns that nobody wants it any more."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

Telling = Callable[[str, str], None]
"""A stage and what it does now."""


class Cancelled(Exception):  # noqa: N818  # nothing went wrong
    """Raised in the worker at the next progress after a job was cancelled."""


class JobProgress:
    """How far a job is. Raises Cancelled, also by `check`, which tells nothing, once nobody wants the job any more."""

    def __init__(self, stop: threading.Event, tell: Telling) -> None:
        self._stop, self._tell = stop, tell

    def __call__(self, stage: str, text: str) -> None:
        self.check()
        self._tell(stage, text)

    def check(self) -> None:
        """Raise Cancelled once nobody wants the job any more."""
        if self._stop.is_set():
            raise Cancelled


Work = Callable[[JobProgress], dict[str, Any]]
"""What a job does, telling its progress; the facts that it returns go to the page."""


@dataclass(eq=False)
class EditorJob:
    """One thing to do. state: waiting, running, done, failed or cancelled."""

    number: int
    kind: str
    work: Work
    state: str = "waiting"
    stage: str = ""
    text: str = ""
    result: dict[str, Any] = field(default_factory=dict)
    stop: threading.Event = field(default_factory=threading.Event)

    def told(self) -> dict[str, Any]:
        """For the page."""
        return {
            "job": self.number,
            "kind": self.kind,
            "state": self.state,
            "stage": self.stage,
            "text": self.text,
            "result": self.result,
        }
