"""`sweep`: every combination of some values, in memory."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from dsfab.errors import DsfabError, PresetError
from dsfab.pipeline import draft
from dsfab.pipeline.design import Design
from dsfab.preset import Preset
from dsfab.preset_file import overridden
from dsfab.study.sweeps.metrics import BASIC, METRICS, Metric
from dsfab.study.sweeps.order import stage_order


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
