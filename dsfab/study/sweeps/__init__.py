"""Parameter sweeps: many designs from one preset, in memory (`sweep`) or in a folder that survives interruptions.

plan        sweep files: values, constraints, and strict checks
metrics     quantities that a sweep can measure
runs        points, the database of a folder, and the optimiser
workers     processes on this machine, or a Dask cluster
scheduler   gives runs to workers
folder      writes all results"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsfab.core.errors import DsfabError, PresetError
from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.study.sweeps.metrics import BASIC, METRICS, Metric
from dsfab.study.variations import combinations, stage_order

__all__ = ["BASIC", "METRICS", "Run", "sweep"]


@dataclass(frozen=True)
class Run:
    """A design of a sweep: changed preset values by key, metrics by name, and an error message if it was not built."""

    changes: Mapping[str, Any]
    metrics: Mapping[str, float]
    error: str = ""


def sweep(
    preset: Preset,
    vary: Mapping[str, Sequence[Any]],
    metrics: Mapping[str, Metric] | Sequence[str] = BASIC,
    keep: Callable[[Mapping[str, Any], Design], None] | None = None,
) -> list[Run]:
    """Make a design for every combination of the values in `vary`. In the result, the last key changes fastest.
    vary    : dotted preset keys and their values, e.g. {"pattern.major.phase": [0, 0.5], "diffusion.r": [10, 100]}.
    metrics : names from `METRICS`, or a dict that maps names to functions of a Design.
    keep    : function that is called with the changes and the Design of each successful run, e.g. to write files.
    A design that cannot be built gives a Run with an error. The command `dsfab sweep` can use many processes and
    continue after an interruption. Raises PresetError for invalid keys, metrics or values, before anything is built."""
    measured = _metrics(metrics)
    listed = list(combinations(vary))
    presets = [with_overrides(preset, changes) for changes in listed]
    runs: dict[int, Run] = {}
    design: Design | None = None
    for index in stage_order(listed):
        changes = listed[index]
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
