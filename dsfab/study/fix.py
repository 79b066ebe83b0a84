"""`fixed_design`: a preset changed until what it makes keeps to its limits of fabrication, or why it cannot be."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dsfab.errors import PatternError
from dsfab.pipeline import revise
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress
from dsfab.preset import Preset
from dsfab.preset_file import overridden
from dsfab.study.fabrication import Check, FabricationMeasures, fabrication

ATTEMPTS = 8
"""So many changes are tried, each measured on the whole design."""

MARGIN = 1.02
"""Widths are asked for this much over the limit: slicing moves lines by hairs."""

LARGEST_STEP = 1.25
"""A width that came out too small is asked for again, larger by at most this factor."""

COARSER, COARSEST = 0.85, 0.6
"""What frequencies are multiplied by where no width helps, at most and at least."""


@dataclass(frozen=True, eq=False)
class Fixed:
    """A design that keeps to its limits, what was measured on it, and the keys that were changed: old and new value."""

    design: Design
    made: FabricationMeasures
    changes: Mapping[str, tuple[Any, Any]]


def fixed_design(design: Design, progress: Progress | None = None) -> Fixed:
    """The design with wider members and gaps, or fewer of them, until no check of its [fabrication] fails.

    Members: pattern.width.min_width, and the rim or the kept region where these are narrow. Gaps: pattern.width.min_gap
    fills those between two stripes of a family, slicing.min_opening what is left between families. Then both are asked
    to be larger, and frequencies are lowered. Each change is made on the design before: nothing is solved twice.

    Raises PatternError where another section must change (walls, bed), and when `ATTEMPTS` changes do not suffice.
    """
    original, made = design.preset, fabrication(design)
    for turn in range(ATTEMPTS):
        if not made.failed:
            return Fixed(design, made, _differences(original, design.preset))
        for check in made.failed:
            _refuse_hopeless(check)
        changes = _changes(design, made) | (_coarser(design, made) if turn >= ATTEMPTS // 2 else {})
        try:
            design = revise(design, overridden(design.preset, changes), progress)
        except PatternError:  # wider stripes and the wanted share of material contradict each other
            design = revise(design, overridden(design.preset, _coarser(design, made)), progress)
        made = fabrication(design)
    if made.failed:
        left = "; ".join(
            f"{check.name} {_mm(check.limit[0])}: {_mm(check.value[0])}, {check.what}" for check in made.failed
        )
        fewer = "raise pattern.*.spacing" if design.pattern.even else "lower pattern.*.frequency, or choose other modes"
        raise PatternError(
            f"{ATTEMPTS} changes of widths and distances did not meet the limits of fabrication ({left}); lower the "
            f"limits, or {fewer}"
        )
    return Fixed(design, made, _differences(original, design.preset))


def _refuse_hopeless(check: Check) -> None:
    if check.name == "min_wall":
        raise PatternError(
            f"the thinnest wall is {_mm(check.value[0])}, the limit fabrication.min_wall {_mm(check.limit[0])}: no "
            "pattern changes that; raise statics.thickness"
        )
    if check.name == "bed":
        size, bed = (" x ".join(_mm(x) for x in values) for values in (check.value, check.limit))
        raise PatternError(
            f"the solid is {size}, the bed of the machine {bed}: no pattern changes that; split it with "
            "[[thickening.extra]] kind = 'split', or raise fabrication.bed"
        )


def _changes(design: Design, made: FabricationMeasures) -> dict[str, Any]:
    """The next values of the keys that can help, from what failed."""
    pattern, changes = design.preset.pattern, dict[str, Any]()
    failed = {check.name: check for check in made.failed}
    if check := failed.get("min_member"):
        changes |= _wider(design.preset, check)
    if check := failed.get("min_gap"):
        key, old = "pattern.width.min_gap", pattern.width.min_gap
        if old >= check.limit[0]:
            key, old = "slicing.min_opening", design.preset.slicing.min_opening or 0.0
        changes[key] = _raised(old, check)
    return changes


def _coarser(design: Design, made: FabricationMeasures) -> dict[str, Any]:
    """Fewer stripes, by as much as a member that failed is too narrow, within limits."""
    short = min((c.value[0] / c.limit[0] for c in made.failed if c.name == "min_member"), default=COARSER)
    by, changes = min(max(short, COARSEST), COARSER), dict[str, Any]()
    pattern = design.preset.pattern
    for name, family in zip(pattern.family_names, pattern.drawn, strict=True):
        if family.spacing or design.pattern.even:
            spacing = family.distance(design.surface.area, design.surface.mean_edge)
            changes[f"pattern.{name}.spacing"] = _rounded(spacing / by)
        else:
            changes[f"pattern.{name}.frequency"] = _rounded(family.frequency * by)
    return changes


def _wider(preset: Preset, check: Check) -> dict[str, Any]:
    """Wider stripes, or a wider rim or kept region where that is what is narrow."""
    pattern = preset.pattern
    if check.what == "the rim" and pattern.rim < MARGIN * check.limit[0]:
        return {"pattern.rim": _raised(pattern.rim, check)}
    width = _raised(pattern.width.asked_least, check)
    changes = {"pattern.width.min_width": width}
    if check.what == "a kept region":
        changes["pattern.keep"] = _raised(pattern.keep, check)
    if 0 < pattern.width.max_width < width:
        changes["pattern.width.max_width"] = width
    return changes


def _raised(old: float, check: Check) -> float:
    """The limit, or more where the limit was asked before and came out smaller."""
    limit = MARGIN * check.limit[0]
    if old < limit:
        return _rounded(limit)
    return _rounded(old * min(LARGEST_STEP, max(MARGIN, check.limit[0] / max(check.value[0], 1e-300))))


def _rounded(value: float) -> float:
    """Four digits: a value that a person may copy into a preset."""
    return float(f"{value:.4g}")


def _differences(old: Preset, new: Preset) -> dict[str, tuple[Any, Any]]:
    """Dotted keys whose values differ."""

    def leaves(values: Any, path: str) -> dict[str, Any]:
        if not isinstance(values, dict):
            return {path: values}
        return {k: v for key, value in values.items() for k, v in leaves(value, f"{path}.{key}".strip(".")).items()}

    before, after = (leaves(preset.model_dump(mode="json"), "") for preset in (old, new))
    return {key: (before.get(key), value) for key, value in after.items() if before.get(key) != value}


def _mm(metres: float) -> str:
    return f"{1000 * metres:.3g} mm"
