"""Fabrication limits: the smallest members, gaps and walls of a design."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import PatternError, StaticsError
from dsfab.core.limits import FILM, Status
from dsfab.core.messages import length, point_words
from dsfab.design import acting_on, least_widths, revise, sheet_loads
from dsfab.design.design import Design
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.results import Progress
from dsfab.slicing.finishing.mesh_quality import Quality, quality
from dsfab.slicing.measures.widths import Feature, Features, features, kept_cells
from dsfab.surface import Picker, edges_of, load_names, pieces, support_names
from dsfab.thickening.wall_thickness import Wall, thinnest_wall


@dataclass(frozen=True, eq=False)
class Check:
    """A fabrication limit and the measured value, metres. The check `bed` has three limits and three sizes.
    name  : key of the preset's section [fabrication], such as "min_gap".
    value : measured value.    place, what : position and description of the part that was measured.
    asked : True if the preset sets the limit; False for a default limit."""

    name: str
    limit: tuple[float, ...]
    value: tuple[float, ...]
    place: tuple[float, ...]
    what: str
    verdict: Status
    asked: bool = True


@dataclass(frozen=True)
class PieceContacts:
    """A connected piece of the sheet, and the supports and loads that touch it. area : m2.
    supports, loads : numbers of these supports and loads in the preset, from 1.    names : their names."""

    area: float
    supports: tuple[int, ...]
    loads: tuple[int, ...]
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FabricationMeasures:
    """Measured sizes of a design that matter for fabrication, in metres, and checks of the fabrication limits."""

    thickness: float
    features: Features
    wall: Wall | None
    box: Floats
    pieces: tuple[PieceContacts, ...]
    quality: Quality
    checks: tuple[Check, ...]

    @property
    def failed_checks(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if check.verdict == "fail")


def fabrication(design: Design) -> FabricationMeasures:
    """Measure the sheet and the solid of a design, and check the preset's fabrication limits."""
    cells = design.slicing.cells
    least = least_widths(design.resolved_preset, design.surface)
    sizes = features(cells, kept_cells(cells, design.sheet), design.pattern.names, tips=least.gap > 0)
    wall, box = thinnest_wall(design.solid), np.ptp(design.solid.box, axis=0)
    limits = design.preset.fabrication
    checks = []
    if limit := limits.min_member or least.member:
        checks.append(_limit_check("min_member", limit, sizes.member, is_requested=limits.min_member > 0))
    if limit := limits.min_gap or least.gap:
        checks.append(_limit_check("min_gap", limit, sizes.gap, is_requested=limits.min_gap > 0))
    if limits.min_wall:
        feature = None if wall is None else Feature(wall.thickness, wall.place, "a wall of the solid", 0.0)
        checks.append(_limit_check("min_wall", limits.min_wall, feature))
    if limits.bed is not None:
        fits = bool((np.sort(box) <= np.sort(limits.bed)).all())
        size = tuple(box.tolist())
        checks.append(Check("bed", limits.bed, size, (), "the whole solid", "pass" if fits else "fail"))
    touches, thickness = _piece_contacts(design), design.preset.statics.thickness
    return FabricationMeasures(thickness, sizes, wall, box, touches, quality(design.sheet.surface), tuple(checks))


def refusals(design: Design, measured: FabricationMeasures | None = None) -> tuple[str, ...]:
    """Return the reasons why a design should not be exported, or an empty tuple.
    measured : result of `fabrication`; None to leave out the checks of members and gaps."""
    loads, why = {name: case.load for name, case in design.statics.cases.items()}, []
    try:
        sheet_loads(design.surface, design.slicing.cells.subset(), design.sheet, loads)
    except StaticsError as error:
        why.append(str(error))
    repairs = design.solid.repairs
    if repairs.thinnest < FILM and repairs.thinnest_at is not None:
        thin = length(repairs.thinnest * design.preset.statics.thickness)
        why.append(f"the thickened sheet has become a film of only {thin} at {point_words(repairs.thinnest_at)}")
    for check in measured.failed_checks if measured and design.resolved_preset.pattern.for_workshop else ():
        if check.name in ("min_member", "min_gap") and check.value[0] < 1e-3:
            why.append(
                f"{check.what} of {length(check.value[0])} at {point_words(check.place)} is too small for fabrication"
            )
    return tuple(why)


