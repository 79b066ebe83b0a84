"""`Early`: what a sketch was drawn from before better elements answered; the design keeps what they do not change."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from dsfab.pipeline.log import Log, Progress
from dsfab.results import StaticsResult

T = TypeVar("T")


class Early:
    """Results that follow from `statics`, by name, each with a log of its own.

    statics : of `rough_statics`: what the pattern follows is there, stress and energy are rough.
    """

    def __init__(self, statics: StaticsResult, progress: Progress | None) -> None:
        self.statics, self._progress = statics, progress
        self._made: dict[str, tuple[Any, Log]] = {}

    def once(self, name: str, make: Callable[[Log], T]) -> T:
        """What `make` gives, made once."""
        if name not in self._made:
            log = Log(self._progress)
            self._made[name] = make(log), log
        found: T = self._made[name][0]
        return found

    def taken(self, name: str, statics: StaticsResult, log: Log) -> Any | None:
        """It, with its seconds and notes into `log`, if the pattern follows the same stress; else None."""
        if name not in self._made or not self._holds(statics):
            return None
        found, told = self._made.pop(name)
        log.seconds.update(told.seconds)
        log.notes.extend(told.notes)
        return found

    def _holds(self, statics: StaticsResult) -> bool:
        cases = self.statics.cases
        return all(np.array_equal(case.followed, cases[name].followed) for name, case in statics.cases.items())
