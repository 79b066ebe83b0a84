"""Finishing of the cut: least widths, round corners, and removal of point contacts, slits and spikes."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.design.log import Log
from dsfab.preset.model import Pattern, Preset, Slicing
from dsfab.results import PatternResult
from dsfab.slicing import (
    LeastWidths,
    Merging,
    PolygonMesh,
    Sheet,
    bridged_gaps,
    bridged_necks,
    cut_polygons,
    divided_walls,
    faired_walls,
    filled_crumbs,
    filled_openings,
    filled_slits,
    improve_cells,
    resolve_pinches,
    sheet_of,
    widened_members,
    with_least_widths,
    without_spikes,
)
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.surface import Surface

SPECK = 0.15
"""Openings between evenly spaced stripes that are smaller than this share of the spacing are filled: the rest of an
opening at the edge of the surface."""
BRIDGED_SHARE, ROUNDING_ROUNDS = 0.95, 5
"""Gaps between rounded members narrower than this share of a neck are bridged too, in up to this number of rounds."""


class FinishedCells(NamedTuple):
    """Finished cells with round corners; numbers of details changed, radii, and places of widened members."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int
    rounded: Floats
    widened: int = 0


class Unrounded(NamedTuple):
    """Finished cells before corners are rounded: no point contacts, specks, slits, necks and spikes; their numbers."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int


class FirstRounding(NamedTuple):
    """Cells after the first rounding of corners, the radii, and the number of slits filled then."""

    cells: Sheet
    radii: Floats
    merged: int


class SmallestWidths(NamedTuple):
    """Metres: smaller openings are filled, and openings with a narrower neck are bridged; 0 for neither."""

    opening: float
    neck: float


class FinishingOptions(NamedTuple):
    """Options that decide the finishing, up to the first rounding of corners; metres."""

    snap: float
    pinch: str
    min_opening: float | None
    smallest: SmallestWidths
    merge: Merging
    thickness: float
    fillet: float


def _finishing_options(
    preset: Preset, slicing: Slicing, smallest: SmallestWidths, pattern: PatternResult
) -> FinishingOptions:
    thickness_and_fillet = preset.statics.thickness, preset.pattern.fillet
    return FinishingOptions(
        slicing.snap, slicing.pinch, slicing.min_opening, smallest, merges_slits(preset, pattern), *thickness_and_fillet
    )


@dataclass(frozen=True, eq=False)
class TrialCut:
    """The trial cut of a pattern from the search for its widths: slicing with the same options continues from it.

    drawn   : weak references to the fields, levels and tidy of the pattern: fields may keep the surface alive.
    terms   : options of finishing.    cells : as they were cut.
    rounded, bridged : after the first rounding, and with bridges by the defaults of [slicing].
    cured   : least widths of openings and members, metres, and the sheet that keeps them.
    """

    drawn: tuple[ref[Any], ...]
    terms: FinishingOptions
    cells: Sheet
    unrounded: Unrounded
    rounded: FirstRounding | None
    bridged: "RoundedCells | None" = None
    cured: tuple[tuple[float, float], LeastWidths] | None = None

    def matches(self, pattern: PatternResult, options: FinishingOptions) -> bool:
        """Return whether a pattern with these options would be cut and finished in the same way."""
        pattern_refs = _pattern_refs(pattern)
        unchanged = len(pattern_refs) == len(self.drawn) and all(
            a() is b() for a, b in zip(pattern_refs, self.drawn, strict=True)
        )
        return unchanged and options == self.terms

    @property
    def latest_cells(self) -> Sheet:
        """The cells after the latest step of finishing."""
        return (self.bridged or self.rounded or self.unrounded).cells

    def with_least_widths(self, gap: float, member: float) -> LeastWidths:
        """Return these cells with least widths, metres, of openings and members."""
        if self.cured and self.cured[0] == (gap, member):
            return self.cured[1]
        neck = least_neck(self.terms.smallest, self.terms.merge, self.terms.fillet)
        return with_least_widths(self.latest_cells, gap, member, self.terms.merge, neck)


def _pattern_refs(pattern: PatternResult) -> tuple[ref[Any], ...]:
    return tuple(ref(part) for part in (*pattern.fields, *pattern.levels, pattern.tidy) if part is not None)


_TRIAL_CUTS: WeakKeyDictionary[Surface, TrialCut] = WeakKeyDictionary()
"""The latest trial cut of each surface, until slicing takes it."""


def take_trial_cut(
    preset: Preset, surface: Surface, pattern: PatternResult, smallest: SmallestWidths
) -> TrialCut | None:
    """Remove and return the trial cut of a surface if slicing can continue from it; its memory is needed later."""
    trial_cut = _TRIAL_CUTS.pop(surface, None)
    if trial_cut is None or not trial_cut.matches(
        pattern, _finishing_options(preset, preset.slicing, smallest, pattern)
    ):
        return None
    return trial_cut


def finished_cells(
    preset: Preset,
    cells: Sheet,
    slicing: Slicing,
    smallest: SmallestWidths,
    merging_rule: Merging,
    rounds: int = ROUNDING_ROUNDS,
    trial_cut: TrialCut | None = None,
) -> FinishedCells:
    """Finish cells after the cut; fill slits and bridge necks by `merging_rule`, and gaps of rounded members in
    `rounds`.

    trial_cut : of these cells, if it exists: its steps are not repeated.
    """
    unrounded = trial_cut.unrounded if trial_cut else unrounded_cells(preset, cells, slicing, smallest, merging_rule)
    if not preset.pattern.fillet:
        return FinishedCells(*unrounded, np.empty(0))
    least = _least_rounded(smallest, slicing, merging_rule)
    first_rounding, rounded = (trial_cut.rounded, trial_cut.bridged) if trial_cut else (None, None)
    if rounded is None or rounds != ROUNDING_ROUNDS or least != _least_rounded(smallest, Slicing(), merging_rule):
        rounded = _rounded_cells(unrounded.cells, preset.pattern.fillet, merging_rule, least, rounds, first_rounding)
    merged, bridged = unrounded.merged + rounded.merged, unrounded.bridged + rounded.bridged
    return FinishedCells(
        rounded.cells,
        unrounded.pinches,
        unrounded.filled,
        merged,
        bridged,
        unrounded.spikes,
        rounded.radii,
        rounded.widened,
    )


def unrounded_cells(
    preset: Preset, cells: Sheet, slicing: Slicing, smallest: SmallestWidths, merge: Merging
) -> Unrounded:
    """Finish cells after the cut, without rounding corners."""
    pinched = resolve_pinches(cells, preset.statics.thickness / 2, slicing.pinch)
    cells, filled, merged, bridged, spikes = pinched.sheet, 0, 0, 0, 0
    fills_after_slits = merge != "none" and slicing.min_opening is None  # most of these are slits
    if smallest.opening and not fills_after_slits:
        cells, filled = filled_openings(cells, smallest.opening)
    if merge != "none":
        cells, merged = filled_slits(cells, merge)
    if smallest.opening and fills_after_slits:
        cells, filled = filled_openings(cells, smallest.opening, alike=True)
    if smallest.opening and slicing.min_opening is None:
        cells, crumbs = filled_crumbs(cells)
        filled += crumbs
    if smallest.neck and merge != "none":
        cells, bridged = bridged_necks(cells, smallest.neck)
    if merge != "none":
        cells, later_merged = filled_slits(
            divided_walls(faired_walls(cells)), merge
        )  # fairing opens or closes thin slits
        merged += later_merged
        cells, spikes = without_spikes(cells)
    return Unrounded(cells, pinched.count, filled, merged, bridged, spikes)


class LeastRounded(NamedTuple):
    """Metres: narrower rounded openings and members are bridged and widened; 0 for neither."""

    neck: float
    member: float


def _least_rounded(smallest: SmallestWidths, slicing: Slicing, merge: Merging) -> LeastRounded:
    """Return the widths below which openings are bridged and members widened; none if slits stay."""
    return LeastRounded(smallest.neck, slicing.min_member or 0.0) if merge != "none" else LeastRounded(0.0, 0.0)


def least_neck(smallest: SmallestWidths, merge: Merging, fillet: float) -> float:
    """Return metres below which openings with round corners are bridged, except tips; 0 for none."""
    return BRIDGED_SHARE * smallest.neck if fillet and merge != "none" else 0.0


class RoundedCells(NamedTuple):
    """Cells with round corners, their radii, slits filled, bridges built, and places of widened members."""

    cells: Sheet
    radii: Floats
    merged: int
    bridged: int
    widened: int


def _rounded_cells(
    cells: Sheet,
    radius: float,
    merge: Merging,
    least: LeastRounded,
    rounds: int,
    first_rounding: FirstRounding | None = None,
) -> RoundedCells:
    """Round corners, and repeat in up to `rounds` where the result is too narrow; fill slits by `merge`.

    first_rounding : the first result, if it exists.
    """
    bridged, widened, previous_count = 0, 0, cells.surface.m
    for attempt in range(rounds + 1):
        rounded, radii, merged = first_rounding or _rounded_once(cells, radius, merge)
        first_rounding = None
        if attempt == rounds:
            break
        better, bridges, places = _bridged_or_widened(cells, rounded, least)
        if not (bridges or places) or places > previous_count:  # done, or the rounds do not converge
            break
        cells, bridged, widened, previous_count = better, bridged + bridges, widened + places, places or previous_count
    return RoundedCells(rounded, radii, merged, bridged, widened)


def _rounded_once(cells: Sheet, radius: float, merge: Merging) -> FirstRounding:
    rounded, radii = rounded_corners(cells, radius)
    rounded, merged = (
        filled_slits(rounded, merge) if merge != "none" and len(radii) else (rounded, 0)
    )  # round corners narrow the openings
    return FirstRounding(rounded, radii, merged)


def _bridged_or_widened(cells: Sheet, rounded: Sheet, least: LeastRounded) -> tuple[Sheet, int, int]:
    """Bridge gaps of the rounded sheet, or else widen its members; return cells, bridges and widened places."""
    if least.neck:
        better, bridges = bridged_gaps(cells, rounded, BRIDGED_SHARE * least.neck, least.neck)
        if bridges:
            better, neck_bridges = bridged_necks(better, least.neck)
            return better, bridges + neck_bridges, 0
    better, places = widened_members(cells, rounded, least.member) if least.member else (cells, 0)
    return better, 0, places


def merges_slits(preset: Preset, pattern: PatternResult) -> Merging:
    """Return which members with a slit between them merge, in tidied patterns; see `merging_rule`.

    Patterns without stripes keep their slits: a topology optimisation, cut by the same preset, meets its mass as it is.
    """
    has_stripes = pattern.even is not None or pattern.preset_with_choices(preset).pattern.method == "modes"
    return merging_rule(preset) if pattern.tidy is not None and has_stripes else "none"


def merging_rule(preset: Preset) -> Merging:
    """Return whether all slits are filled, or only those of crowded members.

    With more than half of the surface solid, members are hardly narrower than openings anyway.
    """
    return "crowded" if preset.pattern.width.solid_fraction > 0.5 else "slits"


def added_share(preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None) -> float:
    """Return the share of the surface that finishing, mainly round corners, adds to the stripes of a pattern.

    It uses the defaults of [slicing], because no stage depends on a later section. Slicing continues from that cut if
    it can.
    polygons : the surface cut along the pattern, if it exists.
    """
    slicing, fields = Slicing(), (pattern.fields, pattern.levels)
    cells = sheet_of(polygons or cut_polygons(surface, *fields, slicing.snap, pattern.tidy))
    if not cells.material.any():
        return 0.0
    smallest = smallest_widths(pattern.preset_with_choices(preset.model_copy(update={"slicing": slicing})), surface)
    merge = merges_slits(preset, pattern)
    unrounded = unrounded_cells(preset, cells, slicing, smallest, merge)
    radius = preset.pattern.fillet
    rounded = _rounded_once(unrounded.cells, radius, merge) if radius else None
    finished = rounded.cells if rounded else unrounded.cells
    options = _finishing_options(preset, slicing, smallest, pattern)
    _TRIAL_CUTS[surface] = TrialCut(_pattern_refs(pattern), options, cells, unrounded, rounded)
    return (_material_area(finished) - _material_area(cells)) / surface.area


def bridged_share(surface: Surface) -> float:
    """Return the share of the surface that bridges add to the latest trial cut; 0 without one.

    Bridges fill gaps that are too narrow between rounded members.
    """
    trial_cut = _TRIAL_CUTS.get(surface)
    if trial_cut is None or trial_cut.rounded is None:
        return 0.0
    options = trial_cut.terms
    least = _least_rounded(options.smallest, Slicing(), options.merge)
    unrounded_sheet = trial_cut.unrounded.cells
    rounded = _rounded_cells(unrounded_sheet, options.fillet, options.merge, least, ROUNDING_ROUNDS, trial_cut.rounded)
    _TRIAL_CUTS[surface] = replace(trial_cut, bridged=rounded)
    return (_material_area(rounded.cells) - _material_area(trial_cut.rounded.cells)) / surface.area


def widened_share(surface: Surface, gap: float, member: float) -> float:
    """Return the share of the surface that least widths, metres, add to the latest trial cut; 0 without one."""
    trial_cut = _TRIAL_CUTS.get(surface)
    if trial_cut is None:
        return 0.0
    widened = trial_cut.with_least_widths(gap, member)
    _TRIAL_CUTS[surface] = replace(trial_cut, cured=((gap, member), widened))
    return (_material_area(widened.cells) - _material_area(trial_cut.latest_cells)) / surface.area


def _material_area(cells: Sheet) -> float:
    return float(cells.surface.areas[cells.material].sum())


def smallest_widths(preset: Preset, surface: Surface) -> SmallestWidths:
    """Return the smallest openings and necks; evenly spaced openings have necks about as wide as the sheet is thick."""
    options, min_opening = preset.pattern, preset.slicing.min_opening
    if min_opening is not None or options.method != "stripes":
        return SmallestWidths(min_opening or 0.0, min_opening or 0.0)
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    thickness = preset.statics.thickness
    # slits between tidied members are filled anyway
    opening = min(SPECK * spacing, thickness) if options.removes_loose_ends else SPECK * spacing
    # a neck exceeds the thickness by a tenth, because chords round the corners beside a bridge
    return SmallestWidths(opening, min(1.1 * thickness, 0.2 * spacing))


REQUESTED_SHARE = 0.95
"""Members below the usual width are at least this share of the requested one: on flat triangles widths are right to a
few percent."""


class WorkshopWidths(NamedTuple):
    """Least widths of openings and members, metres; 0 for no limit."""

    gap: float
    member: float


def least_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths of a preset on a surface, by [slicing] or by default; none without `pattern.workshop`.

    By default no member is narrower than half the thickness, about the width of a cutter. Members never have more than
    that default: if [slicing] requests more, only members between openings with round corners are widened.
    """
    if not preset.pattern.for_workshop:
        return WorkshopWidths(0.0, 0.0)
    slicing, thickness = preset.slicing, preset.statics.thickness
    gap = usual_gap(thickness, surface.size) if slicing.min_gap is None else slicing.min_gap
    unlimited = preset.pattern.width.min_width == 0
    usual = (
        0.0 if unlimited else min(0.5 * thickness, REQUESTED_SHARE * _least_requested_member(preset.pattern, surface))
    )
    return WorkshopWidths(gap, usual if slicing.min_member is None else min(slicing.min_member, usual))


