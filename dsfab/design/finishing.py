"""Options of finishing from a preset: slits, least openings and least widths; and the material that finishing adds."""

from collections import Counter
from typing import NamedTuple

from dsfab.core.messages import length
from dsfab.preset.model import Pattern, Preset, Slicing
from dsfab.results import PatternResult
from dsfab.slicing import Merging, PolygonMesh, sheet_of, with_least_widths
from dsfab.slicing.finishing.finish import FinishingOptions, TrialCut, tidied_polygons, unrounded_sheet
from dsfab.surface import Surface

SPECK = 0.15
"""Smallest opening between evenly spaced stripes, divided by their spacing. Smaller openings are filled; most of them
lie at the edge of the surface."""


def finishing_options(preset: Preset, surface: Surface, pattern: PatternResult) -> FinishingOptions:
    slicing, merge, resolved = preset.slicing, merges_slits(preset, pattern), pattern.preset_with_choices(preset)
    opening, neck = smallest_widths(resolved, surface)
    cut = slicing.snap, slicing.pinch, preset.statics.thickness, slicing.min_opening is not None
    openings = opening, merge, neck, preset.pattern.fillet
    least, tolerance = least_widths(resolved, surface), slicing.tolerance if slicing.improve else None
    return FinishingOptions(*cut, *openings, slicing.min_member or 0.0, least, tolerance)


def merges_slits(preset: Preset, pattern: PatternResult) -> Merging:
    """Return the members that merge across a slit; see `merging_rule`.
    Only tidied stripes merge: a topology optimisation, cut by the same preset, must keep its mass."""
    has_stripes = pattern.even is not None or pattern.preset_with_choices(preset).pattern.method == "modes"
    return merging_rule(preset) if pattern.tidy is not None and has_stripes else "none"


def merging_rule(preset: Preset) -> Merging:
    """Return the rule for filling slits: all slits, or only slits between crowded members.
    If more than half of the surface is solid, most openings are narrower than members and must stay."""
    return "crowded" if preset.pattern.width.solid_fraction > 0.5 else "slits"


