"""Which run after which: designs that share stages lie side by side, and whoever is idle takes half of the most."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from dsfab.preset import STAGES

Signature = tuple[str, ...]
"""What a run asks of each stage, in their order."""


def signature(changes: Mapping[str, Any]) -> Signature:
    """One text per stage, from the values of its keys; runs with a common beginning share these stages."""
    by_stage: dict[str, dict[str, Any]] = {stage: {} for stage in STAGES}
    for key, value in changes.items():
        section = key.split(".")[0]
        if section in by_stage:
            by_stage[section][key] = value
    return tuple(json.dumps(values, sort_keys=True, default=str) for values in by_stage.values())


def stage_order(runs: Sequence[Mapping[str, Any]]) -> list[int]:
    """Indices of the runs, early stages varying slowest; values of a stage in the order in which they first come."""
    signatures = [signature(changes) for changes in runs]
    places: list[dict[str, int]] = [{} for _ in STAGES]
    for texts in signatures:
        for place, text in zip(places, texts, strict=True):
            place.setdefault(text, len(place))
    return sorted(
        range(len(runs)), key=lambda i: [place[text] for place, text in zip(places, signatures[i], strict=True)]
    )


class Rows:
    """Runs that wait, in rows: one for each worker, and one for those that nobody has taken yet."""

    def __init__(self, numbers: Sequence[int], changes: Sequence[Mapping[str, Any]]) -> None:
        self._free: list[int] = [numbers[i] for i in stage_order(changes)]
        self._rows: dict[str, list[int]] = {}

    def __len__(self) -> int:
        return len(self._free) + sum(len(row) for row in self._rows.values())

    def take(self, worker: str) -> int | None:
        """The next run of a worker; when its row is empty, it gets part of the longest one."""
        row = self._rows.setdefault(worker, [])
        if not row:
            self._rows[worker] = row = self._share()
        return row.pop(0) if row else None

    def give_back(self, worker: str, number: int) -> None:
        """A run that must be tried again, by whoever comes next."""
        self._free.insert(0, number)
        self.leave(worker)

    def leave(self, worker: str) -> None:
        """A worker is gone: others may take its row."""
        self._free.extend(self._rows.pop(worker, []))

    def _share(self) -> list[int]:
        """The back half of the longest row, all of it when nobody holds it."""
        if self._free:
            row, self._free = self._free, []
            return row
        longest = max(self._rows.values(), key=len, default=[])
        at = len(longest) // 2
        taken = longest[at:]
        del longest[at:]
        return taken