def usual_gap(thickness: float, size: float) -> float:
    """Return the least width of openings, metres, for a thickness and a diagonal of the surface's box, metres.

    It is a quarter of the thickness, and at least 3 mm for a blade, or a 500th of the size of small things.
    """
    return max(0.25 * thickness, min(3e-3, 1 / 500 * size))


def _least_requested_member(options: Pattern, surface: Surface) -> float:
    """Return the least member width, metres, that the preset requests or permits; infinite without any."""
    width = options.width
    member = width.member if width.rule == "constant" else 0.0
    widths_differ = options.method == "stripes" and width.rule in ("graded", "stressed") and not width.asked_least
    slim = least_member(options, surface) if widths_differ else 0.0
    return min((x for x in (member, width.asked_least, width.max_width, slim) if x), default=float("inf"))


def least_member(options: Pattern, surface: Surface) -> float:
    """Return the least width, metres, of evenly spaced members of varying width, for any thickness.

    It is half the width that equally wide members would have; without a solid fraction half the surface is material.
    """
    density = sum(1 / family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    return 0.5 * (options.width.solid_fraction or 0.5) / density


def kept_to_least_widths(
    preset: Preset,
    cells: Sheet,
    surface: Surface,
    log: Log,
    merge: Merging = "none",
    neck: float = 0.0,
    trial_cut: TrialCut | None = None,
) -> Sheet:
    """Return cells, cut from a surface, without narrow places, as far as added material can; note how many were
    changed.

    Filled strips leave needles with edges of a micrometre, on which quadrature and sparse solvers lose digits: cells
    are flipped and collapsed within the faces of the surface, which moves no edge of the material.

    merge, neck : slits to fill and widths to bridge afterwards, see `with_least_widths`.
    trial_cut   : its steps on these cells are not repeated.
    """
    if not any(least := least_widths(preset, surface)):
        return cells
    if trial_cut and trial_cut.latest_cells is cells:
        widened = trial_cut.with_least_widths(*least)
    else:
        widened = with_least_widths(cells, *least, merge, neck)
    if message := _least_widths_message(least, widened):
        log.note("slicing", message)
    return improve_cells(widened.cells, surface).sheet if widened.bridged or widened.widened else widened.cells


def closed_share(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> float:
    """Return the share of the surface that least widths add to the sheet of a pattern, by the defaults of [slicing].

    polygons : the surface cut along the pattern, if it exists.
    """
    usual = pattern.preset_with_choices(preset.model_copy(update={"slicing": Slicing()}))
    merge, smallest = merges_slits(usual, pattern), smallest_widths(usual, surface)
    polygons = polygons or cut_polygons(surface, pattern.fields, pattern.levels, usual.slicing.snap, pattern.tidy)
    cells = unrounded_cells(usual, sheet_of(polygons), usual.slicing, smallest, merge).cells
    widened = with_least_widths(cells, *_usual_widths(preset, surface), merge).cells
    before, after = (float(sheet.surface.areas[sheet.material].sum()) for sheet in (cells, widened))
    return (after - before) / surface.area


def trial_closed_share(preset: Preset, surface: Surface) -> float:
    """Return the same share for the latest trial cut; 0 without `pattern.workshop`."""
    return widened_share(surface, *_usual_widths(preset, surface)) if preset.pattern.for_workshop else 0.0


def least_drawn_member(preset: Preset, surface: Surface) -> float:
    """Return the least width, metres, of members in the pattern, so that few must be widened; 0 without
    `pattern.workshop`.
    """
    return _usual_widths(preset, surface).member / REQUESTED_SHARE


def _usual_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths by the defaults of [slicing], because no stage depends on a later section."""
    return least_widths(preset.model_copy(update={"slicing": Slicing()}), surface)


def _least_widths_message(least: WorkshopWidths, result: LeastWidths) -> str:
    closed, widened = result.filled + result.bridged, result.widened
    messages = [f"openings narrower than {length(least.gap)} were closed at {_places(closed)}"] * bool(closed)
    messages += [f"members narrower than {length(least.member)} were widened at {_places(widened)}"] * bool(widened)
    messages += [f"{result.merged} openings that this left narrower than the members beside were filled"] * bool(
        result.merged
    )
    messages += [f"bridges were built at {_places(result.necks)} that this left narrow"] * bool(result.necks)
    return ", ".join(messages) and ", ".join(messages) + " (slicing.min_gap, min_member)"


def _places(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"
