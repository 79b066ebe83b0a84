"""Sweeps in memory: all combinations of values, in an order in which designs share their stages."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from dsfab.core.errors import DsfabError, PresetError
from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.preset.file import with_overrides
from dsfab.preset.model import STAGES, Preset
from dsfab.study.sweeps.metrics import BASIC, METRICS, Metric

Signature = tuple[str, ...]  # for each stage, in order: the changed values of its keys, as text


def signature(changes: Mapping[str, Any]) -> Signature:
    """Return the changed values of each stage as a text. Two runs share all stages before the first different text."""
    by_stage: dict[str, dict[str, Any]] = {stage: {} for stage in STAGES}
    for key, value in changes.items():
        section = key.split(".")[0]
        if section in by_stage:
            by_stage[section][key] = value
    return tuple(json.dumps(values, sort_keys=True, default=str) for values in by_stage.values())


def stage_order(runs: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return indices of the runs in an order in which successive runs share many stages: keys of early stages change
    least often. Values of a stage keep the order in which they first appear."""
    signatures = [signature(changes) for changes in runs]
    places: list[dict[str, int]] = [{} for _ in STAGES]
    for texts in signatures:
        for place, text in zip(places, texts, strict=True):
            place.setdefault(text, len(place))
    ranks = [[place[text] for place, text in zip(places, texts, strict=True)] for texts in signatures]
    return sorted(range(len(runs)), key=ranks.__getitem__)


class Rows:
    """Queues of waiting runs: one queue for each worker, and one queue of runs that belong to no worker."""

    def __init__(self, numbers: Sequence[int], changes: Sequence[Mapping[str, Any]]) -> None:
        self._free: list[int] = [numbers[i] for i in stage_order(changes)]
        self._rows: dict[str, list[int]] = {}

    def __len__(self) -> int:
        return len(self._free) + sum(len(row) for row in self._rows.values())

    def take(self, worker: str) -> int | None:
        """Return the next run of a worker, or None. A worker with an empty queue takes over the free runs, or half of
        the longest queue."""
        row = self._rows.setdefault(worker, [])
        if not row:
            self._rows[worker] = row = self._take_share()
        return row.pop(0) if row else None

    def give_back(self, worker: str, number: int) -> None:
        """Put back a run that the next free worker must try again."""
        self._free.insert(0, number)
        self.leave(worker)

    def leave(self, worker: str) -> None:
        """Free the runs in the queue of a worker that has gone, so that any worker can take them."""
        self._free.extend(self._rows.pop(worker, []))

    def _take_share(self) -> list[int]:
        if self._free:
            row, self._free = self._free, []
            return row
        longest = max(self._rows.values(), key=len, default=[])
        middle = len(longest) // 2
        taken = longest[middle:]
        del longest[middle:]
        return taken


@dataclass(frozen=True)
class Run:
    """One design of a sweep: its changes and metrics, or the error that stopped it."""

    changes: Mapping[str, Any]
    metrics: Mapping[str, float]
    error: str = ""


def sweep(
    preset: Preset,
    vary: Mapping[str, Sequence[Any]],
    metrics: Mapping[str, Metric] | Sequence[str] = BASIC,
    keep: Callable[[Mapping[str, Any], Design], None] | None = None,
) -> list[Run]:
    """Run every combination of the values in `vary`; the value of the last key changes most often.
    vary    : dotted preset keys and their values, e.g. {"pattern.major.phase": [0, 0.5], "diffusion.r": [10, 100]}.
    metrics : names from `METRICS`, or a dict of names and functions of a Design.
    keep    : receives the changes and the Design of each successful run, e.g. to write files.
    Successive runs share stages: a sweep over pattern keys solves statics and modes once. For metrics from `METRICS`,
    only the necessary stages run. A design that cannot be built gives a Run with the error. The command `dsfab sweep`
    runs a sweep in a folder, with many processes; it can continue after a stop.
    Raises PresetError for invalid keys, metrics or values, before anything is built."""
    measured = _metrics(metrics)
    combinations = [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]
    presets = [with_overrides(preset, changes) for changes in combinations]
    runs: dict[int, Run] = {}
    design: Design | None = None
    for index in stage_order(combinations):
        changes = combinations[index]
        try:
            design = draft(presets[index], earlier=design)
            runs[index] = Run(changes, {name: measure(design) for name, measure in measured.items()})
            if keep:
                keep(changes, design.until("thickening"))
        except DsfabError as error:
            runs[index] = Run(changes, {}, str(error))
    return [runs[index] for index in range(len(presets))]


def _metrics(metrics: Mapping[str, Metric] | Sequence[str]) -> dict[str, Callable[[Design], float]]:
    if isinstance(metrics, Mapping):
        return {name: _after_thickening(metric) for name, metric in metrics.items()}
    unknown = [name for name in metrics if name not in METRICS]
    if unknown:
        raise PresetError(f"metric {unknown[0]!r} is not known; use {', '.join(METRICS)}, or give a function")
    return {name: METRICS[name] for name in metrics}


def _after_thickening(metric: Metric) -> Callable[[Design], float]:
    return lambda design: float(metric(design.until("thickening")))