def require_fit(design: Design, measured: FabricationMeasures | None = None, measure: bool = True) -> None:
    """Raise PatternError if `refusals` finds reasons against an export, unless the preset accepts them.
    measured : result of `fabrication`.    measure : True to compute this result if it is missing."""
    if measured is None and measure and design.resolved_preset.pattern.for_workshop:
        measured = fabrication(design)
    if not design.preset.fabrication.accept and (why := refusals(design, measured)):
        raise PatternError(f"{'; '.join(why)}. To export it anyway, use --accept or set fabrication.accept = true")


def _limit_check(name: str, limit: float, feature: Feature | None, is_requested: bool = True) -> Check:
    if feature is None:
        return Check(name, (limit,), (), (), "", "pass", is_requested)
    verdict: Status = "fail" if feature.size < limit else "pass"
    return Check(name, (limit,), (feature.size,), tuple(feature.place.tolist()), feature.what, verdict, is_requested)


def _piece_contacts(design: Design) -> tuple[PieceContacts, ...]:
    sheet, acting = design.sheet, acting_on(design.preset, design.surface)
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)

    def numbers_touching(entries: Sequence[object]) -> list[list[int]]:
        numbers: list[list[int]] = [[] for _ in range(count)]
        for number, entry in enumerate(entries, 1):
            if (picker := getattr(entry, "at", None)) is not None:
                for k in _pieces_at(design, picker, label):
                    numbers[k].append(number)
        return numbers

    supports, loads = numbers_touching(acting.support), numbers_touching(acting.load)
    called = support_names(acting.support), load_names(acting.load)

    def piece(k: int) -> PieceContacts:
        names = [
            names[number - 1]
            for names, numbers in zip(called, (supports[k], loads[k]), strict=True)
            for number in numbers
        ]
        return PieceContacts(float(area[k]), tuple(supports[k]), tuple(loads[k]), tuple(names))

    return tuple(map(piece, range(count)))


def _pieces_at(design: Design, picker: Picker, label: Ints) -> list[int]:
    surface = design.surface
    is_touched = design.sheet.vertices_between(surface, picker.vertices(surface), edges_of(picker, surface))
    return [int(k) for k in np.unique(label[is_touched[design.sheet.surface.F].any(axis=1)])]


ATTEMPTS = 8  # most changes of a design; each change takes a whole run
MARGIN = 1.02  # requested width divided by the limit: above 1 because slicing may narrow a member slightly
COARSER, COARSEST = 0.85, 0.6  # one change of a design multiplies the frequencies of its stripes by 0.6 to 0.85


@dataclass(frozen=True, eq=False)
class FixedDesign:
    """A design that meets the fabrication limits after changes of its preset.
    made : measured sizes of the design.    changes : old and new value of each changed preset key."""

    design: Design
    made: FabricationMeasures
    changes: Mapping[str, tuple[Any, Any]]


