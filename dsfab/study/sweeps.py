"""Parametric sweeps: many designs of one preset, each stage made once for all designs that share it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from dsfab.design import Design
from dsfab.errors import DsfabError, PresetError
from dsfab.pipeline import revise, run
from dsfab.preset import STAGES, Preset
from dsfab.preset_file import overridden

Metric = Callable[[Design], float]

METRICS: dict[str, Metric] = {
    "area": lambda design: design.sheet.surface.area,
    "kept_share": lambda design: design.sheet.surface.area / design.surface.area,
    "volume": lambda design: design.solid.volume,
    "mass": lambda design: design.mass,
    "pieces": lambda design: float(len(design.slicing.pieces)),
    "genus": lambda design: float(design.solid.genus),
    "compliance_uncut": lambda design: design.statics.equilibrium.compliance,
}
"""What a sweep can measure, in SI units; `compliance_uncut` is that of the surface before it is cut."""


@dataclass(frozen=True)
class Run:
    """One design of a sweep: what was changed, what was measured, or why it could not be built."""

    changes: Mapping[str, Any]
    metrics: Mapping[str, float]
    error: str = ""


def sweep(
    preset: Preset,
    vary: Mapping[str, Sequence[Any]],
    metrics: Mapping[str, Metric] | Sequence[str] = tuple(METRICS),
    keep: Callable[[Mapping[str, Any], Design], None] | None = None,
) -> list[Run]:
    """Every combination of the values in `vary`, in the order of the last key running fastest.

    vary    : dotted preset keys and their values, e.g. {"pattern.major.phase": [0, 0.5], "diffusion.r": [10, 100]}.
    metrics : names out of `METRICS`, or functions of a Design by name.
    keep    : called with the changes and the Design of each run that worked, e.g. to write files.

    Runs are made in the order that lets `revise` reuse most: a sweep over pattern keys solves statics and modes once.
    A design that cannot be built is a Run with its error; it stops nothing.

    Raises PresetError, before anything is built, for keys, metrics or values that presets do not allow.
    """
    measured = _metrics(metrics)
    combinations = [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]
    presets = [overridden(preset, changes) for changes in combinations]
    runs: dict[int, Run] = {}
    for index, design, error in _designs(presets, sorted(range(len(presets)), key=_stage_order(vary, combinations))):
        changes = combinations[index]
        if design is None:
            runs[index] = Run(changes, {}, error)
            continue
        runs[index] = Run(changes, {name: float(metric(design)) for name, metric in measured.items()})
        if keep:
            keep(changes, design)
    return [runs[index] for index in range(len(presets))]


def _metrics(metrics: Mapping[str, Metric] | Sequence[str]) -> Mapping[str, Metric]:
    if isinstance(metrics, Mapping):
        return metrics
    unknown = [name for name in metrics if name not in METRICS]
    if unknown:
        raise PresetError(f"metric {unknown[0]!r} is not known; use {', '.join(METRICS)}, or give a function")
    return {name: METRICS[name] for name in metrics}


def _stage_order(
    vary: Mapping[str, Sequence[Any]], combinations: list[dict[str, Any]]
) -> Callable[[int], tuple[int, ...]]:
    """Sort key of a combination: values of early stages first, so that neighbours share as many stages as can be."""
    keys = sorted(vary, key=lambda key: STAGES.index(key.split(".")[0]) if key.split(".")[0] in STAGES else len(STAGES))
    places = {key: list(vary[key]) for key in keys}
    return lambda index: tuple(places[key].index(combinations[index][key]) for key in keys)


def _designs(presets: list[Preset], order: list[int]) -> Iterator[tuple[int, Design | None, str]]:
    """Each design, revised from the one before it; a failure starts again from the last that worked."""
    last: Design | None = None
    for index in order:
        try:
            last = revise(last, presets[index]) if last else run(presets[index])
            yield index, last, ""
        except DsfabError as error:
            yield index, None, str(error)
