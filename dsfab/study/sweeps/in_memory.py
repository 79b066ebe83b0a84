"""Sweeps in memory: all combinations of some values, in an order in which designs share their stages."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from dsfab.core.errors import DsfabError, PresetError
from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.preset.file import overridden
from dsfab.preset.model import STAGES, Preset
from dsfab.study.sweeps.metrics import BASIC, METRICS, Metric

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


@dataclass(frozen=True)
class Run:
    """One design of a sweep: what was changed, what was measured, or why it could not be built."""

    changes: Mapping[str, Any]
    metrics: Mapping[str, float]
    error: str = ""


def sweep(
    preset: Preset,
    vary: Mapping[str, Sequence[Any]],
    metrics: Mapping[str, Metric] | Sequence[str] = BASIC,
    keep: Callable[[Mapping[str, Any], Design], None] | None = None,
) -> list[Run]:
    """Every combination of the values in `vary`, in the order of the last key running fastest.

    vary    : dotted preset keys and their values, e.g. {"pattern.major.phase": [0, 0.5], "diffusion.r": [10, 100]}.
    metrics : names out of `METRICS`, or functions of a Design by name.
    keep    : called with the changes and the Design of each run that worked, e.g. to write files.

    Runs are made in the order that lets most be reused: a sweep over pattern keys solves statics and modes once. With
    metrics by name no stage is made that none of them needs: areas and compliances thicken nothing.
    A design that cannot be built is a Run with its error; it stops nothing.
    For sweeps in a folder, in many processes, that can be stopped and continued: `dsfab sweep`.

    Raises PresetError, before anything is built, for keys, metrics or values that presets do not allow.
    """
    measured = _metrics(metrics)
    combinations = [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]
    presets = [overridden(preset, changes) for changes in combinations]
    runs: dict[int, Run] = {}
    for index, made, error in _designs(presets, stage_order(combinations)):
        changes = combinations[index]
        if made is None:
            runs[index] = Run(changes, {}, error)
            continue
        try:
            runs[index] = Run(changes, {name: measure(made) for name, measure in measured.items()})
            if keep:
                keep(changes, made.until("thickening"))
        except DsfabError as refusal:
            runs[index] = Run(changes, {}, str(refusal))
    return [runs[index] for index in range(len(presets))]


def _metrics(metrics: Mapping[str, Metric] | Sequence[str]) -> dict[str, Callable[[Design], float]]:
    if isinstance(metrics, Mapping):
        return {name: _of_design(metric) for name, metric in metrics.items()}
    unknown = [name for name in metrics if name not in METRICS]
    if unknown:
        raise PresetError(f"metric {unknown[0]!r} is not known; use {', '.join(METRICS)}, or give a function")
    return {name: METRICS[name] for name in metrics}


def _of_design(metric: Metric) -> Callable[[Design], float]:
    return lambda made: float(metric(made.until("thickening")))


def _designs(presets: list[Preset], order: list[int]) -> Iterator[tuple[int, Design | None, str]]:
    """Each design, made from the one before it; a failure starts again from the last that worked."""
    last: Design | None = None
    for index in order:
        try:
            last = draft(presets[index], old=last)
            yield index, last, ""
        except DsfabError as error:
            yield index, None, str(error)