def fixed_design(design: Design, progress: Progress | None = None) -> FixedDesign:
    """Return a changed design that meets all limits of [fabrication].
    Raises PatternError if `ATTEMPTS` changes do not suffice, or if `min_wall` or `bed` fails."""
    original, measured = design.preset, fabrication(design)
    for turn in range(ATTEMPTS):
        if not measured.failed_checks:
            return FixedDesign(design, measured, _differences(original, design.preset))
        for check in measured.failed_checks:
            _refuse_unfixable(check)
        changes = _changes(design, measured) | (fewer_stripes(design, measured) if turn >= ATTEMPTS // 2 else {})
        try:
            design = revise(design, with_overrides(design.preset, changes), progress)
        except PatternError:  # wider stripes may not fit into the requested share
            design = revise(design, with_overrides(design.preset, fewer_stripes(design, measured)), progress)
        measured = fabrication(design)
    if measured.failed_checks:
        failed = measured.failed_checks
        failures = "; ".join(f"{x.name} {_mm(x.limit[0])}: {_mm(x.value[0])}, {x.what}" for x in failed)
        fewer = (
            "raise pattern.*.spacing"
            if design.pattern.even
            else "lower the frequency of the stripes (pattern.*.frequency), or choose other modes"
        )
        raise PatternError(
            f"the design does not meet the limits of fabrication after {ATTEMPTS} changes of widths and spacings "
            f"({failures}); lower the limits, or {fewer}"
        )
    return FixedDesign(design, measured, _differences(original, design.preset))


def _refuse_unfixable(check: Check) -> None:
    if check.name == "min_wall":
        raise PatternError(
            f"the thinnest wall is {_mm(check.value[0])}, below the limit fabrication.min_wall = "
            f"{_mm(check.limit[0])}; a change of the pattern does not make walls thicker: raise statics.thickness"
        )
    if check.name == "bed":
        size, bed = (" x ".join(_mm(x) for x in values) for values in (check.value, check.limit))
        raise PatternError(
            f"the size of the solid is {size}, larger than the machine, {bed}; a change of the pattern does not make "
            f"the solid smaller: split the solid with [[thickening.extra]] kind = 'split', or raise fabrication.bed"
        )


def _changes(design: Design, measured: FabricationMeasures) -> dict[str, Any]:
    pattern, changes = design.preset.pattern, dict[str, Any]()
    failed = {check.name: check for check in measured.failed_checks}
    if check := failed.get("min_member"):
        changes |= _wider_stripes(design.preset, check)
    if check := failed.get("min_gap"):
        key, current = "pattern.width.min_gap", pattern.width.min_gap
        if current >= check.limit[0]:
            key, current = "slicing.min_opening", design.preset.slicing.min_opening or 0.0
        changes[key] = raised_value(current, check)
    return changes


def fewer_stripes(design: Design, measured: FabricationMeasures) -> dict[str, Any]:
    """Return new values of preset keys, such as pattern.major.spacing, that give fewer stripes."""
    short = min((c.value[0] / c.limit[0] for c in measured.failed_checks if c.name == "min_member"), default=COARSER)
    return spacing_changes(design, 1 / min(max(short, COARSEST), COARSER))


def spacing_changes(design: Design, factor: float) -> dict[str, Any]:
    """Return new values of preset keys that multiply the spacing of all stripes by `factor`."""
    pattern, changes = design.preset.pattern, dict[str, Any]()
    for name, family in zip(pattern.family_names, pattern.drawn_families, strict=True):
        if family.spacing or design.pattern.even:
            spacing = family.distance(design.surface.area, design.surface.mean_edge)
            changes[f"pattern.{name}.spacing"] = _four_digits(spacing * factor)
        else:
            changes[f"pattern.{name}.frequency"] = _four_digits(family.frequency / factor)
    return changes


def _wider_stripes(preset: Preset, check: Check) -> dict[str, Any]:
    pattern = preset.pattern
    if check.what == "the rim" and pattern.rim < MARGIN * check.limit[0]:
        return {"pattern.rim": raised_value(pattern.rim, check)}
    width = raised_value(pattern.width.asked_least, check)
    changes = {"pattern.width.min_width": width}
    if check.what == "a kept region":
        changes["pattern.keep"] = raised_value(pattern.keep, check)
    if 0 < pattern.width.max_width < width:
        changes["pattern.width.max_width"] = width
    return changes


def raised_value(value: float, check: Check) -> float:
    """Return a width (m) larger than `value` for the next attempt to meet the limit of a failed check."""
    limit = MARGIN * check.limit[0]
    if value < limit:
        return _four_digits(limit)
    return _four_digits(value * min(1.25, max(MARGIN, check.limit[0] / max(check.value[0], 1e-300))))


def _four_digits(value: float) -> float:
    return float(f"{value:.4g}")


def _differences(old: Preset, new: Preset) -> dict[str, tuple[Any, Any]]:
    def leaves(values: Any, path: str) -> dict[str, Any]:
        if not isinstance(values, dict):
            return {path: values}
        return {k: v for key, value in values.items() for k, v in leaves(value, f"{path}.{key}".strip(".")).items()}

    before, after = (leaves(preset.model_dump(mode="json"), "") for preset in (old, new))
    return {key: (before.get(key), value) for key, value in after.items() if before.get(key) != value}


def _mm(metres: float) -> str:
    return f"{1000 * metres:.3g} mm"
