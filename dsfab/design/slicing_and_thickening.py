"""Stages 5 and 6: the cut sheet, and the solid."""

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, Ints, first_few
from dsfab.core.errors import PatternError, SolidError
from dsfab.core.messages import count_phrase, force, length
from dsfab.design.pattern_measures import largest_filling, merged_members
from dsfab.design.regions_and_loads import LOST_LOAD_REMEDY, held_vertices, lost_load
from dsfab.pattern import small_loops
from dsfab.preset.model import Pattern, Preset, Slicing
from dsfab.results import FilledOpenings, Log, PatternResult, Piece, SlicingResult, StaticsResult
from dsfab.slicing import Merging, PolygonMesh, Sheet, sheet_of, with_least_widths
from dsfab.slicing.finishing.finish import (
    FinishedSheet,
    FinishingOptions,
    TrialCut,
    finish,
    tidied_polygons,
    tidied_sheet,
    unrounded_sheet,
)
from dsfab.slicing.measures.widths import kept_cells
from dsfab.surface import LoadCase, Surface, pieces
from dsfab.thickening import Base, OffsetLayer, Solid, offsets, proven_cells, thicken, with_extras
from dsfab.thickening.offset_vectors import Offsets

SPECK = 0.15
"""Smallest width of an opening between evenly spaced stripes, divided by the stripe spacing. Smaller openings are
filled. Most small openings lie at the edge of the surface."""


def finishing_options(preset: Preset, surface: Surface, pattern: PatternResult) -> FinishingOptions:
    slicing, merge, resolved = preset.slicing, merges_slits(preset, pattern), pattern.preset_with_choices(preset)
    opening, neck = smallest_widths(resolved, surface)
    cut = slicing.snap, slicing.pinch, preset.statics.thickness, slicing.min_opening is not None
    openings = opening, merge, neck, preset.pattern.fillet
    least, tolerance = least_widths(resolved, surface), slicing.tolerance if slicing.improve else None
    return FinishingOptions(*cut, *openings, slicing.min_member or 0.0, least, tolerance)


def merges_slits(preset: Preset, pattern: PatternResult) -> Merging:
    """Return the rule by which slits (narrow openings) of a pattern are filled; 'none' to fill no slit."""
    has_stripes = pattern.even is not None or pattern.preset_with_choices(preset).pattern.method == "modes"
    return merging_rule(preset) if pattern.tidy is not None and has_stripes else "none"


def merging_rule(preset: Preset) -> Merging:
    """Return the rule by which slits (narrow openings) are filled: 'slits': all; 'crowded': between dense members."""
    return "crowded" if preset.pattern.width.solid_fraction > 0.5 else "slits"