def trial_cut(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> TrialCut | None:
    """Return the cut of a pattern, finished up to the first rounding of corners; None without material.
    The defaults of [slicing] apply, because a stage must not depend on a later section.
    polygons : the surface cut along the pattern, if the caller has it."""
    preset = preset.model_copy(update={"slicing": Slicing()})
    options = finishing_options(preset, surface, pattern)
    cells = sheet_of(polygons or tidied_polygons(surface, pattern.fields, pattern.levels, options.snap, pattern.tidy))
    return TrialCut.from_cells(pattern.cut_inputs, cells, options) if cells.material.any() else None


def with_bridges(preset: Preset, surface: Surface, trial: TrialCut) -> tuple[TrialCut, float]:
    """Return a trial cut with bridges (for a workshop also with least widths), and the added share of the surface.
    A bridge crosses a gap that is too narrow between rounded members."""
    trial = trial.with_bridges()
    if preset.pattern.for_workshop:
        trial = trial.with_least_widths(*_usual_widths(preset, surface))
    return trial, trial.bridged_area / surface.area + trial.widened_area / surface.area


def smallest_widths(preset: Preset, surface: Surface) -> tuple[float, float]:
    """Return the smallest openings and the smallest necks of openings (m), or 0.
    Smaller openings are filled, narrower necks bridged. By default a neck is about as wide as the thickness."""
    options, min_opening = preset.pattern, preset.slicing.min_opening
    if min_opening is not None or options.method != "stripes":
        return min_opening or 0.0, min_opening or 0.0
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    thickness = preset.statics.thickness
    # the rule for slits fills larger openings between tidied members
    opening = min(SPECK * spacing, thickness) if options.removes_loose_ends else SPECK * spacing
    # 1.1, because chords replace the round corners beside a bridge
    return opening, min(1.1 * thickness, 0.2 * spacing)


REQUESTED_SHARE = 0.95
"""Least actual width of a member divided by its requested width: flat triangles cause errors of a few percent."""


class WorkshopWidths(NamedTuple):
    """Least widths of openings and members, metres; 0 for no limit."""

    gap: float
    member: float


def least_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths of a preset on a surface, from [slicing] or by default; 0 without `pattern.workshop`.
    By default members are at least half as wide as the thickness, about the width of a cutter. Larger limits in
    [slicing] widen only members between openings with round corners."""
    if not preset.pattern.for_workshop:
        return WorkshopWidths(0.0, 0.0)
    slicing, thickness = preset.slicing, preset.statics.thickness
    gap = usual_gap(thickness, surface.size) if slicing.min_gap is None else slicing.min_gap
    unlimited = preset.pattern.width.min_width == 0
    requested = REQUESTED_SHARE * _least_requested_member(preset.pattern, surface)
    usual = 0.0 if unlimited else min(0.5 * thickness, requested)
    return WorkshopWidths(gap, usual if slicing.min_member is None else min(slicing.min_member, usual))


def usual_gap(thickness: float, size: float) -> float:
    """Return the default least width (m) of openings. size : diagonal of the surface's bounding box, metres.
    It is a quarter of the thickness, but at least 3 mm for a saw blade, or a 500th of the size of small designs."""
    return max(0.25 * thickness, min(3e-3, 1 / 500 * size))


def _least_requested_member(options: Pattern, surface: Surface) -> float:
    """Return the least member width (m) in the preset; infinite if the preset sets no width."""
    width = options.width
    member = width.member if width.rule == "constant" else 0.0
    widths_differ = options.method == "stripes" and width.rule in ("graded", "stressed") and not width.asked_least
    slim = least_member(options, surface) if widths_differ else 0.0
    return min((x for x in (member, width.asked_least, width.max_width, slim) if x), default=float("inf"))


def least_member(options: Pattern, surface: Surface) -> float:
    """Return the least width (m) of evenly spaced members of varying width: half the width of equally wide members.
    Without a solid fraction, half of the surface counts as material."""
    density = sum(1 / family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    return 0.5 * (options.width.solid_fraction or 0.5) / density


def closed_share(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> float:
    """Return the share of the surface that least widths add to the sheet of a pattern, with the defaults of [slicing].
    polygons : the surface cut along the pattern, if the caller has it."""
    usual = pattern.preset_with_choices(preset.model_copy(update={"slicing": Slicing()}))
    options = finishing_options(usual, surface, pattern)
    polygons = polygons or tidied_polygons(surface, pattern.fields, pattern.levels, options.snap, pattern.tidy)
    sheet = unrounded_sheet(sheet_of(polygons), options)
    widened = with_least_widths(sheet.cells, *_usual_widths(preset, surface), options.merge).cells
    return (widened.material_area - sheet.cells.material_area) / surface.area


def least_drawn_member(preset: Preset, surface: Surface) -> float:
    """Return the least width (m) of drawn members, so that few members need widening; 0 without `pattern.workshop`."""
    return _usual_widths(preset, surface).member / REQUESTED_SHARE


def _usual_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths with the defaults of [slicing]."""
    return least_widths(preset.model_copy(update={"slicing": Slicing()}), surface)


def least_widths_message(least: tuple[float, float], counts: Counter[str]) -> str:
    """Return a note that counts the places that finishing changed for the least widths; '' without changes."""
    gap, member = least
    parts = (
        ("closed", f"openings narrower than {length(gap)} were closed at {places_phrase(counts['closed'])}"),
        ("thickened", f"members narrower than {length(member)} were widened at {places_phrase(counts['thickened'])}"),
        ("narrowed", f"{counts['narrowed']} openings that became narrower than the members beside them were filled"),
        ("necks", f"bridges were built at {places_phrase(counts['necks'])} that became narrow"),
    )
    messages = [message for name, message in parts if counts[name]]
    return ", ".join(messages) + " (slicing.min_gap, min_member)" if messages else ""


def places_phrase(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"