def trial_cut(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> TrialCut | None:
    """Cut the surface along a pattern; finish the cut up to the first rounding of corners. None without material.
    polygons : the surface already cut along the pattern, or None."""
    preset = preset.model_copy(update={"slicing": Slicing()})
    options = finishing_options(preset, surface, pattern)
    cells = sheet_of(polygons or tidied_polygons(surface, pattern.fields, pattern.levels, options.snap, pattern.tidy))
    return TrialCut.from_cells(pattern.cut_inputs, cells, options) if cells.material.any() else None


def with_bridges(preset: Preset, surface: Surface, trial: TrialCut) -> tuple[TrialCut, float]:
    """Add bridges across narrow openings to a trial cut. Return the cut, and the added area / area of the surface."""
    trial = trial.with_bridges()
    if preset.pattern.for_workshop:
        trial = trial.with_least_widths(*_usual_widths(preset, surface))
    return trial, trial.bridged_area / surface.area + trial.widened_area / surface.area


def smallest_widths(preset: Preset, surface: Surface) -> tuple[float, float]:
    """Return the smallest size of openings, and the width below which openings get bridges, metres; 0 for no limit."""
    options, min_opening = preset.pattern, preset.slicing.min_opening
    if min_opening is not None or options.method != "stripes":
        return min_opening or 0.0, min_opening or 0.0
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    thickness = preset.statics.thickness
    # with `removes_loose_ends`, a smaller limit is enough, because `merging_rule` also fills larger openings
    opening = min(SPECK * spacing, thickness) if options.removes_loose_ends else SPECK * spacing
    # factor 1.1: round corners are polygons, so an opening beside a bridge is narrower than between exact arcs
    return opening, min(1.1 * thickness, 0.2 * spacing)


REQUESTED_SHARE = 0.95
"""The default least width of members is at most this fraction of the smallest width that the preset requests."""


class WorkshopWidths(NamedTuple):
    """Smallest allowed widths of openings and members, metres; 0 for no limit."""

    gap: float
    member: float


def least_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the smallest allowed widths of openings and members, metres; 0 without `pattern.workshop`."""
    if not preset.pattern.for_workshop:
        return WorkshopWidths(0.0, 0.0)
    slicing, thickness = preset.slicing, preset.statics.thickness
    gap = usual_gap(thickness, surface.size) if slicing.min_gap is None else slicing.min_gap
    unlimited = preset.pattern.width.min_width == 0
    requested = REQUESTED_SHARE * _least_requested_member(preset.pattern, surface)
    usual = 0.0 if unlimited else min(0.5 * thickness, requested)
    return WorkshopWidths(gap, usual if slicing.min_member is None else min(slicing.min_member, usual))


def usual_gap(thickness: float, size: float) -> float:
    """Return the default smallest width (m) of openings. size : diagonal of the surface's bounding box, metres."""
    return max(0.25 * thickness, min(3e-3, 1 / 500 * size))


def _least_requested_member(options: Pattern, surface: Surface) -> float:
    width = options.width
    member = width.member if width.rule == "constant" else 0.0
    widths_differ = options.method == "stripes" and width.rule in ("graded", "stressed") and not width.asked_least
    slim = least_member(options, surface) if widths_differ else 0.0
    return min((x for x in (member, width.asked_least, width.max_width, slim) if x), default=float("inf"))


def least_member(options: Pattern, surface: Surface) -> float:
    """Return the default smallest width (m) of members, for patterns with members of varying width."""
    density = sum(1 / family.distance(surface.area, surface.mean_edge) for family in options.drawn_families)
    return 0.5 * (options.width.solid_fraction or 0.5) / density


def closed_share(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> float:
    """Return the area that widened members and closed openings add, divided by the area of the surface."""
    usual = pattern.preset_with_choices(preset.model_copy(update={"slicing": Slicing()}))
    options = finishing_options(usual, surface, pattern)
    polygons = polygons or tidied_polygons(surface, pattern.fields, pattern.levels, options.snap, pattern.tidy)
    sheet = unrounded_sheet(sheet_of(polygons), options)
    widened = with_least_widths(sheet.cells, *_usual_widths(preset, surface), options.merge).cells
    return (widened.material_area - sheet.cells.material_area) / surface.area


def least_drawn_member(preset: Preset, surface: Surface) -> float:
    """Return the smallest width (m) with which the pattern draws members; 0 without `pattern.workshop`."""
    return _usual_widths(preset, surface).member / REQUESTED_SHARE


def _usual_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    return least_widths(preset.model_copy(update={"slicing": Slicing()}), surface)


def least_widths_message(least: tuple[float, float], counts: Counter[str]) -> str:
    """Return a note on changes of too narrow members and openings; '' without changes. counts : changes by kind."""
    gap, member = least
    parts = (
        ("closed", f"openings narrower than {length(gap)} were closed at {places_phrase(counts['closed'])}"),
        ("thickened", f"members narrower than {length(member)} were widened at {places_phrase(counts['thickened'])}"),
        ("narrowed", f"{counts['narrowed']} openings that became narrower than the members beside them were filled"),
        ("necks", f"members became narrow at {places_phrase(counts['necks'])}, and bridges were built there"),
    )
    messages = [message for name, message in parts if counts[name]]
    return ", ".join(messages) + " (slicing.min_gap, min_member)" if messages else ""


def places_phrase(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"


FILLED_PLATE = 5  # Smallest number of neighbouring filled openings that form a plate.


def slicing_step(
    preset: Preset, surface: Surface, statics: StaticsResult, pattern: PatternResult, log: Log
) -> SlicingResult:
    """Cut the surface (stage 5): return all cells, and the sheet of material. Raises PatternError without material."""
    options = preset.slicing
    with log.stage("slicing", f"cutting {surface.m:,} triangles"):
        finishing, trial = finishing_options(preset, surface, pattern), pattern.trial
        trial = trial if trial and trial.serves(pattern.cut_inputs, finishing) else None
        cells = trial.cells if trial else tidied_sheet(surface, *pattern.cut_inputs[:2], options.snap, pattern.tidy)
        cut_cells = cells
        if not cells.material.any():
            raise PatternError("the pattern leaves no material; lower pattern.major.threshold or increase pattern.keep")
        finished = finish(cells, surface, finishing, trial)
        if message := least_widths_message(finishing.least, finished.counts):
            log.note("slicing", message)
        cells = finished.cells
        sheet = cells.subset()
        all_pieces, label = _pieces(surface, sheet, statics.load)
        kept_pieces, supported = all_pieces, np.array([p.held for p in all_pieces])
        if options.loose == "refuse":
            _refuse_loose(preset, sheet, all_pieces, label)
        supported_sheet = sheet.subset(supported[label]) if supported.any() and not supported.all() else sheet
        lost_loads = lost_load(surface, sheet, supported_sheet, [case.load for case in statics.cases.values()])
        if options.loose == "drop" and supported_sheet is not sheet:
            sheet, kept_pieces = supported_sheet, tuple(p for p in all_pieces if p.held)
    _note_slicing(preset, sheet, all_pieces, statics.load, finished.counts["pinches"], lost_loads, log)
    _note_loads(preset, surface, sheet, statics, log)
    _note_finishing(preset, finished, finishing, cut_cells.stubs, log)
    plate = filled_plate(preset.pattern, surface, statics.load, pattern, (cut_cells, finished.unwidened or cells))
    if plate:
        log.note("slicing", f"{plate.message}; to avoid this plate, change pattern.keep, pattern.rotate or the spacing")
    if finished.shape:
        log.note("slicing", finished.shape)
    return SlicingResult(cells, sheet, kept_pieces, finished.counts["pinches"], plate)


def _note_finishing(preset: Preset, finished: FinishedSheet, options: FinishingOptions, stubs: int, log: Log) -> None:
    names = "filled", "merged", "bridged", "spikes", "widened"
    filled, merged, bridged, spikes, widened = (finished.counts[name] for name in names)
    if stubs:
        places = places_phrase(stubs)
        log.note("slicing", f"dsfab cut off or straightened members near singular points of the stress at {places}")
    if filled:
        openings, limit = count_phrase(filled, "opening"), length(options.opening)
        by_limit = f"dsfab filled {openings} smaller than {limit}"
        by_others = f"dsfab filled {openings} that are smaller than {limit}, or far smaller than most openings"
        log.note("slicing", by_others if preset.slicing.min_opening is None else by_limit)
    if merged:
        openings = count_phrase(merged, "opening")
        log.note(
            "slicing", f"dsfab closed {openings} narrower than the members beside them; these members are now joined"
        )
    if bridged:
        bridges = count_phrase(bridged, "bridge")
        log.note(
            "slicing", f"dsfab built {bridges} between members where openings are narrower than {length(options.neck)}"
        )
    if spikes:
        log.note("slicing", f"dsfab cut off {count_phrase(spikes, 'short projection')} of members into openings")
    if widened:
        least = length(preset.slicing.min_member or 0)
        log.note("slicing", f"members were widened to {least} at {places_phrase(widened)}")
    if radius := preset.pattern.fillet:
        log.note("slicing", _fillet_message(radius, finished.radii))


def filled_plate(
    options: Pattern, surface: Surface, load: LoadCase, pattern: PatternResult, cells: tuple[Sheet, Sheet]
) -> FilledOpenings | None:
    """Return the largest group of neighbouring filled openings, or None if no group is large enough for a plate.
    cells : the cells of the cut before and after small openings were filled."""
    spacings = [family.distance(surface.area, surface.mean_edge) for family in options.drawn_families]
    fillings = merged_members(options, surface, pattern), largest_filling(*cells, max(spacings))
    filling = max(filter(None, fillings), key=lambda group: group.openings, default=None)
    if not filling or filling.openings < FILLED_PLATE:
        return None
    for loop in small_loops(surface, load.supported, min(spacings)):
        centre = surface.V[loop].mean(axis=0)
        if np.linalg.norm(filling.place - centre) < np.linalg.norm(surface.V[loop] - centre, axis=1).max():
            return None
    return filling


def _fillet_message(radius: float, radii: Floats) -> str:
    if not len(radii):
        return (
            f"dsfab rounded no corner of an opening, because no corner has space for a radius of {length(radius)} "
            f"(pattern.fillet)"
        )
    verb = "was" if len(radii) == 1 else "were"
    message = f"{count_phrase(len(radii), 'corner')} of openings {verb} rounded"
    if np.median(radii) < radius / 2:
        half = length(float(np.median(radii)))
        return (
            f"{message}; half of the radii are below {half}, because many corners have no space for pattern.fillet = "
            f"{length(radius)}"
        )
    return f"{message} with a radius of {length(radius)}, or with a smaller radius where the opening is too narrow"


def _pieces(surface: Surface, sheet: Sheet, load: LoadCase) -> tuple[tuple[Piece, ...], Ints]:
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)
    marks = []
    for mark in (held_vertices(surface, sheet, load), sheet.vertices_between(surface, load.loaded)):
        marks.append(np.bincount(label, mark[sheet.surface.F].any(axis=1), count) > 0)
    listed = tuple(Piece(float(area[k]), bool(marks[0][k]), bool(marks[1][k])) for k in range(count))
    return listed, label


def _one_family_hint(preset: Preset) -> str:
    name = preset.pattern.families
    return (
        ""
        if name == "both"
        else f": stripes of the {name} family alone do not cross; set pattern.rim, or draw both families"
    )


def _refuse_loose(preset: Preset, sheet: Sheet, all_pieces: tuple[Piece, ...], label: Ints) -> None:
    loose = [k for k, piece in enumerate(all_pieces) if not piece.held]
    if loose:
        largest = max(loose, key=lambda k: all_pieces[k].area)
        x, y, z = sheet.surface.centroids[int((label == largest).argmax())]
        raise PatternError(
            f"{len(loose)} of {len(all_pieces)} pieces reach no support, the largest "
            f"({all_pieces[largest].area:.3g} m2) near ({x:.3g}, {y:.3g}, {z:.3g}) m"
            + (
                _one_family_hint(preset)
                or "; lower the thresholds of the stripes, or set pattern.rim, pattern.keep or slicing.loose"
            )
        )


def _note_slicing(
    preset: Preset, sheet: Sheet, all_pieces: tuple[Piece, ...], load: LoadCase, pinches: int, lost: str, log: Log
) -> None:
    loose = [piece for piece in all_pieces if not piece.held]
    if loose:
        area = sum(piece.area for piece in loose)
        outcome = "dropped" if preset.slicing.loose == "drop" and len(loose) < len(all_pieces) else "kept"
        message = (
            f"{len(loose)} of {len(all_pieces)} pieces of material reach no support and were {outcome} ({area:.3g} m2)"
        )
        log.note("slicing", f"{message}{_one_family_hint(preset)}")
    if pinches:
        contacts = f"{pinches} point contacts were" if pinches > 1 else "a point contact was"
        log.note("slicing", f"{contacts} {'joined' if preset.slicing.pinch == 'join' else 'split'}")
    unsupported_loads = np.flatnonzero(load.loaded & (sheet.same_vertex() < 0))
    if lost:
        log.note("slicing", f"{lost}; {LOST_LOAD_REMEDY}")
    elif len(unsupported_loads):
        log.note(
            "slicing",
            f"{len(unsupported_loads)} of {load.loaded.sum()} loaded points lie on removed material (vertices "
            f"{first_few(unsupported_loads, 3)}); set pattern.keep to keep material there",
        )
    total = load.spring.sum()
    if total and (share := 1 - load.spring[sheet.same_vertex() >= 0].sum() / total) > 0.005:
        log.note("slicing", f"{share:.0%} of the stiffness of spring supports is on removed material; set pattern.keep")


def _note_loads(preset: Preset, surface: Surface, sheet: Sheet, statics: StaticsResult, log: Log) -> None:
    parts = [case.load.parts for case in statics.cases.values() if case.load.parts is not None]
    if any(part.weight.any() for part in parts):
        areas = surface.area, sheet.surface.area
        uncut_weight, sheet_weight = (force(preset.statics.area_weight * area) for area in areas)
        message = f"the cut sheet weighs {sheet_weight}; all results of the cut sheet include this weight"
        if not preset.pattern.rounds:  # with `rounds`, stripes follow the weight of the cut sheet
            message += f"; the directions of the stripes follow the weight of the uncut sheet, {uncut_weight}"
        log.note("slicing", message)
    if any(part.bare.any() for part in parts):
        log.note(
            "slicing",
            "loads without a covering act only on members; but the stripes follow these loads on the whole uncut sheet",
        )


def checked_offsets(preset: Preset, surface: Surface) -> Offsets:
    """Return vectors from the surface to its two offset skins. Raises SolidError if the surface bends too sharply."""
    options = preset.thickening
    offset = offsets(surface, preset.statics.thickness, options.side)
    if offset.smallest < options.thinnest:
        x, y, z = surface.V[offset.tightest]
        raise SolidError(
            f"the surface bends so sharply at ({x:.4g}, {y:.4g}, {z:.4g}) m that only {offset.smallest:.0%} of "
            f"the thickness would remain (allowed: {options.thinnest:.0%}); reduce statics.thickness, smooth the "
            "surface, or lower thickening.thinnest"
        )
    return offset


def thickening_step(preset: Preset, surface: Surface, slicing: SlicingResult, log: Log) -> Solid:
    """Thicken the sheet to a solid (stage 6). Raises SolidError if the surface bends too sharply for the thickness."""
    options = preset.thickening
    with log.stage("thickening", f"thickening {slicing.sheet.surface.m:,} triangles"):
        offset = checked_offsets(preset, surface)
        D = slicing.sheet.carry_corners(offset.at_corners(surface.F), surface.F)
        cells = slicing.cells
        layer = OffsetLayer(surface, offset.D, cells.surface, cells.carry(offset.D), cells.parent, options.side)
        proven = proven_cells(layer)[kept_cells(cells, slicing.sheet)]
        solid = thicken(slicing.sheet.surface, D, options.side, proven)
        solid = replace(solid, repairs=replace(solid.repairs, limited=offset.limited, smallest=offset.smallest))
        base = Base(surface, slicing.sheet.surface, partial(slicing.sheet.vertices_between, surface))
        solid = with_extras(solid, options.extra, base)
    if options.strict and solid.repairs.pairs:
        message = next(text for text in reversed(solid.notes) if "intersect" in text)
        raise SolidError(f"{message}; thickening.strict refuses such a solid: reduce statics.thickness")
    if offset.limited:
        log.note(
            "thickening",
            f"the solid is thinner at {offset.limited} of {surface.n} vertices, where the surface bends sharply: "
            f"at the thinnest vertex, {offset.smallest:.0%} of the thickness remains",
        )
    for text in solid.notes:
        log.note("thickening", text)
    return solid
